"""Eyeballs: a sphere with a cornea, found in the eye parts of a character."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.contact.frames import AffineFrame, to_rest
from faceposer.model.subject import Subject

Array = NDArray[np.float64]

# Steps of the radius over the angle to the gaze axis.
_STEPS = 90
# Radius over the sphere's, from which a bulge is a cornea; nearer to the axis than this angle it belongs to the bulge.
_BULGE = 0.005
_SCLERA_COSINE = 0.6


@dataclass(frozen=True, eq=False)
class Eyeball:
    """A surface of revolution about the gaze axis, at rest: radius over the angle to that axis.

    Attributes:
        frame: Its motion.
        centre: Centre of the sclera's sphere, shape (3,).
        radius: Radius of that sphere.
        axis: Unit vector through the cornea, shape (3,).
        profile: Greatest radius at ``_STEPS`` + 1 equal steps of the angle from 0 to pi.
    """

    frame: AffineFrame
    centre: Array
    radius: float
    axis: Array
    profile: Array

    def resting(self, points: Array, vertices: NDArray[np.floating]) -> Array:
        """Return where ``points`` (n, 3) of the pose ``vertices`` (N, 3) lie relative to the centre at rest."""
        linear, moved = self.frame.motion(vertices)
        return to_rest(points, self.frame.origin, linear, moved) - self.centre

    def clearance(self, relative: Array) -> tuple[Array, Array]:
        """Return how far points outside, at ``relative`` (n, 3) to the centre, are, and their distances, (n,) each."""
        distance = np.sqrt(np.einsum("nd,nd->n", relative, relative))
        cosine = np.clip((relative @ self.axis) / np.maximum(distance, 1e-9), -1.0, 1.0)
        return distance - self.radii(cosine), distance

    def radii(self, cosine: Array) -> Array:
        """Return the radius at the ``cosine`` of the angle to the axis, shape (n,)."""
        position = np.arccos(cosine) * (_STEPS / np.pi)
        low = np.minimum(position.astype(np.intp), _STEPS - 1)
        share = position - low
        radii: Array = self.profile[low] * (1.0 - share) + self.profile[low + 1] * share
        return radii


def fit_sphere(points: Array) -> tuple[Array, float]:
    """Return centre, (3,), and radius of the sphere nearest to ``points``, (n, 3), by linear least squares."""
    middle = points.mean(axis=0)
    moved = points - middle
    system = np.hstack([2.0 * moved, np.ones((len(points), 1))])
    solution = np.linalg.lstsq(system, (moved**2).sum(axis=1), rcond=None)[0]
    return middle + solution[:3], float(np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0.0)))


def find_eyeballs(subject: Subject) -> list[Eyeball]:
    """Return the eyeballs of the ``subject``, one for each part of the material "eye" that is about a sphere."""
    balls = []
    for part in subject.parts:
        ids = np.arange(*part.vertices, dtype=np.intp)
        if part.material != "eye" or len(ids) < 12:
            continue
        points = subject.vertices[ids].astype(np.float64)
        centre, radius = fit_sphere(points)
        distance = np.linalg.norm(points - centre, axis=1)
        if not 0.0 < radius < 0.25 * subject.height or distance.min() < 0.5 * radius:
            continue
        axis = _gaze_axis(points - centre, radius)
        sclera = (points - centre) @ axis < _SCLERA_COSINE * radius
        if sclera.sum() >= 12 and np.ptp((points - centre)[sclera] @ axis) > 0.8 * radius:
            centre, radius = fit_sphere(points[sclera])
        balls.append(
            Eyeball(AffineFrame.of(ids, subject.vertices), centre, radius, axis, _profile(points - centre, axis))
        )
    return balls


def _gaze_axis(relative: Array, radius: float) -> Array:
    """Return the direction of the bulge of points ``relative`` (n, 3) to the centre, or ahead if there is none."""
    excess = np.linalg.norm(relative, axis=1) - radius
    ahead = np.array([0.0, 0.0, 1.0])
    if excess.max() < _BULGE * radius:
        return ahead
    weights = np.maximum(excess - 0.5 * excess.max(), 0.0)
    direction = weights @ relative
    length = float(np.linalg.norm(direction))
    return direction / length if length > 0.0 and direction[2] > 0.7 * length else ahead


def _profile(relative: Array, axis: Array) -> Array:
    """Return the greatest radius over the angle to ``axis``; between rings of vertices it is interpolated."""
    distance = np.linalg.norm(relative, axis=1)
    angle = np.arccos(np.clip(relative @ axis / distance, -1.0, 1.0))
    bins = np.round(angle * (_STEPS / np.pi)).astype(np.intp)
    greatest = np.zeros(_STEPS + 1)
    np.maximum.at(greatest, bins, distance)
    known = np.flatnonzero(greatest > 0.0)
    return np.interp(np.arange(_STEPS + 1), known, greatest[known])
