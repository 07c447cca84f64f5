"""What kind of source a file or folder is, told without the libraries that learning needs."""

import re
from itertools import islice
from pathlib import Path
from typing import Literal

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_io import GLTF_SUFFIXES
from faceposer.geometry.mesh_sequence import ARRAY_SUFFIX
from faceposer.model.shape_names import canonical_shape

Kind = Literal["rig", "examples", "markers"]

#: Of files with the motion of markers.
MARKER_SUFFIXES = (".c3d", ".csv")
# So many files called like ARKit's shapes make a folder a rig and not a heap of examples.
_SHAPES_IN_RIG = 5
# A rig's folder does not hold more: the window looks into folders while their path is typed.
_MOST_FILES = 1000


def kind_of(source: Path) -> Kind:
    """Return what ``source`` most likely is: a rig, examples or markers.

    Raises:
        FacePoserError: If it is none of them, or a folder that cannot be read.
    """
    suffix = source.suffix.lower()
    if source.is_dir():
        try:
            files = islice(source.iterdir(), _MOST_FILES)
            shapes = islice((path for path in files if _last_name(path.stem) is not None), _SHAPES_IN_RIG)
            return "rig" if len(list(shapes)) == _SHAPES_IN_RIG else "examples"
        except OSError as error:
            raise FacePoserError(f"The folder '{source}' cannot be read: {error.strerror}.") from error
    if suffix in GLTF_SUFFIXES:
        return "rig"
    if suffix == ARRAY_SUFFIX:
        return "examples"
    if suffix in MARKER_SUFFIXES:
        return "markers"
    raise FacePoserError(
        f"'{source}' is nothing to learn a character from; give a glTF file with shapes, a folder of meshes, or the "
        "motion of markers."
    )


def plain_name(path: Path) -> str:
    """Return a short name for a character from the name of its source."""
    name = re.sub(r"[^a-z0-9]+", "-", (path.name if path.is_dir() else path.stem).lower()).strip("-")
    return name or "character"


def _last_name(stem: str) -> str | None:
    """Return the ARKit shape that a file is called after, whatever stands before it."""
    words = re.split(r"[-.\s]+", stem)
    return canonical_shape(stem) or canonical_shape(words[-1])
