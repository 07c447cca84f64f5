"""Layers over the skin: hair, brows, stubble, lips and lids, separated from our painted textures.

A layer of hairs turns a colour c into T c + H h, with the colour h of the hair: the transmission T is what the painting
makes of white skin and black hair, H what it makes of black skin and white hair.
"""

import dataclasses
import io
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scripts.asset_building.looks import LOOKS
from scripts.asset_building.raster import Image32, Noise, smoothstep
from scripts.asset_building.skin_texture import (
    SkinLook,
    SkinTexels,
    darkening,
    lip_share,
    paint_beard,
    paint_brows,
    paint_scalp,
    spot,
)

_WHITE, _BLACK = (255.0, 255.0, 255.0), (0.0, 0.0, 0.0)
#: Sizes at which the layers are stored, and JPEG's quality for each.
_FINE, _MASK, _SMOOTH = (2048, 62), (1024, 80), (256, 90)
#: Ratios of the sides of a texel on the surface between which pores fade, since they would become streaks.
_STRETCH = (1.5, 2.4)


def build_layers(texels: SkinTexels) -> dict[str, NDArray[np.uint8]]:
    """Return encoded images by name, from texels of 2048 x 2048.

    ``hair.STYLE``, ``brows.STYLE`` and ``beard`` have T and H one above the other; ``masks`` are lips, wet lines and
    lashes, ``inside`` the lining of the mouth, what lies behind the lips, and the openness of folds. ``grain`` is
    the strength of pores.
    """
    looks = {name: LOOKS[name].skin for name in ("man", "woman", "low")}
    found = {}
    for style, name in (("short", "man"), ("combed", "woman")):
        found[f"hair.{style}"] = _hairs(
            texels, looks[name], lambda c, s, look, rng: paint_scalp(c, s, look, rng, Noise(look.seed + 3))
        )
    for style, name in (("arched", "woman"), ("straight", "man"), ("heavy", "low")):
        found[f"brows.{style}"] = _hairs(texels, looks[name], paint_brows)
    beard = dataclasses.replace(looks["man"], beard=1.0)
    found["beard"] = _hairs(texels, beard, paint_beard)
    found["grain"] = encoded(texels.texels.image(_grain(texels)[:, None])[..., 0], *_SMOOTH)
    masks = texels.masks
    lips = lip_share(masks["lips"], texels.place, Noise(looks["man"].seed))
    lining = masks["inside"] * (1.0 - lips)
    openness = darkening(texels.occlusion, masks)[:, 0] ** (1.0 / 0.35)
    for name, group in (
        ("masks", (lips, masks["wet_line"], masks["lash_line"])),
        ("inside", (lining, lining * masks["behind_lips"], openness)),
    ):
        found[name] = encoded(texels.texels.image(np.stack(group, axis=1)), *_MASK)
    return found


def _grain(texels: SkinTexels) -> Image32:
    """Return the strength of pores: full where texels are about square, most on the nose, shape (K,)."""
    along = texels.texels.along
    gram = along @ np.swapaxes(along, 1, 2)
    # The singular values of a 2 x 3 matrix, from trace and determinant of its square.
    half, product = 0.5 * (gram[:, 0, 0] + gram[:, 1, 1]), np.linalg.det(gram)
    root = np.sqrt(np.maximum(half**2 - product, 0.0))
    ratio = np.sqrt((half + root) / np.maximum(half - root, 1e-6 * half + 1e-12))
    square = smoothstep(_STRETCH[1], _STRETCH[0], ratio.astype(np.float32))
    return (0.15 + 0.6 * square + 0.25 * square * spot(texels.place, (0.0, 69.5, 16.0), 2.5)).astype(np.float32)


def _hairs(texels: SkinTexels, look: SkinLook, paint: Callable[..., Image32]) -> NDArray[np.uint8]:
    layers = []
    for skin, hair in ((_BLACK, _BLACK), (_WHITE, _BLACK), (_BLACK, _WHITE)):
        colour = np.tile(np.array(skin, dtype=np.float32), (len(texels.place), 1))
        painted = paint(colour, texels, dataclasses.replace(look, hair=hair), np.random.default_rng(look.seed))
        layers.append(texels.texels.image(painted[:, :1])[..., 0])
    # What is neither skin nor hair is the shade of stubble below the skin.
    fixed, skin_only, hair_only = layers
    return encoded(np.concatenate([skin_only - fixed, hair_only - fixed]) / 255.0, *_FINE)


def encoded(image: Image32, size: int, quality: int) -> NDArray[np.uint8]:
    """Return an image (H, W) or (H, W, 3) of values 0..1 as JPEG of width ``size``."""
    values = np.rint(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
    picture = Image.fromarray(values)
    if picture.width != size:
        picture = picture.resize((size, size * picture.height // picture.width), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    picture.save(buffer, "JPEG", quality=quality, subsampling=0, optimize=True)
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)
