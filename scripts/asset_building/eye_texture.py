"""Paint the textures of eyeball and lashes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.identity.anatomy.eyeballs import IRIS_ANGLE
from scripts.asset_building.eyes import PUPIL_ANGLE, TEXTURE_ANGLE, TEXTURE_RADIUS
from scripts.asset_building.raster import Image32, Noise, smoothstep

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class IrisLook:
    """Colours of an eye (sRGB, 0..255).

    Attributes:
        inner: The iris at the pupil.
        middle: The iris in the middle.
        rim: The iris at its rim.
        seed: Seed of the pattern of the iris and the veins.
        white: The white of the eye.
        slit: Factor on the width of the pupil, and its inverse on the height: 1 is round, 0.5 a cat's.
    """

    inner: Colour
    middle: Colour
    rim: Colour
    seed: int
    white: Colour = (222, 215, 208)
    slit: float = 1.0


def paint_eye(look: IrisLook, size: int = 1024) -> NDArray[np.uint8]:
    """Return the eyeball's texture, shape (size, size, 3): seen along the gaze axis, radius proportional to angle."""
    row, column = np.mgrid[:size, :size]
    x = ((column + 0.5) / size - 0.5).astype(np.float32)
    y = (0.5 - (row + 0.5) / size).astype(np.float32)
    theta = np.hypot(x, y) * np.float32(TEXTURE_ANGLE / TEXTURE_RADIUS)
    phi = np.arctan2(y, x)
    rng = np.random.default_rng(look.seed)
    white = _sclera(x, y, theta, look.white, rng)
    iris = _iris(theta, phi, look, rng)
    share = smoothstep(IRIS_ANGLE + 0.5, IRIS_ANGLE - 0.9, theta)[..., None]
    colour = white * (1.0 - share) + iris * share
    colour = np.where(theta[..., None] < 99.0, colour, np.array([190, 150, 140], np.float32))
    return np.rint(np.clip(colour, 0, 255)).astype(np.uint8)


def paint_lashes(length_seed: int, width: int = 1024, height: int = 512) -> NDArray[np.uint8]:
    """Return the lashes' texture, shape (height, width, 4): upper lashes in the upper half, roots at its lower border.

    Columns run from the inner to the outer corner of the eye. The colour is a uniform dark brown, alpha contains the
    hairs.
    """
    rng = np.random.default_rng(length_seed)
    scale = 2
    alpha = np.zeros((height * scale, width * scale), dtype=np.float32)
    for low, high, count, width_share in ((0.52, 0.98, 105, 1.0), (0.02, 0.48, 74, 0.7)):
        root, tip = (1.0 - low) * height * scale, (1.0 - high) * height * scale
        for k in range(count):
            at = (k + 0.5 + rng.uniform(-0.35, 0.35)) / count
            clump = 0.012 * np.sin(2 * np.pi * at * count / 4.3 + rng.uniform(-0.6, 0.6))
            reach = rng.uniform(0.72, 1.0) if rng.random() < 0.75 else rng.uniform(0.4, 0.7)
            _hair(alpha, at * width * scale, clump * width * scale, root, root + (tip - root) * reach, width_share, rng)
    alpha = ndimage.zoom(np.clip(alpha, 0, 1), 1 / scale, order=1)
    image = np.empty((height, width, 4), dtype=np.uint8)
    image[..., :3] = (24, 16, 13)
    image[..., 3] = np.rint(255 * np.clip(alpha, 0, 1))
    return image


def _hair(
    alpha: Image32, x: float, lean: float, root: float, tip: float, share: float, rng: np.random.Generator
) -> None:
    """Draw one lash into ``alpha``: a curve from row ``root`` to row ``tip`` leaning by ``lean``, ``share`` as wide."""
    rows = np.arange(max(int(min(root, tip)), 0), min(int(root) + 1, alpha.shape[0]))
    t = np.clip((root - rows) / max(root - tip, 1.0), 0.0, 1.0)
    centre = x + lean * t**1.5 + rng.uniform(-5, 5) * t**2
    half = share * rng.uniform(2.6, 3.8) * (1.0 - t) ** 0.7 + 0.5
    columns = np.rint(centre).astype(int)[:, None] + np.arange(-6, 7)[None, :]
    value = np.clip(half[:, None] + 0.5 - np.abs(columns - centre[:, None]), 0.0, 1.0) * 0.95
    inside = (columns >= 0) & (columns < alpha.shape[1])
    row_index = np.broadcast_to(rows[:, None], columns.shape)[inside]
    np.maximum.at(alpha, (row_index, columns[inside]), value[inside].astype(np.float32))


def _iris(theta: Image32, phi: Image32, look: IrisLook, rng: np.random.Generator) -> Image32:
    t = np.clip((theta - PUPIL_ANGLE) / (IRIS_ANGLE - PUPIL_ANGLE), 0.0, 1.0)
    fibres = _around(phi, t, 150, 2.0, rng) + 0.7 * _around(phi, t, 70, 3.0, rng) + 0.5 * _around(phi, t, 24, 3.0, rng)
    wave = 0.33 + 0.035 * _around(phi, 0 * t, 26, 1.0, rng)
    inner = smoothstep(0.08, -0.06, t - wave)[..., None]
    rim = smoothstep(0.72, 1.0, t)[..., None]
    colour = np.array(look.middle, np.float32) * (1.0 - inner) + np.array(look.inner, np.float32) * inner
    ridge = np.exp(-(((t - wave) / 0.07) ** 2))
    colour *= (1.0 + 0.17 * fibres * smoothstep(0.0, 0.15, t) + 0.14 * ridge)[..., None]
    crypts = smoothstep(0.9, 1.7, _around(phi, t, 22, 4.0, rng)) * smoothstep(0.3, 0.45, t) * smoothstep(0.9, 0.7, t)
    colour *= (1.0 - 0.35 * crypts)[..., None]
    colour = colour * (1.0 - 0.85 * rim) + np.array(look.rim, np.float32) * 0.85 * rim
    across = theta * np.hypot(np.cos(phi) / look.slit, np.sin(phi) * look.slit) if look.slit != 1.0 else theta
    pupil = smoothstep(PUPIL_ANGLE + 0.5, PUPIL_ANGLE - 0.4, across)[..., None]
    result: Image32 = colour * (1.0 - pupil) + np.array([7, 6, 7], np.float32) * pupil
    return result


def _around(phi: Image32, t: Image32, count: int, radial: float, rng: np.random.Generator) -> Image32:
    """Return noise with ``count`` features around the circle and ``radial`` along the radius, deviation about 1."""
    lattice = rng.standard_normal((count, 8)).astype(np.float32)
    at = [(phi / (2 * np.pi) * count) % count, 1.0 + radial * t]
    value = ndimage.map_coordinates(lattice, at, order=3, mode="grid-wrap")
    result: Image32 = value * np.float32(1.3)
    return result


def _sclera(x: Image32, y: Image32, theta: Image32, white: Colour, rng: np.random.Generator) -> Image32:
    points = np.stack([x, y, 0 * x], axis=-1) + np.float32(1.0)
    blotches = Noise(5)(points, 0.05, 3)
    colour = np.empty((*x.shape, 3), dtype=np.float32)
    colour[:] = white
    colour *= (1.0 + 0.012 * blotches)[..., None]
    away = smoothstep(34.0, 80.0, theta)[..., None]
    colour = colour * (1.0 - 0.75 * away) + np.array([206, 158, 146], np.float32) * 0.75 * away
    near_rim = smoothstep(IRIS_ANGLE + 7.0, IRIS_ANGLE, theta)[..., None]
    colour = colour * (1.0 - 0.28 * near_rim) + np.array([150, 150, 158], np.float32) * 0.28 * near_rim
    veins = _veins(x.shape[0], rng)[..., None] * smoothstep(IRIS_ANGLE + 4.0, IRIS_ANGLE + 30.0, theta)[..., None]
    result: Image32 = colour * (1.0 - 0.36 * veins) + np.array([176, 70, 66], np.float32) * 0.36 * veins
    return result


def _veins(size: int, rng: np.random.Generator) -> Image32:
    """Return thin branching lines that wander from the border towards the middle, shape (size, size), 0..1."""
    image = np.zeros((size, size), dtype=np.float32)
    walkers = [(rng.uniform(0, 2 * np.pi), 0.48, rng.uniform(0.5, 1.0)) for _ in range(46)]
    while walkers:
        phi, radius, strength = walkers.pop()
        drift = rng.normal(0, 0.3)
        for _ in range(int(rng.uniform(120, 300))):
            column, row = (0.5 + radius * np.cos(phi)) * size, (0.5 - radius * np.sin(phi)) * size
            if not (1 <= column < size - 2 and 1 <= row < size - 2):
                break
            image[int(row), int(column)] = max(image[int(row), int(column)], strength)
            drift = 0.93 * drift + rng.normal(0, 0.10)
            radius -= 0.8 / size
            phi += drift * 0.8 / size / max(radius, 0.1)
            strength *= 0.995
            if rng.random() < 0.006 and len(walkers) < 200 and strength > 0.3:
                walkers.append((phi, radius, 0.6 * strength))
    blurred: Image32 = ndimage.gaussian_filter(image, 0.8) * np.float32(2.2)
    return np.clip(blurred, 0, 1)
