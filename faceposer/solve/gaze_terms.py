"""Terms of the gaze: both eyes look at one target, and do not turn unless a constraint asks for it."""

from collections.abc import Iterable

import numpy as np

from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.sized_cache import weak_cache
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.term import Array, PoseState, QuadraticTerm, ResidualTerm

# Standard deviation of the angle between the gazes of both eyes, in radians: about a quarter of a degree.
_GAZE_SIGMA = 0.005
# Standard deviation of the turn of an eye that no constraint asks for, in radians: about half a degree.
_HELD_SIGMA = 0.01


class HeldGaze(ResidualTerm, QuadraticTerm):
    """w / sigma^2 |A (p - p0)|^2, with A p the turns of both eyes, in radians.

    In performances lids follow the eyes. From a lid alone the solver would conclude that both eyes look down, with all
    their lids; but who shapes a lid means that lid.
    """

    def __init__(self, turns: Array, start: Array, weight: float = 1.0) -> None:
        """Keep ``turns @ p`` as it is at the pose ``start``, shape (r,), with ``turns`` of shape (4, r)."""
        super().__init__(np.full(len(turns), weight / _HELD_SIGMA**2))
        self._turns = turns
        self._target = turns @ start

    def residual(self, state: PoseState) -> Array:
        """Return the change of the turns, shape (4,)."""
        residual: Array = self._turns @ state.p - self._target
        return residual

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives, shape (4, r)."""
        return self._turns


class ParallelGaze(ResidualTerm, QuadraticTerm):
    """w / sigma^2 |A (p - p0)|^2, with A p the vertical and horizontal differences between both gazes, in radians.

    Both eyes look at one target, but captures measure each eye separately, and their noise would make a face squint.
    """

    def __init__(self, apart: Array, start: Array, weight: float = 1.0) -> None:
        """Keep ``apart @ p`` as it is at the pose ``start``, shape (r,), with ``apart`` from ``gaze_differences``."""
        super().__init__(np.full(len(apart), weight / _GAZE_SIGMA**2))
        self._apart = apart
        self._target = apart @ start

    def residual(self, state: PoseState) -> Array:
        """Return the change of both differences, shape (2,)."""
        residual: Array = self._apart @ state.p - self._target
        return residual

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives, shape (2, r)."""
        return self._apart


def gaze_differences(model: FaceModel) -> Array:
    """Return A, (2, r): the vertical and horizontal differences between both gazes, in radians, to first order.

    The shape is (0, r) for a character without two movable eyes.
    """
    turns = model.eye_turns
    return turns[0, :2] - turns[1, :2] if len(turns) == 2 else np.zeros((0, model.n_coefficients))


def eye_turns(model: FaceModel) -> Array:
    """Return A, (4, r): vertical and horizontal turns of the eyes, in radians; (0, r) without two movable eyes."""
    turns = model.eye_turns
    return turns[:, :2].reshape(-1, model.n_coefficients)


def moves_eyes(character: Character, constraints: Iterable[Constraint]) -> bool:
    """Return True if one of ``constraints`` that acts has a point on an eyeball."""
    return any(c.enabled and c.weight > 0 and _has_point_on_eyes(character, c.points) for c in constraints)


@weak_cache(512)
def _has_point_on_eyes(character: Character, points: SurfacePoints) -> bool:
    """Return True if one of ``points`` is on an eyeball; cached, since dragging targets leaves the points unchanged."""
    vertices = np.where(points.faces < 0, -1 - points.faces, character.triangles[points.faces, 0])
    eyes = [part.vertices for part in character.parts if part.material == "eye"]
    return any(bool(((vertices >= first) & (vertices < end)).any()) for first, end in eyes)
