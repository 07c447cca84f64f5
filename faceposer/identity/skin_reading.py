"""Layers of hair, brows, stubble, lips and lids, estimated from the image of a skin by least squares."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from faceposer.identity.skin_layers import BROW_STYLES, HAIR_STYLES, STUBBLE_BELOW, Colour, SkinLayers
from faceposer.identity.texture_model import LIPSTICK, TextureModel

Array = NDArray[np.float64]

#: Width and height at which images are compared.
_SIZE = 512
#: Densities of brows and stubble that are tried.
_DENSITIES, _STUBBLE = (0.4, 0.55, 0.7, 0.85, 1.0), (0.0, 0.15, 0.3, 0.5, 0.75, 1.0)
#: Share of a texel from which lips and edges of lids count, and transmission below which hairs do.
_COUNTS, _COVERED, _STUBBLED = 0.4, 0.75, 0.9


def layers_of(
    model: TextureModel, coefficients: ArrayLike, picture: NDArray[np.uint8], usual: SkinLayers
) -> SkinLayers:
    """Return the layers with which the skin ``coefficients`` is most like an image.

    Args:
        model: The texture model.
        coefficients: Coefficients of the skin, shape (K,).
        picture: sRGB colours in the skin's layout, shape (H, W, 3).
        usual: Layers whose colour of hair remains if the image shows no hair.
    """
    reduced = Image.fromarray(picture).resize((_SIZE, _SIZE), Image.Resampling.BOX)
    seen = np.asarray(reduced, dtype=np.float64) / 255.0
    plain = SkinLayers("none", usual.hair_colour, "none", lash_line=0.0)
    bare = model.instance(coefficients, plain, _SIZE) / 255.0
    hair, hair_colour = _hair(model, seen, bare)
    hair_colour = hair_colour or usual.hair_colour
    brows, density, brow_colour = _brows(model, seen, bare)
    return SkinLayers(
        hair,
        hair_colour,
        brows,
        brow_colour,
        density,
        _beard(model, seen, bare, hair_colour),
        _lip_redness(model, seen, bare),
        _lash_line(model, seen, bare),
    )


def _shares(model: TextureModel, names: tuple[str, ...]) -> tuple[dict[str, tuple[Array, Array]], NDArray[np.bool_]]:
    """Return transmission and shade of layers, (H, W), and the texels that any of them covers."""
    shares = {name: model.layer(name, _SIZE) for name in names}
    return shares, np.any([transmission < _COVERED for transmission, _ in shares.values()], axis=0)


def _fitted(seen: Array, bare: Array, transmission: Array, shade: Array) -> tuple[Colour | None, float]:
    """Return the colour h with which T s + H h is nearest to texels (n, 3), and the mean square of what is left."""
    through = transmission[:, None] * bare
    weight = np.square(shade).sum()
    if weight < 1e-6:
        return None, float(np.square(seen - through).mean())
    colour = np.clip((shade @ (seen - through)) / weight, 0.02, 0.95)
    red, green, blue = np.round(colour, 3).tolist()
    return (red, green, blue), float(np.square(seen - through - shade[:, None] * colour).mean())


def _hair(model: TextureModel, seen: Array, bare: Array) -> tuple[str, Colour | None]:
    shares, region = _shares(model, tuple(f"hair.{style}" for style in HAIR_STYLES[1:]))
    found = {name[5:]: _fitted(seen[region], bare[region], t[region], h[region]) for name, (t, h) in shares.items()}
    found["none"] = (None, float(np.square(seen[region] - bare[region]).mean()))
    style = min(found, key=lambda name: found[name][1])
    return style, found[style][0]


def _brows(model: TextureModel, seen: Array, bare: Array) -> tuple[str, float, Colour | None]:
    shares, region = _shares(model, tuple(f"brows.{style}" for style in BROW_STYLES[1:]))
    best: tuple[str, float, Colour | None] = ("none", SkinLayers().brow_strength, None)
    least = float(np.square(seen[region] - bare[region]).mean())
    for name, (transmission, shade) in shares.items():
        t, h = transmission[region], shade[region]
        for density in _DENSITIES:
            shown = t**density
            colour, left = _fitted(seen[region], bare[region], shown, h * (1.0 - shown) / np.maximum(1.0 - t, 1e-3))
            if left < least:
                best, least = (name[6:], density, colour), left
    return best


def _beard(model: TextureModel, seen: Array, bare: Array, colour: Colour) -> float:
    transmission, shade = model.layer("beard", _SIZE)
    region = transmission < _STUBBLED
    t, h = transmission[region][:, None], shade[region][:, None]

    def left(density: float) -> float:
        shown = t**density
        hairs = h * (1.0 - shown) / np.maximum(1.0 - t, 1e-3)
        through = shown + np.array(STUBBLE_BELOW) * np.maximum(1.0 - shown - hairs, 0.0)
        return float(np.square(seen[region] - bare[region] * through - hairs * np.array(colour)).mean())

    return min(_STUBBLE, key=left)


def _lip_redness(model: TextureModel, seen: Array, bare: Array) -> float:
    lips = model.mask("lips", _SIZE) > _COUNTS
    change = np.median(np.log(np.maximum(seen[lips], 0.01)) - np.log(np.maximum(bare[lips], 0.01)), axis=0)
    # Relative to its brightness, so that a darker or lighter image is not taken for lipstick.
    tint = LIPSTICK - LIPSTICK.mean()
    return round(float(np.clip(change @ tint / (tint @ tint), 0.0, 1.0)), 3)


def _lash_line(model: TextureModel, seen: Array, bare: Array) -> float:
    lashes = model.mask("lashes", _SIZE)
    region = lashes > _COUNTS
    darkened = lashes[region][:, None] * bare[region]
    share = float((darkened * (bare[region] - seen[region])).sum() / max(np.square(darkened).sum(), 1e-6))
    return round(float(np.clip(share, 0.0, 1.0)), 3)
