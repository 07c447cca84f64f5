"""How far what one region of the face does may be taken to tell of another.

One performer's takes hold coincidences: a smile with a blink, a raised brow with a frowning mouth. A drag of a brow
would then move the mouth. Multiplying each covariance of the rig's weights by a correlation matrix over regions
(covariance tapering: Houtekamer and Mitchell 2001, Schur product) keeps what is known within a region and damps what
is believed between regions; the product of two positive semi-definite matrices, entry by entry, stays so.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

BROWS, LIDS, GAZE, MIDFACE, MOUTH = "brows", "lids", "gaze", "midface", "mouth"
_NEIGHBOURS = ({MIDFACE, MOUTH}, {MIDFACE, LIDS}, {MIDFACE, BROWS})
_BETWEEN_NEIGHBOURS = 0.5
_BETWEEN_OTHERS = 0.2


def region_of_shape(name: str) -> str:
    """Return the region that the ARKit shape ``name`` belongs to."""
    if name.startswith("brow"):
        return BROWS
    if name.startswith("eyeLook"):
        return GAZE
    if name.startswith("eye"):
        return LIDS
    if name.startswith(("nose", "cheekSquint")):
        return MIDFACE
    return MOUTH


def coupling(shape_names: Sequence[str]) -> NDArray[np.float64]:
    """Return the factor on the covariance of each pair of shapes, shape (S, S), a correlation matrix.

    Shapes of one region keep theirs; gaze is independent of everything, since eyes look where they look.
    """
    regions = [region_of_shape(name) for name in shape_names]
    factors = np.array([[_between(a, b) for b in regions] for a in regions])
    # The chosen factors need not be a correlation matrix: take the nearest by dropping negative eigenvalues.
    values, axes = np.linalg.eigh(factors)
    nearest = (axes * np.maximum(values, 0.0)) @ axes.T
    scale = 1.0 / np.sqrt(np.diag(nearest))
    matrix: NDArray[np.float64] = nearest * np.outer(scale, scale)
    return matrix


def _between(a: str, b: str) -> float:
    if a == b:
        return 1.0
    if GAZE in (a, b):
        return 0.0
    return _BETWEEN_NEIGHBOURS if {a, b} in _NEIGHBOURS else _BETWEEN_OTHERS
