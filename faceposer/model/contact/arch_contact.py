"""Contact of lips, cheeks and chin with the teeth.

In the rest frame of a jaw, its teeth and gums are a height field: radius H(angle, height) around a vertical axis. Skin
in front of them in the neutral face keeps r >= H: it is pushed out along the radius, and the skin around it follows.
Above and below the teeth H falls with a constant slope, so that lips slide onto the teeth and do not jump.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.model.character import Character
from faceposer.model.contact.arches import DentalArch, columns_of
from faceposer.model.contact.displacement import Displacement, move_vertices
from faceposer.model.contact.lids import skin_ids
from faceposer.model.contact.lips import find_covering, skin_samples, surface_distance, with_neighbours
from faceposer.model.contact.spreading import NEGLIGIBLE, Spreading, fading, hinge

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]

# Shares of the head's height: width of the valleys between teeth that are filled, extension of the field above and
# below, and distance up to which the inside of the lips follows.
_VALLEY, _BEYOND, _INSIDE = 0.02, 0.06, 0.06
# The same: gap in front of the teeth, and distance beyond their ends, at which pushes begin to fade and have faded.
_FADES, _FADED, _LEVEL_FADES, _LEVEL_FADED = 0.06, 0.12, 0.04, 0.08
# The same: spacing of the control points, largest neutral gap of skin that may touch the teeth, largest distance of
# vertices with neighbours that may be deeper, start and margin of pushes.
_SPACING, _TOUCHES, _NEAR, _START, _MARGIN = 0.022, 0.12, 0.01, 0.0001, 0.001
# Near vertices are also within this share of their longest edge.
_STRETCHED = 0.6
# Number of columns and rows of the blocks of the coarse test.
_BLOCK = 4
# Slope of the field above and below the teeth and beyond the ends of the arch.
_SLOPE = 2.5
# Depth behind the field at rest that skin in front of the teeth loses for each length by which it leaves its place.
_LEAVING = 0.5
_UPPER_LIP = ("8.1", "8.5", "8.6", "8.9", "8.10", "2.2", "2.6", "2.7")
_LOWER_LIP = ("8.2", "8.7", "8.8", "2.3", "2.8", "2.9")


class ArchContact:
    """Contact that keeps the skin in front of one dental arch."""

    def __init__(self, character: Character, arch: DentalArch) -> None:
        """Precompute the contact of the skin of ``character`` with ``arch``."""
        size = character.height
        self._arch = arch
        self._start, self._margin, self._negligible = _START * size, _MARGIN * size, NEGLIGIBLE * size
        self._bottom, field = _obstacle(arch, size)
        # Single precision and a coarse upper bound, for scattered lookups that stay within the processor's cache.
        self._field: Singles = field.astype(np.float32)
        self._ceiling = _ceiling(self._field)
        covering = find_covering(character, arch)
        gap = arch.gap(character.vertices[covering.lips].astype(np.float64))
        keys = np.intersect1d(covering.lips, with_neighbours(character, covering.lips[gap < _TOUCHES * size]))
        self._samples = skin_samples(character, keys)
        self._near = np.minimum(_NEAR * size, _STRETCHED * self._samples.spans).astype(np.float32)
        inside = surface_distance(character, covering.lips, _INSIDE * size)
        skin = skin_ids(character)
        behind = np.setdiff1d(skin[inside[skin] < np.inf], keys)
        ids = np.concatenate([keys, behind])
        points = character.vertices[ids].astype(np.float64)
        place, height, radius = arch.cylinder(points)
        fade = fading(inside[ids], 0.0, _INSIDE * size)
        fade *= fading(arch.gap(points), _FADES * size, _FADED * size)
        beyond = np.maximum(height - arch.top, arch.bottom - height)
        fade *= fading(beyond, _LEVEL_FADES * size, _LEVEL_FADED * size)
        along = arch.angle(place) * float(np.median(radius[: len(keys)])) if len(keys) else place
        spacing = _SPACING * size
        pushed = np.arange(len(keys))
        layer = _upper_share(character, ids)
        spreading = Spreading.over(along / spacing, height / spacing, layer, fade, pushed)
        moving = np.concatenate([pushed, np.setdiff1d(spreading.support, pushed)])
        self._ids, self._spreading = ids[moving], spreading.restricted(moving)
        self._jaw_at_rest = character.vertices[arch.frame.witnesses]
        self._skin_at_rest = character.vertices[self._samples.ids]
        at_rest = self._samples.places(character.vertices)
        self._at_rest: Singles = np.ascontiguousarray(at_rest.T, dtype=np.float32)
        self._allowed = np.maximum(self._depth(self._at_rest), 0.0)
        in_front = (arch.gap(at_rest) >= 0.0) & (arch.depth(at_rest) == 0.0)
        self._leaving = np.where(in_front, _LEAVING, 0.0).astype(np.float32)

    def _depth(self, rows: Singles) -> Singles:
        """Return the depth behind the field of points at rest, shape (n,); ``rows`` are coordinates, (3, n)."""
        place, radius = columns_of(rows[0] - self._arch.axis[0], rows[2] - self._arch.axis[1])
        return self._radius(place, rows[1]) - radius

    def _deeper(self, rows: Singles, numbers: Ids) -> Singles:
        """Return how much deeper samples are than they may be, (n,); ``rows`` are coordinates at rest, (3, n).

        Skin may be behind the field where it is so in the neutral face. If it is in front of the teeth nevertheless,
        above the slope of their ends or in a filled valley, that holds for its place at rest and not for others.
        """
        deeper = self._depth(rows)
        allowed = self._allowed.take(numbers)
        known = np.flatnonzero(allowed)
        if len(known):
            chosen = numbers.take(known)
            left = rows.take(known, axis=1) - self._at_rest.take(chosen, axis=1)
            fall = self._leaving.take(chosen) * np.sqrt(np.einsum("kn,kn->n", left, left))
            deeper[known] -= np.maximum(allowed.take(known) - fall, 0.0)
        return deeper

    def _radius(self, place: Singles, height: Singles) -> Singles:
        """Return the field H, shape (n,), interpolated bilinearly between cell centres."""
        x, y = self._cells(place, height)
        column, line = x.astype(np.intp), y.astype(np.intp)
        x -= column
        y -= line
        rows = self._field.shape[1]
        cell = column * rows + line
        low, high = self._field.take(cell), self._field.take(cell + rows)
        low += y * (self._field.take(cell + 1) - low)
        high += y * (self._field.take(cell + rows + 1) - high)
        return low + x * (high - low)

    def _cells(self, place: Singles, height: Singles) -> tuple[Singles, Singles]:
        """Return fractional columns and rows of the field, clipped to its extent, shape (n,) each."""
        columns, rows = self._field.shape
        return (
            np.minimum(np.maximum(place, 0.0), columns - 1.001),
            np.minimum(np.maximum((height - self._bottom) / self._arch.row, 0.0), rows - 1.001),
        )

    def _may_reach(self, rows: Singles) -> Ids:
        """Return the indices of vertices at rest that may touch the field, (k,); ``rows`` are coordinates, (3, n)."""
        place, radius = columns_of(rows[0] - self._arch.axis[0], rows[2] - self._arch.axis[1])
        column, line = ((each * (1.0 / _BLOCK)).astype(np.intp) for each in self._cells(place, rows[1]))
        ceiling = self._ceiling.take(column * self._ceiling.shape[1] + line)
        return np.flatnonzero(ceiling > radius - self._near)

    def apply(self, vertices: Singles) -> Iterator[Displacement]:
        """Correct the pose ``vertices``, shape (N, 3), in place."""
        frame = self._arch.frame
        places, witnesses = vertices.take(self._samples.ids, axis=0), vertices.take(frame.witnesses, axis=0)
        jaw_moves = not np.array_equal(witnesses, self._jaw_at_rest)
        if not jaw_moves and np.array_equal(places, self._skin_at_rest):
            return
        linear, moved = frame.motion_of(witnesses)
        back = np.linalg.inv(linear).T
        to_rest = frame.origin - moved @ back
        turn, shift = back.T.astype(np.float32), to_rest.astype(np.float32)[:, None]
        rows = np.ascontiguousarray(places.T)
        near = self._may_reach(turn @ rows + shift)
        if not jaw_moves:
            near = near[(places.take(near, axis=0) != self._skin_at_rest.take(near, axis=0)).any(axis=1)]
        if not len(near):
            return
        push = self._samples.vertex_maxima(
            rows,
            near,
            lambda points, numbers: hinge(self._deeper(turn @ points + shift, numbers), self._start, self._margin),
        )
        if push.max() <= self._negligible:
            return
        field = self._spreading(push)
        field[: len(push)] = np.maximum(field[: len(push)], push)
        pushed = np.flatnonzero(field)
        ids = self._ids.take(pushed)
        before = vertices.take(ids, axis=0)
        # Coordinates x and z relative to the vertical axis, scaled to a push along the radius, then mapped to the pose.
        radial = back[:, ::2].T @ before.T
        radial += (to_rest[::2] - self._arch.axis)[:, None]
        radial *= field.take(pushed) / np.maximum(np.sqrt(radial[0] * radial[0] + radial[1] * radial[1]), 1e-9)
        move = linear[:, ::2] @ radial
        yield move_vertices(vertices, ids, before, move)


def _obstacle(arch: DentalArch, size: float) -> tuple[float, Array]:
    """Return the height of the lowest row and the field H, (columns, rows): smooth, valleys filled, ends sloping."""
    pad = int(np.ceil(_BEYOND * size / arch.row))
    known = np.isfinite(arch.front)
    floor = float(arch.front[known].min()) - 4.0 * _BEYOND * size
    field = np.pad(np.where(known, arch.front, floor), ((0, 0), (pad, pad)), constant_values=floor)
    step = arch.column_width
    width = 2 * max(1, round(0.5 * _VALLEY * size / step)) + 1
    field = ndimage.grey_closing(field, size=(width, 1))
    for axis, fall in ((1, _SLOPE * arch.row), (0, _SLOPE * step)):
        lines = np.moveaxis(field, axis, 0)
        for order in (range(1, len(lines)), range(len(lines) - 2, -1, -1)):
            back = -order.step
            for i in order:
                np.maximum(lines[i], lines[i + back] - fall, out=lines[i])
    field = ndimage.gaussian_filter(ndimage.maximum_filter(field, size=3), 0.8, mode="nearest", truncate=1.5)
    return arch.bottom - pad * arch.row, np.ascontiguousarray(field)


def _ceiling(field: Singles) -> Singles:
    """Return the maximum of a ``field`` over each block and its surroundings, shape (block columns, block rows)."""
    columns, rows = (-(-length // _BLOCK) for length in field.shape)
    padding = [(0, _BLOCK * n - length) for n, length in zip((columns, rows), field.shape, strict=True)]
    around = np.pad(ndimage.maximum_filter(field, size=3), padding, mode="edge")
    ceiling: Singles = around.reshape(columns, _BLOCK, rows, _BLOCK).max(axis=(1, 3))
    return ceiling


def _upper_share(character: Character, ids: Ids) -> Array:
    """Return the share of the vertices ``ids`` in the upper of two layers, separated by the lips, shape (n,)."""
    sources = [
        np.array([character.feature_points[name] for name in names if name in character.feature_points], dtype=np.intp)
        for names in (_UPPER_LIP, _LOWER_LIP)
    ]
    if not (len(sources[0]) and len(sources[1])):
        return np.full(len(ids), 0.5)
    upper, lower = (
        np.minimum(surface_distance(character, each, character.height)[ids], character.height) for each in sources
    )
    return 1.0 - fading((lower - upper) / np.maximum(lower + upper, 1e-9), -0.3, 0.3)
