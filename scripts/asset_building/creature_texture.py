"""Paint the creature's skin: green, mottled, wrinkled over its dark brows and pale below, otherwise hairless."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scripts.asset_building.raster import Image32, Noise, smoothstep
from scripts.asset_building.skin_texture import Colour, SkinTexels, blend, darkening, paint_brows, spot


@dataclass(frozen=True)
class HideLook:
    """Colours (sRGB, 0..255) of a hide, hairless except for the brows.

    Attributes:
        base: The face.
        back: Scalp, back of the head and outside of the ears.
        pale: Throat, jaw and around the mouth.
        blood: Colour where blood shows through: inside of the ears, nose, rims of the lids.
        lips: The lips.
        spots: Freckles and blotches.
        hair: The brows.
        brow: Curve of the left brow, as in `SkinLook`.
        brow_strength: Opacity of the brow's hairs.
        seed: Seed of the random fields.
    """

    base: Colour
    back: Colour
    pale: Colour
    blood: Colour
    lips: Colour
    spots: Colour
    hair: Colour
    brow: tuple[tuple[float, float, float], ...]
    brow_strength: float
    seed: int


def paint_hide(skin: SkinTexels, look: HideLook) -> NDArray[np.uint8]:
    """Return the skin's texture, shape (H, W, 3)."""
    noise = [Noise(look.seed + k) for k in range(5)]
    p, masks = skin.place, skin.masks
    q = np.stack([np.abs(p[:, 0]), p[:, 1], p[:, 2]], axis=1)
    x, y, z = q.T
    wide, middle, fine = noise[0](p, 3.5, 3), noise[1](p, 0.9, 3), noise[2](p, 0.07, 2)

    colour = np.broadcast_to(np.array(look.base, dtype=np.float32), p.shape).copy()
    behind = smoothstep(11.0, 3.0, z + 0.5 * wide) * (1.0 - masks["free_ears"])
    above = smoothstep(77.0, 82.5, y + 0.7 * wide)
    colour = blend(colour, look.back, 0.75 * np.maximum(behind, above))
    below = smoothstep(66.5, 61.5, y + 0.4 * wide) * smoothstep(3.0, 9.0, z)
    muzzle = np.exp(-(((x / 3.4) ** 2 + ((y - 65.6) / 2.6) ** 2) ** 2)) * smoothstep(11.0, 13.0, z)
    colour = blend(colour, look.pale, np.maximum(0.75 * below, 0.5 * muzzle))
    colour = _ears(colour, skin, look, q, middle)
    blood = 0.45 * spot(q, (0.0, 69.3, 16.6), 1.3) + 0.35 * spot(q, (4.8, 70.0, 12.6), 1.8)
    colour = blend(colour, look.blood, blood * (1.0 + 0.3 * middle))
    # The rims of the eyes are dark, as if lined with kohl, and the lids a little.
    around = spot(q * np.array([0.75, 1.0, 0.5], np.float32), (2.45, 72.9, 6.8), 1.7)
    colour = blend(colour, look.back, 0.35 * around + 0.40 * masks["eyelids"])
    colour = _wrinkled(colour, look, q, noise[4])
    blotches = smoothstep(0.75, 1.5, noise[3](p, 1.5, 2)) * smoothstep(72.0, 78.0, y + 0.12 * (14.0 - z) * 4.0)
    freckles = smoothstep(1.35, 2.1, noise[4](p, 0.5, 2)) * (0.25 + 0.75 * smoothstep(70.0, 76.0, y))
    colour = blend(colour, look.spots, 0.34 * blotches + 0.42 * freckles)
    colour *= (1.0 + 0.045 * wide + 0.035 * middle + 0.030 * np.where(fine < 0.0, 1.5 * fine, 0.5 * fine))[:, None]
    colour = paint_brows(colour, skin, look, np.random.default_rng(look.seed))

    lips = smoothstep(0.25, 0.75, masks["lips"] + 0.06 * middle)
    colour = blend(colour, look.lips, 0.8 * lips)
    colour = blend(colour, (150, 92, 88), 0.7 * masks["wet_line"])
    colour = blend(colour, (30, 30, 20), 0.65 * masks["lash_line"])
    colour = blend(colour, (96, 38, 44), np.maximum(masks["inside"] * (1.0 - lips), lips * smoothstep(14.4, 13.8, z)))
    colour *= darkening(skin.occlusion, masks)
    return np.rint(skin.texels.image(np.clip(colour, 0, 255))).astype(np.uint8)


def _ears(colour: Image32, skin: SkinTexels, look: HideLook, q: Image32, noise: Image32) -> Image32:
    """Tint the ears: pink with veins inside, at their back like the scalp."""
    mask = skin.masks["free_ears"]
    ahead = smoothstep(-0.15, 0.35, skin.normal[:, 2] * 0.8 + np.sign(skin.place[:, 0]) * skin.normal[:, 0] * 0.6)
    colour = blend(colour, look.back, 0.55 * mask * (1.0 - ahead))
    hollow = smoothstep(1.0, 0.35, skin.occlusion)
    return blend(colour, look.blood, mask * ahead * (0.35 + 0.45 * hollow) * (1.0 + 0.15 * noise))


def _wrinkled(colour: Image32, look: HideLook, q: Image32, noise: Noise) -> Image32:
    """Draw soft furrows across the forehead, crow's feet next to the eyes and a dark ridge at the brows."""
    x, y, z = q.T
    bend = noise(q, 5.0, 1)
    front = smoothstep(8.0, 10.5, z)
    # Furrows sag between the brows and come down at the temples.
    height = (y - 76.7 + 0.045 * x * x + 0.30 * np.exp(-((x / 1.3) ** 2)) + 0.13 * bend) / 1.05
    row = np.floor(height)
    furrows = np.exp(-((height - row - 0.5) ** 2) / 0.016) * ((row >= 0) & (row < 3))
    reach = 5.4 - 0.7 * np.abs(row - 0.6) + 0.5 * noise(q, 1.7, 1)
    furrows *= smoothstep(reach, reach - 1.8, x) * front
    away = np.hypot(x - 4.6, y - 72.7)
    fan = (np.degrees(np.arctan2(y - 72.7, x - 4.2)) + 4.0 * bend) / 18.0
    feet = np.exp(-((fan - np.floor(fan) - 0.5) ** 2) / 0.020) * smoothstep(3.2, 2.4, np.abs(fan))
    feet *= smoothstep(0.8, 1.3, away) * smoothstep(2.9, 1.7, away) * front
    ridge_y = np.interp(x, [0.6, 1.6, 3.6, 5.6, 6.6], [74.3, 74.8, 75.3, 74.5, 73.8])
    ridge = np.exp(-(((y - ridge_y) / 0.42) ** 2)) * smoothstep(0.7, 1.5, x) * smoothstep(6.4, 5.0, x) * front
    dark = (0.55 * look.back[0], 0.55 * look.back[1], 0.55 * look.back[2])
    return blend(colour, dark, (0.20 * furrows + 0.26 * feet + 0.38 * ridge).astype(np.float32))
