"""Skins of MakeHuman in our texture layout: painted eyes, lips, hair and brows taken out, then a mean and modes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage
from scipy.spatial import cKDTree

from scripts.asset_building.raster import Image32, smoothstep
from scripts.asset_building.skin_texture import SkinTexels, above_hairline

#: Age (0 young, 0.5 middle, 1 old) by the first word of a skin's file name.
_AGES = {"young": 0.0, "middleage": 0.5, "old": 1.0}
#: Width of the skin that is filled around painted eyes, and around lips, in centimetres.
_EYE_REACH, _LIP_REACH = 0.42, 0.18
#: Share of the shading of the mean skin, brighter or darker than the surface as a whole, that is taken out.
_FLATTENED = 0.55
#: Detail that is no shading, in pixels of the texture, as a Gaussian's deviation at 1024 pixels.
_SHADING_SIZE = 28.0


@dataclass(frozen=True)
class Skins:
    """Skins in our layout.

    Attributes:
        names: Names of the S files.
        logs: Logarithms of the colours (sRGB, 0..1) without eyes, lips and hair, shape (S, H, W, 3).
        lips: Logarithms of the colour of the lips relative to the skin around them, shape (S, 3).
        labels: Age (0..1) and gender (-1 male, 1 female) of each, shape (S, 2).
    """

    names: tuple[str, ...]
    logs: Image32
    lips: NDArray[np.float64]
    labels: NDArray[np.float64]


def read_skins(folder: Path, texels: SkinTexels) -> Skins:
    """Read all skins in ``folder`` and bake them onto ``texels``."""
    paths = sorted(folder.glob("*_diffuse*.jpg"))
    if not paths:
        raise SystemExit(f"The folder '{folder}' has no skins named *_diffuse*.jpg.")
    unknown = _unknown(texels)
    known = texels.texels.image(1.0 - unknown[:, None])[..., 0]
    known[~texels.texels.covered] = 0.0
    on_lips = texels.masks["lips"] * (texels.place[:, 2] > 14.0) > 0.6
    beside = _near(texels.place, on_lips, 1.2) & (unknown < 0.01)
    logs, lips = [], []
    for path in paths:
        colours = _sampled(path, texels.texels.values[:, 7:9])
        lips.append(np.median(colours[on_lips], axis=0) - np.median(colours[beside], axis=0))
        image = np.zeros((*texels.texels.covered.shape, 3), dtype=np.float32)
        image[texels.texels.covered] = colours
        logs.append(filled(image, known))
    labels = [(_AGES[path.name.split("_")[0]], 1.0 if "female" in path.name else -1.0) for path in paths]
    return Skins(tuple(path.stem for path in paths), np.stack(logs), np.array(lips), np.array(labels))


def _sampled(path: Path, uv: Image32) -> Image32:
    """Return logarithms of the colours of an image at ``uv`` (K, 2), shape (K, 3)."""
    image = np.log(np.clip(np.asarray(Image.open(path).convert("RGB"), dtype=np.float32) / 255.0, 0.012, 1.0))
    at = [(1.0 - uv[:, 1]) * image.shape[0] - 0.5, uv[:, 0] * image.shape[1] - 0.5]
    channels = [ndimage.map_coordinates(image[..., k], at, order=1, mode="nearest") for k in range(3)]
    return np.stack(channels, axis=1).astype(np.float32)


def _near(place: Image32, mask: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
    tree = cKDTree(place[mask][::4])
    near = np.zeros(len(place), dtype=bool)
    low, high = place[mask].min(axis=0) - reach, place[mask].max(axis=0) + reach
    box = np.flatnonzero(((place > low) & (place < high)).all(axis=1))
    near[box] = tree.query(place[box], distance_upper_bound=reach)[0] < reach
    return near


def _unknown(texels: SkinTexels) -> Image32:
    """Return the share of each texel that the skins do not show as skin, 0..1, shape (K,)."""
    place, masks = texels.place, texels.masks
    result = np.zeros(len(place), dtype=np.float32)
    inner = (masks["wet_line"] > 0.02) | (masks["lash_line"] > 0.3)
    lips = masks["lips"] > 0.25
    for mask, reach in ((inner & (place[:, 2] > 9.0), _EYE_REACH), (lips & (place[:, 2] > 12.0), _LIP_REACH)):
        distance, _ = cKDTree(place[mask][::2]).query(place, distance_upper_bound=2.0 * reach)
        result = np.maximum(result, smoothstep(1.25 * reach, 0.9 * reach, distance.astype(np.float32)))
    result = np.maximum(result, (masks["inside"] > 0.02) | (masks["wet_line"] > 0.02))
    ears = smoothstep(0.1, 0.5, masks["ears"])
    hair = smoothstep(-1.6, -0.5, above_hairline(place)) * (1.0 - ears)
    return np.maximum(result, hair).astype(np.float32)


def filled(image: Image32, known: Image32) -> Image32:
    """Return ``image`` (H, W, C) with its unknown parts filled smoothly from the known ones (pull and push).

    Args:
        image: Values.
        known: Share of each value that is known, 0..1, shape (H, W).
    """
    weight = known[..., None]
    if min(image.shape[:2]) <= 2 or known.min() > 0.999:
        total = np.maximum(weight.sum(axis=(0, 1)), 1e-9)
        return image * weight + (1.0 - weight) * (image * weight).sum(axis=(0, 1)) / total
    value = ndimage.gaussian_filter(image * weight, (1.0, 1.0, 0.0))[::2, ::2]
    share = ndimage.gaussian_filter(known, 1.0)[::2, ::2]
    coarse = filled(value / np.maximum(share, 1e-6)[..., None], np.clip(4.0 * share, 0.0, 1.0))
    finer = np.stack([_doubled(coarse[..., k], image.shape[:2]) for k in range(image.shape[2])], axis=-1)
    return (image * weight + (1.0 - weight) * finer).astype(np.float32)


def _doubled(channel: Image32, shape: tuple[int, int]) -> Image32:
    larger = Image.fromarray(channel).resize((shape[1], shape[0]), Image.Resampling.BICUBIC)
    return np.asarray(larger, dtype=np.float32)
