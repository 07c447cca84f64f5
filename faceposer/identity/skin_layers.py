"""Layers over the skin in textures: hair, brows, stubble, lips and lids."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError

Image32 = NDArray[np.float32]
Colour = tuple[float, float, float]

#: Styles of the layers; "none" leaves one out.
HAIR_STYLES, BROW_STYLES = ("none", "short", "combed"), ("none", "straight", "arched", "heavy")
#: Logarithm of the colour of the lids' wet edges relative to skin.
_WET = np.array([-0.03, -0.22, -0.15], dtype=np.float32)
#: Colours (sRGB, 0..1) of the lining of the mouth: deep inside, and behind the lips.
_LINING, _BEHIND_LIPS = (0.44, 0.16, 0.16), (0.70, 0.36, 0.345)
#: Powers with which folds are darkened per channel: light there has passed through skin.
FOLDS = np.array([0.35, 0.55, 0.60], dtype=np.float32)
#: Share of that darkening that skins do not show already.
FOLDS_SHARE = 0.6
#: Factors of the skin's colour where stubble shines through it.
STUBBLE_BELOW = (0.40, 0.47, 0.54)
#: Colours of hair between which those of people lie.
BLACK_HAIR, _BROWN_HAIR = np.array([0.07, 0.06, 0.055]), np.array([0.40, 0.27, 0.16])
_RED_HAIR, GREY_HAIR = np.array([0.45, 0.22, 0.12]), np.array([0.62, 0.61, 0.60])


@dataclass(frozen=True)
class SkinLayers:
    """What lies over the skin. Colours are sRGB, 0..1.

    Attributes:
        hair: Style of the hair, one of `HAIR_STYLES`.
        hair_colour: Colour of the hair.
        brows: Style of the brows, one of `BROW_STYLES`.
        brow_colour: Colour of the brows; that of the hair if None.
        brow_strength: Density of the brows: 0 none, 1 as painted.
        beard: Density of the stubble: 0 none, 1 strong.
        lip_redness: Redness of the lips relative to that of the skin model: 0 as it is, 1 like lipstick.
        lash_line: Darkness of the lids' edges, 0..1.
    """

    hair: str = "short"
    hair_colour: Colour = (0.23, 0.165, 0.125)
    brows: str = "straight"
    brow_colour: Colour | None = None
    brow_strength: float = 0.85
    beard: float = 0.0
    lip_redness: float = 0.0
    lash_line: float = 0.4

    def __post_init__(self) -> None:
        for noun, style, styles in (("hair", self.hair, HAIR_STYLES), ("brows", self.brows, BROW_STYLES)):
            if style not in styles:
                raise FacePoserError(f"There is no style '{style}' of {noun}; styles are {', '.join(styles)}.")
        numbers = [*self.hair_colour, *(self.brow_colour or ()), self.brow_strength, self.beard]
        if not np.isfinite([*numbers, self.lip_redness, self.lash_line]).all():
            raise FacePoserError("Colours and strengths of layers over the skin must be finite numbers.")


@dataclass(frozen=True, eq=False)
class Layer:
    """Planes of 8 bits, shape (P, SIZE, SIZE), and the value that has no effect in each."""

    planes: NDArray[np.uint8]
    neutral: tuple[int, ...]

    def at(self, place: tuple[slice, slice]) -> list[Image32 | None]:
        """Return each plane in a tile as 0..1, or None where it has no effect."""
        found: list[Image32 | None] = []
        for plane, neutral in zip(self.planes, self.neutral, strict=True):
            tile = plane[place]
            found.append(None if np.abs(tile.astype(np.int16) - neutral).max() < 3 else tile * np.float32(1.0 / 255.0))
        return found


def painted(
    k: int,
    log: Image32,
    lips: np.float32,
    masks: list[Image32 | None],
    over: list[tuple[str, list[Image32 | None], Colour, float]],
    lash_line: float,
    creases: Image32,
) -> Image32:
    """Return channel ``k`` of a tile, 0..255, from the logarithm of the bare skin and the layers."""
    lip, wet, lash, lining, behind, openness = masks
    if lip is not None:
        log = log + lip * (lips + creases)
    if wet is not None:
        log = log + wet * _WET[k]
    channel: Image32 = np.exp(log)
    if lash is not None:
        channel *= 1.0 - np.float32(lash_line) * lash
    for name, (transmission, shade), colour, density in over:
        if transmission is None:
            continue
        shown = transmission if density == 1.0 else transmission ** np.float32(density)
        hair = 0.0 if shade is None else shade * np.float32(colour[k])
        if density != 1.0:
            hair = hair * (1.0 - shown) / np.maximum(1.0 - transmission, np.float32(1e-3))
        if name == "beard":
            # Stubble below the surface of the skin darkens it, least in blue.
            shown = shown + STUBBLE_BELOW[k] * np.maximum(1.0 - shown - (0.0 if shade is None else shade), 0.0)
        channel = channel * shown + hair
    if lining is not None:
        inside = np.float32(_LINING[k]) + (0.0 if behind is None else behind) * np.float32(_BEHIND_LIPS[k] - _LINING[k])
        channel += lining * (inside - channel)
    if openness is not None:
        if lip is not None:
            # Lips part when the mouth moves, so that the line between them is not painted.
            openness = openness + np.float32(0.8) * lip * (1.0 - openness)
        channel *= np.maximum(openness, np.float32(0.02)) ** np.float32(FOLDS[k] * FOLDS_SHARE)
    return np.clip(channel * np.float32(255.0) + np.float32(0.5), 0.0, 255.0)


def greyness(age: float, early: float = 0.5) -> float:
    """Return the share of the hair that has turned grey at an age, 0 average to 1 old; ``early`` is 0..1."""
    return float(np.clip(1.6 * age - 0.5 * (1.0 - early), 0.0, 0.9))


def random_layers(seed: int, tone: float, gender: float = 0.0, age: float = 0.0) -> SkinLayers:
    """Return layers of a random person: darker hair with darker skin, grey hair with age, stubble on men.

    Args:
        seed: Seed of the choice.
        tone: Tone of the skin in standard deviations, negative light.
        gender: -1 male to 1 female.
        age: 0 average to 1 old.
    """
    rng = np.random.default_rng(seed)
    fair = rng.random() * np.clip(0.6 - 0.8 * tone, 0.0, 1.0)
    warm = rng.random()
    colour = BLACK_HAIR + fair * (_BROWN_HAIR + warm * (_RED_HAIR - _BROWN_HAIR) * (fair > 0.5) - BLACK_HAIR)
    colour = colour + greyness(age, 1.0 - rng.random()) * (GREY_HAIR - colour)
    female = gender + 0.3 * rng.standard_normal() > 0.0
    red, green, blue = (float(channel) for channel in colour)
    return SkinLayers(
        hair="combed" if female else "short",
        hair_colour=(red, green, blue),
        brows="arched" if female else str(rng.choice(["straight", "heavy"])),
        brow_colour=(0.75 * red, 0.75 * green, 0.75 * blue),
        brow_strength=float(rng.uniform(0.7, 1.0)),
        beard=0.0 if female else float(rng.choice([0.0, 0.3, 0.7])),
        lip_redness=float(rng.uniform(0.0, 0.25)) if female else 0.0,
        lash_line=0.55 if female else 0.35,
    )
