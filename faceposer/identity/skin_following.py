"""A skin of the texture model that follows the age and the gender of its head."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from faceposer.identity.identity import SkinTexture
from faceposer.identity.skin_layers import BLACK_HAIR, GREY_HAIR, Colour, greyness
from faceposer.identity.texture_model import load_texture_model

#: Natural range of the labels of skins, by name.
NATURAL_LABELS: Mapping[str, tuple[float, float]] = {"age": (-0.5, 1.2), "gender": (-1.2, 1.5)}
# Greyness of a brow relative to the hair's.
_BROWS = 0.7


def following_skin(texture: SkinTexture, before: Mapping[str, float], after: Mapping[str, float]) -> SkinTexture:
    """Return the skin of a head whose age or gender changes.

    Its labels change as much as the attributes, within their natural range, the hair turns grey or back,
    and a woman's stubble goes.

    Args:
        texture: The skin before.
        before: Attributes "age" and "gender" of the head before.
        after: Those after.
    """
    model = load_texture_model()
    found = np.array(texture.coefficients)
    for name, (low, high) in NATURAL_LABELS.items():
        if after[name] != before[name]:
            label = model.label(found, name)
            wanted = float(np.clip(label + after[name] - before[name], min(low, label), max(high, label)))
            found = model.with_label(found, name, wanted)
    layers = texture.layers
    grey, less = greyness(after["age"]), greyness(before["age"])
    if grey != less:
        brows = layers.brow_colour and _greyed(layers.brow_colour, _BROWS * less, _BROWS * grey)
        layers = replace(layers, hair_colour=_greyed(layers.hair_colour, less, grey), brow_colour=brows)
    if after["gender"] > max(before["gender"], 0.0):
        layers = replace(layers, beard=layers.beard * float(np.clip(1.0 - 2.0 * after["gender"], 0.0, 1.0)))
    return replace(texture, coefficients=tuple(found.tolist()), layers=layers)


def _greyed(colour: ArrayLike, before: float, after: float) -> Colour:
    """Return a colour of hair of which the share ``before`` has turned grey, with another share ``after``."""
    young = np.maximum((np.asarray(colour) - before * GREY_HAIR) / (1.0 - before), BLACK_HAIR)
    # Hair that was grey at an age at which it usually is not stays as grey.
    young = np.minimum(young, np.maximum(colour, BLACK_HAIR))
    red, green, blue = np.round(young + after * (GREY_HAIR - young), 4).tolist()
    return red, green, blue
