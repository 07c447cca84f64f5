"""What keeps textures within human skin: tones beyond those of people, and what the modes add up to, are compressed.

The logarithm of the colour is linear in the tone only among the skins that the model was learned from; beyond them, a
line leads to plaster and soot. The tones of the model's scale are therefore mapped to those of the line by a function
that is the identity among people, has a continuous slope, and approaches the lightest and the darkest skin.
"""

import numpy as np
from numpy.typing import NDArray

Image32 = NDArray[np.float32]

#: Tones of the line up to which the scale is that of the line, and distance from there to the asymptote.
_LIGHT, _DARK = (-0.55, 0.28), (1.30, 0.55)
#: Share of that distance that the inverse reaches, so that it is finite.
_NEARLY = 0.9995
#: Largest changes by the modes other than the tone, as logarithms: of brightness down, as in folds, and up, of chroma,
#: and of its mean, which in the few skins that were learned goes with age.
_DARKER, _BRIGHTER, _CHROMA, _UNDERTONE = 0.30, 0.10, 0.22, 0.05
#: Largest channel that bare skin has, and logarithm of the width in which brighter ones approach it.
_BRIGHTEST, _SHOULDER = 0.93, 0.06


def line_tone(tone: float) -> float:
    """Return the coefficient of the first mode for a tone in standard deviations of people."""
    (light, below), (dark, above) = _LIGHT, _DARK
    if tone < light:
        return float(light - below * -np.expm1((tone - light) / below))
    if tone > dark:
        return float(dark + above * -np.expm1((dark - tone) / above))
    return float(tone)


def scale_tone(coefficient: float) -> float:
    """Return the tone whose coefficient of the first mode is the given one, the inverse of `line_tone`."""
    (light, below), (dark, above) = _LIGHT, _DARK
    if coefficient < light:
        return float(light + below * np.log1p(-min((light - coefficient) / below, _NEARLY)))
    if coefficient > dark:
        return float(dark - above * np.log1p(-min((coefficient - dark) / above, _NEARLY)))
    return float(coefficient)


def _limited(change: Image32, most: float) -> Image32:
    """Return a change of logarithms that stays as it is where small, and never exceeds ``most`` either way."""
    ratio = np.square(np.square(change / np.float32(most)))
    result: Image32 = change / np.sqrt(np.sqrt(1.0 + ratio))
    return result


def limited_brightness(change: Image32) -> Image32:
    """Return the brightness that modes other than the tone add, limited; folds do not turn into ridges of light."""
    return np.where(change < 0.0, _limited(change, _DARKER), _limited(change, _BRIGHTER))


def limited_chroma(change: Image32) -> Image32:
    """Return the chroma that modes other than the tone add, shape (2, H, W), limited; so is its mean."""
    undertone = change.mean(axis=(1, 2), keepdims=True)
    return _limited(change - undertone, _CHROMA) + _limited(undertone, _UNDERTONE)


def below_white(brightness: Image32, largest: Image32) -> Image32:
    """Return the brightness reduced where the ``largest`` chroma added to it would near white; the hue stays."""
    excess = (brightness + largest - np.float32(np.log(_BRIGHTEST) - _SHOULDER)) / np.float32(_SHOULDER)
    # Softplus less its bounded part: the result approaches the limit from below.
    over = np.maximum(excess, 0.0)
    result: Image32 = brightness - np.float32(_SHOULDER) * (over - -np.expm1(-over))
    return result
