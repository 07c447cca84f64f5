"""Constraint on the gaze: both eyes and their lids follow a handle."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from faceposer.files.json_documents import JsonError, convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mirror import SurfaceMirror
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson, PlaceNames
from faceposer.solve.constraints.fixed import PX_PER_CM
from faceposer.solve.term import Array, Indices, PoseState, QuadraticTerm, ResidualTerm, Term

#: Rotation of an eye in degrees at full strength of its shape: outwards or inwards, up or down.
MOST_YAW, MOST_PITCH = _MOST = (31.0, 23.0)
# Tolerance of a direction in a file, in degrees.
_ROUNDING = 1e-6
#: Distance in centimetres from the eyes to the handle.
REACH_CM = 22.0
# Standard deviation of the rig weights of gaze.
_SIGMA = 0.01
_NO_POINTS = SurfacePoints(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))


class _GazeJson(ConstraintJson, kw_only=True):
    direction: codec.Pixel

    def __post_init__(self) -> None:
        if any(abs(angle) > most + _ROUNDING for angle, most in zip(self.direction, _MOST, strict=True)):
            raise JsonError(
                f"is beyond the range of the eyes, {MOST_YAW:g} degrees to a side and {MOST_PITCH:g} up or down",
                "direction",
            )


@dataclass(frozen=True)
class GazeConstraint(ConstraintBase):
    """Turns both eyes to ``direction``.

    Gaze is independent of the statistics of the rest of the face. It moves the start pose on which the prior is
    conditioned, through the eyeLook shapes only, so that the prior does not penalise it and only eyes and lids move.

    Attributes:
        direction: Degrees to the character's left and upwards.
    """

    kind: ClassVar[str] = "gaze"
    noun: ClassVar[str] = "gaze"
    icon: ClassVar[str] = "gaze"
    # Gaze is independent of the rest of the face.
    informs_prior: ClassVar[bool] = False
    camera: ClassVar[None] = None

    direction: tuple[float, float] = (0.0, 0.0)

    @property
    def points(self) -> SurfacePoints:
        """No points: the constraint acts on the rig's weights."""
        return _NO_POINTS

    @property
    def places(self) -> None:
        """None: the constraint has no places on the surface."""
        return None

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "GazeConstraint":
        """Return the constraint unchanged: directions apply to every version of a character."""
        return self

    def weights(self) -> dict[str, float]:
        """Return the values of the eight eyeLook shapes, 0 to 1, by name."""
        yaw, pitch = self.direction
        left, up = (min(max(angle / most, -1.0), 1.0) for angle, most in ((yaw, MOST_YAW), (pitch, MOST_PITCH)))
        return {
            "eyeLookOutLeft": max(left, 0.0),
            "eyeLookInRight": max(left, 0.0),
            "eyeLookInLeft": max(-left, 0.0),
            "eyeLookOutRight": max(-left, 0.0),
            **{f"eyeLookUp{side}": max(up, 0.0) for side in ("Left", "Right")},
            **{f"eyeLookDown{side}": max(-up, 0.0) for side in ("Left", "Right")},
        }

    def offset_start(self, model: FaceModel, start: Array) -> Array:
        """Return the start pose ``start``, shape (r,), with the eyes turned."""
        weights = model.weights_of(start)
        for name, value in self.weights().items():
            if name in model.character.shape_names:
                weights[model.character.shape_names.index(name)] = value
        return model.coefficients_of(weights)

    def place(self, names: PlaceNames) -> str:
        """Return the name of the constrained parts."""
        return "both eyes"

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the distance of the gaze of the face ``p`` from the handle, in pixels of an ordinary view."""
        current = gaze_direction(model, p)
        angle = math.hypot(*(math.radians(current[i] - self.direction[i]) for i in range(2)))
        return PX_PER_CM * REACH_CM * angle

    @staticmethod
    def terms(constraints: Sequence["GazeConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return a term for each of ``constraints``."""
        return [GazeTerm(constraint, model) for constraint in constraints]

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> "GazeConstraint | None":
        """Return None: one handle turns both eyes."""
        return None

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form of the constraint."""
        return {"type": self.kind, "direction": list(self.direction), **self.switches_to_json()}

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "GazeConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; ``where`` names the place.
        """
        form = convert(data, _GazeJson, where)
        return cls(form.direction, **form.switches).within_reach()

    def within_reach(self) -> "GazeConstraint":
        """Return the constraint with its direction clamped to the range of the eyes."""
        yaw, pitch = self.direction
        return replace(self, direction=(min(max(yaw, -MOST_YAW), MOST_YAW), min(max(pitch, -MOST_PITCH), MOST_PITCH)))


def gaze_direction(model: FaceModel, p: ArrayLike) -> tuple[float, float]:
    """Return the mean gaze of the face ``p``, in degrees to the character's left and upwards."""
    weights = dict(zip(model.character.shape_names, model.weights_of(p).tolist(), strict=True))

    def mean(*names: str) -> float:
        return sum(weights.get(name, 0.0) for name in names) / len(names)

    left = mean("eyeLookOutLeft", "eyeLookInRight") - mean("eyeLookInLeft", "eyeLookOutRight")
    up = mean("eyeLookUpLeft", "eyeLookUpRight") - mean("eyeLookDownLeft", "eyeLookDownRight")
    return (MOST_YAW * left, MOST_PITCH * up)


class GazeTerm(ResidualTerm, QuadraticTerm):
    """w / sigma^2 sum over the eyeLook shapes of (weight_j(p) - value_j)^2, so that other constraints keep the gaze."""

    def __init__(self, constraint: GazeConstraint, model: FaceModel) -> None:
        """Prepare the term for ``constraint``."""
        values = {n: v for n, v in constraint.weights().items() if n in model.character.shape_names}
        super().__init__(np.full(len(values), constraint.weight / _SIGMA**2))
        self._directions = model.subspace.directions[[model.character.shape_names.index(name) for name in values]]
        self._values = np.array(list(values.values()))

    def residual(self, state: PoseState) -> Array:
        """Return the weights minus their values, shape (m,)."""
        residual: Array = self._directions @ state.p - self._values
        return residual

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the weights, shape (m, r)."""
        return self._directions
