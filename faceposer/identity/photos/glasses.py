"""Frames of glasses in a photo: rings around both eyes, in some channel darker or lighter than the skin beside them.

The logarithms of the photo's colours over those of the texture model's skin in the light found are looked at from the
front of the average head. About each eye, the closed curve that differs most from its surroundings is found by dynamic
programming in polar coordinates (as the paths of E. Mortensen and W. Barrett, "Intelligent scissors for image
composition", SIGGRAPH 1995). Bags under the eyes, wrinkles and brows make parts of such curves, but only frames are
distinct below both eyes at once.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Part of the front of the head that is looked at, and distance between its points, in centimetres.
_LEFT, _RIGHT, _BOTTOM, _TOP, _STEP = -7.5, 7.5, -3.5, 6.5, 0.05
# Distance of points from texels, in centimetres, up to which they have a colour.
_NEAR = 0.15
# Width of the surroundings in centimetres, and least logarithm that counts among them and the largest difference.
_AROUND, _DARK, _MOST = 0.6, -0.3, 1.0
# Directions about an eye from its outer corner upwards, radii of frames in centimetres, and how many the radius changes
# at most from one direction to the next.
_DIRECTIONS, _TURN = 96, 2
_TURNS = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
_ANGLES = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=-1)
_RADII = np.arange(1.5, 4.2, _STEP)
# Half the number of radii by which the frames of both eyes differ at most.
_UNLIKE = 4
# How much less brows count.
_BROWS = 0.6
# Least share of brows at a frame that covers them, and at points that are brows beside it.
_ON_BROW, _BESIDE_BROW = 0.5, 0.2
# Largest width over a brow relative to the usual one.
_OVER_BROW = 1.5
# Half the least width of a frame, with its shade, and the largest, in centimetres; least share of its own darkness.
_LEAST_WIDTH, _MOST_WIDTH, _SHARE = 0.12, 0.6, 0.3
# What is left out about a frame, in centimetres.
_MARGIN = 0.1
#: Least mean and median darkness of the lower half of a frame, in a photo and in a painting, where shadows about the
#: eyes can be as dark as thin frames.
DISTINCT, DISTINCT_PAINTED = 0.2, 0.35
# Least darkness of bridge and temples.
_WEAKEST = 0.2
# Farthest bridge from the middle, and nearest temple, and heights over the eyes between which they lie, in centimetres.
_BRIDGE, _TEMPLE, _LEVELS = 1.6, 4.4, (-1.2, 1.4)
# Logarithms by which glasses' reflections are brighter than skin: the first counts fully, the second not at all.
_GLARE = (0.3, 0.5)


@dataclass(frozen=True, eq=False)
class Frame:
    """The frame about one eye.

    Attributes:
        centre: The middle of the eye, shape (2,).
        side: -1 for the eye on the left in pictures, 1 for the other.
        radii: Distance of the frame in each direction, shape (d,).
        widths: Half its width there, shape (d,).
        darkness: How much darker than its surroundings it is there, shape (d,).
    """

    centre: Array
    side: float
    radii: Array
    widths: Array
    darkness: Array

    @property
    def distinctness(self) -> float:
        """Lesser one of the mean and the median darkness of the lower half, where nothing of a face is like it."""
        lower = self.darkness[len(self.darkness) // 2 :]
        return float(min(lower.mean(), np.median(lower)))

    def distances(self, points: Array) -> tuple[Array, Array]:
        """Return how far ``points``, (n, 2), lie outside the frame's middle, and half its width there, (n,)."""
        offset = points - self.centre
        turn = np.arctan2(offset[:, 1], self.side * offset[:, 0]) / (2.0 * np.pi) * _DIRECTIONS
        at = np.arange(_DIRECTIONS)
        radius, width = (np.interp(turn, at, values, period=_DIRECTIONS) for values in (self.radii, self.widths))
        return np.linalg.norm(offset, axis=1) - radius, width


class FrontView:
    """Points of the front of the average head, at which glasses are looked for."""

    def __init__(self, positions: Array, brows: Array, eyes: Array) -> None:
        """Prepare the points.

        Args:
            positions: Places of the texels on the average head, shape (n, 3).
            brows: How much each belongs to the brows, 0 to 1, shape (n,).
            eyes: Middles of both eyes, shape (2, 3).
        """
        from scipy.spatial import cKDTree

        self.eyes, self._places = eyes[:, :2], positions[:, :2]
        self._sides = np.sign(self.eyes[:, 0]).tolist()
        columns, rows = np.arange(_LEFT, _RIGHT, _STEP), np.arange(_BOTTOM, _TOP, _STEP)
        self._shape = (len(rows), len(columns))
        grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        # What lies behind, inside the mouth and the sockets, would cover the skin.
        front = np.flatnonzero(positions[:, 2] > eyes[:, 2].mean() - 5.0)
        distances, nearest = cKDTree(self._places[front]).query(grid, distance_upper_bound=_NEAR)
        self._known = np.isfinite(distances)
        self._texels = np.where(self._known, front[np.minimum(nearest, len(front) - 1)], 0)
        self._brows = np.where(self._known, brows[self._texels], 0.0).reshape(self._shape)

    def kept(self, logs: Array, weights: Array, distinct: float = DISTINCT) -> Array | None:
        """Return factors on the weights of texels: 0 where there are glasses; None if there are none, (n,).

        Args:
            logs: Logarithms of colours over those of the skin expected, about 0 for skin, shape (n, 3).
            weights: How much each texel is seen, 0 to 1, shape (n,).
            distinct: Least distinctness of a frame.
        """
        darkness = np.maximum(self._darkness(logs.min(axis=1), weights), self._darkness(-logs.max(axis=1), weights))
        frames = self.frames(darkness)
        if any(frame.distinctness <= distinct for frame in frames):
            return None
        masked, inside = np.zeros(len(logs), dtype=bool), np.zeros(len(logs), dtype=bool)
        for frame in frames:
            distance, width = frame.distances(self._places)
            masked |= np.abs(distance) < width + _MARGIN
            inside |= distance < 0.0
        masked |= self._joined(darkness, masked, inside)
        result = 1.0 - masked.astype(np.float64)
        glare = (self._smooth(logs.mean(axis=1), weights) - _GLARE[0]) / (_GLARE[1] - _GLARE[0])
        result[inside] *= 1.0 - np.clip(glare[inside], 0.0, 1.0)
        return result

    def _of_grid(self, values: NDArray[np.generic]) -> NDArray[np.generic]:
        """Return ``values`` of the points, (h, w), at the texels."""
        at = ((self._places - (_LEFT, _BOTTOM)) / _STEP + 0.5).astype(np.int64)
        rows, columns = np.clip(at[:, 1], 0, self._shape[0] - 1), np.clip(at[:, 0], 0, self._shape[1] - 1)
        return values[rows, columns]

    def _blurred(self, values: Array, weights: Array, width: float) -> Array:
        stacked = np.stack([values * weights, weights])
        total, share = ndimage.gaussian_filter(stacked, (0.0, width / _STEP, width / _STEP))
        result: Array = total / np.maximum(share, 1e-3)
        return result

    def _grids(self, values: Array, weights: Array) -> tuple[Array, Array]:
        seen = np.where(self._known, weights[self._texels], 0.0).reshape(self._shape)
        return values[self._texels].reshape(self._shape), seen

    def _smooth(self, values: Array, weights: Array) -> Array:
        return np.asarray(self._of_grid(self._blurred(*self._grids(values, weights), 0.1)), dtype=np.float64)

    def _darkness(self, values: Array, weights: Array) -> Array:
        """Return how much less ``values`` are at points than about them, shape (h, w)."""
        values, seen = self._grids(values, weights)
        around = self._blurred(np.maximum(values, _DARK), seen, _AROUND)
        result: Array = np.clip(around - values, 0.0, _MOST) * (seen > 0.1)
        return result

    def frames(self, darkness: Array) -> list[Frame]:
        """Return the darkest closed curves about the eyes, which are nearly each other's mirror image."""
        polar = [self._polar(darkness, eye, side) for eye, side in zip(self.eyes, self._sides, strict=True)]
        scores = [ndimage.gaussian_filter1d(dark, 1.0, axis=1) * (1.0 - _BROWS * brows) for dark, brows in polar]
        common = _closed_path(sum(ndimage.maximum_filter1d(score, 2 * _UNLIKE + 1, axis=1) for score in scores))
        far = np.abs(np.arange(scores[0].shape[1]) - common[:, None]) > 2 * _UNLIKE
        result = []
        for (dark, brows), score, eye, side in zip(polar, scores, self.eyes, self._sides, strict=True):
            path = _closed_path(np.where(far, -1.0, score))
            result.append(_frame(dark, brows, path, eye, side))
        return result

    def _polar(self, darkness: Array, eye: Array, side: float) -> tuple[Array, Array]:
        """Return the darkness, and how much brows count, about ``eye``, (2,), shape (d, r) each."""
        points = eye + _RADII[None, :, None] * (_ANGLES * (side, 1.0))[:, None]
        at = (points - (_LEFT, _BOTTOM)).transpose(2, 0, 1)[::-1] / _STEP
        return ndimage.map_coordinates(darkness, at, order=1), ndimage.map_coordinates(self._brows, at, order=1)

    def _joined(self, darkness: Array, masked: Mask, inside: Mask) -> Mask:
        """Return the texels of bridge and temples: dark ones outside the frames that hang together with them."""
        x, y = self._places.T
        level = y - self.eyes[:, 1].mean()
        zone = ((np.abs(x) < _BRIDGE) | (np.abs(x) > _TEMPLE)) & (level > _LEVELS[0]) & (level < _LEVELS[1]) & ~inside
        texels = self._texels.reshape(self._shape)
        known = self._known.reshape(self._shape)
        start, allowed = (
            masked[texels] & known,
            zone[texels] & known & (darkness > _WEAKEST) & (self._brows < _BESIDE_BROW),
        )
        grown = ndimage.binary_propagation(start & zone[texels], mask=allowed | start) & allowed
        grown = ndimage.binary_dilation(grown, iterations=round(_MARGIN / _STEP))
        return np.asarray(self._of_grid(grown), dtype=np.bool_) & zone


def _frame(dark: Array, brows: Array, path: NDArray[np.int64], eye: Array, side: float) -> Frame:
    """Return the frame along the ``path``, (d,), in the darkness about an eye, (d, r)."""
    rows = np.arange(_DIRECTIONS)
    found = dark[rows, path]
    # A brow beside the frame is none of it.
    beside = brows[rows, path] < _ON_BROW
    dark = np.where(beside[:, None], dark * (brows < _BESIDE_BROW), dark)
    widths = np.zeros(_DIRECTIONS)
    for k in range(_DIRECTIONS):
        clear = np.flatnonzero(dark[k] < max(_SHARE * found[k], 0.05))
        inner, outer = clear[clear < path[k]], clear[clear > path[k]]
        ends = (inner[-1] if len(inner) else 0, outer[0] if len(outer) else len(_RADII))
        widths[k] = _STEP * max(path[k] - ends[0], ends[1] - path[k])
    widths[~beside] = np.minimum(widths[~beside], _OVER_BROW * np.median(widths))
    widths = ndimage.maximum_filter1d(np.clip(widths, _LEAST_WIDTH, _MOST_WIDTH), 3, mode="wrap")
    return Frame(eye, side, _RADII[path], widths, found)


def _closed_path(scores: Array) -> NDArray[np.int64]:
    """Return the closed path with the largest sum of ``scores``, (d, r): a column for each row, by two rounds."""
    n_rows, n_columns = scores.shape
    best = np.zeros(n_columns)
    came = np.zeros((3 * n_rows, n_columns), dtype=np.int64)
    for row in range(3 * n_rows):
        padded = np.pad(best, _TURN, constant_values=-np.inf)
        options = np.stack([padded[k : k + n_columns] - 0.02 * abs(k - _TURN) for k in range(2 * _TURN + 1)])
        choice = options.argmax(axis=0)
        came[row] = np.arange(n_columns) + choice - _TURN
        best = options[choice, np.arange(n_columns)] + scores[row % n_rows]
    path = np.zeros(3 * n_rows, dtype=np.int64)
    path[-1] = int(best.argmax())
    for row in range(3 * n_rows - 1, 0, -1):
        path[row - 1] = came[row, path[row]]
    return path[n_rows : 2 * n_rows]
