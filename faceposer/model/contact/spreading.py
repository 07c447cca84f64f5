"""Smooth spreading of pushes of a few vertices over the surrounding skin.

Pushes u_v of vertices v are gathered at control points c and interpolated by quadratic B-splines B over two surface
coordinates:

    g_c = (sum_v B_cv u_v^4 / sum_v B_cv)^(1/4),    s_v = f_v sum_c B_cv g_c.

The weighted 4-norm is close to the maximum of the pushes around a point but smooth; both steps are nonexpansive, so
that the field changes by no more than the pushes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]
_Float = TypeVar("_Float", np.float32, np.float64)

#: Pushes below this share of the head's height are ignored, as they are below single precision.
NEGLIGIBLE = 1e-8


@dataclass(frozen=True, eq=False)
class Spreading:
    """Operator that gathers pushes of K of V vertices at C control points and interpolates them.

    Attributes:
        gather: Weights of pushed vertices at control points, shape (C, K).
        spread: Weights of control points at vertices, with row sums of at most f_v, shape (V, C).
    """

    gather: sparse.csr_array
    spread: sparse.csr_array

    @classmethod
    def over(cls, first: Array, second: Array, layer: Array, fade: Array, keys: Ids) -> Self:
        """Return the spreading over V vertices, given two surface coordinates in units of the control points' spacing.

        Args:
            first: First coordinate, shape (V,).
            second: Second coordinate, shape (V,).
            layer: Share of each vertex in the upper of two separate layers, such as the lips, shape (V,).
            fade: Factor f_v of each vertex, shape (V,).
            keys: Indices of the vertices that can be pushed, shape (K,); the pushes of all others are 0.
        """
        count = len(first)
        rows, places, values = [], [], []
        for i, along in enumerate(_splines(first)):
            for j, across in enumerate(_splines(second)):
                cell = np.stack([np.round(first) + i - 1, np.round(second) + j - 1], axis=1)
                for number, share in enumerate((layer, 1.0 - layer)):
                    rows.append(np.arange(count))
                    places.append(np.column_stack([cell, np.full(count, number)]))
                    values.append(along * across * share)
        row, value = np.concatenate(rows), np.concatenate(values)
        used = value > 1e-6
        cells, column = np.unique(np.concatenate(places)[used].astype(np.int64), axis=0, return_inverse=True)
        shape = (count, len(cells))
        splines = sparse.csr_array((value[used], (row[used], column.ravel())), shape=shape)
        totals = np.asarray(splines.sum(axis=0)).ravel()
        pushed = splines[keys]
        # Control points that receive no push are omitted.
        reached = np.flatnonzero(np.asarray(pushed.sum(axis=0)).ravel())
        gather = sparse.dia_array((1.0 / totals[None, reached], [0]), shape=(len(reached),) * 2) @ pushed[:, reached].T
        spread = sparse.dia_array((fade[None], [0]), shape=(count, count)) @ splines[:, reached]
        return cls(_compact(gather), _compact(spread))

    @classmethod
    def block_diagonal(cls, parts: Sequence[Self]) -> Self:
        """Return the ``parts`` as one spreading, with their pushes and fields concatenated."""
        return cls(
            _compact(sparse.block_diag([part.gather for part in parts])),
            _compact(sparse.block_diag([part.spread for part in parts])),
        )

    @property
    def support(self) -> Ids:
        """The vertices at which the field can be positive, in ascending order."""
        return np.flatnonzero(np.diff(self.spread.indptr))

    def restricted(self, vertices: Ids) -> Self:
        """Return the spreading with the field at ``vertices`` only, shape (n,)."""
        return type(self)(self.gather, _compact(self.spread[vertices]))

    def __call__(self, push: NDArray[np.floating]) -> Singles:
        """Return the field, shape (V,), of a ``push``, shape (K,); both are nonnegative."""
        squared = (push * push).astype(np.float32)
        field: Singles = self.spread @ np.sqrt(np.sqrt(self.gather @ (squared * squared)))
        return field


def _compact(matrix: sparse.sparray) -> sparse.csr_array:
    """Return the ``matrix`` in CSR format with 32-bit indices and values and without zeros, for fast products."""
    rows = sparse.csr_array(matrix, dtype=np.float32)
    rows.eliminate_zeros()
    rows.indices, rows.indptr = rows.indices.astype(np.int32), rows.indptr.astype(np.int32)
    return rows


def _splines(position: Array) -> tuple[Array, Array, Array]:
    """Return the quadratic B-splines centred one before, at and one after the nearest integer, shape (V,) each."""
    t = position - np.round(position)
    return 0.5 * (0.5 - t) ** 2, 0.75 - t * t, 0.5 * (0.5 + t) ** 2


def hinge(depth: NDArray[_Float], start: NDArray[_Float] | float, margin: NDArray[_Float] | float) -> NDArray[_Float]:
    """Return the push of points at ``depth`` below a surface, shape (n,); 0 for points outside.

    With d = max(depth, 0), start s and margin m it is (d + m d / (d + m)) d / (d + s): smooth at 0, and slightly more
    than d for d above s, so that penetration is removed completely.
    """
    d = np.maximum(depth, 0.0)
    push: NDArray[_Float] = np.asarray((d + margin * d / (d + margin)) * d / (d + start), dtype=depth.dtype)
    return push


def fading(value: Array, full: float, gone: float) -> Array:
    """Return 1 where ``value`` is at most ``full``, 0 from ``gone`` on, and a smooth cubic between."""
    t = np.clip((gone - value) / (gone - full), 0.0, 1.0)
    smooth: Array = t * t * (3.0 - 2.0 * t)
    return smooth
