"""Colours and hair of the human characters, and the creature's hide."""

from scripts.asset_building.creature_texture import HideLook
from scripts.asset_building.eye_texture import IrisLook
from scripts.asset_building.skin_texture import SkinLook
from scripts.asset_building.textures import Look

#: Also the source of the regions of the brows.
MAN_SKIN = SkinLook(
    base=(203, 158, 134),
    flush=(190, 112, 96),
    lips=(170, 104, 94),
    hair=(58, 42, 32),
    beard=0.8,
    brow=((1.4, 74.78, 0.27), (2.4, 74.95, 0.33), (3.6, 75.1, 0.32), (4.7, 74.98, 0.24), (5.7, 74.42, 0.08)),
    brow_strength=0.95,
    hair_length=0.45,
    combed_back=False,
    lash_line=0.35,
    seed=11,
)

_WOMAN = SkinLook(
    base=(217, 174, 152),
    flush=(206, 124, 112),
    lips=(186, 98, 98),
    hair=(64, 40, 27),
    beard=0.0,
    brow=((1.45, 74.75, 0.20), (2.5, 75.0, 0.25), (3.7, 75.28, 0.23), (4.7, 75.25, 0.15), (5.7, 74.72, 0.05)),
    brow_strength=0.85,
    hair_length=1.6,
    combed_back=True,
    lash_line=0.6,
    seed=23,
)

_LOW = SkinLook(
    base=(142, 96, 70),
    flush=(140, 78, 58),
    lips=(140, 80, 77),
    hair=(26, 21, 19),
    beard=0.35,
    brow=((1.4, 74.75, 0.30), (2.4, 74.95, 0.36), (3.6, 75.1, 0.34), (4.7, 74.98, 0.26), (5.7, 74.42, 0.12)),
    brow_strength=1.0,
    hair_length=0.12,
    combed_back=False,
    lash_line=0.85,
    seed=47,
)

_CREATURE = HideLook(
    base=(128, 146, 88),
    back=(86, 104, 62),
    pale=(172, 176, 124),
    blood=(176, 122, 96),
    lips=(128, 96, 78),
    spots=(70, 82, 46),
    hair=(44, 40, 26),
    brow=((1.2, 74.62, 0.36), (2.1, 74.92, 0.52), (3.3, 75.18, 0.48), (4.5, 75.02, 0.36), (5.7, 74.45, 0.16)),
    brow_strength=1.0,
    seed=31,
)

LOOKS = {
    "low": Look(
        _LOW,
        IrisLook(inner=(86, 54, 32), middle=(66, 42, 28), rim=(26, 20, 18), seed=9),
        skin_size=1024,
        eye_size=256,
        tongue_size=128,
    ),
    "man": Look(MAN_SKIN, IrisLook(inner=(120, 110, 96), middle=(106, 126, 142), rim=(36, 44, 54), seed=3)),
    "woman": Look(_WOMAN, IrisLook(inner=(128, 84, 48), middle=(92, 84, 52), rim=(34, 30, 24), seed=4)),
    "creature": Look(
        _CREATURE,
        IrisLook(
            inner=(236, 190, 70), middle=(196, 120, 30), rim=(58, 34, 18), seed=7, white=(226, 216, 182), slit=0.62
        ),
        skin_size=1024,
        eye_size=512,
        tongue_size=256,
    ),
}
