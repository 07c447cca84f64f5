"""Kinds of files that are no sessions, for messages that name the command to open them."""

import re
from contextlib import suppress
from pathlib import Path
from typing import Literal

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.images import FOREIGN_SUFFIXES
from faceposer.files.reading import open_file
from faceposer.files.tables import open_table
from faceposer.geometry.gltf_io import GLTF_SUFFIXES
from faceposer.model.shape_names import canonical_shape
from faceposer.photo.reading import PHOTO_SUFFIXES
from faceposer.session.document import FORMAT

Kind = Literal[
    "performance", "weights", "trajectories", "pose", "table", "rig", "mesh", "photo", "drawing", "folder", ""
]

_MESHES = (".obj", ".ply", ".stl", ".off")
_FORMATS: dict[str, Kind] = {
    "faceposer.weights": "weights",
    "faceposer.trajectories": "trajectories",
    "faceposer.pose": "pose",
    "faceposer.strokes": "drawing",
    FORMAT: "",
}
# Bytes in which a file names its format or its columns, and the rows of a table in which these are.
_HEAD, _ROWS = 65_536, 12
_LARGEST_TABLE = 256 * 2**20
_AXIS = re.compile(r".+[ ._:][xyz]", re.IGNORECASE)


def kind_of(path: Path) -> Kind:
    """Return the kind of the file ``path`` by its suffix and the beginning of its content, "" if it is not known."""
    suffix = path.suffix.lower()
    if paths.is_dir(path):
        return "folder"
    if not paths.exists(path):
        return ""
    if suffix == ".json":
        return _kind_of_json(path)
    if suffix in (".csv", ".txt", ".trc"):
        return "trajectories" if suffix == ".trc" else _kind_of_table(path)
    kinds: dict[Kind, tuple[str, ...]] = {
        "trajectories": (".c3d",),
        "rig": GLTF_SUFFIXES,
        "mesh": _MESHES,
        "photo": (*PHOTO_SUFFIXES, *FOREIGN_SUFFIXES),
        "drawing": (".svg",),
    }
    return next((kind for kind, suffixes in kinds.items() if suffix in suffixes), "")


def _kind_of_json(path: Path) -> Kind:
    with suppress(OSError), open_file(path) as stream:
        text = stream.read(_HEAD).decode("utf-8", "ignore")
        stated = re.search(r'"format"\s*:\s*"([^"\\]{0,80})"', text)
        if stated is not None:
            return _FORMATS.get(stated[1], "")
        return "weights" if any(canonical_shape(name) for name in re.findall(r'"([^"\\]{3,64})"', text)) else ""
    return ""


def _kind_of_table(path: Path) -> Kind:
    with suppress(FacePoserError), open_table(path, "table", _LARGEST_TABLE) as rows:
        for _, (_, cells) in zip(range(_ROWS), rows, strict=False):
            names = [cell.strip() for cell in cells[:2000]]
            if names[:1] in (["bs"], ["info"]) or any(canonical_shape(name) for name in names):
                return "performance"
            if any(_AXIS.fullmatch(name) for name in names) or [name.lower() for name in names].count("x") > 0:
                return "trajectories"
        return "table"
    return ""
