"""Paint teeth, gums, throat and tongue, including the shadow of the mouth."""

import numpy as np
from numpy.typing import NDArray

from scripts.asset_building.dental_arch import N_KINDS
from scripts.asset_building.raster import Image32, Noise, smoothstep

#: Light on the crowns of each kind, from the middle backwards.
_LIGHT = (1.0, 0.985, 0.94, 0.85, 0.68, 0.42, 0.26)


def paint_teeth(height: int = 256) -> NDArray[np.uint8]:
    """Return the teeth's texture, shape (height, 4 height, 3).

    There is a column for each kind of tooth in each jaw. u runs around the crown from its back over the face; v from
    the root to the middle of the biting surface, with its rim at about 0.74.
    """
    u, v = _grid(height, 4 * height)
    place = u * 2 * N_KINDS
    kind = np.clip(place.astype(int) // 2, 0, N_KINDS - 1)
    turn = np.clip((place % 1.0 - 0.08) / 0.84, 0.0, 1.0)
    noise = Noise(31)(_points(place * 1.5, v * 4), 0.5, 3)
    colour = _ramp(
        v,
        [
            (0.0, (214, 190, 158)),
            (0.16, (230, 213, 188)),
            (0.32, (239, 227, 207)),
            (0.52, (243, 233, 215)),
            (0.70, (240, 231, 214)),
            (1.0, (230, 218, 199)),
        ],
    )
    colour *= (1.0 + 0.02 * noise)[..., None]
    # Teeth are slightly warmer from the middle backwards.
    warm = np.array([0.0, 0.2, 0.5, 0.6, 0.7, 0.9, 1.0], np.float32)[kind]
    colour *= 1.0 - warm[..., None] * np.array([0.005, 0.015, 0.035], np.float32)
    between = np.abs(np.cos(2.0 * np.pi * turn)) ** 5
    inside = smoothstep(0.0, 1.0, -np.sin(2.0 * np.pi * turn))
    shade = 1.0 - 0.42 * between * smoothstep(0.78, 0.35, v) - 0.16 * inside
    # The fissures of premolars and molars.
    shade *= 1.0 - 0.22 * smoothstep(0.86, 1.0, v) * (kind >= 3)
    shade *= 1.0 - 0.30 * smoothstep(0.22, 0.08, v)
    shade *= np.array(_LIGHT, np.float32)[kind]
    return _encode(_shaded(colour, shade))


def paint_gums(size: int = 512) -> NDArray[np.uint8]:
    """Return the gums' texture, shape (size, size, 3).

    u runs along the arch; v from the outer fold over the margins, at 0.40 and 0.52, to the middle of palate or floor.
    """
    u, v = _grid(size, size)
    stipple = Noise(37)(_points(u * 60, v * 24), 0.45, 2)
    patches = Noise(38)(_points(u * 9, v * 5), 1.0, 3)
    colour = _ramp(
        v,
        [
            (0.0, (150, 58, 60)),
            (0.13, (170, 78, 78)),
            (0.20, (198, 116, 112)),
            (0.33, (206, 128, 122)),
            (0.40, (196, 110, 106)),
            (0.44, (182, 98, 94)),
            (0.48, (182, 98, 94)),
            (0.52, (188, 104, 100)),
            (0.62, (194, 116, 110)),
            (0.80, (180, 100, 96)),
            (1.0, (164, 84, 82)),
        ],
    )
    attached = smoothstep(0.16, 0.24, v) * smoothstep(0.42, 0.36, v)
    colour *= (1.0 + 0.05 * patches + 0.035 * stipple * attached)[..., None]
    # Vessels shine through the lining of the outer fold.
    vessels = np.abs(Noise(39)(_points(u * 40, v * 10), 1.0, 3))
    colour *= 1.0 - (smoothstep(0.12, 0.0, vessels) * smoothstep(0.20, 0.05, v))[..., None] * np.array(
        [0.06, 0.22, 0.18], np.float32
    )
    # Folds across the front of the palate.
    folds = np.sin(75.0 * v + 3.0 * patches) * smoothstep(0.64, 0.70, v) * smoothstep(0.16, 0.05, np.abs(u - 0.5))
    colour *= (1.0 + 0.07 * folds)[..., None]
    behind = np.abs(u - 0.5) * 2.0
    shade = (1.0 - 0.48 * smoothstep(0.30, 0.95, behind)) * (1.0 - 0.30 * smoothstep(0.12, 0.0, v))
    shade *= 1.0 - 0.38 * smoothstep(0.58, 0.95, v)
    return _encode(_shaded(colour, shade))


def paint_throat(size: int = 256) -> NDArray[np.uint8]:
    """Return the throat's texture, shape (size, size, 3): the soft palate below v = 0.5, above it the wall behind."""
    u, v = _grid(size, size)
    noise = Noise(47)(_points(u * 6, v * 8), 0.6, 3)
    side = np.abs(u - 0.5) * 2.0
    soft = _ramp(v * 2.0, [(0.0, (168, 88, 84)), (0.6, (158, 74, 72)), (1.0, (164, 74, 74))])
    soft_shade = 0.80 - 0.12 * smoothstep(0.0, 0.35, v) - 0.26 * smoothstep(0.45, 1.0, side)
    wall = _ramp(2.0 * v - 1.0, [(0.0, (112, 40, 40)), (0.5, (132, 50, 48)), (1.0, (96, 34, 34))])
    wall_shade = 0.42 - 0.24 * smoothstep(0.25, 0.95, side)
    is_soft = v < 0.5
    colour = np.where(is_soft[..., None], soft, wall) * (1.0 + 0.07 * noise)[..., None]
    return _encode(_shaded(colour, np.where(is_soft, soft_shade, wall_shade)))


def paint_tongue(size: int = 512) -> NDArray[np.uint8]:
    """Return the tongue's texture, shape (size, size, 3): v from the root to the tip, u as in `build_tongue`."""
    u, v = _grid(size, size)
    papillae = Noise(41)(_points(u * 56, v * 44), 0.45, 2)
    dots = Noise(42)(_points(u * 40, v * 32), 0.5, 1)
    patches = Noise(43)(_points(u * 4, v * 6), 1.0, 3)
    colour = _ramp(v, [(0.0, (150, 70, 70)), (0.5, (186, 104, 102)), (0.8, (196, 108, 106)), (1.0, (200, 100, 100))])
    across = np.abs(u - 0.5)
    above = smoothstep(0.32, 0.20, across)
    # The back of the tongue is pale, its edges and its tip are redder.
    coat = smoothstep(0.20, 0.04, across) * smoothstep(0.95, 0.6, v) * 0.5
    colour += coat[..., None] * np.array([8, 26, 24], np.float32)
    colour *= (1.0 + above * (0.04 * papillae + 0.05 * (dots > 0.75)) + 0.04 * patches)[..., None]
    colour *= 1.0 - (1.0 - above)[..., None] * np.array([0.04, 0.16, 0.12], np.float32)
    groove = np.exp(-((across / 0.018) ** 2)) * 0.14 * smoothstep(0.1, 0.3, v) * smoothstep(1.0, 0.85, v)
    shade = (1.0 - groove) * (0.40 + 0.60 * smoothstep(0.10, 0.72, v))
    return _encode(_shaded(colour, shade))


def _shaded(colour: Image32, shade: Image32) -> Image32:
    """Return sRGB ``colour`` at the share ``shade`` of the light; the remaining ambient light is red."""
    dark = np.asarray(shade, np.float32)[..., None]
    result: Image32 = colour * dark ** np.array([0.42, 0.53, 0.55], np.float32)
    return result


def _grid(height: int, width: int) -> tuple[Image32, Image32]:
    row, column = np.mgrid[:height, :width].astype(np.float32)
    return (column + 0.5) / width, 1.0 - (row + 0.5) / height


def _points(u: Image32, v: Image32) -> Image32:
    points: Image32 = np.stack([u, v, 0 * u], axis=-1)
    return points


def _ramp(t: Image32, stops: list[tuple[float, tuple[int, int, int]]]) -> Image32:
    at = [stop[0] for stop in stops]
    channels = [np.interp(t, at, [stop[1][k] for stop in stops]) for k in range(3)]
    return np.stack(channels, axis=-1).astype(np.float32)


def _encode(colour: Image32) -> NDArray[np.uint8]:
    return np.rint(np.clip(colour, 0, 255)).astype(np.uint8)
