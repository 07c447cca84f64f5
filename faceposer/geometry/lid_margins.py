"""Margins of the lids: points of the skin along the edge of the opening in front of an eyeball.

Directions from the ball's centre have an azimuth, from straight ahead towards +x, and an elevation. In each of several
columns of constant azimuth, the opening is the range of elevations around straight ahead that no skin covers. Its ends
are on the margins of the lids and, as points of the skin, move with it in every pose.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Columns and coarse rows, and number of bisections of the ends between two rows.
_AZIMUTHS = np.radians(np.arange(-75.0, 75.1, 5.0))
_ELEVATIONS = np.radians(np.arange(-56.0, 56.1, 7.0))
_HALVINGS = 6
# Range of distances from the centre of the ball at which skin covers it, in radii.
_NEAREST, _FARTHEST = 0.985, 1.45
# Least width of an opening, in columns.
_FEWEST_COLUMNS = 4


@dataclass(frozen=True, eq=False)
class LidMargins:
    """Points of the skin along the margins of the lids of one eye, from one corner to the other.

    Attributes:
        corners: Vertex ids of the triangle of each point, shape (n, 3).
        barycentric: Barycentric coordinates of each point, shape (n, 3).
        count: Number of points of the upper lid, which precede those of the lower lid.
    """

    corners: NDArray[np.intp]
    barycentric: Array
    count: int

    def angles(self, vertices: NDArray[np.floating], centre: ArrayLike) -> tuple[Array, Array]:
        """Return azimuth and elevation, in radians, of the upper and of the lower margin as seen from ``centre``.

        Args:
            vertices: Vertices of the pose, shape (N, 3).
            centre: Centre of the ball, shape (3,).

        Returns:
            Two arrays of shape (n, 2), each sorted by azimuth.
        """
        relative = (self.barycentric[:, :, None] * vertices[self.corners]).sum(axis=1) - np.asarray(centre)
        both = angles_of(relative)
        upper, lower = both[: self.count], both[self.count :]
        return upper[upper[:, 0].argsort()], lower[lower[:, 0].argsort()]


def angles_of(directions: Array) -> Array:
    """Return azimuth and elevation, shape (n, 2), of ``directions`` of any length, shape (n, 3)."""
    x, y, z = directions.T
    return np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=1)


def directions_of(azimuth: ArrayLike, elevation: ArrayLike) -> Array:
    """Return the unit directions, shape (..., 3), of azimuths and elevations."""
    a, e = np.broadcast_arrays(np.asarray(azimuth, dtype=np.float64), np.asarray(elevation, dtype=np.float64))
    return np.stack([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)], axis=-1)


def find_lid_margins(
    vertices: NDArray[np.floating], triangles: NDArray[np.integer], centre: Array, radius: float
) -> LidMargins | None:
    """Find the margins of the lids of an eyeball; return None if the skin has no eye-shaped opening in front of it.

    Args:
        vertices: Vertices of the neutral face, which looks along +z, shape (N, 3).
        triangles: Triangles of the skin, shape (T, 3).
        centre: Centre of the ball, shape (3,).
        radius: Radius of the ball.
    """
    distance = np.linalg.norm(vertices - centre, axis=1)
    near = (distance < _FARTHEST * radius) & (vertices[:, 2] > centre[2])
    outside = distance > _NEAREST * radius
    # Coarse triangles extend far beyond the lids: one corner suffices.
    around = triangles[near[triangles].any(axis=1) & outside[triangles].any(axis=1)]
    if not len(around):
        return None
    skin = _Skin(vertices[around].astype(np.float64) - centre, radius)
    azimuth, elevation = np.meshgrid(_AZIMUTHS, _ELEVATIONS, indexing="ij")
    open_at = (skin.covering(directions_of(azimuth.ravel(), elevation.ravel())) < 0).reshape(azimuth.shape)
    runs = _runs(open_at)
    if len(runs) < _FEWEST_COLUMNS:
        return None
    columns = _AZIMUTHS[[column for column, _, _ in runs]]
    ends = []
    for inner, outer in (
        ([last for _, _, last in runs], [last + 1 for _, _, last in runs]),
        ([first for _, first, _ in runs], [first - 1 for _, first, _ in runs]),
    ):
        free, covered = _ELEVATIONS[inner], _ELEVATIONS[outer]
        for _ in range(_HALVINGS):
            middle = 0.5 * (free + covered)
            is_open = skin.covering(directions_of(columns, middle)) < 0
            free, covered = np.where(is_open, middle, free), np.where(is_open, covered, middle)
        ends.append(directions_of(columns, covered))
    directions = np.concatenate(ends)
    hit = skin.covering(directions)
    return LidMargins(around[hit].astype(np.intp), skin.barycentric(directions, hit), len(columns))


def _runs(open_at: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Return column, first and last row of the opening in each of its columns, traced from the middle outwards."""
    middle = len(_AZIMUTHS) // 2
    found: dict[int, tuple[int, int]] = {}
    for columns in (range(middle, len(_AZIMUTHS)), range(middle - 1, -1, -1)):
        before = found.get(middle)
        for column in columns:
            run = _run(open_at[column], before)
            if run is None:
                break
            found[column] = before = run
    return [(column, *found[column]) for column in sorted(found)]


def _run(column: NDArray[np.bool_], neighbour: tuple[int, int] | None) -> tuple[int, int] | None:
    """Return the first and last open row adjacent to those of the ``neighbour`` column, or around straight ahead."""
    low, high = neighbour or (len(column) // 2 - 2, len(column) // 2 + 2)
    rows = np.flatnonzero(column[low : high + 1]) + low
    if not len(rows):
        return None
    first = last = int(rows[len(rows) // 2])
    while first > 0 and column[first - 1]:
        first -= 1
    while last < len(column) - 1 and column[last + 1]:
        last += 1
    # An opening that extends to the border of the grid is not between two lids.
    return None if first == 0 or last == len(column) - 1 else (first, last)


class _Skin:
    """Triangles of skin, for intersection with rays from the origin."""

    def __init__(self, corners: Array, radius: float) -> None:
        a, b, c = np.moveaxis(corners, 1, 0)
        volume = np.einsum("td,td->t", a, np.cross(b, c))
        # Turned so that a ray which meets a triangle has three positive shares, on either side of the skin.
        self._edges = np.sign(volume)[:, None] * np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
        self._volume = np.abs(volume)
        self._near, self._far = _NEAREST * radius, _FARTHEST * radius

    def covering(self, directions: Array) -> NDArray[np.intp]:
        """Return the nearest triangle outside the ball on each ray, or -1, shape (n,)."""
        shares = directions @ self._edges.transpose(0, 2, 1)
        total = shares.sum(axis=0)
        # The distance is the volume divided by the total.
        meets = (total * self._near < self._volume) & (total * self._far > self._volume)
        meets &= shares.min(axis=0) >= -1e-9 * total
        rays, triangles = np.nonzero(meets)
        distance = np.full(total.shape, np.inf)
        distance[rays, triangles] = self._volume[triangles] / total[rays, triangles]
        return np.where(meets.any(axis=1), distance.argmin(axis=1), -1)

    def barycentric(self, directions: Array, triangles: NDArray[np.intp]) -> Array:
        """Return the barycentric coordinates of each ray on its triangle, shape (n, 3)."""
        shares = np.einsum("nd,knd->nk", directions, self._edges[:, triangles])
        return np.asarray(shares / shares.sum(axis=1, keepdims=True))
