"""The energies of constraints on thousands of examples at once: what methods that go through a database need."""

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

# A stroke is compared in so many of its points with each example: more find the same neighbours, much later.
_STROKE_POINTS = 24
# So many examples at a time stay in the processor's cache.
_CHUNK = 300


class Examples:
    """A database of faces.

    Attributes:
        model: The face whose coefficients are used; it has all dimensions.
        coefficients: Of the examples, shape (n, r).
    """

    def __init__(self, setting: StudyContext, augmented: bool, most: int | None = None) -> None:
        """Take the frames of the ``setting``, or what they were augmented to; at most ``most``, evenly spread."""
        weights = setting.examples if augmented else setting.frames
        if most is not None and len(weights) > most:
            weights = weights[np.linspace(0, len(weights) - 1, most).round().astype(np.intp)]
        self.model: FaceModel = setting.full
        self.coefficients: Array = setting.rig_weights(weights) @ self.model.subspace.projection.T

    def energies(self, constraints: Sequence[Constraint]) -> Array:
        """Return the energy of the ``constraints``, as solving has it, on each example, shape (n,)."""
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
        raise TypeError(f"examples are not compared by constraints of the kind '{constraint.kind}'")

    def _pixels(self, constraint: PointConstraint | DistanceConstraint | StrokeConstraint, some: int | None) -> Array:
        """Return where the camera sees the constraint's points, or ``some`` of them, on all examples, (n, m, 2)."""
        rows, neutral = self.model.rows_at(constraint.points)
        if some is not None:
            chosen = np.unique(np.linspace(0, len(rows) - 1, some).round().astype(np.intp))
            rows, neutral = rows[chosen], neutral[chosen]
        m = len(rows)
        points = self.coefficients @ rows.reshape(3 * m, -1).T + neutral.ravel()
        return constraint.camera.project(points.reshape(-1, 3)).reshape(-1, m, 2)

    def _stroke_energy(self, stroke: StrokeConstraint) -> Array:
        target = stroke.target_pixels
        centre = target.mean(axis=0)
        target = target[np.unique(np.linspace(0, len(target) - 1, _STROKE_POINTS).round().astype(np.intp))]
        pixels = self._pixels(stroke, _STROKE_POINTS)
        # Examples last, so that all that is done runs along the memory: a tenth of the time.
        us, vs = (np.ascontiguousarray(pixels[..., i].T) for i in range(2))
        energies = []
        for first in range(0, len(pixels), _CHUNK):
            u, v = us[:, first : first + _CHUNK], vs[:, first : first + _CHUNK]
            squared = (u[:, None] - target[None, :, :1]) ** 2
            squared += (v[:, None] - target[None, :, 1:]) ** 2
            apart = (u.mean(axis=0) - centre[0]) ** 2 + (v.mean(axis=0) - centre[1]) ** 2
            energies.append(
                squared.min(axis=1).mean(axis=0) + REVERSE * squared.min(axis=0).mean(axis=0) + CENTRE * apart
            )
        energy: Array = np.concatenate(energies) * AS_MANY_POINTS / SIGMA_PX**2
        return energy
