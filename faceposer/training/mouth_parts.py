"""Teeth and the inside of the mouth that a file has in the mesh of the skin, found by where they lie."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Fewer crowns on each side make no row of teeth.
_FEWEST = 3
# Shares of the height of the skin: the size of a crown, least and greatest, and how low and how wide the row is.
_CROWN, _ROW_HEIGHT, _ROW_WIDTH = (0.01, 0.09), 0.2, 0.35
# Of the crowns, so many lie behind skin as seen from the front.
_HIDDEN = 0.8
# How far crowns may stick out of the mouth's box and the mouth out of the skin's, as a share of the skin's height.
_ROOM = 0.03


@dataclass(frozen=True, eq=False)
class MouthIslands:
    """Islands of a mesh that are no skin.

    Attributes:
        islands: Number of the island of each face, shape (F,).
        teeth: Numbers of the islands that are crowns.
        mouth: Numbers of the islands that are the inside of the mouth around them.
    """

    islands: Ids
    teeth: Ids
    mouth: Ids


def find_mouth(corners: Ids, vertices: Array) -> MouthIslands | None:
    """Return the crowns, and the inside of the mouth, in a mesh of skin, or None if it has none.

    Crowns are small islands in a row, some on either side, which lie behind skin when they are seen from the front; the
    inside of the mouth is an island around them, neither of them connected with the rest.

    Args:
        corners: Three corners of each face, vertex ids, shape (F, 3).
        vertices: Upright, the left at +x, looking along +z, shape (M, 3).
    """
    islands = _islands(corners, len(vertices))
    count = int(islands.max(initial=-1)) + 1
    if count < 2 * _FEWEST + 1:
        return None
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for column in corners.T:
        np.minimum.at(low, islands, vertices[column])
        np.maximum.at(high, islands, vertices[column])
    skin = int(np.prod(high - low, axis=1).argmax())
    size = float(high[skin, 1] - low[skin, 1])
    middle, extent = 0.5 * (low + high), (high - low).max(axis=1)
    inside = ((low > low[skin]) & (high < high[skin])).all(axis=1)
    small = np.flatnonzero(inside & (extent > _CROWN[0] * size) & (extent < _CROWN[1] * size))
    teeth = small[_hidden(middle[small], vertices[corners[islands == skin]])]
    sides = middle[teeth, 0] - middle[skin, 0]
    if min((sides > 0.0).sum(), (sides < 0.0).sum()) < _FEWEST or len(teeth) < _HIDDEN * len(small):
        return None
    row_low, row_high = low[teeth].min(axis=0), high[teeth].max(axis=0)
    width, height, _ = row_high - row_low
    if height > _ROW_HEIGHT * size or width > _ROW_WIDTH * size:
        return None
    room = _ROOM * size
    around = (low < row_low + room).all(axis=1) & (high > row_high - room).all(axis=1) & inside
    around &= (high - low).prod(axis=1) < 0.25 * (high - low)[skin].prod()
    return MouthIslands(islands, teeth, np.flatnonzero(around))


def _islands(corners: Ids, count: int) -> Ids:
    """Return the number of the connected piece of each face, from 0."""
    a, b, c = corners.T
    edges = (np.ones(2 * len(a), dtype=np.int8), (np.tile(a, 2), np.concatenate([b, c])))
    _, labels = connected_components(coo_array(edges, shape=(count, count)), directed=False)
    return np.unique(labels[a], return_inverse=True)[1].astype(np.intp)


def _hidden(points: Array, triangles: Array) -> NDArray[np.bool_]:
    """Return which ``points``, (n, 3), have one of the ``triangles``, (F, 3, 3), before them, along +z."""
    hidden = np.zeros(len(points), dtype=bool)
    low, high = triangles[..., :2].min(axis=1), triangles[..., :2].max(axis=1)
    for i, point in enumerate(points):
        near = triangles[((low <= point[:2]) & (high >= point[:2])).all(axis=1)]
        if not len(near):
            continue
        flat = near[..., :2] - point[:2]
        weights = np.stack(
            [flat[:, k - 2, 0] * flat[:, k - 1, 1] - flat[:, k - 1, 0] * flat[:, k - 2, 1] for k in range(3)], axis=1
        )
        total = weights.sum(axis=1)
        met = (weights * np.sign(total)[:, None] >= 0.0).all(axis=1) & (total != 0.0)
        depth = (weights[met] * near[met][..., 2]).sum(axis=1) / total[met]
        hidden[i] = bool((depth > point[2]).any())
    return hidden
