"""Eyeballs: a sphere with a cornea, found in the eye parts of a character."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.contact.frames import AffineFrame, moves_affinely

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]

# Number of steps of a profile over the cosine of the angle to the gaze axis, and of its measurement over that angle.
_STEPS, _ANGLES = 400, 90
# Least height of a cornea over the sphere, as a share of the radius, and cosine of the angle from which the surface
# counts as sclera.
_BULGE = 0.005
_SCLERA_COSINE = 0.6
#: Spheres with centres closer than this share of the smaller radius are shells of one eyeball.
CONCENTRIC = 0.35


@dataclass(frozen=True, eq=False)
class Eyeball:
    """An eyeball at rest as a surface of revolution about the gaze axis.

    Attributes:
        frame: Motion of the eyeball.
        centre: Centre of the sclera's sphere, shape (3,).
        radius: Radius of that sphere.
        axis: Unit vector through the cornea, shape (3,).
        profile: Greatest radius at ``_STEPS`` + 1 equal steps of the cosine of the angle to the axis, from -1 to 1.
    """

    frame: AffineFrame
    centre: Array
    radius: float
    axis: Array
    profile: Array

    def motion(self, vertices: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return the linear part, (3, 3), of the motion in the pose ``vertices``, (N, 3), and the centre, (3,)."""
        return self.motion_of(vertices.take(self.frame.witnesses, axis=0))

    def motion_of(self, places: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return the same, given the positions ``places`` of the frame's witnesses, (w, 3)."""
        linear, moved = self.frame.motion_of(places)
        return linear, moved + linear @ (self.centre - self.frame.origin)

    def clearance(self, relative: Array) -> tuple[Array, Array]:
        """Return the clearance of points at rest, and their distances from the centre, shape (n,) each.

        Args:
            relative: Positions relative to the centre, shape (n, 3).
        """
        distance = np.sqrt(np.einsum("nd,nd->n", relative, relative))
        return distance - self.radii((relative @ self.axis) / np.maximum(distance, 1e-9)), distance

    def radii(self, cosine: Array) -> Array:
        """Return the radii at the ``cosine`` of the angle to the axis, shape (n,)."""
        position = np.clip((cosine + 1.0) * (0.5 * _STEPS), 0.0, _STEPS - 1e-9)
        low = position.astype(np.intp)
        first = self.profile[low]
        radii: Array = first + (position - low) * (self.profile[low + 1] - first)
        return radii


class Eyeballs:
    """Several eyeballs, evaluated together.

    Attributes:
        witnesses: Vertices to which their motion is fitted, w of each, shape (E w,).
        at_rest: Neutral positions of these, shape (E w, 3).
        radii: Radii of the spheres, shape (E,).
    """

    def __init__(self, balls: Sequence[Eyeball], neutral: NDArray[np.floating]) -> None:
        """Combine the ``balls`` of the ``neutral`` face, shape (N, 3)."""
        most = max(len(ball.frame.witnesses) for ball in balls)
        # Padded witnesses have a weight of 0.
        self.witnesses = np.concatenate(
            [np.pad(ball.frame.witnesses, (0, most - len(ball.frame.witnesses)), mode="edge") for ball in balls]
        )
        self.at_rest = neutral[self.witnesses]
        self._solvers = np.stack(
            [np.pad(ball.frame.solver, ((0, 0), (0, most - ball.frame.solver.shape[1]))) for ball in balls]
        )
        self._offsets = np.stack([ball.centre - ball.frame.origin for ball in balls])
        self._axes = np.stack([ball.axis for ball in balls], axis=1).astype(np.float32)
        self._profiles = np.concatenate([ball.profile for ball in balls]).astype(np.float32)
        self.radii = np.array([ball.radius for ball in balls])

    def motion_of(self, places: NDArray[np.floating]) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return linear parts, (E, 3, 3), centres, (E, 3), and the mask of moved balls, (E,).

        Args:
            places: Positions of the witnesses, shape (E w, 3).
        """
        count = len(self.radii)
        found = self._solvers @ places.astype(np.float64).reshape(count, -1, 3)
        linear = found[:, :3].transpose(0, 2, 1)
        centres = found[:, 3] + np.einsum("eij,ej->ei", linear, self._offsets)
        return linear, centres, (places != self.at_rest).reshape(count, -1).any(axis=1)

    def clearance(self, rows: Singles, balls: Ids) -> Singles:
        """Return the clearance of points at rest, shape (n,).

        Args:
            rows: Coordinates relative to the centre of each point's ball, shape (3, n).
            balls: Index of each point's ball, shape (n,).
        """
        x, y, z = rows
        distance = np.sqrt(x * x + y * y + z * z)
        p, q, r = self._axes.take(balls, axis=1)
        cosine = (x * p + y * q + z * r) / np.maximum(distance, 1e-9)
        position = np.minimum(np.maximum((cosine + 1.0) * (0.5 * _STEPS), 0.0), _STEPS - 1e-3)
        low = position.astype(np.int32)
        place = low + balls * (_STEPS + 1)
        first = self._profiles.take(place)
        position -= low
        position *= self._profiles.take(place + 1) - first
        return distance - first - position


def fit_sphere(points: Array) -> tuple[Array, float]:
    """Return the centre, (3,), and the radius of a sphere fitted to ``points``, (n, 3), by linear least squares."""
    middle = points.mean(axis=0)
    moved = points - middle
    system = np.hstack([2.0 * moved, np.ones((len(points), 1))])
    solution = np.linalg.lstsq(system, (moved**2).sum(axis=1), rcond=None)[0]
    return middle + solution[:3], float(np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0.0)))


def find_eyeballs(character: Character) -> list[Eyeball]:
    """Find the eyeballs of the ``character``: parts of the material "eye" that are nearly spherical.

    Concentric parts that move together, such as sclera and iris in separate shells, form one eyeball.
    """
    balls = []
    for ids in _spheres(character):
        points = character.vertices[ids].astype(np.float64)
        centre, radius = fit_sphere(points)
        axis = _gaze_axis(points - centre, radius)
        sclera = (points - centre) @ axis < _SCLERA_COSINE * radius
        if sclera.sum() >= 12 and np.ptp((points - centre)[sclera] @ axis) > 0.8 * radius:
            centre, radius = fit_sphere(points[sclera])
        balls.append(
            Eyeball(AffineFrame.of(ids, character.vertices), centre, radius, axis, _profile(points - centre, axis))
        )
    return balls


def _spheres(character: Character) -> list[NDArray[np.intp]]:
    """Return the vertex ids of each sphere among the parts of eyes, with concentric shells merged."""
    found: list[tuple[NDArray[np.intp], Array, float]] = []
    for part in character.parts:
        ids = np.arange(*part.vertices, dtype=np.intp)
        if part.material != "eye" or len(ids) < 12:
            continue
        points = character.vertices[ids].astype(np.float64)
        centre, radius = fit_sphere(points)
        distance = np.linalg.norm(points - centre, axis=1)
        if not 0.0 < radius < 0.25 * character.height or distance.min() < 0.5 * radius:
            continue
        for i, (others, other_centre, other_radius) in enumerate(found):
            near = np.linalg.norm(centre - other_centre) < CONCENTRIC * min(radius, other_radius)
            if near and moves_affinely(character, np.concatenate([others, ids])):
                found[i] = np.concatenate([others, ids]), other_centre, other_radius
                break
        else:
            found.append((ids, centre, radius))
    return [ids for ids, _, _ in found]


def _gaze_axis(relative: Array, radius: float) -> Array:
    """Return the direction of the cornea from points ``relative`` to the centre, (n, 3), or +z if there is none."""
    excess = np.linalg.norm(relative, axis=1) - radius
    ahead = np.array([0.0, 0.0, 1.0])
    if excess.max() < _BULGE * radius:
        return ahead
    weights = np.maximum(excess - 0.5 * excess.max(), 0.0)
    direction = weights @ relative
    length = float(np.linalg.norm(direction))
    return direction / length if length > 0.0 and direction[2] > 0.7 * length else ahead


def _profile(relative: Array, axis: Array) -> Array:
    """Return the profile about ``axis`` of points ``relative`` to the centre, interpolated between vertices."""
    distance = np.linalg.norm(relative, axis=1)
    angle = np.arccos(np.clip(relative @ axis / distance, -1.0, 1.0))
    greatest = np.zeros(_ANGLES + 1)
    np.maximum.at(greatest, np.round(angle * (_ANGLES / np.pi)).astype(np.intp), distance)
    known = np.flatnonzero(greatest > 0.0)
    over_angle = np.interp(np.arange(_ANGLES + 1), known, greatest[known])
    angles = np.arccos(np.linspace(-1.0, 1.0, _STEPS + 1))
    return np.interp(angles, np.arange(_ANGLES + 1) * (np.pi / _ANGLES), over_angle)
