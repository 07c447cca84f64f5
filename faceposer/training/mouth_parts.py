"""Detection of teeth and the inside of the mouth in a mesh that also contains the skin, by their positions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Least number of crowns on each side of a row of teeth.
_FEWEST = 3
# Shares of the height of the skin: smallest and largest size of a crown, largest height and width of the row.
_CROWN, _ROW_HEIGHT, _ROW_WIDTH = (0.01, 0.09), 0.2, 0.35
# Least share of the small islands that must be hidden behind skin.
_HIDDEN = 0.8
# Tolerance of the bounding box of the mouth around the teeth, as a share of the skin's height.
_ROOM = 0.03


@dataclass(frozen=True, eq=False)
class MouthIslands:
    """Islands of a mesh that are not skin.

    Attributes:
        islands: Island number of each face, shape (F,).
        teeth: Numbers of the islands that are crowns.
        mouth: Numbers of the islands that are the inside of the mouth.
    """

    islands: Ids
    teeth: Ids
    mouth: Ids


def find_mouth(corners: Ids, vertices: Array) -> MouthIslands | None:
    """Return the crowns and the inside of the mouth in a mesh of skin, or None if it has none.

    Crowns are small islands in a row on both sides, hidden behind skin as seen from the front. The inside of the mouth
    is an island around them.

    Args:
        corners: Vertex ids of three corners of each face, shape (F, 3).
        vertices: Upright, with the left at +x, facing +z, shape (M, 3).
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
    """Return the number of the connected component of each face, from 0."""
    a, b, c = corners.T
    edges = (np.ones(2 * len(a), dtype=np.int8), (np.tile(a, 2), np.concatenate([b, c])))
    _, labels = connected_components(coo_array(edges, shape=(count, count)), directed=False)
    return np.unique(labels[a], return_inverse=True)[1].astype(np.intp)


def _hidden(points: Array, triangles: Array) -> NDArray[np.bool_]:
    """Return the mask of ``points``, (n, 3), with one of the ``triangles``, (F, 3, 3), in front of them, along +z."""
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
