"""Kinds of training sources, detected without importing the libraries that training needs."""

import re
from itertools import islice
from pathlib import Path
from typing import Literal

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.names import is_hidden
from faceposer.geometry.gltf_io import GLTF_SUFFIXES
from faceposer.geometry.mesh_sequence import ARRAY_SUFFIX
from faceposer.model.name_matching import match_with_ties

Kind = Literal["rig", "examples", "markers"]
#: Reading of left and right in names: exchanged where they move the other side, as they are, or all exchanged.
Sides = Literal["auto", "as-named", "exchanged"]

#: Suffixes of files with the motion of markers.
MARKER_SUFFIXES = (".c3d", ".csv", ".trc")
# Number of files named after ARKit's shapes that make a folder a rig rather than examples.
_SHAPES_IN_RIG = 5
# Largest number of files examined, since the window inspects folders while their path is typed.
_MOST_FILES = 1000


def kind_of(source: Path) -> Kind:
    """Detect whether ``source`` is a rig, examples or markers.

    Raises:
        FacePoserError: If it is none of these, or a folder that cannot be read.
    """
    suffix = source.suffix.lower()
    if paths.is_dir(source):
        try:
            stems = [path.stem for path in islice(source.iterdir(), _MOST_FILES) if not is_hidden(path)]
            return "rig" if len(set(match_with_ties(stems).shapes.values())) >= _SHAPES_IN_RIG else "examples"
        except OSError as error:
            raise FacePoserError(f"The folder '{source}' cannot be read: {error.strerror}.") from error
    if suffix in GLTF_SUFFIXES:
        return "rig"
    if suffix == ARRAY_SUFFIX:
        return "examples"
    if suffix in MARKER_SUFFIXES:
        return "markers"
    raise FacePoserError(
        f"'{source}' is not a source of characters; use a glTF file with shapes, a folder of meshes, or a file with "
        "the motion of markers."
    )


def plain_name(path: Path) -> str:
    """Derive the short name of a character from the name of its source."""
    name = re.sub(r"[^a-z0-9]+", "-", (path.name if paths.is_dir(path) else path.stem).lower()).strip("-")
    return name or "character"
