"""Constraint on the projected distance between two points of the face (Lau et al. 2009, section 4.2)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from faceposer.files.json_documents import convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.geometry.mirror import SurfaceMirror, mirrored_camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.sized_cache import weak_cache
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson, PlaceNames
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, Indices, PoseState, ResidualTerm, Term

# Distance in pixels below which the direction between two points is undefined.
_COINCIDENT = 1e-6


class _DistanceJson(ConstraintJson, kw_only=True):
    anchors: tuple[codec.Anchor, codec.Anchor]
    target: codec.NotNegative
    camera: codec.CameraJson


@dataclass(frozen=True)
class DistanceConstraint(ConstraintBase):
    """Moves the two ``anchors`` to a distance of ``target`` pixels under ``camera``.

    Attributes:
        anchors: Two surface points or indices of vertices.
        target: Distance in the pixels of ``camera``, at least 0.
        camera: The camera under which the distance was set.
    """

    kind: ClassVar[str] = "distance"
    noun: ClassVar[str] = "distance"
    icon: ClassVar[str] = "distance"

    anchors: tuple[SurfacePoint | int, SurfacePoint | int]
    target: float
    camera: Camera

    @cached_property
    def points(self) -> SurfacePoints:
        """The two points of the surface."""
        return SurfacePoints.of(self.anchors)

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "DistanceConstraint":
        """Return the constraint at ``places`` of another version of the character, its camera moved by ``frame``."""
        assert places is not None
        return replace(self, anchors=(places[0], places[1]), camera=self.camera.following(frame), rest=None)

    def pixels(self, model: FaceModel, p: ArrayLike) -> Array:
        """Return the pixels of the two points of the face ``p`` under ``camera``, shape (2, 2)."""
        return self.camera.project(model.positions_at(self.points, p))

    def measured(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the distance of the two points on the face ``p``, shape (r,), in pixels."""
        first, second = self.pixels(model, p)
        return float(np.hypot(*(first - second)))

    def reach(self, model: FaceModel) -> tuple[float, float]:
        """Return the smallest and the largest distance that the face can attain, in pixels of ``camera``.

        They are taken over all single shapes and pairs of shapes of the rig at full strength.
        """
        return _reach(model, self.points, self.camera)

    def nudged(self, offset: tuple[float, float]) -> "DistanceConstraint":
        """Return the constraint with its distance increased by the ``offset`` to the right plus upwards, in pixels."""
        return replace(self, target=max(self.target + offset[0] - offset[1], 0.0))

    def place(self, names: PlaceNames) -> str:
        """Return the name of the distance."""
        return names.pair(self.anchors)

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the error of the distance on the face ``p``, shape (r,), in pixels."""
        return self.residual_of(self.pixels(model, p))

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given the projected ``pixels`` of the constraint's points, shape (n, 2)."""
        return self.residual_of(pixels)

    def residual_of(self, pixels: Array) -> float:
        """Return the error of the distance between two ``pixels``, shape (2, 2)."""
        return abs(float(np.hypot(*(pixels[0] - pixels[1]))) - self.target)

    @staticmethod
    def terms(constraints: Sequence["DistanceConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return one term for all ``constraints``; ``slots`` are the indices of their points in the state."""
        return [DistanceTerm(constraints, np.array(slots))]

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> "DistanceConstraint | None":
        """Return the mirrored constraint for the face ``p``, or None if its points have no mirror image."""
        opposite = mirror.points(self.points)
        if opposite is None:
            return None
        pair = DistanceConstraint((opposite[0], opposite[1]), 0.0, mirrored_camera(self.camera), weight=self.weight)
        target = pair.measured(model, p) + self.target - self.measured(model, p)
        return replace(pair, target=max(target, 0.0), enabled=self.enabled)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form of the constraint."""
        return {
            "type": self.kind,
            "anchors": [codec.anchor_to_json(anchor) for anchor in self.anchors],
            "target": self.target,
            "camera": codec.camera_to_json(self.camera),
            **self.switches_to_json(),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "DistanceConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; ``where`` names the place.
        """
        form = convert(data, _DistanceJson, where)
        first, second = (anchor.anchor() for anchor in form.anchors)
        return cls((first, second), form.target, form.camera.camera(), **form.switches)


@weak_cache(64)
def _reach(model: FaceModel, points: SurfacePoints, camera: Camera) -> tuple[float, float]:
    rows, neutral = model.jacobian_at(points)
    # With about 100 shapes, all pairs are a few thousand faces of two points each.
    alone = np.concatenate([np.zeros((1, 2, 3)), np.moveaxis(rows @ model.subspace.projection, -1, 0)])
    pairs = neutral + alone[:, None] + alone[None]
    pixels = camera.project(pairs.reshape(-1, 3)).reshape(-1, 2, 2)
    distances = np.hypot(*(pixels[:, 0] - pixels[:, 1]).T)
    return float(distances.min()), float(distances.max())


class DistanceTerm(ResidualTerm):
    """sum over pairs of w (|y_i - y_j| - d)^2 / sigma^2 (paper, eqs. (10) and (26); the printed (10) lacks the norm).

    The derivative of the distance is taken to be zero where two points coincide.
    """

    def __init__(self, constraints: Sequence[DistanceConstraint], points: Indices) -> None:
        """Prepare the term for ``constraints``; ``points``, (n, 2), are the indices of their points in the state."""
        super().__init__(np.array([constraint.weight / SIGMA_PX**2 for constraint in constraints]))
        self._targets = np.array([constraint.target for constraint in constraints])
        self._points = points

    def _measure(self, state: PoseState) -> tuple[Array, Array]:
        """Return the distances, (n,), and the unit vectors from the second point to the first, (n, 2)."""
        offsets = state.pixels[self._points[:, 0]] - state.pixels[self._points[:, 1]]
        distances = np.hypot(offsets[:, 0], offsets[:, 1])
        directions = np.where(distances[:, None] > _COINCIDENT, offsets, 0.0)
        return distances, directions / np.maximum(distances, _COINCIDENT)[:, None]

    def residual(self, state: PoseState) -> Array:
        """Return distance minus target, shape (n,)."""
        return self._measure(state)[0] - self._targets

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the distances, shape (n, r)."""
        directions = self._measure(state)[1]
        ends = state.pixel_jacobian(self._points[:, 0]) - state.pixel_jacobian(self._points[:, 1])
        return np.einsum("nd,ndr->nr", directions, ends)

    def pull_back(self, state: PoseState, by_residual: Array) -> Array:
        """Return jacobian^T ``by_residual``, shape (r,)."""
        by_pixel = self._measure(state)[1] * by_residual[:, None]
        return state.pull_back(self._points.T.ravel(), np.concatenate([by_pixel, -by_pixel]))
