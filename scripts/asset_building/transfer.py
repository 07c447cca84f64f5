"""Fit the source's face units to a head of very different proportions.

Each offset is transformed by the affine map of its vertex's neighbourhood between the two heads: Noh and Neumann,
"Expression cloning" (2001), with least-squares maps in place of local bounding boxes, since these include shear.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from scripts.asset_building.piece import Floats

#: Vertices in a neighbourhood, and its radius in centimetres, larger than folds.
_NEIGHBOURS, _RADIUS = 96, 2.2
#: Weight of the identity, which determines the normal direction of flat neighbourhoods.
_RIDGE = 0.25
#: A direction is stretched or shrunk by at most this factor.
_MOST = 2.0


def fitted_units(rest: Floats, head: Floats, units: Floats, chosen: NDArray[np.bool_]) -> Floats:
    """Return ``units`` fitted to ``head``.

    Args:
        rest: Original mesh of the units, in centimetres, shape (N, 3).
        head: The same mesh in the shape of another head, shape (N, 3).
        units: Offsets on ``rest``, shape (S, N, 3).
        chosen: Mask of the vertices of the head, shape (N,); the others keep their offsets.
    """
    ids = np.flatnonzero(chosen)
    distance, near = cKDTree(rest[ids]).query(rest[ids], k=_NEIGHBOURS)
    weight = np.exp(-((distance / _RADIUS) ** 2))
    weight /= weight.sum(axis=1, keepdims=True)
    before, after = rest[ids][near], head[ids][near]
    before = before - np.einsum("nk,nkd->nd", weight, before)[:, None]
    after = after - np.einsum("nk,nkd->nd", weight, after)[:, None]
    # after = map @ before, and map near the identity: normal equations with a ridge.
    spread = np.einsum("nk,nki,nkj->nij", weight, before, before)
    both = np.einsum("nk,nki,nkj->nij", weight, after, before)
    maps = (both + _RIDGE * np.eye(3)) @ np.linalg.inv(spread + _RIDGE * np.eye(3))
    u, stretch, vt = np.linalg.svd(maps)
    maps = (u * np.clip(stretch, 1.0 / _MOST, _MOST)[:, None, :]) @ vt
    result = units.copy()
    result[:, ids] = np.einsum("nij,snj->sni", maps, units[:, ids])
    return result
