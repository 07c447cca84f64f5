"""Statistics for rigs with left and right halves of shapes that the statistics have as a whole."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.model.expression_statistics import ExpressionStatistics

Array = NDArray[np.float64]

_SIDES = ("Left", "Right")
# Assumed variance of the difference between halves, as a share of the whole's variance, and its least value.
_DIFFER = 0.25
_LEAST = 1e-4


def split_to_match(statistics: ExpressionStatistics, shape_names: Sequence[str]) -> ExpressionStatistics:
    """Return ``statistics`` with every shape replaced by its halves of which ``shape_names`` has a half.

    ARKit has one browInnerUp and one cheekPuff; rigs such as ICT-FaceKit have left and right halves. Each half follows
    the whole with a difference of its own, so that an artist can move one alone.
    """
    for side, other in (_SIDES, _SIDES[::-1]):
        for name in shape_names:
            whole = name.removesuffix(side)
            if name != whole and whole in statistics.shape_names and name not in statistics.shape_names:
                statistics = _with_halves(statistics, whole, (whole + side, whole + other))
    return statistics


def _with_halves(statistics: ExpressionStatistics, whole: str, halves: tuple[str, str]) -> ExpressionStatistics:
    column = statistics.shape_names.index(whole)
    order = [*range(len(statistics.shape_names)), column]
    names = [*statistics.shape_names, halves[1]]
    names[column] = halves[0]
    pair = np.ix_([column, len(order) - 1], [column, len(order) - 1])
    pattern = np.array([[1.0, -1.0], [-1.0, 1.0]])
    covariances = statistics.covariances[:, order][:, :, order]
    covariance = statistics.covariance[np.ix_(order, order)]
    for matrix in (*covariances, covariance):
        matrix[pair] += (_DIFFER * matrix[column, column] + _LEAST) * pattern
    return replace(
        statistics,
        shape_names=tuple(names),
        means=statistics.means[:, order],
        covariances=covariances,
        mean=statistics.mean[order],
        covariance=covariance,
        regions=tuple(statistics.regions[i] for i in order),
        coupling=statistics.factors[np.ix_(order, order)],
        examples=None if statistics.examples is None else _halved(statistics.examples[:, order], column),
    )


def _halved(examples: Array, column: int) -> Array:
    """Split the weight of the whole, in ``column`` and the last column of ``examples``, by reproducible differences."""
    difference = np.sqrt(_DIFFER) * np.random.default_rng(column).uniform(-1.0, 1.0, len(examples))
    whole = examples[:, column]
    examples[:, column], examples[:, -1] = whole * (1.0 + difference), whole * (1.0 - difference)
    return examples
