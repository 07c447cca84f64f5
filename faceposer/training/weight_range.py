"""Range of recorded weights: from 0 to 1, or percentages."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Weights range from 0 to 1, and tracking and animators exceed this; values beyond these are percentages or invalid.
LOWEST, HIGHEST = -1.0, 2.0
# Largest percentage, and the least that the largest of many may be.
_MOST_PERCENT, _LEAST_PERCENT = 110.0, 5.0
# A single weight is a percentage only if it is this one.
_WHOLE = 100.0
# Share of the weights that are not 0 beyond those limits in percentages.
_SHARE_TO_TELL = 0.2


def in_range(weights: Array) -> tuple[Array, str] | None:
    """Return ``weights`` of any shape from 0 to 1, and the sentence about percentages or ""; None if they are neither.

    Weights a little above 1 or below 0 remain. Single wrong values among weights from 0 to 1 are not percentages.
    """
    if weights.min(initial=0.0) >= LOWEST and weights.max(initial=0.0) <= HIGHEST:
        return weights, ""
    sizes = np.abs(weights[weights != 0.0])
    most = float(sizes.max())
    beyond = sizes > HIGHEST
    if not _LEAST_PERCENT <= most <= _MOST_PERCENT or float(beyond.mean()) < _SHARE_TO_TELL:
        return None
    if np.count_nonzero(beyond) == 1 and most != _WHOLE:
        return None
    return weights / 100.0, f"The weights reach {most:.4g} and were read as percentages."
