"""Contact of the lids with each other and with the eyeball.

Lid on lid: where the edges have passed each other by an angle o, seen from the centre of the eye, the upper lid turns
back by a share of o and the lower lid by the rest, so that they meet; the surrounding skin turns with them, by an angle
that decreases with distance. Lid on ball: skin in a direction d from the centre at a distance below the radius rho(d)
of sclera or cornea is pushed out along d; the surrounding skin follows.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.contact.displacement import Displacement, move_vertices
from faceposer.model.contact.eyeballs import Eyeball, Eyeballs
from faceposer.model.contact.lid_turning import (
    SPACING,
    TURN_REACH,
    Turning,
    attached_lashes,
    slices_of,
    upper_lid_share,
)
from faceposer.model.contact.lids import (
    LidEdges,
    azimuth_and_elevation,
    find_all_edges,
    skin_ids,
    skin_near_ball,
)
from faceposer.model.contact.lips import skin_samples, surface_distance, with_neighbours
from faceposer.model.contact.samples import SurfaceSamples
from faceposer.model.contact.spreading import NEGLIGIBLE, Spreading, fading, hinge

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]
Vertices = NDArray[np.floating]

# Clearances in radii of the ball: largest neutral clearance of skin that may touch the ball; clearances at which pushes
# begin to fade and have faded.
_TOUCHES, _FADES, _FADED = 0.8, 0.4, 0.8
# A sphere of radius R protrudes by s^2 / 6 R through a triangle with edges s, here the neutral edges times this factor.
_STRETCH = 3.0
# Start and margin of pushes, in radii of the ball.
_START, _MARGIN = 0.001, 0.018


@dataclass(frozen=True, eq=False)
class _Eye:
    """An eye with its surroundings.

    Attributes:
        ball: The eyeball.
        edges: Edges of the lids; None if there are none.
        distances: Distances of all vertices from the upper and the lower edge; None without edges.
        samples: Samples of the skin that may touch the ball.
        ids: Ids of the vertices that move with pushes, those of the samples first, shape (n,).
        spreading: Spreading of pushes of the samples' vertices over ``ids``.
        lashes: Vertex ids of lashes, and the index into ``ids`` of the vertex to which each is attached.
    """

    ball: Eyeball
    edges: LidEdges | None
    distances: list[Array] | None
    samples: SurfaceSamples
    ids: Ids
    spreading: Spreading
    lashes: tuple[Ids, Ids]

    @classmethod
    def of(cls, character: Character, ball: Eyeball, edges: LidEdges | None) -> Self:
        """Build the eye of the ``character`` with ``ball`` and the lids' ``edges``, if there are any."""
        distances = None
        if edges is not None:
            reach = 4.0 * ball.radius
            distances = [surface_distance(character, ids, reach) for ids in (edges.upper, edges.lower)]
        near = skin_near_ball(character, ball)
        clearance, _ = ball.clearance(character.vertices[near] - ball.centre)
        touches = np.isin(near, with_neighbours(character, near[clearance < _TOUCHES * ball.radius]))
        samples = skin_samples(character, near[touches])
        pushed = np.arange(int(touches.sum()))
        ids = np.concatenate([near[touches], near[~touches]])
        points = character.vertices[ids] - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        layer = upper_lid_share(distances, ids)
        fade = fading(ball.clearance(points)[0], _FADES * ball.radius, _FADED * ball.radius)
        outward = np.sign(ball.centre[0]) or 1.0
        spreading = Spreading.over(outward * azimuth / SPACING, elevation / SPACING, layer, fade, pushed)
        moving = np.concatenate([pushed, np.setdiff1d(spreading.support, pushed)])
        lashes = attached_lashes(character, ball, edges, ids[moving])
        return cls(ball, edges, distances, samples, ids[moving], spreading.restricted(moving), lashes)


class LidContact:
    """Contact that keeps the lids of some eyes off the balls and apart.

    The surroundings of the eyes have no vertices in common, so that all eyes are corrected together.
    """

    def __init__(self, character: Character, eyes: Sequence[_Eye]) -> None:
        """Precompute the contact of the ``eyes`` of ``character``."""
        self._balls = Eyeballs([eye.ball for eye in eyes], character.vertices)
        edged = [
            (number, eye.ball, eye.edges, eye.distances)
            for number, eye in enumerate(eyes)
            if eye.edges is not None and eye.distances is not None
        ]
        self._turning = Turning(character, edged) if edged else None
        self._samples = SurfaceSamples.concatenated([eye.samples for eye in eyes])
        numbers = np.arange(len(eyes))
        vertices = np.repeat(numbers, [len(eye.samples.ids) for eye in eyes])
        between = np.repeat(numbers, [eye.samples.corners.shape[1] for eye in eyes])
        self._eye_of_sample = np.concatenate([vertices, between])
        self._runs = slices_of([len(eye.samples.ids) for eye in eyes])
        radii = self._balls.radii.take(vertices)
        self._radii = self._balls.radii.astype(np.float32)
        self._near = ((_STRETCH * self._samples.spans) ** 2 / (6.0 * radii)).astype(np.float32)
        widest = np.array([eye.ball.profile.max() for eye in eyes]).take(vertices)
        self._far = ((widest + self._near) ** 2).astype(np.float32)
        at_rest = self._samples.places(character.vertices).T.astype(np.float32)
        at_rest -= (
            np.stack([eye.ball.centre for eye in eyes], axis=1).astype(np.float32).take(self._eye_of_sample, axis=1)
        )
        self._allowed = np.maximum(-self._balls.clearance(at_rest, self._eye_of_sample), 0.0)
        self._spreading = Spreading.block_diagonal([eye.spreading for eye in eyes])
        self._ids = np.concatenate([eye.ids for eye in eyes])
        self._eye_of_id = np.repeat(numbers, [len(eye.ids) for eye in eyes])
        first = np.cumsum([0, *(len(eye.ids) for eye in eyes)])
        # Indices of the samples' vertices among those that move.
        self._own = np.concatenate([first[i] + np.arange(len(eye.samples.ids)) for i, eye in enumerate(eyes)])
        self._lashes = np.concatenate([eye.lashes[0] for eye in eyes])
        self._roots = np.concatenate([first[i] + eye.lashes[1] for i, eye in enumerate(eyes)])
        self._at_rest = character.vertices[self._samples.ids]
        self._negligible = NEGLIGIBLE * character.height

    def apply(self, vertices: Singles) -> Iterator[Displacement]:
        """Correct the pose ``vertices``, shape (N, 3), in place."""
        balls = self._balls
        linear, centres, moving = balls.motion_of(vertices.take(balls.witnesses, axis=0))
        eyes_move = bool(moving.any())
        if self._turning is not None:
            yield from self._turning.apply(vertices, centres, eyes_move)
        places = vertices.take(self._samples.ids, axis=0)
        if not eyes_move and np.array_equal(places, self._at_rest):
            return
        back: Array = np.asarray(np.linalg.inv(linear), dtype=np.float64)
        rows = np.ascontiguousarray(places.T)
        turns, shifts = back.astype(np.float32), -np.einsum("eij,ej->ei", back, centres).astype(np.float32)
        near = self._may_touch(rows, turns, shifts)
        if not moving.all():
            moved = (places.take(near, axis=0) != self._at_rest.take(near, axis=0)).any(axis=1)
            near = near[moved | moving.take(self._eye_of_sample.take(near))]
        if not len(near):
            return

        def pushes(points: Singles, numbers: Ids) -> Singles:
            eyes = self._eye_of_sample.take(numbers)
            resting = np.einsum("nij,jn->in", turns.take(eyes, axis=0), points) + shifts.T.take(eyes, axis=1)
            depth = -balls.clearance(resting, eyes) - self._allowed.take(numbers)
            radius = self._radii.take(eyes)
            return hinge(depth, _START * radius, _MARGIN * radius)

        push = self._samples.vertex_maxima(rows, near, pushes)
        if push.max() <= self._negligible:
            return
        field = self._spreading(push)
        field[self._own] = np.maximum(field.take(self._own), push)
        pushed = np.flatnonzero(field)
        ids, eyes = self._ids.take(pushed), self._eye_of_id.take(pushed)
        before = vertices.take(ids, axis=0)
        points = before - centres.take(eyes, axis=0)
        x, y, z = np.einsum("nij,nj->in", back.take(eyes, axis=0), points)
        move = points.T * (field.take(pushed) / np.maximum(np.sqrt(x * x + y * y + z * z), 1e-9))
        yield move_vertices(vertices, ids, before, move)
        if len(self._lashes):
            whole = np.zeros((3, len(field)))
            whole[:, pushed] = move
            yield move_vertices(
                vertices, self._lashes, vertices.take(self._lashes, axis=0), whole.take(self._roots, axis=1)
            )

    def _may_touch(self, rows: Singles, turns: Singles, shifts: Singles) -> Ids:
        """Return the indices of the samples' vertices that may touch their ball, (n,).

        Args:
            rows: Posed positions of the vertices by coordinate, shape (3, V).
            turns: Linear part of the maps from the pose to the balls at rest, shape (E, 3, 3).
            shifts: Translations of these maps, shape (E, 3).
        """
        resting = np.empty_like(rows)
        for run, turn, shift in zip(self._runs, turns, shifts, strict=True):
            resting[:, run] = turn @ rows[:, run] + shift[:, None]
        x, y, z = resting
        close = np.flatnonzero(x * x + y * y + z * z < self._far)
        clearance = self._balls.clearance(resting.take(close, axis=1), self._eye_of_sample.take(close))
        near: Ids = close[clearance < self._near.take(close)]
        return near


def lid_contacts(character: Character, balls: list[Eyeball]) -> list[LidContact]:
    """Return the contacts of the lids with those of ``balls`` that have skin in front of them.

    Eyes with common vertices in their surroundings are corrected one after another, all others together.
    """
    eyes = [
        _Eye.of(character, ball, edges)
        for ball, edges in zip(balls, find_all_edges(character, balls), strict=True)
        if len(skin_near_ball(character, ball))
    ]
    groups: list[list[_Eye]] = []
    for eye in eyes:
        own = _surroundings(character, eye)
        if groups and not any(np.isin(own, _surroundings(character, other)).any() for other in groups[-1]):
            groups[-1].append(eye)
        else:
            groups.append([eye])
    return [LidContact(character, group) for group in groups]


def _surroundings(character: Character, eye: _Eye) -> Ids:
    """Return all vertices that the contact of the ``eye`` reads or moves."""
    skin = skin_ids(character)
    turning = np.zeros(0, dtype=np.intp)
    if eye.distances is not None:
        turning = skin[np.minimum(*eye.distances)[skin] < TURN_REACH * eye.ball.radius]
    return np.concatenate([eye.samples.ids, eye.ids, eye.lashes[0], turning])
