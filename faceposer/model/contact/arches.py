"""Dental arches: teeth and gums of one jaw as a height field around a vertical axis behind them.

Columns are equal steps of tan(angle / 2) = x / (r + z), which is smooth in front and needs no arctangent.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.model.character import Character
from faceposer.model.contact.frames import AffineFrame, group_by_motion, moves_affinely, pieces, to_rest
from faceposer.model.contact.samples import lattice

Array = NDArray[np.float64]
Ids = NDArray[np.intp]
_Float = TypeVar("_Float", np.float32, np.float64)

# Greatest tangent of half the angle to straight ahead, number of coarse columns, and height of a coarse row as a share
# of the head's height.
_WIDEST = 1.5
_COARSE_COLUMNS = 241
_COARSE_ROW = 0.002
#: Cells of the height field per coarse cell in each direction, an odd number.
FINE = 3
_COLUMNS = FINE * (_COARSE_COLUMNS - 1) + 1
# Largest gap between teeth in coarse columns, and radius in coarse cells of the search for a path past the teeth.
_GAP, _WINDOW = 9, 16
# Position of the axis, as a share of the arch's depth from its back end.
_AXIS = 0.3


@dataclass(frozen=True, eq=False)
class DentalArch:
    """Height field of the teeth and gums of one jaw at rest, in cylinder coordinates (column, height, radius).

    Attributes:
        frame: Motion of the jaw.
        triangles: Triangles of its teeth and gums, shape (T, 3).
        axis: Coordinates x and z of the vertical axis.
        bottom: Height of the centre of the lowest row.
        row: Height of a row.
        front: Greatest radius of the surface in each cell, shape (columns, rows); -inf in empty cells.
    """

    frame: AffineFrame
    triangles: NDArray[np.int32]
    axis: tuple[float, float]
    bottom: float
    row: float
    front: Array

    def cylinder(self, points: Array) -> tuple[Array, Array, Array]:
        """Return column, height and radius of ``points`` at rest, (n, 3), each of shape (n,)."""
        column, radius = _columns(points, self.axis)
        return column, points[:, 1], radius

    @staticmethod
    def angle(place: Array) -> Array:
        """Return the angle to straight ahead, shape (n,), of fractional columns ``place``."""
        angle: Array = 2.0 * np.arctan(place * (2.0 * _WIDEST / (_COLUMNS - 1)) - _WIDEST)
        return angle

    @property
    def column_width(self) -> float:
        """Width of the middle columns at the median radius of the front."""
        usual = float(np.median(self.front[np.isfinite(self.front)]))
        return usual * 2.0 * 2.0 * _WIDEST / (_COLUMNS - 1)

    def resting(self, points: Array, vertices: NDArray[np.floating]) -> Array:
        """Return ``points`` of the pose ``vertices``, (N, 3), in the rest frame of the jaw, shape (n, 3)."""
        linear, moved = self.frame.motion(vertices)
        return to_rest(points, self.frame.origin, linear, moved)

    @cached_property
    def _coarse(self) -> Array:
        """Greatest radius in coarse cells, (columns, rows)."""
        columns, rows = self.front.shape
        lines = -(-(rows + 1) // FINE)
        field = np.pad(self.front, ((1, 1), (1, FINE * lines - rows - 1)), constant_values=-np.inf)
        return field.reshape((columns + 2) // FINE, FINE, lines, FINE).max(axis=(1, 3))

    def coarse_cell(self, place: Array, height: Array) -> tuple[Ids, Ids]:
        """Return the coarse column and row of points at columns ``place`` and a ``height``, shape (n,) each."""
        return np.round(place / FINE).astype(np.intp), np.round((height - self.bottom) / self.coarse_row).astype(
            np.intp
        )

    @property
    def coarse_row(self) -> float:
        """Height of a coarse row."""
        return FINE * self.row

    @cached_property
    def _closed(self) -> Array:
        """The coarse field with the gaps between teeth filled, padded by a wide margin without teeth."""
        known = np.isfinite(self._coarse)
        floor = float(self._coarse[known].min()) - 1.0
        field = np.pad(np.where(known, self._coarse, floor), _GAP + _WINDOW, constant_values=floor)
        closed: Array = ndimage.grey_closing(field, size=(_GAP, 1))
        return closed

    @cached_property
    def _window(self) -> tuple[Ids, Ids, Array]:
        """Offsets in columns and rows of the coarse cells around a cell, and their distances along the front."""
        steps = np.arange(-_WINDOW, _WINDOW + 1)
        columns, rows = (x.ravel() for x in np.meshgrid(steps, steps, indexing="ij"))
        return columns, rows, np.hypot(columns * FINE * self.column_width, rows * self.coarse_row)

    @cached_property
    def extended(self) -> Array:
        """The coarse field extrapolated to all cells."""
        field = self._coarse
        known = np.isfinite(field)
        nearest = ndimage.distance_transform_edt(
            ~known, sampling=(3.0, 1.0), return_distances=False, return_indices=True
        )
        return field[nearest[0], nearest[1]]

    def depth(self, points: Array) -> Array:
        """Return the depth of ``points`` at rest, (n, 3), behind the front of the teeth, shape (n,); 0 in front.

        Above and below the teeth it is 0; near their edges it is at most the distance past the edge.
        """
        place, height, radius = self.cylinder(points)
        column = np.round(place).astype(np.intp)
        line = np.round((height - self.bottom) / self.row).astype(np.intp)
        met = (column >= 0) & (column < self.front.shape[0]) & (line >= 0) & (line < self.front.shape[1])
        depth = np.zeros(len(points))
        depth[met] = np.maximum(self.front[column[met], line[met]] - radius[met], 0.0)
        behind = np.flatnonzero(depth)
        columns, rows, distances = self._window
        pad = _GAP + _WINDOW
        column, line = self.coarse_cell(place[behind], height[behind])
        cells = self._closed[column[:, None] + columns + pad, line[:, None] + rows + pad]
        past = np.where(cells <= radius[behind, None], distances, np.inf).min(axis=1, initial=np.inf)
        depth[behind] = np.minimum(depth[behind], past)
        return depth

    def gap(self, points: Array) -> Array:
        """Return the distance of ``points`` at rest, (n, 3), in front of the extrapolated arch, shape (n,).

        It is negative behind the arch and infinite beyond its sides.
        """
        place, height, radius = self.cylinder(points)
        column, line = self.coarse_cell(place, height)
        columns, rows = self._coarse.shape
        outside = (column < 0) | (column >= columns)
        radii = self.extended[np.clip(column, 0, columns - 1), np.clip(line, 0, rows - 1)]
        gap: Array = np.where(outside, np.inf, radius - radii)
        return gap

    @property
    def top(self) -> float:
        """Height of the centre of the highest row."""
        return self.bottom + self.row * (self.front.shape[1] - 1)


def find_arches(character: Character) -> list[DentalArch]:
    """Find the dental arches of the ``character``: its teeth and gums, grouped by their motion.

    Gums that deform, such as the soft lining of a mouth that bends with the jaw, are not obstacles.
    """
    candidates: list[Ids] = []
    for part in character.parts:
        if part.material in ("teeth", "gums"):
            whole = np.arange(*part.vertices, dtype=np.intp)
            found = [whole] if moves_affinely(character, whole) else pieces(character, part)
            candidates += [ids for ids in found if part.material == "teeth" or moves_affinely(character, ids)]
    arches = [_arch(character, ids) for ids in group_by_motion(character, [ids for ids in candidates if len(ids) >= 4])]
    return [arch for arch in arches if arch is not None]


def _arch(character: Character, ids: Ids) -> DentalArch | None:
    chosen = np.zeros(len(character.vertices), dtype=bool)
    chosen[ids] = True
    triangles = character.triangles[chosen[character.triangles].all(axis=1)]
    points = character.vertices[ids].astype(np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    if not len(triangles) or (high - low).max() < 0.02 * character.height:
        return None
    axis = (0.5 * float(low[0] + high[0]), float(low[2] + _AXIS * (high[2] - low[2])))
    row = _COARSE_ROW * character.height / FINE
    rows = int(np.ceil((high[1] - low[1]) / row)) + 1
    bottom = float(low[1])
    surface = lattice(character.vertices[triangles].astype(np.float64), 0.6 * row)
    front = radius_raster(surface, axis, bottom, row, rows, _COLUMNS)
    return DentalArch(AffineFrame.of(ids, character.vertices), triangles, axis, bottom, row, front)


def radius_raster(
    points: Array, axis: tuple[float, float], bottom: float, row: float, rows: int, columns: int = _COARSE_COLUMNS
) -> Array:
    """Return the greatest radius of ``points``, (n, 3), in each cell around ``axis``, (columns, rows), or -inf."""
    place, radius = _columns(points, axis, columns)
    column = np.round(place).astype(np.intp)
    line = np.round((points[:, 1] - bottom) / row).astype(np.intp)
    met = (column >= 0) & (column < columns) & (line >= 0) & (line < rows)
    raster = np.full(columns * rows, -np.inf)
    np.maximum.at(raster, column[met] * rows + line[met], radius[met])
    return raster.reshape(columns, rows)


def _columns(points: Array, axis: tuple[float, float], columns: int = _COLUMNS) -> tuple[Array, Array]:
    """Return the fractional columns and the radii of ``points``, (n, 3), around ``axis``, shape (n,) each."""
    return columns_of(points[:, 0] - axis[0], points[:, 2] - axis[1], columns)


def columns_of(
    x: NDArray[_Float], z: NDArray[_Float], columns: int = _COLUMNS
) -> tuple[NDArray[_Float], NDArray[_Float]]:
    """Return the fractional columns and the radii of points at ``x`` and ``z`` from the axis, shape (n,) each."""
    radius = np.sqrt(x * x + z * z)
    # Directly behind the axis the tangent is infinite.
    tangent = x / np.maximum(radius + z, 1e-3 * radius + 1e-9)
    return np.clip((tangent + _WIDEST) * ((columns - 1) / (2.0 * _WIDEST)), -float(FINE), columns + FINE - 1.0), radius
