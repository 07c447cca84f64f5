"""The eyes of a head: eyeballs that fit its lids, lids that fit the eyeballs, and blinks that close."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.eyeballs import place_eye, surface_radius
from faceposer.identity.anatomy.falloff import ramp
from faceposer.identity.anatomy.lids import gaze_lids, keep_clear, tuck_socket, upper_and_lower
from faceposer.identity.anatomy.loops import (
    LASH_RING,
    LID_RINGS,
    SOCKET_RINGS,
    among,
    fine_loop,
    ordered_ring,
    rings,
)
from faceposer.identity.template import HeadTemplate

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

#: Vertices of the control mesh at the backs of the sockets.
_SOCKETS = {"Left": 3456, "Right": 1328}
#: Weight of the eyeball's place relative to the lids as in the reference, sideways, vertically and in depth.
_AS_REFERENCE = (10.0, 10.0, 0.1)
#: Largest difference of the lids' distance from the ball to that in the reference, in radii; excess is removed.
_LOOSE = 0.06
#: Distance from the lids' edges over which their corrections fade out, in centimetres.
_FADES = 1.1
#: Least distance of skin in front of the ball from it, in radii, except where the lids touch it.
_BEFORE = 0.02
#: Least and greatest overlap of closed lids in radians, as seen from the eye's centre, unless the reference's have less
#: or more, and number of vertices over which corrections are averaged.
_OVERLAP, _PRESSED, _EVENED = 0.008, 0.034, 1.0
#: Number of times that a blink is closed and kept off the ball.
_ROUNDS = 2
#: Share of the upper lid in corrections of a blink.
_UPPER = 0.8


@dataclass(frozen=True)
class Ball:
    """An eyeball: centre, shape (3,), and radius, in centimetres."""

    centre: Floats
    radius: float


class EyeFit:
    """One eye of a reference head, for fitting those of other heads of the same topology.

    Attributes:
        side: "Left" or "Right".
        ball: The reference's eyeball.
        ring: The closed loop of vertices that the lashes grow from, in order.
        halves: Its upper and its lower half, each from the inner to the outer corner.
        lid: Control vertices around it.
    """

    def __init__(self, side: str, template: HeadTemplate, skin: Floats, blink: Floats, ball: Ball) -> None:
        """Measure the reference's ``skin``, (N, 3), with its shape ``blink``, (N, 3), and eyeball ``ball``."""
        start = _SOCKETS[side]
        around = rings(template.control_quads, start, LASH_RING + 6)
        loop = ordered_ring(template.control_quads, around[LASH_RING])
        self.side, self.ball = side, ball
        self.ring = fine_loop(template.fine, loop)
        # The same vertices on each head, wherever its corners are: they are rows of the lashes' mesh.
        self.halves = upper_and_lower(template.rest, self.ring, side)
        self.lid = np.concatenate(around[LASH_RING - 2 : LASH_RING + 4])
        self._socket = among(template.fine, np.concatenate(around[: SOCKET_RINGS + 1]))
        self._edges = np.concatenate(around[LASH_RING - 1 : LASH_RING + 1])
        self._corners = loop[[skin[loop, 0].argmin(), skin[loop, 0].argmax()]]
        margin = among(template.fine, np.concatenate([around[k] for k in LID_RINGS]))
        inside = among(template.fine, np.concatenate(around[: LASH_RING + 1]))
        self._rest_lids = skin[self._edges]
        self._width = float(np.linalg.norm(np.diff(skin[self._corners], axis=0)))
        self._share = np.linalg.norm(skin[self._edges] - ball.centre, axis=1) / ball.radius
        # The inner edges of the lids are placed relative to the outer ones, as in the reference.
        self._inner = np.setdiff1d(margin, self.ring)
        away, self._outer = cKDTree(skin[self.ring]).query(skin[self._inner], k=3)
        self._nearness = 1.0 / (away + 0.01)
        self._nearness /= self._nearness.sum(axis=1, keepdims=True)
        self._behind = self._relative(skin, ball)
        self._behind_closed = self._relative(skin + blink, ball)
        self._ring_share = np.linalg.norm(skin[self.ring] - ball.centre, axis=1) / ball.radius
        # The skin around the lids follows the corrections of its nearest places on them.
        away, nearest = cKDTree(skin[self.ring]).query(skin, k=4, distance_upper_bound=_FADES)
        near = np.flatnonzero(np.isfinite(away).all(axis=1))
        near = np.setdiff1d(near, inside)
        self._around = near
        weight = 1.0 / (away[near] + 0.02)
        self._follow = (
            nearest[near],
            weight / weight.sum(axis=1, keepdims=True) * (1.0 - ramp(0.0, _FADES, away[near].min(axis=1)))[:, None],
        )
        self._before = np.setdiff1d(
            np.flatnonzero(
                (np.linalg.norm(skin - ball.centre, axis=1) < 2.0 * ball.radius) & (skin[:, 2] > ball.centre[2])
            ),
            inside,
        )
        gaps = self._gaps(skin, blink, ball.centre)
        self._most_pressed, self._least_pressed = np.minimum(gaps, -_PRESSED), np.maximum(gaps, -_OVERLAP)
        away, nearest = cKDTree(skin[self.ring]).query(skin, distance_upper_bound=_FADES)
        self._blinking = np.setdiff1d(np.flatnonzero(np.isfinite(away)), self._socket)
        self._on_ring = nearest[self._blinking]
        self._fade = 1.0 - ramp(0.35, _FADES, away[self._blinking])

    def place(self, skin: Floats) -> Ball:
        """Return the eyeball that fits the lids of ``skin``, (N, 3).

        Its radius is in proportion to the width between the corners of the eye; its centre, the one for which the
        lids' edges are at the same distances from the ball as in the reference (least squares), is held where the
        similarity transformation of the lids takes the reference's.
        """
        lids = skin[self._edges]
        radius = self.ball.radius * float(np.linalg.norm(np.diff(skin[self._corners], axis=0))) / self._width
        expected, _ = place_eye(self._rest_lids, lids, self.ball.centre)
        centre, hold = expected, np.diag(_AS_REFERENCE)
        for _ in range(6):
            away = lids - centre
            distance = np.linalg.norm(away, axis=1)
            slope = away / distance[:, None]
            residual = distance - self._share * radius
            centre = centre + np.linalg.solve(slope.T @ slope + hold, slope.T @ residual - hold @ (centre - expected))
        return Ball(centre, radius)

    def fit_lids(self, skin: Floats, ball: Ball) -> Floats:
        """Return ``skin`` (N, 3) with its lids at about the reference's distances from ``ball``, and no skin inside."""
        result = skin.copy()
        away = skin[self.ring] - ball.centre
        distance = np.linalg.norm(away, axis=1)
        lack = self._ring_share * ball.radius - distance
        excess = lack - np.clip(lack, -_LOOSE * ball.radius, _LOOSE * ball.radius)
        moves = (excess / distance)[:, None] * away
        result[self.ring] += moves
        result[self._inner] = self._inside(result, self._behind, ball)
        nearest, weight = self._follow
        result[self._around] += np.einsum("nk,nkd->nd", weight, moves[nearest])
        away = result[self._before] - ball.centre
        distance = np.linalg.norm(away, axis=1)
        angle = np.degrees(np.arccos(np.clip(away[:, 2] / distance, -1.0, 1.0)))
        inside = np.maximum((surface_radius(angle) + _BEFORE) * ball.radius - distance, 0.0)
        result[self._before] += (inside / distance)[:, None] * away
        return tuck_socket(result, self._socket, ball.centre, ball.radius)

    def fit_shapes(self, skin: Floats, shapes: Floats, names: tuple[str, ...], ball: Ball) -> Floats:
        """Return ``shapes`` (S, N, 3) of ``skin`` with a blink that closes and lids that follow the gaze."""
        result = shapes.copy()
        blink = names.index(f"eyeBlink{self.side}")
        for action, offsets in gaze_lids(skin, self.ring, ball.centre).items():
            result[names.index(f"eye{action}{self.side}")] = offsets
        result = keep_clear(skin, result, self._socket, ball.centre, ball.radius)
        # What keeps a half closed lid off the ball also moves the closed one.
        for _ in range(_ROUNDS):
            closed = self.closed(skin, result[blink], ball)
            result[blink] = keep_clear(skin, closed[None], self._socket, ball.centre, ball.radius)[0]
        result[blink] = self.closed(skin, result[blink], ball)
        return result

    def closed(self, skin: Floats, blink: Floats, ball: Ball) -> Floats:
        """Return the shape ``blink`` (N, 3) of ``skin``, turned about the eye so that the lids' edges just overlap."""
        result = blink.copy()
        is_upper = np.isin(self.ring, self.halves[0][1:-1])
        share = np.where(is_upper, -_UPPER, 1.0 - _UPPER)
        for _ in range(3):
            gap = self._gaps(skin, result, ball.centre)
            turn = gap - np.clip(gap, self._most_pressed, self._least_pressed)
            angle = share * gaussian_filter1d(turn, _EVENED, mode="wrap")
            moved = skin[self._blinking] + result[self._blinking]
            turned = _raised(moved, ball.centre, self._fade * angle[self._on_ring])
            result[self._blinking] += turned - moved
        result[self._inner] = self._inside(skin + result, self._behind_closed, ball) - skin[self._inner]
        return result

    def _relative(self, vertices: Floats, ball: Ball) -> Floats:
        """Return the inner edges relative to the outer ones as azimuth, elevation and distance in radii, (n, 3)."""
        outer = _polar(vertices[self.ring], ball)
        relative: Floats = _polar(vertices[self._inner], ball) - np.einsum(
            "nk,nkd->nd", self._nearness, outer[self._outer]
        )
        return relative

    def _inside(self, vertices: Floats, relative: Floats, ball: Ball) -> Floats:
        """Return the places of the inner edges, (n, 3), from the outer ones of ``vertices``; see `_relative`."""
        outer = _polar(vertices[self.ring], ball)
        azimuth, elevation, distance = (np.einsum("nk,nkd->nd", self._nearness, outer[self._outer]) + relative).T
        level = np.cos(elevation)
        direction = np.stack([level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)], axis=1)
        places: Floats = ball.centre + ball.radius * distance[:, None] * direction
        return places

    def _gaps(self, skin: Floats, blink: Floats, centre: Floats) -> Floats:
        """Return the angle between the edges of the closed lids at each vertex of the ring, in radians, shape (n,)."""
        places = _polar(skin[self.ring] + blink[self.ring], Ball(centre, 1.0))[:, :2]
        by_vertex = dict(zip(self.ring.tolist(), places.tolist(), strict=True))
        above, below = (np.array(sorted(by_vertex[vertex] for vertex in half.tolist())).T for half in self.halves)
        gaps: Floats = np.interp(places[:, 0], *above) - np.interp(places[:, 0], *below)
        return gaps


def _polar(points: Floats, ball: Ball) -> Floats:
    """Return ``points`` (n, 3) as azimuth and elevation in radians and distance from the centre in radii, (n, 3)."""
    x, y, z = (points - ball.centre).T / ball.radius
    return np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z)), np.sqrt(x * x + y * y + z * z)], axis=1)


def _raised(points: Floats, centre: Floats, angle: Floats) -> Floats:
    """Return ``points`` (n, 3) raised by ``angle``, (n,), in radians, as seen from ``centre``."""
    away = points - centre
    level = np.maximum(np.hypot(away[:, 0], away[:, 2]), 1e-9)
    cosine, sine = np.cos(angle), np.sin(angle)
    flat = cosine * level - sine * away[:, 1]
    raised = np.stack(
        [away[:, 0] * flat / level, sine * level + cosine * away[:, 1], away[:, 2] * flat / level], axis=1
    )
    return centre + raised
