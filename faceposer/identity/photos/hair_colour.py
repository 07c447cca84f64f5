"""The colour of the hair in photos, for the short hair of the built-in heads.

Over the forehead, a photo shows hair, or a hat, a bald head or what is behind the head. Colours of hair are a narrow
family, and hair has about one colour: what else is seen there tells nothing of it.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.photos.face_texels import Spots
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.skin_samples import corner_uvs
from faceposer.identity.photos.unlit_colours import LitPhoto, unlit_colours
from faceposer.identity.skin_layers import Colour

Array = NDArray[np.float64]

# Transmission of the layer below which a vertex lies under hair, and how far from the middle the sides begin, where the
# outline of the head does not say what is behind, in centimetres.
_BARE, _SIDES = 0.65, 5.5
# Least weight of a vertex, and least number of them.
_SEEN, _LEAST = 0.2, 40
# Quantiles of brightness between which colours are taken, darker than the mean for the lamp's light on hair, and those
# whose logarithms differ by no more than the number after them.
_TAKEN, _ALIKE, _SPREAD = (0.25, 0.5), (0.15, 0.85), 1.3
# Least difference of logarithms from the skin.
_NO_SKIN = 0.15
# Range of the logarithms of red over green and of green over blue of hair.
_RED, _YELLOW = (-0.06, 0.85), (-0.12, 1.4)
# Range of the channels of the layers' colour.
_RANGE = (0.04, 0.8)


def hair_colour_of(
    photos: Iterable[LitPhoto], layer: tuple[Array, Array], skin: Array, basis: HeadBasis
) -> Colour | None:
    """Return the colour of hairs with which a layer looks like the hair in ``photos``, or None if they do not show it.

    Args:
        photos: The photos.
        layer: Transmission and shade of the layer, 0 to 1, shape (side, side) each.
        skin: Colour of the skin, sRGB 0 to 1, shape (3,).
        basis: The model of heads.
    """
    triangles = basis.editor.template.triangles
    uv = np.zeros((basis.n_skin, 2))
    uv[triangles.ravel()] = corner_uvs(basis).reshape(-1, 2)
    side = len(layer[0])
    cells = np.clip(np.stack([(1.0 - uv[:, 1]) * side, uv[:, 0] * side]).astype(np.int64), 0, side - 1)
    transmission, shade = (plane[cells[0], cells[1]] for plane in layer)
    places = basis.character.vertices[: basis.n_skin]
    at = np.flatnonzero((transmission < _BARE) & (np.abs(places[:, 0]) < _SIDES))
    spots = Spots(np.repeat(at[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (len(at), 1)), np.ones(len(at)))
    seen = []
    for photo in photos:
        colours, weights, _ = unlit_colours(photo, spots, basis)
        seen.append(colours[weights > _SEEN])
    looks = colour_of_hair(np.concatenate(seen), skin)
    if looks is None:
        return None
    # Skin shines through the layer. Its colour is taken away in part only: errors of it would make hair gaudy.
    hairs = (np.array(looks) - transmission[at].mean() * skin) / max(float(shade[at].mean()), 0.1)
    hairs = (hairs + np.array(looks) * (hairs.mean() / max(float(np.mean(looks)), 0.02))) / 2.0
    red, green, blue = np.clip(hairs, *_RANGE).tolist()
    return (red, green, blue)


def colour_of_hair(colours: Array, skin: Array) -> Colour | None:
    """Return the colour of hair among ``colours``, (n, 3), or None if they are those of no one's hair."""
    if len(colours) < _LEAST:
        return None
    brightness = np.log(np.maximum(colours.mean(axis=1), 0.02))
    dark, light = np.quantile(brightness, _ALIKE)
    if light - dark > _SPREAD:
        return None
    low, high = np.quantile(brightness, _TAKEN)
    found = np.median(colours[(brightness >= low) & (brightness <= high)], axis=0)
    red, green, blue = np.log(np.maximum(found, 0.02)).tolist()
    if not (_RED[0] < red - green < _RED[1] and _YELLOW[0] < green - blue < _YELLOW[1]):
        return None
    if np.abs(np.log(np.maximum(found, 0.02) / np.maximum(skin, 0.02))).max() < _NO_SKIN:
        return None
    r, g, b = found.tolist()
    return (r, g, b)
