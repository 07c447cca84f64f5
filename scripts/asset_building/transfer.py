"""Fits the source's face units to a head of very different proportions.

Each offset is turned and stretched as the surface around its vertex is between the two heads, by the affine map that
takes one neighbourhood to the other: Noh and Neumann, "Expression cloning" (2001), with maps by least squares in the
place of local bounding boxes, since these also know shear.
"""

import numpy as np
from scipy.spatial import cKDTree

from scripts.asset_building.piece import Floats

#: Vertices in a neighbourhood, and its radius in centimetres: enough to look past folds.
_NEIGHBOURS, _RADIUS = 96, 2.2
#: Weight of the identity beside the neighbourhood, which keeps flat neighbourhoods from leaving a direction unknown.
_RIDGE = 0.25
#: A direction is stretched or shrunk by at most this factor.
_MOST = 2.0


def fitted_units(rest: Floats, head: Floats, units: Floats, chosen: Floats) -> Floats:
    """Return ``units`` as they fit on ``head``.

    Args:
        rest: The mesh that the units were made for, in centimetres, shape (N, 3).
        head: The same mesh as another head, shape (N, 3).
        units: Offsets on ``rest``, shape (S, N, 3).
        chosen: Which vertices belong to the head, shape (N,); the others keep their offsets.
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
