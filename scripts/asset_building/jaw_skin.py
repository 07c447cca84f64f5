"""How the skin follows the lower jaw when it opens.

The mandible is rigid, so the skin over it turns with it; the skull's skin stays; between them each vertex turns by a
share of the jaw's angle. The shares are the smoothest function on the mesh (`smoothest`) with given values on chin,
lips and skull, and are drawn weakly to how far the source's skin follows its jaw everywhere else. The corners of the
mouth come nearer to each other, so that the lips keep about their length.
"""

from dataclasses import dataclass

import numpy as np

from scripts.asset_building.falloff import ramp
from scripts.asset_building.head import Skin
from scripts.asset_building.jaw import OPENING, jaw_hinge, jaw_opening, jaw_rotation
from scripts.asset_building.mouth_rings import MouthRings, mouth_rings
from scripts.asset_building.piece import Floats
from scripts.asset_building.smoothest import smoothest

#: Share of the jaw's turn at the corners of the mouth, in the middle of the upper lip and of the lower lip.
_CORNER, _UPPER, _LOWER = 0.145, 0.02, 0.97
#: Rings around the lips' contact that make up the lips, whose sections stay rigid.
_LIP_RINGS = 4
#: How much narrower the mouth is at full opening, and how far around it, in centimetres.
_NARROWER, _REACH = 0.2, 2.6
#: Weight of the source's own shares beside smoothness, where none is given.
_SOURCE = 4e-4


@dataclass(frozen=True)
class JawSkin:
    """What the skin's control vertices have of the jaw's movement.

    Attributes:
        share: Of the jaw's turn, shape (C,).
        narrowing: Share of x that is lost at full opening, shape (C,).
    """

    share: Floats
    narrowing: Floats

    def opening(self, control: Floats, hinge: Floats) -> Floats:
        """Return the offsets of jawOpen of the skin's ``control`` vertices, shape (C, 3), on a head with this hinge."""
        offsets = jaw_rotation(control, OPENING * self.share, hinge) - control
        offsets[:, 0] -= self.narrowing * control[:, 0]
        return offsets


def jaw_skin(skin: Skin, rest: Floats, source: Floats) -> JawSkin:
    """Return how the ``skin`` follows the jaw.

    Args:
        skin: Its topology.
        rest: The whole base mesh in centimetres, shape (N, 3).
        source: Offsets of the source's jawOpen on it, shape (N, 3).
    """
    control = rest[skin.base_ids]
    rings = mouth_rings(skin, control, _LIP_RINGS)
    x, y, z = control.T
    full = jaw_opening(control, jaw_hinge(rest))
    followed = np.einsum("ij,ij->i", source[skin.base_ids], full) / np.maximum((full**2).sum(axis=1), 0.01)
    inside = np.isin(np.arange(len(control)), np.unique(skin.quads[skin.in_mouth]))

    given = np.full(len(control), np.nan)
    given[(y > 71.3) | (z < 4.5)] = 0.0
    given[~inside & (y < 60.8)] = 0.0
    given[~inside & (y > 68.1) & (np.abs(x) < 1.9) & (z > 13.5)] = 0.0
    given[inside & ((y > 67.2) | (z < 6.5))] = 0.0
    given[inside & (y < 65.4) & (z > 11.0) & (np.abs(x) < 2.4)] = 1.0
    chin = ~inside & (y < 64.4) & (y > 61.6) & (z > np.interp(np.abs(x), [0.0, 2.0, 4.2], [13.3, 12.6, 10.8]))
    given[chin & (np.abs(x) < 4.2)] = 1.0
    ids, values = rings.spread(_lips(rings), _LIP_RINGS)
    given[ids] = values
    free = smoothest(skin, control, given[:, None], np.clip(followed, 0.0, 1.0)[:, None], _SOURCE)[:, 0]
    share = 0.5 * (free + free[skin.mirror])
    middle = control[skin.lip_contact].mean(axis=0)
    beside = np.linalg.norm((control - middle) * [0.55, 1.0, 0.45], axis=1)
    narrowing = (
        _NARROWER * (1.0 - ramp(0.6, _REACH, beside)) * np.minimum(np.abs(x) / np.abs(x[skin.lip_contact]).max(), 1.0)
    )
    return JawSkin(np.clip(share, 0.0, 1.0), narrowing)


def _lips(rings: MouthRings) -> Floats:
    """Return the share of each vertex of the loop of contact, shape (L,)."""
    s = rings.along
    return np.where(rings.lower, _CORNER + (_LOWER - _CORNER) * (1.0 - s**2.5), _UPPER + (_CORNER - _UPPER) * s**1.7)
