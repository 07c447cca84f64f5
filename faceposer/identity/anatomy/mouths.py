"""The mouth of a head: lips that are closed, teeth and tongue behind them, and the motion of its jaw."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.cavity import Cavity
from faceposer.identity.anatomy.falloff import ramp
from faceposer.identity.anatomy.jaw import OPENING, condyle, jaw_opening, jaw_rotation
from faceposer.identity.anatomy.lids import upper_and_lower
from faceposer.identity.anatomy.lining import Lining
from faceposer.identity.anatomy.loops import edge_loop, faces_at_edges, fine_loop
from faceposer.identity.template import HeadTemplate

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

#: Vertices of the skin in the middle of the loop where the lips touch, in the middle of the inner sides of both lips,
#: and in front of the ears.
_LIP_CONTACT, _INNER_LIPS, _BEFORE_EARS = 474, (554, 537, 520, 557, 574), (4277, 2171)
#: Distance from the contact of the lips in which their closing moves skin, in centimetres.
_LIP_REACH = 0.45
#: Shares of the lips' width at both ends over which closing fades in, since their contact folds there, and overlap of
#: the lips along their contact, relative to the reference's, which remains since the lips hide it, in centimetres.
_ENDS, _HIDDEN_OVERLAP = (0.15, 0.35), 0.1
#: Distances from the lips over which mouthClose undoes what is particular to the head's jaw, in centimetres.
_CLOSING = (1.0, 2.8)
#: Radius around the mouth in which the size of the face determines that of the teeth, in centimetres.
_AROUND = 5.0
#: Distance behind the upper incisors at which the rise of the rows of teeth levels off, that of the incisors behind the
#: inner side of the lips, and the slope of the reference's gums towards the back.
_LEVELS_OFF, _BEHIND_LIPS, _SLOPE = 1.6, 0.16, 0.14
#: Rise that is left out, since lips cover so much more of the gums, and the greatest one, in reference centimetres.
_COVERED, _GREATEST_RISE = 0.1, 0.5
#: Motion below which a vertex is taken not to turn with the jaw, and distance from the hinge for the same, in
#: centimetres.
_STILL, _AT_HINGE = 1e-3, 1.0


@dataclass(frozen=True)
class Place:
    """Place of the inside of the mouth: reference point, size, hinge of the jaw, and rise of the back teeth.

    Attributes:
        origin: Middle of the lips at the depth of their inner sides, shape (3,), in centimetres.
        scale: Size relative to the reference.
        hinge: Point of the jaw's hinge, shape (3,).
        rise: Height of the back teeth over the incisors, beyond the reference's, in centimetres of the reference.
    """

    origin: Floats
    scale: float
    hinge: Floats
    rise: float = 0.0


class MouthFit:
    """Mouth of a reference head, for fitting those of other heads of the same topology."""

    def __init__(self, template: HeadTemplate, skin: Floats, outer: Ints, opening: Floats, smile: Floats) -> None:
        """Measure the reference's ``skin``, (N, 3), with visible vertices ``outer``, and its shapes.

        Args:
            template: Topology of the skin.
            skin: The reference's skin, shape (N, 3).
            outer: Its visible vertices.
            opening: Offsets of jawOpen, shape (N, 3).
            smile: Sum of the offsets of mouthSmileLeft and mouthSmileRight, shape (N, 3).
        """
        faces_at = faces_at_edges(template.control_quads, range(len(template.control_quads)))
        contact_ids = np.array(edge_loop(faces_at, template.rest, _LIP_CONTACT), dtype=np.int32)
        self._loop = fine_loop(template.fine, contact_ids)
        self._upper, self._lower = upper_and_lower(template.rest, self._loop, "Left")
        contact = skin[self._loop]
        self._near = np.flatnonzero(np.linalg.norm(skin - contact.mean(axis=0) * [0, 1, 1], axis=1) < _AROUND)
        self._width = float(np.ptp(contact[:, 0]))
        self._size = float(np.sqrt(skin[self._near].var(axis=0).sum()))
        away, nearest = cKDTree(contact).query(skin, distance_upper_bound=3.0 * _LIP_REACH)
        self._moved = np.flatnonzero(np.isfinite(away)).astype(np.int32)
        self._contact_of = self._loop[nearest[self._moved]]
        self._fade = np.exp(-((away[self._moved] / _LIP_REACH) ** 2))
        middle = 0.5 * (self._line(skin, self._upper) + self._line(skin, self._lower))
        height = np.interp(self._along(skin, self._moved), _SAMPLES, middle)
        self._towards = np.where(skin[self._moved, 1] > height, -0.5, 0.5)
        on_upper = np.isin(self._moved, self._upper[1:-1])
        on_lower = np.isin(self._moved, self._lower[1:-1])
        self._towards[on_upper], self._towards[on_lower] = -0.5, 0.5
        self.lining = Lining(template, skin, outer, self._loop)
        self.cavity = Cavity(template, skin, self._loop)
        self._gap = self.gaps(skin)
        self.closing = 1.0 - ramp(*_CLOSING, cKDTree(contact).query(skin)[0])
        self._corners = self._upper[[0, -1]]
        self._corners_smile = smile[self._corners]
        self._reference = self._seat(skin)
        self._smiling = self._smiling_corners(skin, np.broadcast_to(np.eye(3), (len(skin), 3, 3)), self._reference)
        hinge = self._reference.hinge
        # The share of the jaw's rotation of each vertex, and the rest of its motion.
        from_hinge, moved = skin - hinge, skin - hinge + opening
        cross = from_hinge[:, 1] * moved[:, 2] - from_hinge[:, 2] * moved[:, 1]
        dot = from_hinge[:, 1] * moved[:, 1] + from_hinge[:, 2] * moved[:, 2]
        turned = np.degrees(np.arctan2(cross, dot))
        far = (np.linalg.norm(opening, axis=1) > _STILL) & (np.hypot(from_hinge[:, 1], from_hinge[:, 2]) > _AT_HINGE)
        self._turned = np.where(far, np.clip(turned, 0.0, OPENING), 0.0)
        self._rest_of_opening = opening - (jaw_rotation(skin, self._turned, hinge) - skin)

    def gaps(self, skin: Floats) -> Floats:
        """Return the height of the upper lip over the lower one along their contact in ``skin``, (N, 3), (81,)."""
        return self._line(skin, self._upper) - self._line(skin, self._lower)

    def close_lips(self, skin: Floats) -> Floats:
        """Return ``skin`` (N, 3) with lips that are nowhere further apart than the reference's, nor overlap much."""
        scale = float(np.ptp(skin[self._loop, 0])) / self._width
        gap = self.gaps(skin) - scale * self._gap
        excess = gap - np.clip(gap, -scale * _HIDDEN_OVERLAP, 0.0)
        excess *= ramp(*_ENDS, np.minimum(_SAMPLES, 1.0 - _SAMPLES))
        result = skin.copy()
        amount = np.interp(self._along(skin, self._contact_of), _SAMPLES, excess)
        result[self._moved, 1] += self._towards * self._fade * amount
        return result

    def place(self, skin: Floats, maps: Floats) -> Place:
        """Return the place of the inside of the mouth behind the lips of ``skin``, (N, 3), with ``maps`` (N, 3, 3).

        The higher the corners of the mouth in a smile, the more the rows of teeth rise towards the back, so that the
        smile shows the crowns at its sides and not the gums: the edges of the upper teeth are parallel to the lower lip
        then, as in most people (D. M. Sarver, "The importance of incisor positioning in the esthetic smile: the smile
        arc", 2001).
        """
        seat = self._seat(skin)
        higher = self._smiling_corners(skin, maps, seat) - self._smiling
        excess = higher[1] + _SLOPE * higher[2]
        behind = self._behind_incisors(self._smiling + higher)
        rise = float(np.clip(excess / np.maximum(_levelling(behind), 0.3) - _COVERED, 0.0, _GREATEST_RISE))
        return replace(seat, rise=rise)

    def _seat(self, skin: Floats) -> Place:
        line, inner = float(skin[self._loop, 1].mean()), float(skin[list(_INNER_LIPS), 2].min())
        width = float(np.ptp(skin[self._loop, 0])) / self._width
        size = float(np.sqrt(skin[self._near].var(axis=0).sum())) / self._size
        middle = float(skin[self._loop, 0].mean())
        return Place(np.array([middle, line, inner]), 0.5 * (width + size), condyle_of(skin))

    def _smiling_corners(self, skin: Floats, maps: Floats, seat: Place) -> Floats:
        """Return the mean of the corners of the smiling mouth relative to the lips, (3,), in reference centimetres."""
        smile = np.einsum("nij,nj->ni", maps[self._corners], self._corners_smile)
        corners: Floats = (skin[self._corners] + smile - seat.origin).mean(axis=0) / seat.scale
        return corners

    def _behind_incisors(self, relative: Floats) -> Floats:
        """Return the depth behind the upper incisors' edges of points ``relative`` (..., 3) to the lips."""
        return -_BEHIND_LIPS - relative[..., 2]

    def opening(self, skin: Floats, maps: Floats, place: Place) -> Floats:
        """Return the offsets of jawOpen of ``skin``, (N, 3), about the head's own hinge, with ``maps`` (N, 3, 3)."""
        turned = jaw_rotation(skin, self._turned, place.hinge) - skin
        opening: Floats = turned + np.einsum("nij,nj->ni", maps, self._rest_of_opening)
        return opening

    def carry(self, points: Floats, place: Place) -> Floats:
        """Return ``points`` (n, 3) inside the reference's mouth at their ``place`` in another head."""
        carried: Floats = place.origin + place.scale * (points - self._reference.origin + self._risen(points, place))
        return carried

    def carry_opening(self, points: Floats, opening: Floats, share: Floats, place: Place) -> Floats:
        """Return the offsets of jawOpen of parts inside the mouth.

        Args:
            points: Their positions in the reference, shape (n, 3).
            opening: Their offsets there, shape (n, 3).
            share: Share of the jaw's motion of each vertex, shape (n,).
            place: Place in the head.
        """
        # A rotation's offsets are affine in the point: only what is added to the points, and the hinge's relative
        # position, differ.
        hinge = self.carry(self._reference.hinge[None], replace(place, rise=0.0))
        offset = jaw_opening(hinge, place.hinge) + place.scale * jaw_opening(self._risen(points, place), np.zeros(3))
        carried: Floats = place.scale * opening + share[:, None] * offset
        return carried

    def _risen(self, points: Floats, place: Place) -> Floats:
        """Return how far ``points`` (n, 3) in the reference's mouth rise with the back teeth, (n, 3)."""
        risen = np.zeros_like(points)
        risen[:, 1] = place.rise * _levelling(self._behind_incisors(points - self._reference.origin))
        return risen

    def _along(self, skin: Floats, ids: Ints) -> Floats:
        """Return the positions of vertices along the lips, 0 to 1 from the right corner to the left one."""
        x = skin[self._loop, 0]
        along: Floats = np.clip((skin[ids, 0] - x.min()) / np.ptp(x), 0.0, 1.0)
        return along

    def _line(self, skin: Floats, half: Ints) -> Floats:
        """Return the height of one ``half`` of the loop of contact along the lips."""
        order = half[np.argsort(skin[half, 0])]
        return np.interp(_SAMPLES, self._along(skin, order), skin[order, 1])


_SAMPLES = np.linspace(0.0, 1.0, 81)


def _levelling(behind: Floats) -> Floats:
    """Return the share of the rise at depths ``behind`` the incisors: linear at first, then level."""
    t = np.maximum(behind, 0.0) / _LEVELS_OFF
    share: Floats = t / (1.0 + t**4) ** 0.25
    return share


def condyle_of(skin: Floats) -> Floats:
    """Return the point of the jaw's hinge in the head with ``skin``, (N, 3): the middle of the left condyle, (3,)."""
    left, right = skin[list(_BEFORE_EARS)]
    return condyle(0.5 * (left + right * [-1.0, 1.0, 1.0]))
