"""Regions of the face, and how far what one of them does may be taken to tell of another.

One performer's takes hold coincidences: a smile with a blink, a raised brow with a frowning mouth. A drag of a brow
would then move the mouth. Multiplying the covariance of each pair of rig weights by a correlation matrix over regions
(covariance tapering: Houtekamer and Mitchell 2001, Schur product) keeps what is known within a region and damps what
is believed between regions; the product of two positive semi-definite matrices, entry by entry, stays so. How much to
believe is learned: by how well one region is predicted from another in a part of the take that was not learned from.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.model.muscles import nearest_correlation

Array = NDArray[np.float64]
#: Examples to learn from, (n, S), and changes between unseen ones to predict, (m, S).
Fold = tuple[Array, Array]

BROWS, LIDS, GAZE, MIDFACE, MOUTH = "brows", "lids", "gaze", "midface", "mouth"
# Weights are seen through constraints, not exactly: how far off, as a standard deviation.
_SEEN_WITHIN = 0.05
_GRID = np.linspace(0.0, 1.0, 101)


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


def independent(regions: Sequence[str]) -> Array:
    """Return the coupling of regions that know nothing of each other, shape (S, S), for the region of each weight."""
    names = np.array(regions)
    return (names[:, None] == names).astype(np.float64)


def learn_coupling(folds: Sequence[Fold], regions: Sequence[str], metric: Array | None = None) -> Array:
    """Return the factor on the covariance of each pair of weights, shape (S, S), a correlation matrix.

    For each pair of regions: the weights of one are predicted linearly from those of the other and back, from second
    moments about rest as the prior has them, and the factor scales the prediction. Of all factors whose error on unseen
    changes is within one standard error (over the folds) of the least, the smallest is taken, so that regions hang
    together no more than they must (the one-standard-error rule: Breiman et al. 1984, section 3.4.3). The weights of
    one region share a factor; within a region it is 1.

    Args:
        folds: At least two; what is predicted in each must not come from frames near to those learned from.
        regions: Name of the region of each of the S weights.
        metric: Inner products of what the weights move, shape (S, S), in which errors are measured; the identity if
            None. Where it is that of a face's shapes, an error counts as far as it can be seen.
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


def _gain(fold: Fold, seen: NDArray[np.intp], unseen: NDArray[np.intp], metric: Array) -> Array:
    """Return the inner products of the prediction of the ``unseen`` with the truth, and with itself."""
    examples, changes = fold
    known = examples[:, seen]
    moment = known.T @ known / len(examples) + _SEEN_WITHIN**2 * np.eye(len(seen))
    slope = np.linalg.solve(moment, known.T @ examples[:, unseen] / len(examples))
    predicted, inner = changes[:, seen] @ slope, metric[np.ix_(unseen, unseen)]
    projected = predicted @ inner
    return np.array([(projected * changes[:, unseen]).sum(), (projected * predicted).sum()]) / len(changes)


def _cautious_factor(gains: Array) -> float:
    """Return the least factor whose error is within one standard error of the least error, for ``gains`` (folds, 2)."""
    errors = _GRID**2 * gains[:, 1:] - 2.0 * _GRID * gains[:, :1]
    excess = errors - errors[:, [int(errors.mean(axis=0).argmin())]]
    allowed = excess.std(axis=0, ddof=1) / np.sqrt(len(gains))
    return float(_GRID[np.flatnonzero(excess.mean(axis=0) <= allowed + 1e-12)[0]])
