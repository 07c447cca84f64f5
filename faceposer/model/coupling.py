"""Regions of the face, and the factors that damp covariances between them.

The takes of one performer contain coincidences: a smile with a blink, a raised brow with a frowning mouth. Dragging a
brow would then move the mouth. Multiplying the covariance of each pair of rig weights by a correlation matrix over
regions (covariance tapering: Houtekamer and Mitchell 2001, Schur product) preserves covariances within a region and
damps those between regions; the elementwise product of positive semidefinite matrices is positive semidefinite. The
factors are learned from how well one region predicts another in held-out parts of the takes.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.model.muscles import nearest_correlation

Array = NDArray[np.float64]
#: Training examples, (n, S), and changes between held-out examples to predict, (m, S).
Fold = tuple[Array, Array]

BROWS, LIDS, GAZE, MIDFACE, MOUTH = "brows", "lids", "gaze", "midface", "mouth"
# Standard deviation of weights as observed through constraints.
_OBSERVATION_NOISE = 0.05
_GRID = np.linspace(0.0, 1.0, 101)


def region_of_shape(name: str) -> str:
    """Return the region of the ARKit shape ``name``."""
    if name.startswith("brow"):
        return BROWS
    if name.startswith("eyeLook"):
        return GAZE
    if name.startswith("eye"):
        return LIDS
    if name.startswith(("nose", "cheekSquint")):
        return MIDFACE
    return MOUTH


def independent(regions: Sequence[str]) -> Array:
    """Return the coupling of independent regions, shape (S, S), given the region of each of the S weights."""
    names = np.array(regions)
    return (names[:, None] == names).astype(np.float64)


def learn_coupling(folds: Sequence[Fold], regions: Sequence[str], metric: Array | None = None) -> Array:
    """Return the factor on the covariance of each pair of weights, a correlation matrix of shape (S, S).

    For each pair of regions, the weights of one are predicted linearly from those of the other and vice versa, by
    second moments about rest as in the prior, and the factor scales the prediction. Of all factors with an error on
    held-out changes within one standard error (over the folds) of the least error, the smallest is taken, so that
    regions are coupled no more than necessary (the one-standard-error rule: Breiman et al. 1984, section 3.4.3). All
    weights of a region share a factor; within a region it is 1.

    Args:
        folds: At least two folds; the frames to predict must not be close to the training frames in time.
        regions: Name of the region of each of the S weights.
        metric: Inner product of the weights in which errors are measured, shape (S, S); the identity if None. With the
            Gram matrix of a face's shapes, errors count as displacements of the surface.
    """
    if len(folds) < 2:
        raise ValueError("coupling is learned from at least two folds")
    names = list(dict.fromkeys(regions))
    members = [np.flatnonzero(np.array(regions) == name) for name in names]
    metric = np.eye(len(regions)) if metric is None else metric
    factors = np.eye(len(names))
    for a in range(len(names)):
        for b in range(a):
            gains = [
                np.sum([_gain(fold, members[i], members[j], metric) for i, j in ((a, b), (b, a))], axis=0)
                for fold in folds
            ]
            factors[a, b] = factors[b, a] = _cautious_factor(np.array(gains))
    index = [names.index(region) for region in regions]
    return nearest_correlation(factors)[np.ix_(index, index)]


def _gain(fold: Fold, observed: NDArray[np.intp], predicted: NDArray[np.intp], metric: Array) -> Array:
    """Return the inner products of the prediction of weights with the true ones and with itself, shape (2,)."""
    examples, changes = fold
    known = examples[:, observed]
    moment = known.T @ known / len(examples) + _OBSERVATION_NOISE**2 * np.eye(len(observed))
    slope = np.linalg.solve(moment, known.T @ examples[:, predicted] / len(examples))
    prediction = changes[:, observed] @ slope
    projected = prediction @ metric[np.ix_(predicted, predicted)]
    return np.array([(projected * changes[:, predicted]).sum(), (projected * prediction).sum()]) / len(changes)


def _cautious_factor(gains: Array) -> float:
    """Return the smallest factor within one standard error of the least error, given ``gains``, (folds, 2)."""
    errors = _GRID**2 * gains[:, 1:] - 2.0 * _GRID * gains[:, :1]
    excess = errors - errors[:, [int(errors.mean(axis=0).argmin())]]
    allowed = excess.std(axis=0, ddof=1) / np.sqrt(len(gains))
    return float(_GRID[np.flatnonzero(excess.mean(axis=0) <= allowed + 1e-12)[0]])
