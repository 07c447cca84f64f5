"""Rig weights over time as JSON (docs/interchange.md)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.files.atomic import write_text
from faceposer.files.writing import check_finite, json_text
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.training.weights_file import FORMAT, VERSION

_DIGITS = 6


def write_weights(path: Path, model: FaceModel, motion: NDArray[np.float64] | Performance) -> None:
    """Write the weights of the character's shapes, within their limits, that best reproduce a pose or a performance.

    Args:
        path: The file.
        model: The face.
        motion: A pose, shape (r,), or a performance.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    # SciPy's optimisers are slow to import, and the window imports the table of formats at its start.
    from faceposer.solve.weight_fit import fit_weights_of_frames

    coefficients = motion.coefficients if isinstance(motion, Performance) else motion[None]
    check_finite(path, "weights", coefficients)
    frames = np.round(fit_weights_of_frames(model, coefficients), _DIGITS) + 0.0
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "subject": model.character.name}
    if isinstance(motion, Performance):
        data["rate"] = motion.rate
    lines = [f'"{name}": {json_text(path, value, "weights")}' for name, value in data.items()]
    lines.append('"names": ' + json_text(path, model.character.shape_names, "weights", indent=None))
    rows = ",\n  ".join(json_text(path, row, "weights", indent=None) for row in frames.tolist())
    text = "{\n " + ",\n ".join(lines) + f',\n "frames": [\n  {rows}\n ]\n}}\n'
    write_text(path, text, "weights")
