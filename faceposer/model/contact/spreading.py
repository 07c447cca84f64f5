"""Spreads what a few vertices are pushed by over the skin around them, so that it ends softly.

A push u_v of vertices v is gathered at control points c and handed out again by quadratic B-splines B over two surface
coordinates:

    g_c = (sum_v B_cv u_v^4 / sum_v B_cv)^(1/4),    s_v = f_v sum_c B_cv g_c.

A weighted 4-norm is nearly the greatest push around a point, and unlike that it is smooth; both steps are nonexpansive,
so that the field changes by no more than the pushes do.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]

#: Pushes of less than this share of a head's height are nothing: single precision does not know them.
NOTHING = 1e-8


@dataclass(frozen=True, eq=False)
class Spreading:
    """Gathers pushes of V vertices at control points and hands them out.

    Attributes:
        gather: Weights of vertices in control points, rows sum to one, shape (C, V).
        spread: Weights of control points at vertices, rows sum to f_v, shape (V, C).
    """

    gather: sparse.csc_array
    spread: sparse.csr_array

    @classmethod
    def over(cls, first: Array, second: Array, layer: Array, fade: Array) -> Self:
        """Return the spreading over vertices with two surface coordinates in units of the control points' distance.

        Args:
            first: First coordinate, shape (V,).
            second: Second coordinate, shape (V,).
            layer: Share of each vertex in the upper of two layers that hand nothing to each other, as the lips; (V,).
            fade: Factor f_v on what each vertex gets, shape (V,).
        """
        count = len(first)
        rows, keys, values = [], [], []
        for i, along in enumerate(_splines(first)):
            for j, across in enumerate(_splines(second)):
                cell = np.stack([np.round(first) + i - 1, np.round(second) + j - 1], axis=1)
                for number, share in enumerate((layer, 1.0 - layer)):
                    rows.append(np.arange(count))
                    keys.append(np.column_stack([cell, np.full(count, number)]))
                    values.append(along * across * share)
        row, value = np.concatenate(rows), np.concatenate(values)
        used = value > 1e-6
        cells, column = np.unique(np.concatenate(keys)[used].astype(np.int64), axis=0, return_inverse=True)
        shape = (count, len(cells))
        splines = sparse.csr_array((value[used], (row[used], column.ravel())), shape=shape)
        totals = np.asarray(splines.sum(axis=0)).ravel()
        gather = sparse.csc_array(sparse.dia_array((1.0 / totals[None], [0]), shape=(len(cells),) * 2) @ splines.T)
        spread = sparse.csr_array(sparse.dia_array((fade[None], [0]), shape=(count, count)) @ splines)
        # Short indices: half of what a product reads.
        spread.indices, spread.indptr = spread.indices.astype(np.int32), spread.indptr.astype(np.int32)
        return cls(gather, spread)

    def __call__(self, push: Array) -> Array:
        """Return the field, shape (V,), at least 0, of a ``push`` at least 0, shape (V,)."""
        field: Array = self.spread @ np.sqrt(np.sqrt(self._gathered(push)))
        return field

    def _gathered(self, push: Array) -> Array:
        """Return the means of the fourth powers of a ``push``, (V,), at the control points, (C,)."""
        # Most vertices have none.
        pushed = np.flatnonzero(push)
        first = self.gather.indptr.take(pushed)
        counts = self.gather.indptr.take(pushed + 1) - first
        ends = np.cumsum(counts)
        if not len(pushed):
            return np.zeros(self.gather.shape[0])
        entries = np.arange(ends[-1]) + np.repeat(first - ends + counts, counts)
        squared = push.take(pushed)
        squared *= squared
        values = self.gather.data.take(entries) * np.repeat(squared * squared, counts)
        return np.bincount(self.gather.indices.take(entries), values, minlength=self.gather.shape[0])


def _splines(position: Array) -> tuple[Array, Array, Array]:
    """Return the quadratic B-splines around the nearest integer, before it, at it and after it, (V,) each."""
    t = position - np.round(position)
    return 0.5 * (0.5 - t) ** 2, 0.75 - t * t, 0.5 * (0.5 + t) ** 2


def hinge(depth: Array, start: float, margin: float) -> Array:
    """Return how far a point that lies ``depth`` deep is pushed out, shape (n,); 0 for one that does not.

    With d = max(depth, 0), start s and margin m it is (d + m d / (d + m)) d / (d + s): smooth at 0, and for d above s a
    little more than d, so that surfaces do not stay in one another.
    """
    d = np.maximum(depth, 0.0)
    push: Array = (d + margin * d / (d + margin)) * d / (d + start)
    return push


def fading(value: Array, full: float, gone: float) -> Array:
    """Return 1 where ``value`` is at most ``full``, 0 from ``gone`` on, and a smooth cubic between."""
    t = np.clip((gone - value) / (gone - full), 0.0, 1.0)
    smooth: Array = t * t * (3.0 - 2.0 * t)
    return smooth


def farthest(moves: NDArray[np.floating]) -> float:
    """Return the greatest length of ``moves``, coordinates by rows (3, n); 0 where there are none."""
    x, y, z = moves
    return float(np.sqrt((x * x + y * y + z * z).max(initial=0.0)))
