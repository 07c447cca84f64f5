"""Paints teeth, gums and tongue."""

import numpy as np
from numpy.typing import NDArray

from scripts.asset_building.raster import Image32, Noise, smoothstep


def paint_teeth(size: int = 256) -> NDArray[np.uint8]:
    """Return the teeth's texture, shape (size, size, 3): v runs from the root to the edge, u over the six kinds."""
    u, v = _grid(size)
    noise = Noise(31)(_points(u * 6, v * 2), 0.35, 3)
    colour = _ramp(v, [(0.0, (208, 186, 150)), (0.25, (225, 213, 188)), (0.6, (234, 227, 211)), (1.0, (228, 226, 220))])
    colour *= (1.0 + 0.015 * noise)[..., None]
    # Teeth further back are seen in the mouth's shade and are a little yellower.
    colour *= (1.0 - 0.22 * smoothstep(0.3, 1.0, u))[..., None] * np.array([1.0, 0.99, 0.97], np.float32)
    return _encode(colour)


def paint_gums(size: int = 256) -> NDArray[np.uint8]:
    """Return the gums' texture, shape (size, size, 3): v runs from the outer fold over the margin to the inner fold."""
    u, v = _grid(size)
    noise = Noise(37)(_points(u * 12, v * 2), 0.4, 3)
    inside, margin, fold = (100, 36, 38), (198, 122, 116), (118, 44, 46)
    colour = _ramp(v, [(0.0, fold), (0.3, (178, 92, 90)), (0.5, margin), (0.75, (150, 70, 70)), (1.0, inside)])
    return _encode(colour * (1.0 + 0.04 * noise)[..., None])


def paint_tongue(size: int = 512) -> NDArray[np.uint8]:
    """Return the tongue's texture, shape (size, size, 3)."""
    u, v = _grid(size)
    papillae = Noise(41)(_points(u * 10, v * 16), 0.13, 2)
    patches = Noise(43)(_points(u * 4, v * 6), 1.0, 3)
    colour = np.empty((size, size, 3), dtype=np.float32)
    colour[:] = (178, 92, 90)
    colour *= (1.0 + 0.05 * papillae + 0.04 * patches)[..., None]
    groove = np.exp(-(((u - 0.5) / 0.03) ** 2)) * 0.16
    return _encode(colour * (1.0 - groove)[..., None])


def _grid(size: int) -> tuple[Image32, Image32]:
    row, column = np.mgrid[:size, :size].astype(np.float32)
    return (column + 0.5) / size, 1.0 - (row + 0.5) / size


def _points(u: Image32, v: Image32) -> Image32:
    points: Image32 = np.stack([u, v, 0 * u], axis=-1)
    return points


def _ramp(t: Image32, stops: list[tuple[float, tuple[int, int, int]]]) -> Image32:
    at = [stop[0] for stop in stops]
    channels = [np.interp(t, at, [stop[1][k] for stop in stops]) for k in range(3)]
    return np.stack(channels, axis=-1).astype(np.float32)


def _encode(colour: Image32) -> NDArray[np.uint8]:
    return np.rint(np.clip(colour, 0, 255)).astype(np.uint8)
