"""Energies of constraints on thousands of examples at once, for methods that search a database."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.setting import StudyContext
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.point import SIGMA_PX, PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.stroke import StrokeConstraint
from faceposer.solve.constraints.stroke_terms import AS_MANY_POINTS, CENTRE, REVERSE

Array = NDArray[np.float64]

# Points of a stroke that are compared with each example; more points find the same neighbours, much more slowly.
_STROKE_POINTS = 24
# Number of examples per step, which fit into the processor's cache.
_CHUNK = 300


class Examples:
    """Database of faces.

    Attributes:
        model: The face in all dimensions, in whose coefficients the examples are.
        coefficients: Coefficients of the examples, shape (n, r).
    """

    def __init__(self, setting: StudyContext, augmented: bool, most: int | None = None) -> None:
        """Load the frames of ``setting``, or the examples augmented from them; at most ``most``, evenly spaced."""
        weights = setting.examples if augmented else setting.frames
        if most is not None and len(weights) > most:
            weights = weights[np.linspace(0, len(weights) - 1, most).round().astype(np.intp)]
        self.model: FaceModel = setting.full
        self.coefficients: Array = setting.rig_weights(weights) @ self.model.subspace.projection.T

    def energies(self, constraints: Sequence[Constraint]) -> Array:
        """Return the energy of the ``constraints`` on each example, as in a solve, shape (n,)."""
        total = np.zeros(len(self.coefficients))
        for constraint in constraints:
            total += constraint.weight * self._energy(constraint)
        return total

    def _energy(self, constraint: Constraint) -> Array:
        if isinstance(constraint, PointConstraint):
            pixels = self._pixels(constraint, None)[:, 0]
            return ((pixels - constraint.target) ** 2).sum(axis=1) / SIGMA_PX**2
        if isinstance(constraint, DistanceConstraint):
            pixels = self._pixels(constraint, None)
            lengths = np.hypot(*(pixels[:, 0] - pixels[:, 1]).T)
            return (lengths - constraint.target) ** 2 / SIGMA_PX**2
        if isinstance(constraint, StrokeConstraint):
            return self._stroke_energy(constraint)
        raise TypeError(f"constraints of the kind '{constraint.kind}' are not supported for examples")

    def _pixels(self, constraint: PointConstraint | DistanceConstraint | StrokeConstraint, most: int | None) -> Array:
        """Return the pixels of the constraint's points, or at most ``most`` of them, on all examples, (n, m, 2)."""
        rows, neutral = self.model.jacobian_at(constraint.points)
        if most is not None:
            chosen = np.unique(np.linspace(0, len(rows) - 1, most).round().astype(np.intp))
            rows, neutral = rows[chosen], neutral[chosen]
        m = len(rows)
        points = self.coefficients @ rows.reshape(3 * m, -1).T + neutral.ravel()
        return constraint.camera.project(points.reshape(-1, 3)).reshape(-1, m, 2)

    def _stroke_energy(self, stroke: StrokeConstraint) -> Array:
        target = stroke.target_pixels
        centre = target.mean(axis=0)
        target = target[np.unique(np.linspace(0, len(target) - 1, _STROKE_POINTS).round().astype(np.intp))]
        pixels = self._pixels(stroke, _STROKE_POINTS)
        # Examples along the last axis, so that all operations are contiguous, which takes a tenth of the time.
        us, vs = (np.ascontiguousarray(pixels[..., i].T) for i in range(2))
        energies = []
        for first in range(0, len(pixels), _CHUNK):
            u, v = us[:, first : first + _CHUNK], vs[:, first : first + _CHUNK]
            squared = (u[:, None] - target[None, :, :1]) ** 2
            squared += (v[:, None] - target[None, :, 1:]) ** 2
            offset = (u.mean(axis=0) - centre[0]) ** 2 + (v.mean(axis=0) - centre[1]) ** 2
            energies.append(
                squared.min(axis=1).mean(axis=0) + REVERSE * squared.min(axis=0).mean(axis=0) + CENTRE * offset
            )
        energy: Array = np.concatenate(energies) * AS_MANY_POINTS / SIGMA_PX**2
        return energy
