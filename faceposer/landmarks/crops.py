"""Square crops of images at any place, size and angle."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Square:
    """A square region of an image, possibly turned, in pixels of the image.

    Attributes:
        x: Its middle, from the left edge.
        y: Its middle, from the top edge.
        side: Length of its sides.
        angle: Direction of its own x axis, clockwise from that of the image, in radians.
    """

    x: float
    y: float
    side: float
    angle: float = 0.0

    @property
    def axes(self) -> Array:
        """The directions of its own axes as rows, shape (2, 2)."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return np.array([[cos, sin], [-sin, cos]])

    def to_image(self, places: ArrayLike) -> Array:
        """Return ``places``, (n, 2), in units of the side from the middle of the square, in pixels of the image."""
        placed: Array = np.asarray(places, dtype=np.float64) @ self.axes * self.side + (self.x, self.y)
        return placed


class Picture:
    """An image from which crops are taken, with smaller versions of it for large regions."""

    def __init__(self, image: ArrayLike) -> None:
        """Prepare ``image``: 8-bit grey or colour values of shape (h, w), (h, w, 1), (h, w, 3) or (h, w, 4).

        Raises:
            ValueError: If it is of another shape or type, or empty.
        """
        pixels = np.asarray(image)
        if pixels.ndim == 2:
            pixels = pixels[..., None]
        if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] not in (1, 3, 4) or not pixels.size:
            raise ValueError(
                f"an image must be 8-bit of shape (h, w), (h, w, 3) or (h, w, 4), not {pixels.dtype} {pixels.shape}"
            )
        colours = np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3]
        self._levels: list[NDArray[Any]] = [colours]
        self.width, self.height = pixels.shape[1], pixels.shape[0]

    def crop(self, square: Square, side: int, repeat_edge: bool = True) -> Floats:
        """Return the region ``square`` sampled linearly at ``side`` x ``side`` pixels, values 0 to 255.

        Args:
            square: The region.
            side: Width and height of the result.
            repeat_edge: Repeat the edge of the image outside of it; otherwise it is black there.
        """
        level = max(0, int(np.floor(np.log2(max(square.side / side, 1.0) * 1.0001))))
        level = min(level, int(np.log2(max(min(self.width, self.height), 1))))
        image, factor = self._level(level), 2.0**level
        steps = (np.arange(side) + 0.5) / side - 0.5
        columns, rows = np.meshgrid(steps, steps)
        places = square.to_image(np.stack([columns.ravel(), rows.ravel()], axis=1)) / factor - 0.5
        height, width = image.shape[:2]
        found = np.zeros((side * side, 3), dtype=np.float32)
        inside = (places > -1.0).all(axis=1) & (places < (width, height)).all(axis=1)
        kept = np.ones(len(places), dtype=bool) if repeat_edge else inside
        at = np.clip(places[kept], 0.0, (width - 1, height - 1))
        first = np.floor(at).astype(np.intp)
        last = np.minimum(first + 1, (width - 1, height - 1))
        share = (at - first).astype(np.float32)
        flat = image.reshape(-1, 3)
        across, down = share[:, :1], share[:, 1:]
        upper = flat[first[:, 1] * width + first[:, 0]] * (1 - across) + flat[first[:, 1] * width + last[:, 0]] * across
        lower = flat[last[:, 1] * width + first[:, 0]] * (1 - across) + flat[last[:, 1] * width + last[:, 0]] * across
        found[kept] = upper * (1 - down) + lower * down
        return found.reshape(side, side, 3)

    def _level(self, level: int) -> NDArray[Any]:
        """Return the image reduced by 2 to the power of ``level``, each pixel the mean of those that it replaces."""
        while len(self._levels) <= level:
            large = self._levels[-1]
            height, width = (max(n // 2 * 2, 2) for n in large.shape[:2])
            large = np.pad(
                large, [(0, max(height - large.shape[0], 0)), (0, max(width - large.shape[1], 0)), (0, 0)], "edge"
            )
            kind = np.uint16 if large.dtype == np.uint8 else np.float32
            total: NDArray[Any] = large[0:height:2, 0:width:2].astype(kind)
            for row, column in ((0, 1), (1, 0), (1, 1)):
                np.add(total, large[row:height:2, column:width:2], out=total)
            self._levels.append(total.astype(np.float32) * np.float32(0.25))
        return self._levels[level]
