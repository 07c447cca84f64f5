"""Rig weights over time as JSON (docs/interchange.md)."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.interchange.named_weights import NamedWeights
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance

FORMAT = "faceposer.weights"
VERSION = 1
_MAX_BYTES = 256 * 2**20
_MAX_NAMES = 10_000
# Modes of examples reach some units; far more is no weight.
_LARGEST = 1000.0
_DIGITS = 6


def write_weights(path: Path, model: FaceModel, motion: NDArray[np.float64] | Performance) -> None:
    """Write the weights of the subject's shapes, within their limits, nearest to a pose (r,) or a performance.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    # SciPy's optimisers are slow to import, and the window reads the table of formats at its start.
    from faceposer.solve.weight_fit import fit_weights_of_frames

    coefficients = motion.coefficients if isinstance(motion, Performance) else motion[None]
    frames = np.round(fit_weights_of_frames(model, coefficients), _DIGITS) + 0.0
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "subject": model.subject.name}
    if isinstance(motion, Performance):
        data["rate"] = motion.rate
    lines = [json.dumps(name) + ": " + json.dumps(value) for name, value in data.items()]
    lines.append('"names": ' + json.dumps(list(model.subject.shape_names)))
    rows = ",\n  ".join(json.dumps(row) for row in frames.tolist())
    text = "{\n " + ",\n ".join(lines) + f',\n "frames": [\n  {rows}\n ]\n}}\n'
    write_text(path, text, "weights")


def read_weights(path: Path) -> NamedWeights:
    """Return the weights in the file ``path``.

    Raises:
        FacePoserError: If it cannot be read or is not such a file, naming the place.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError(f"The weights '{path}' are larger than {_MAX_BYTES >> 20} MB; cut them into parts.")
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FacePoserError(f"The weights '{path}' cannot be read: {error.strerror}.") from error
    except json.JSONDecodeError as error:
        raise FacePoserError(
            f"The weights '{path}' are not valid JSON at line {error.lineno}, column {error.colno}: {error.msg}."
        ) from error
    except (ValueError, RecursionError) as error:
        raise FacePoserError(f"The weights '{path}' are not valid JSON.") from error
    try:
        return _parsed(data)
    except ValueError as error:
        raise FacePoserError(f"The weights '{path}' cannot be used: {error}.") from error


def _parsed(data: Any) -> NamedWeights:
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ValueError(f'they lack \'"format": "{FORMAT}"\'')
    if data.get("version") != VERSION:
        raise ValueError(f"their version is {str(data.get('version'))[:20]}, and this program reads {VERSION}")
    names, frames, rate = data.get("names"), data.get("frames"), data.get("rate")
    if not isinstance(names, list) or not 0 < len(names) <= _MAX_NAMES or not all(isinstance(n, str) for n in names):
        raise ValueError("'names' must be a list of the shapes' names")
    if len(set(names)) < len(names):
        twice = next(name for i, name in enumerate(names) if name in names[:i])
        raise ValueError(f"'names' has '{twice[:60]}' twice")
    if not isinstance(frames, list) or not frames:
        raise ValueError("'frames' must be a list of at least one list of weights")
    for i, frame in enumerate(frames):
        if not isinstance(frame, list) or len(frame) != len(names):
            raise ValueError(f"frames[{i}] must be a list of {len(names)} weights, one for each name")
        for j, value in enumerate(frame):
            if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) <= _LARGEST:
                raise ValueError(f"frames[{i}][{j}] is {str(value)[:20]}, no weight")
    if rate is not None:
        good = isinstance(rate, int | float) and not isinstance(rate, bool) and 0 < rate <= 1000
        if not good:
            raise ValueError(f"'rate' is {str(rate)[:20]}, not frames per second from 0 to 1000")
        rate = float(rate)
    return NamedWeights(tuple(names), np.array(frames, dtype=np.float64), rate)
