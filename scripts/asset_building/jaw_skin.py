"""Motion of the skin with the opening lower jaw.

The skin over the rigid mandible rotates with it, and the skull's skin does not move; between them, each vertex rotates
by a share of the jaw's angle. The shares are the smoothest function on the mesh (`smoothest`) with given values on
chin, lips and skull, pulled weakly to the shares of the source's skin elsewhere. The corners of the mouth approach each
other, so that the lips keep about their length.
"""

from dataclasses import dataclass

import numpy as np

from faceposer.identity.anatomy.falloff import ramp
from faceposer.identity.anatomy.jaw import OPENING, jaw_opening, jaw_rotation
from scripts.asset_building.head import Skin
from scripts.asset_building.mouth import jaw_hinge
from scripts.asset_building.mouth_rings import MouthRings, mouth_rings
from scripts.asset_building.piece import Floats
from scripts.asset_building.smoothest import smoothest

#: Share of the jaw's rotation at the corners of the mouth, in the middle of the upper lip and of the lower lip.
_CORNER, _UPPER, _LOWER = 0.145, 0.02, 0.97
#: Number of rings around the lips' contact that form the lips, with rigid sections.
_LIP_RINGS = 4
#: Narrowing of the mouth at full opening, and its range in centimetres, with factors on the distance.
_NARROWER, _REACH, _MOUTH_FORM = 0.2, 2.6, (0.55, 1.0, 0.45)
#: Weight of the source's shares relative to smoothness, for free vertices.
_SOURCE = 4e-4


@dataclass(frozen=True)
class JawSkin:
    """Shares of the jaw's motion of the skin's control vertices.

    Attributes:
        share: Share of the jaw's rotation, shape (C,).
        narrowing: Relative reduction of x at full opening, shape (C,).
    """

    share: Floats
    narrowing: Floats

    def opening(self, control: Floats, hinge: Floats) -> Floats:
        """Return the offsets of jawOpen of the skin's ``control`` vertices, shape (C, 3), on a head with this hinge."""
        offsets = jaw_rotation(control, OPENING * self.share, hinge) - control
        offsets[:, 0] -= self.narrowing * control[:, 0]
        return offsets


def jaw_skin(skin: Skin, rest: Floats, source: Floats) -> JawSkin:
    """Return the shares of the jaw's motion on the ``skin``.

    Args:
        skin: Its topology.
        rest: The whole base mesh in centimetres, shape (N, 3).
        source: Offsets of the source's jawOpen on it, shape (N, 3).
    """
    control = rest[skin.base_ids]
    full = jaw_opening(control, jaw_hinge(rest))
    followed = np.einsum("ij,ij->i", source[skin.base_ids], full) / np.maximum((full**2).sum(axis=1), 0.01)
    given = _given(skin, control)[:, None]
    free = smoothest(skin, control, given, np.clip(followed, 0.0, 1.0)[:, None], _SOURCE)[:, 0]
    share = 0.5 * (free + free[skin.mirror])
    lips = control[skin.lip_contact]
    beside = np.linalg.norm((control - lips.mean(axis=0)) * _MOUTH_FORM, axis=1)
    along = np.minimum(np.abs(control[:, 0]) / lips[:, 0].max(), 1.0)
    return JawSkin(np.clip(share, 0.0, 1.0), _NARROWER * along * (1.0 - ramp(0.6, _REACH, beside)))


def _given(skin: Skin, control: Floats) -> Floats:
    """Return the given shares, NaN elsewhere, shape (C,), by positions on the base mesh ``control``, (C, 3)."""
    rings = mouth_rings(skin, control, _LIP_RINGS)
    x, y, z = np.abs(control[:, 0]), control[:, 1], control[:, 2]
    inside = np.isin(np.arange(len(control)), np.unique(skin.quads[skin.in_mouth]))
    given = np.full(len(control), np.nan)
    # The skull above the cheekbones and behind the ears, the neck, the nose.
    given[(y > 71.3) | (z < 4.5) | (~inside & (y < 60.8))] = 0.0
    given[~inside & (y > 68.1) & (x < 1.9) & (z > 13.5)] = 0.0
    # Palate and throat, and the skin on the mandible behind the lower lip.
    given[inside & ((y > 67.2) | (z < 6.5))] = 0.0
    given[inside & (y < 65.4) & (z > 11.0) & (x < 2.4)] = 1.0
    # The chin, along the mandible as far as the corners of the mouth and beyond.
    front = z > np.interp(x, [0.0, 2.0, 4.2], [13.3, 12.6, 10.8])
    given[~inside & (y < 64.4) & (y > 61.6) & (x < 4.2) & front] = 1.0
    ids, values = rings.spread(_lips(rings), _LIP_RINGS)
    given[ids] = values
    return given


def _lips(rings: MouthRings) -> Floats:
    """Return the share of each vertex of the loop of contact, shape (L,)."""
    s = rings.along
    return np.where(rings.lower, _CORNER + (_LOWER - _CORNER) * (1.0 - s**2.5), _UPPER + (_CORNER - _UPPER) * s**1.7)
