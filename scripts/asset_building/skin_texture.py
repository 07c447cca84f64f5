"""Paint the skin: tones, lips, lids, pores, brows, the hair's stubble and a shadow of a beard.

All positions are given on the base mesh in centimetres (x to the character's left, y up, z forward; the eyes are at
y = 73, the lips at 66, the top of the head at 85), so that the same rules apply to every person.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from scripts.asset_building.raster import Image32, Noise, TexelMap, draw_strokes, smoothstep, softened, softening

Colour = tuple[float, float, float]


class Brows(Protocol):
    """Look with brows; for the attributes see `SkinLook`."""

    @property
    def hair(self) -> Colour:
        """Their colour."""

    @property
    def brow(self) -> tuple[tuple[float, float, float], ...]:
        """Curve of the left brow."""

    @property
    def brow_strength(self) -> float:
        """Opacity of the hairs."""


@dataclass(frozen=True)
class SkinLook:
    """Colours (sRGB, 0..255) and hair of one person.

    Attributes:
        base: The skin's colour.
        flush: Colour of cheeks, nose and ears, where blood shows.
        lips: Colour of the lips.
        hair: Colour of the hair and brows.
        beard: Strength of the beard's shadow, 0..1.
        brow: Curve of the left brow: x, y and half width in centimetres at points from its inner end to its tail.
        brow_strength: Opacity of the brow's hairs.
        hair_length: Length of the hair's strokes in centimetres.
        combed_back: True if the hair runs from the face to the back, instead of from the crown outwards.
        lash_line: Darkness of the lids' edge under the lashes, 0..1.
        seed: Seed of the random fields.
    """

    base: Colour
    flush: Colour
    lips: Colour
    hair: Colour
    beard: float
    brow: tuple[tuple[float, float, float], ...]
    brow_strength: float
    hair_length: float
    combed_back: bool
    lash_line: float
    seed: int


@dataclass(frozen=True)
class SkinTexels:
    """Properties of the skin at each covered texel; all but ``texels`` have the shape (K,) or (K, 3).

    Attributes:
        texels: The surface in texture space.
        place: Position on the base mesh in centimetres.
        normal: Unit normal on the base mesh.
        occlusion: Unoccluded share of directions, 0..1.
        masks: Further values by name: "lips", "eyelids", "ears", "free_ears" (rising softly from their
            roots), "inside" (of the mouth), "behind_lips" (on its lining), "lash_line", "wet_line".
    """

    texels: TexelMap
    place: Image32
    normal: Image32
    occlusion: Image32
    masks: dict[str, Image32]


#: Distance around larger texels in which the detail of hair is softened, in pixels.
_SOFTENED = 120.0
#: Centimetres per degree around the head.
_ARC = 7.0 * np.pi / 180.0
#: Height of the hairline (y) by angle around the head's axis, from the middle of the forehead to that of the nape.
_HAIRLINE = PchipInterpolator(
    [0, 12, 24, 34, 42, 48, 54, 60, 66, 71, 75, 81, 84.5, 89, 98, 108, 118, 130, 145, 180],
    [79.9, 79.9, 79.8, 79.0, 77.7, 76.3, 75.3, 74.6, 73.6, 71.6]
    + [70.6, 70.4, 72.9, 74.0, 74.2, 73.2, 70.6, 67.6, 66.2, 65.8],
)
#: Upper limit of the beard on chin and cheeks (y) by the same angle.
_BEARD_TOP = PchipInterpolator(
    [0, 8, 15, 22, 32, 45, 60, 72, 84, 90], [64.7, 65.0, 66.0, 67.2, 67.6, 68.2, 69.4, 71.2, 71.2, 66.0]
)


def paint_skin(skin: SkinTexels, look: SkinLook) -> NDArray[np.uint8]:
    """Return the skin's texture, shape (H, W, 3)."""
    rng = np.random.default_rng(look.seed)
    noise = [Noise(look.seed + k) for k in range(4)]
    p, masks = skin.place, skin.masks
    mirrored = p * np.array([0, 1, 1], np.float32) + np.abs(p) * np.array([1, 0, 0], np.float32)
    lips = lip_share(masks["lips"], p, noise[0])

    colour = np.broadcast_to(np.array(look.base, dtype=np.float32), p.shape).copy()
    colour *= (1.0 + 0.025 * noise[0](p, 3.0, 3) + 0.012 * noise[1](p, 0.5, 3))[:, None]
    colour = blend(colour, look.flush, _flush(mirrored, masks) * (1.0 + 0.12 * noise[2](p, 0.9, 3)))
    colour = blend(colour, (150, 98, 92), _around_eyes(mirrored, masks))
    colour = _pores(colour, p, skin, noise)
    if look.beard:
        colour = paint_beard(colour, skin, look, rng)
    colour = blend(colour, look.lips, 0.85 * lips)
    colour *= (1.0 + lips * (0.05 * noise[3](p * np.array([1.0, 0.25, 0.25], np.float32), 0.12, 2)))[:, None]
    colour = blend(colour, (198, 120, 112), 0.7 * masks["wet_line"])
    colour = blend(colour, look.hair, look.lash_line * masks["lash_line"])
    colour = paint_scalp(colour, skin, look, rng, noise[3])
    colour = paint_brows(colour, skin, look, rng)
    lining = masks["inside"] * (1.0 - lips)
    colour = blend(colour, (112, 41, 41), lining * (1.0 + 0.05 * noise[3](p, 0.6, 2)))
    colour = blend(colour, (178, 92, 88), lining * masks["behind_lips"])
    colour *= darkening(skin.occlusion, masks)
    image = skin.texels.image(np.clip(colour, 0, 255))
    return np.rint(image).astype(np.uint8)


def hair_depth(place: Image32) -> Image32:
    """Return the hair density at ``place`` (K, 3) on the base mesh, from 0 at the hairline to 1 inside."""
    return smoothstep(-0.2, 3.0, _above(_HAIRLINE, place))


def above_hairline(place: Image32) -> Image32:
    """Return the approximate height of ``place`` (K, 3) on the base mesh above the hairline, in centimetres."""
    return _above(_HAIRLINE, place)


def blend(colour: Image32, other: Colour, share: Image32) -> Image32:
    """Return ``colour`` (K, 3) blended with ``other`` by ``share`` (K,), clipped to 0..1."""
    share = np.clip(share, 0.0, 1.0)[:, None]
    result: Image32 = colour * (1.0 - share) + np.array(other, dtype=np.float32) * share
    return result


def spot(p: Image32, centre: tuple[float, float, float], radius: float) -> Image32:
    """Return a soft spot around ``centre``: 1 in its middle, 1/e at ``radius`` centimetres, at ``p`` (K, 3)."""
    squared = ((p - np.array(centre, dtype=np.float32)) ** 2).sum(axis=1)
    result: Image32 = np.exp(-squared / np.float32(radius**2))
    return result


def _angle(p: Image32) -> Image32:
    """Return the angle around the head's vertical axis in degrees: 0 ahead, 180 behind, the same on both sides."""
    result: Image32 = np.degrees(np.arctan2(np.abs(p[:, 0]), p[:, 2] - 5.0)).astype(np.float32)
    return result


def _above(line: PchipInterpolator, p: Image32) -> Image32:
    """Return the approximate height of ``p`` (K, 3) above a line around the head, in centimetres."""
    sampled = np.linspace(line.x[0], line.x[-1], 1500)
    tree = cKDTree(np.stack([_ARC * sampled, line(sampled)], axis=1))
    angle = np.clip(_angle(p), line.x[0], line.x[-1])
    distance, _ = tree.query(np.stack([_ARC * angle, p[:, 1]], axis=1), distance_upper_bound=4.0)
    result: Image32 = (np.sign(p[:, 1] - line(angle)) * np.minimum(distance, 4.0)).astype(np.float32)
    return result


def lip_share(mask: Image32, p: Image32, noise: Noise) -> Image32:
    """Return the share of lips at places ``p`` (K, 3), with an uneven border."""
    return smoothstep(0.25, 0.75, mask + 0.06 * noise(p, 0.35, 2))


def _flush(p: Image32, masks: dict[str, Image32]) -> Image32:
    return (
        0.30 * spot(p, (4.6, 70.0, 12.8), 2.3)
        + 0.30 * spot(p, (0.0, 69.3, 16.6), 1.3)
        + 0.35 * spot(p, (1.6, 69.0, 15.2), 0.8)
        + 0.20 * spot(p, (0.0, 63.2, 14.8), 1.6)
        + 0.15 * spot(p, (0.0, 67.2, 15.8), 1.0)
        + 0.40 * masks["free_ears"]
    ).astype(np.float32)


def _around_eyes(p: Image32, masks: dict[str, Image32]) -> Image32:
    under = spot(p * np.array([0.6, 1, 1], np.float32), (1.9, 71.7, 14.0), 0.9)
    inner = spot(p, (1.7, 72.9, 14.0), 0.8)
    return (0.22 * under + 0.22 * inner + 0.14 * masks["eyelids"]).astype(np.float32)


def _pores(colour: Image32, p: Image32, skin: SkinTexels, noise: list[Noise]) -> Image32:
    fine = noise[1](p, 0.055, 1)
    coarse = noise[2](p, 0.11, 2)
    rough = 0.5 + 0.7 * spot(p, (0.0, 69.5, 16.0), 2.5) + 0.3 * spot(np.abs(p), (3.5, 69.5, 13.5), 2.5)
    # Pores are pits, so only the dark half of the noise is used at full strength.
    grain = 0.018 * np.where(fine < 0, 1.5 * fine, 0.5 * fine) + 0.012 * coarse
    freckles = smoothstep(1.9, 2.6, noise[3](p, 0.45, 1)) * 0.10
    result: Image32 = colour * (1.0 + rough * grain)[:, None]
    return blend(result, (150, 100, 76), freckles)


def _tangent(normal: Image32, direction: Image32) -> Image32:
    flat = direction - (direction * normal).sum(axis=1, keepdims=True) * normal
    result: Image32 = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-4)
    return result


def _scatter(rng: np.random.Generator, skin: SkinTexels, density: Image32) -> NDArray[np.intp]:
    """Return random covered texels, ``density`` (K,) of them per square centimetre."""
    return np.flatnonzero(rng.random(len(density)) < density / np.maximum(skin.texels.pixels_per_area, 1e-3))


def _overlay(colour: Image32, skin: SkinTexels, thickness: Image32, tint: Colour) -> Image32:
    opacity = 1.0 - np.exp(-thickness[skin.texels.covered])
    return blend(colour, tint, opacity)


def _shade(colour: Colour, factor: float) -> Colour:
    return (colour[0] * factor, colour[1] * factor, colour[2] * factor)


def _strokes(
    rng: np.random.Generator,
    skin: SkinTexels,
    density: Image32,
    flow: Image32,
    length: float,
    strength: float,
    over_seams: bool = False,
) -> Image32:
    starts = _scatter(rng, skin, density)
    n = len(starts)
    lengths = (length * rng.uniform(0.6, 1.25, n)).astype(np.float32)
    strengths = (strength * rng.uniform(0.5, 1.2, n)).astype(np.float32)
    bend = rng.normal(0.0, 0.16, n).astype(np.float32)
    places = skin.place if over_seams else None
    return draw_strokes(skin.texels, flow, starts, lengths, strengths, bend, skin.masks["ears"] < 0.4, places)


def paint_scalp(colour: Image32, skin: SkinTexels, look: SkinLook, rng: np.random.Generator, noise: Noise) -> Image32:
    """Return ``colour`` (K, 3) of the texels of ``skin`` with the hair of the head."""
    p = skin.place
    above = _above(_HAIRLINE, p) + 0.16 * noise(p, 0.7, 3)
    bare_ears = 1.0 - smoothstep(0.15, 0.5, skin.masks["ears"])
    cover = smoothstep(-0.35, 0.75, above) * bare_ears
    if look.combed_back:
        back, down = np.array([0.0, -0.25, -1.0], np.float32), np.array([0.0, -1.0, -0.1], np.float32)
        behind = smoothstep(4.0, -3.0, p[:, 2:3])
        flow = _tangent(skin.normal, back * (1.0 - behind) + down * behind)
    else:
        away = p - np.array([0.8, 84.5, 0.5], np.float32)
        forward = np.array([0.0, -0.25, 1.0], np.float32) * smoothstep(-2.0, 6.0, p[:, 2:3])
        flow = _tangent(skin.normal, away / np.linalg.norm(away, axis=1, keepdims=True) + 0.8 * forward)
    base = _shade(look.hair, 0.9)
    colour = blend(colour, base, cover * (0.62 if look.combed_back else 0.50))
    fringe = smoothstep(-0.6, 0.3, above) * bare_ears
    sigma = softening(skin.texels, _SOFTENED)
    for tone, count, strength in ((0.55, 60, 0.55), (1.35, 40, 0.40), (0.8, 60, 0.5)):
        thick = _strokes(rng, skin, count * fringe**1.5, flow, look.hair_length, strength, over_seams=True)
        thick = softened(thick, sigma)
        colour = _overlay(colour, skin, thick, _shade(look.hair, tone))
    return colour


def brow_frame(p: Image32, look: Brows) -> tuple[Image32, Image32, Image32]:
    """Return the positions of ``p`` (K, 3) along the brow (0..1) and across it (-1..1 inside), and its slope dy/dx."""
    curve = np.array(look.brow)
    x = np.abs(p[:, 0])
    middle, half = PchipInterpolator(curve[:, 0], curve[:, 1]), PchipInterpolator(curve[:, 0], curve[:, 2])
    clipped = np.clip(x, curve[0, 0], curve[-1, 0])
    along = ((x - curve[0, 0]) / (curve[-1, 0] - curve[0, 0])).astype(np.float32)
    across = ((p[:, 1] - middle(clipped)) / np.maximum(half(clipped), 0.02)).astype(np.float32)
    return along, across, middle.derivative()(clipped).astype(np.float32)


def paint_brows(colour: Image32, skin: SkinTexels, look: Brows, rng: np.random.Generator) -> Image32:
    """Return ``colour`` (K, 3) of the texels of ``skin`` with the hairs of brows."""
    p = skin.place
    front = (p[:, 2] > 10.0).astype(np.float32)
    along, across, slope = brow_frame(p, look)
    inside = smoothstep(1.25, 0.55, np.abs(across)) * front
    inside *= smoothstep(-0.06, 0.22, along) * smoothstep(1.03, 0.9, along)
    colour = blend(colour, look.hair, 0.42 * look.brow_strength * inside)
    # Hairs rise steeply at the inner end and lie down along the brow towards the tail; from above they point down.
    side = np.sign(p[:, 0])
    rise = 1.5 * (1.0 - smoothstep(0.0, 0.55, along)) - 0.35 * smoothstep(0.4, 1.0, along)
    rise = rise - 0.55 * np.clip(across, -1, 1) * smoothstep(0.15, 0.6, along) + slope
    direction = np.stack([side, rise, np.zeros_like(rise)], axis=1).astype(np.float32)
    flow = _tangent(skin.normal, direction)
    root = smoothstep(1.15, 0.75, np.abs(across + 0.15)) * front
    root *= smoothstep(-0.05, 0.16, along) * smoothstep(1.0, 0.9, along)
    for tone, count, strength in ((0.75, 150, 0.75), (1.1, 70, 0.5)):
        thick = _strokes(rng, skin, count * root, flow, 0.62, look.brow_strength * strength)
        colour = _overlay(colour, skin, thick, _shade(look.hair, tone))
    return colour


def paint_beard(colour: Image32, skin: SkinTexels, look: SkinLook, rng: np.random.Generator) -> Image32:
    """Return ``colour`` (K, 3) of the texels of ``skin`` with stubble."""
    p = skin.place
    below = -_above(_BEARD_TOP, p)
    chin = smoothstep(-0.1, 0.9, below) * smoothstep(84.0, 64.0, _angle(p) - 6.0 * smoothstep(67.0, 70.0, p[:, 1]))
    x = np.abs(p[:, 0])
    moustache = smoothstep(3.0, 2.2, x) * smoothstep(66.2, 66.7, p[:, 1]) * smoothstep(68.4, 67.6, p[:, 1] + 0.25 * x)
    moustache *= smoothstep(12.5, 13.5, p[:, 2])
    throat = smoothstep(59.0, 61.5, p[:, 1]) * smoothstep(4.0, 8.0, p[:, 2])
    # The thin-skinned strip next to the corners of the mouth is hairless.
    area = np.maximum(chin, moustache) * throat * (1.0 - smoothstep(0.2, 0.6, skin.masks["lips"]))
    colour = blend(colour, (128, 108, 100), 0.34 * look.beard * area)
    down = np.broadcast_to(np.array([0.0, -1.0, 0.2], np.float32), p.shape)
    thick = _strokes(rng, skin, 90 * area, _tangent(skin.normal, down), 0.07, 0.5 * look.beard)
    return _overlay(colour, skin, thick, _shade(look.hair, 0.8))


def darkening(occlusion: Image32, masks: dict[str, Image32]) -> Image32:
    """Return a factor per channel that darkens folds, least in red because light there has passed through skin."""
    open_share = smoothstep(0.0, 0.85, occlusion)
    # Lips and lids part when the face moves, so closed parts of the neutral face must not be black.
    moving = np.maximum(masks["lips"], masks["wet_line"])
    open_share = np.maximum(open_share, 0.75 * np.clip(moving, 0, 1))
    open_share = np.maximum(open_share, (0.2 + 0.4 * masks["behind_lips"]) * masks["inside"])
    powers = np.array([0.35, 0.55, 0.60], dtype=np.float32)
    result: Image32 = np.maximum(open_share[:, None], 0.02) ** powers
    return result
