"""Skins of MakeHuman in our texture layout: painted eyes, lips, hair and brows taken out, then a mean and modes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage
from scipy.spatial import cKDTree

from scripts.asset_building.raster import Image32, smoothstep
from scripts.asset_building.skin_texture import SkinTexels, above_hairline
from scripts.identity_building.layers import encoded

#: Age (0 young, 0.5 middle, 1 old) by the first word of a skin's file name.
_AGES = {"young": 0.0, "middleage": 0.5, "old": 1.0}
#: Width of the skin that is filled around painted eyes, and around lips, in centimetres.
_EYE_REACH, _LIP_REACH = 0.5, 0.18
#: Share of the shading of the mean skin, brighter or darker than the surface as a whole, that is taken out.
_FLATTENED = 0.7
#: Detail that is no shading, in pixels of the texture, as a Gaussian's deviation at 1024 pixels.
_SHADING_SIZE = 28.0
#: Share of the variance without the tone below which a component is left out.
_LEAST_SHARE = 0.006
#: Sizes and qualities at which brightness and colour are stored.
_LUMA, _CHROMA = (1024, 84), (256, 84)
#: Ridge of the regression of labels, as variance of a coefficient.
_RIDGE = 0.5


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
    known, ears = (texels.texels.image(share[:, None])[..., 0] for share in (1.0 - unknown, _ears(texels)))
    known[~texels.texels.covered] = 0.0
    # Ears are darker than the skin that hair covers.
    beside_ears = known * (1.0 - ears)
    on_lips = texels.masks["lips"] * (texels.place[:, 2] > 14.0) > 0.6
    beside = _near(texels.place, on_lips, 1.2) & (unknown < 0.01)
    logs, lips = [], []
    for path in paths:
        colours = _sampled(path, texels.texels.values[:, 7:9])
        lips.append(np.median(colours[on_lips], axis=0) - np.median(colours[beside], axis=0))
        image = np.zeros((*texels.texels.covered.shape, 3), dtype=np.float32)
        image[texels.texels.covered] = colours
        logs.append(ears[..., None] * filled(image, known) + (1.0 - ears[..., None]) * filled(image, beside_ears))
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
    ears = _ears(texels)
    hair = smoothstep(-1.6, -0.5, above_hairline(place)) * (1.0 - ears)
    return np.maximum(result, hair).astype(np.float32)


def _ears(texels: SkinTexels) -> Image32:
    return smoothstep(0.1, 0.5, texels.masks["ears"])


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


def statistics(skins: Skins, texels: SkinTexels) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return metadata and arrays of the mean skin and its modes.

    The first mode is the tone: what the colours of each texel share with the mean brightness of the face. The others
    are the principal components of the rest. All have unit deviation over the skins. In logarithms, the tone is linear
    in the density of melanin (Beer and Lambert), and colours are positive for all coefficients.
    """
    weight = texels.texels.image(_face(texels)[:, None])[..., 0]
    weight *= texels.texels.covered / weight.sum()
    mean = skins.logs.mean(axis=0)
    rest = skins.logs - mean
    tone = -(rest.mean(axis=3) * weight).sum(axis=(1, 2))
    tone /= tone.std()
    n = len(tone)
    loads = [tone]
    first = np.tensordot(tone, rest, 1) / n
    rest = rest - tone[:, None, None, None] * first
    gram = np.einsum("shwc,thwc,hw->st", rest, rest, weight, optimize=True)
    values, vectors = np.linalg.eigh(gram)
    kept = np.argsort(values)[::-1][: np.count_nonzero(values > _LEAST_SHARE * values.sum())]
    loads += [vectors[:, k] * np.sqrt(n) * np.sign(vectors[np.abs(vectors[:, k]).argmax(), k]) for k in kept]
    coefficients = np.stack(loads, axis=1)
    modes = np.concatenate([first[None], np.einsum("sk,shwc->khwc", coefficients[:, 1:], rest) / n])
    lips = np.concatenate([skins.lips.mean(axis=0)[None], coefficients.T @ (skins.lips - skins.lips.mean(axis=0)) / n])
    arrays: dict[str, NDArray[Any]] = {"lips": lips.astype(np.float32)}
    ranges = []
    for k, image in enumerate([_flattened(mean, weight), *modes]):
        luma = image.mean(axis=2)
        channels = {"luma": luma, "red": image[..., 0] - luma, "blue": image[..., 2] - luma}
        for name, channel in channels.items():
            low, high = (float(limit) for limit in np.quantile(channel, [0.0005, 0.9995]))
            size, quality = _LUMA if name == "luma" else _CHROMA
            arrays[f"skin.{k}.{name}"] = encoded((channel - low) / max(high - low, 1e-6), size, quality)
            ranges.append([low, high])
    labels = skins.labels - skins.labels.mean(axis=0)
    # Labels by regression on the coefficients without the tone; what the ridge takes from their range is given back.
    slopes = np.linalg.solve(
        coefficients.T @ coefficients / n + _RIDGE * np.eye(len(loads)), coefficients.T @ labels / n
    )
    slopes[0] = 0.0
    found, (age, gender) = coefficients @ slopes, skins.labels.T
    ends = (
        found[age == 1.0, 0].mean() - found[age == 0.0, 0].mean(),
        found[gender > 0.0, 1].mean() - found[gender < 0.0, 1].mean(),
    )
    slopes /= np.array(ends) / np.array([1.0, 2.0])
    meta = {
        "ranges": ranges,
        "labels": {"age": slopes[:, 0].tolist(), "gender": slopes[:, 1].tolist()},
        "skins": dict(zip(skins.names, coefficients.round(4).tolist(), strict=True)),
    }
    return meta, arrays


def _face(texels: SkinTexels) -> Image32:
    """Return the weight of each texel in the statistics: 1 on the face, little below and behind it, shape (K,)."""
    place = texels.place
    front = smoothstep(4.0, 9.0, place[:, 2]) * smoothstep(58.0, 62.0, place[:, 1])
    return ((0.02 + front) * (1.0 - _unknown(texels)) / np.maximum(texels.texels.pixels_per_area, 50.0)).astype(
        np.float32
    )


def _flattened(mean: Image32, weight: Image32) -> Image32:
    """Return the ``mean`` (H, W, 3) with less of the light under which the skins were photographed."""
    luma = mean.mean(axis=2)
    smooth = ndimage.gaussian_filter(luma, _SHADING_SIZE, mode="nearest")
    level = (luma * weight).sum() / weight.sum()
    flat: Image32 = mean - (_FLATTENED * (smooth - level))[..., None].astype(np.float32)
    return flat


def _doubled(channel: Image32, shape: tuple[int, int]) -> Image32:
    larger = Image.fromarray(channel).resize((shape[1], shape[0]), Image.Resampling.BICUBIC)
    return np.asarray(larger, dtype=np.float32)
