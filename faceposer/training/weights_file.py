"""JSON files of weights: the program's own form, and those of other tools (docs/interchange.md)."""

from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, Struct

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import JsonError, check_header, convert, read_json, shown
from faceposer.training.foreign_weights import foreign_weights
from faceposer.training.json_values import as_document, check_values
from faceposer.training.named_weights import NamedWeights

FORMAT = "faceposer.weights"
VERSION = 1
_MAX_BYTES = 64 * 2**20
_MAX_NAMES = 10_000
# Modes of examples reach several units; far larger values are errors.
_LARGEST_WEIGHT = 1000.0

_Weights = list[Annotated[float, Meta(ge=-_LARGEST_WEIGHT, le=_LARGEST_WEIGHT)]]
_Rate = Annotated[float, Meta(gt=0.0, le=1000.0, description="a number of frames per second above 0, at most 1000")]


class _WeightsFile(Struct):
    # Further keys are ignored, so that other programs can add their own.
    names: Annotated[tuple[str, ...], Meta(min_length=1, max_length=_MAX_NAMES)]
    frames: Annotated[list[Annotated[_Weights, Meta(title="lists of weights")]], Meta(min_length=1)]
    rate: _Rate | None = None

    def __post_init__(self) -> None:
        if len(set(self.names)) < len(self.names):
            duplicate = Counter(self.names).most_common(1)[0][0]
            raise JsonError(f"has {shown(duplicate)} twice", "names")
        for i, frame in enumerate(self.frames):
            if len(frame) != len(self.names):
                raise JsonError(f"must be a list of {len(self.names)} weights, one for each name", f"frames[{i}]")


def read_weights(path: Path, rate: float | None = None) -> NamedWeights:
    """Read the weights in the file ``path``, in the program's own form or in that of another tool.

    Args:
        path: The file.
        rate: Frames per second in place of those of the file.

    Raises:
        FacePoserError: If the file cannot be read or is invalid; the message names the place.
    """
    return read_json(path, "weights", lambda data: _weights_from_json(data, path, rate), _MAX_BYTES, as_document)


def _weights_from_json(data: Any, path: Path, rate: float | None) -> NamedWeights:
    if not (isinstance(data, dict) and str(data.get("format", "")).startswith("faceposer.")):
        check_values(data)
        found = foreign_weights(data, path, rate)
        if found is not None:
            return found
        raise FacePoserError(
            f'the file has no "format": "{FORMAT}", and no weights of ARKit\'s shapes in a form that is read: '
            "numbers by name in each frame, named weights, rows with a list of names, or curves with times."
        )
    check_header(data, FORMAT, VERSION)
    form = convert(data, _WeightsFile)
    return NamedWeights(form.names, np.array(form.frames), rate or form.rate)
