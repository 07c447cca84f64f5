"""The mouth of a head: lips that are closed, teeth and tongue behind them, and the motion of its jaw."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.falloff import ramp
from faceposer.identity.anatomy.jaw import OPENING, condyle, jaw_opening, jaw_rotation
from faceposer.identity.anatomy.lids import upper_and_lower
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
#: Radius around the lips, distance below them and width in which the mouth's lining is kept behind the chin, its
#: distance from the lips' contact, and its distance behind the chin, all in centimetres.
_CHIN, _LINING, _BEHIND_CHIN = (7.0, 0.5, 3.5), 0.8, 0.15
#: Motion below which a vertex is taken not to turn with the jaw, and distance from the hinge for the same, in
#: centimetres.
_STILL, _AT_HINGE = 1e-3, 1.0


@dataclass(frozen=True)
class Place:
    """Place of the inside of the mouth: reference point, size, and hinge of the jaw.

    Attributes:
        origin: Middle of the lips at the depth of their inner sides, shape (3,), in centimetres.
        scale: Size relative to the reference.
        hinge: Point of the jaw's hinge, shape (3,).
    """

    origin: Floats
    scale: float
    hinge: Floats


class MouthFit:
    """Mouth of a reference head, for fitting those of other heads of the same topology."""

    def __init__(self, template: HeadTemplate, skin: Floats, outer: Ints, opening: Floats) -> None:
        """Measure the reference's ``skin``, (N, 3), with visible vertices ``outer``, and its jawOpen, ``opening``."""
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
        below = contact[:, 1].mean() - skin[:, 1]
        middle_lips = contact.mean(axis=0)
        close = np.linalg.norm(skin - middle_lips, axis=1) < _CHIN[0]
        hidden = close & (below > _CHIN[1]) & (np.abs(skin[:, 0]) < _CHIN[2])
        hidden[outer] = False
        self._lining = np.flatnonzero(hidden & (cKDTree(contact).query(skin)[0] > _LINING))
        front = outer[close[outer] & (below[outer] > 0.0) & (skin[outer, 2] > middle_lips[2] - _CHIN[2])]
        self._chin = front
        self._gap = self.gaps(skin)
        self.closing = 1.0 - ramp(*_CLOSING, cKDTree(contact).query(skin)[0])
        self._reference = self.place(skin)
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

    def place(self, skin: Floats) -> Place:
        """Return the place of the inside of the mouth behind the lips of ``skin``, (N, 3)."""
        line, inner = float(skin[self._loop, 1].mean()), float(skin[list(_INNER_LIPS), 2].min())
        width = float(np.ptp(skin[self._loop, 0])) / self._width
        size = float(np.sqrt(skin[self._near].var(axis=0).sum())) / self._size
        middle = float(skin[self._loop, 0].mean())
        return Place(np.array([middle, line, inner]), 0.5 * (width + size), condyle_of(skin))

    def opening(self, skin: Floats, maps: Floats, place: Place) -> Floats:
        """Return the offsets of jawOpen of ``skin``, (N, 3), about the head's own hinge, with ``maps`` (N, 3, 3)."""
        turned = jaw_rotation(skin, self._turned, place.hinge) - skin
        opening: Floats = turned + np.einsum("nij,nj->ni", maps, self._rest_of_opening)
        return opening

    def lining_behind(self, skin: Floats, opening: Floats, closing: Floats) -> Floats:
        """Return mouthClose, ``closing`` (N, 3), with the mouth's lining behind the chin together with jawOpen."""
        posed = skin + opening + closing
        surface = LinearNDInterpolator(posed[self._chin, :2], posed[self._chin, 2])
        ahead = posed[self._lining, 2] - surface(posed[self._lining, :2]) + _BEHIND_CHIN
        result = closing.copy()
        result[self._lining, 2] -= np.nan_to_num(ahead).clip(min=0.0)
        return result

    def carry(self, points: Floats, place: Place) -> Floats:
        """Return ``points`` (n, 3) inside the reference's mouth at their ``place`` in another head."""
        carried: Floats = place.origin + place.scale * (points - self._reference.origin)
        return carried

    def carry_opening(self, opening: Floats, share: Floats, place: Place) -> Floats:
        """Return the offsets of jawOpen of parts inside the mouth.

        Args:
            opening: Their offsets in the reference, shape (n, 3).
            share: Share of the jaw's motion of each vertex, shape (n,).
            place: Place in the head.
        """
        # A rotation's offsets are affine in the point: only the hinge's relative position differs.
        hinge = self.carry(self._reference.hinge[None], place)
        offset = jaw_opening(hinge, place.hinge)
        carried: Floats = place.scale * opening + share[:, None] * offset
        return carried

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


def condyle_of(skin: Floats) -> Floats:
    """Return the point of the jaw's hinge in the head with ``skin``, (N, 3): the middle of the left condyle, (3,)."""
    left, right = skin[list(_BEFORE_EARS)]
    return condyle(0.5 * (left + right * [-1.0, 1.0, 1.0]))
