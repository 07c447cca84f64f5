"""Performances of all file formats: text tables, JSON, and the morph targets of glTF."""

from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.name_matching import match_with_ties
from faceposer.model.shape_names import whole_shape_of
from faceposer.training.capture import Capture, read_capture
from faceposer.training.gltf_weights import read_gltf_weights
from faceposer.training.named_weights import NamedWeights
from faceposer.training.takes import read_take
from faceposer.training.weights_file import read_weights

GLTF = (".glb", ".gltf")
#: Suffixes of files of performances.
WEIGHTS = (".csv", ".txt", ".json", *GLTF)


def read_named(path: Path, rate: float | None = None) -> NamedWeights:
    """Read the weights in ``path``, by its suffix, at even times.

    Args:
        path: A file with one of the suffixes ``WEIGHTS``.
        rate: Frames per second in place of those of tables and JSON.

    Raises:
        FacePoserError: If the file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix not in WEIGHTS:
        raise FacePoserError(f"'{path}' is not an animation; give weights that end in one of {', '.join(WEIGHTS)}.")
    if suffix == ".json":
        return read_weights(path, rate)
    if suffix in GLTF:
        return read_gltf_weights(path)
    return read_take(path, rate)


def read_recording(path: Path) -> Capture:
    """Read the performance in ``path`` as weights of ARKit's shapes, without frames in which the face was lost.

    Raises:
        FacePoserError: If the file cannot be read or has none of ARKit's shapes.
    """
    if path.suffix.lower() not in WEIGHTS or path.suffix.lower() in (".csv", ".txt"):
        return read_capture(path)
    named = read_named(path)
    match = match_with_ties(named.names)
    shapes = match.shapes | {name: shape for shape, names in match.ties.items() for name in names}
    columns: dict[str, list[int]] = {}
    for column, name in enumerate(named.names):
        if name in shapes:
            columns.setdefault(whole_shape_of(shapes[name]), []).append(column)
    if not columns:
        raise FacePoserError(f"'{path}' has no weights of ARKit's shapes; use a performance with their names.")
    used = [shape for shape in ARKIT_SHAPES if shape in columns]
    weights = np.stack([named.frames[:, columns[shape]].mean(axis=1) for shape in used], axis=1)
    notes = (*named.notes, *([match.note] if match.note else []))
    return Capture(tuple(used), weights, None, notes)
