"""Performances of all file formats: text tables, JSON, and the morph targets of glTF."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.name_matching import match_with_ties
from faceposer.model.shape_names import whole_shape_of
from faceposer.training.capture import Capture, read_capture
from faceposer.training.gltf_weights import read_gltf_weights
from faceposer.training.named_weights import NamedWeights
from faceposer.training.takes import read_take
from faceposer.training.weights_file import read_weights

Array = NDArray[np.float64]

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
    shapes = match.with_ties
    found = {shape: _weights(named, shapes, shape) for shape in ARKIT_SHAPES}
    used = [shape for shape, weights in found.items() if weights is not None]
    if not used:
        raise FacePoserError(f"'{path}' has no weights of ARKit's shapes; use a performance with their names.")
    weights = np.stack([weights for weights in found.values() if weights is not None], axis=1)
    notes = (*named.notes, *([match.note] if match.note else []))
    return Capture(tuple(used), weights, None, notes)


def _weights(named: NamedWeights, shapes: Mapping[str, str], shape: str) -> Array | None:
    """Return the weights of a whole shape, shape (F,): its own and the mean of its halves, which add up; else None."""
    total = None
    for group in ({shape}, {half for half in shapes.values() if half != shape and whole_shape_of(half) == shape}):
        columns = [column for column, name in enumerate(named.names) if shapes.get(name) in group]
        if columns:
            mean = named.frames[:, columns].mean(axis=1)
            total = mean if total is None else total + mean
    return total
