"""Rows of the study of identities."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def row(
    test: str, method: str, modes: int, errors: list[NDArray[np.float64]], seconds: float, **more: Any
) -> dict[str, Any]:
    """Return a row of the study.

    Args:
        test: Name of the test.
        method: Name of the method.
        modes: Number of modes.
        errors: Errors of the vertices of each head in millimetres.
        seconds: Seconds per head.
        more: Further values.
    """
    medians, means = ([float(function(each)) for each in errors] for function in (np.median, np.mean))
    return {
        "test": test,
        "method": method,
        "modes": modes,
        "n": len(errors),
        "error_mm_median": round(float(np.mean(medians)), 4),
        "error_mm_mean": round(float(np.mean(means)), 4),
        "seconds": round(float(seconds), 2),
        **more,
    }
