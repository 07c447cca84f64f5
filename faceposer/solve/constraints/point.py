"""Constraint that projects a point of the face onto a pixel (Lau et al. 2009, section 4.1)."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from faceposer.files.json_documents import convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.geometry.mirror import SurfaceMirror, mirrored_camera, mirrored_pixels
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson
from faceposer.solve.reach import ReachTerm, reach_of_points
from faceposer.solve.term import Array, Indices, PoseState, Term

# Standard deviation of a target set by hand, in pixels: sigma of eq. (9).
SIGMA_PX = 1.5
# Standard deviation of a pull across its direction, as a share of its length, and the number of points up to which it
# applies in full.
_SLACK, _FEW = 0.15, 3.0
# Signs of (v, u) that rotate (u, v) by a right angle.
_QUARTER_TURN = np.array([-1.0, 1.0])


class _PointJson(ConstraintJson, kw_only=True):
    anchor: codec.Anchor
    target: codec.Pixel
    camera: codec.CameraJson


@dataclass(frozen=True)
class PointConstraint(ConstraintBase):
    """Projects the point ``anchor`` of the face onto the pixel ``target``.

    Attributes:
        anchor: A surface point, or the index of a vertex.
        target: Target of the point, (u, v) in the pixels of ``camera``.
        camera: The camera under which the target was drawn.
    """

    kind: ClassVar[str] = "point"
    noun: ClassVar[str] = "point"
    icon: ClassVar[str] = "point"

    anchor: SurfacePoint | int
    target: tuple[float, float]
    camera: Camera

    @cached_property
    def points(self) -> SurfacePoints:
        """The point of the surface, as a batch of one."""
        return _points_at(self.anchor)

    def nudged(self, offset: tuple[float, float]) -> "PointConstraint":
        """Return the constraint with its target moved by ``offset`` pixels."""
        return replace(self, target=(self.target[0] + offset[0], self.target[1] + offset[1]))

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "PointConstraint":
        """Return the constraint at ``places`` of another version of the character, its camera moved by ``frame``."""
        assert places is not None
        return replace(self, anchor=places[0], camera=self.camera.following(frame), rest=None)

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the distance to the target in pixels on the face ``p``, shape (r,)."""
        return self.residual_of(self.camera.project(model.positions_at(self.points, p)))

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given the projected ``pixels`` of the constraint's points, shape (n, 2)."""
        return self.residual_of(pixels)

    def residual_of(self, pixels: Array) -> float:
        """Return the distance from ``pixels``, shape (1, 2), to the target."""
        return float(np.hypot(*(pixels[0] - self.target)))

    @staticmethod
    def terms(constraints: Sequence["PointConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return one term for all ``constraints``; ``slots`` are the indices of their points in the state."""
        return [PointTerm(constraints, np.concatenate(slots))]

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> "PointConstraint | None":
        """Return the mirrored constraint for the face ``p``, or None if its point has no mirror image.

        The mirrored pull is applied to the current position of the opposite point, so that the current asymmetry of the
        face is kept.
        """
        opposite = mirror.points(self.points)
        if opposite is None:
            return None
        camera = mirrored_camera(self.camera)
        pixel = self.camera.project(model.positions_at(self.points, p))[0]
        opposite_pixel = camera.project(model.positions_at(opposite, p))[0]
        pull = mirrored_pixels(self.target, self.camera)[0] - mirrored_pixels(pixel, self.camera)[0]
        u, v = (opposite_pixel + pull).tolist()
        return PointConstraint(opposite[0], (u, v), camera, weight=self.weight, enabled=self.enabled)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form of the constraint."""
        return {
            "type": self.kind,
            "anchor": codec.anchor_to_json(self.anchor),
            "target": list(self.target),
            "camera": codec.camera_to_json(self.camera),
            **self.switches_to_json(),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "PointConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; ``where`` names the place.
        """
        form = convert(data, _PointJson, where)
        return cls(form.anchor.anchor(), form.target, form.camera.camera(), **form.switches)


@lru_cache(maxsize=1024)
def _points_at(anchor: SurfacePoint | int) -> SurfacePoints:
    """Return the point ``anchor`` as a batch of one, cached so that a drag reuses the same object."""
    return SurfacePoints.of([anchor])


class PointTerm(ReachTerm):
    """sum over i of w_i (a_i^2 / sigma^2 + b_i^2 / sigma_i^2), with a_i and b_i y_i(p) - z_i along and across pull i.

    With sigma_i = sigma, these are the paper's eqs. (9) and (25). A hand that pulls a few points determines their
    direction only to some degrees, and meeting it exactly makes unnatural faces. After ``within_reach``,
    sigma_i^2 = sigma^2 + (t l_i min(1, 3 / n))^2 for pulls of length l_i on n points.
    """

    def __init__(self, constraints: Sequence[PointConstraint], points: Indices) -> None:
        """Prepare the term for ``constraints``; ``points`` are the indices of their points in the state."""
        super().__init__(np.repeat([constraint.weight / SIGMA_PX**2 for constraint in constraints], 2))
        self._targets = np.array([constraint.target for constraint in constraints])
        self._cameras = [constraint.camera for constraint in constraints]
        self._points = points
        # Unit vectors along and across the pulls, shape (n, 2, 2).
        self._axes = np.zeros((len(constraints), 2, 2))
        self._axes[:, (0, 1), (0, 1)] = 1.0

    def within_reach(self, model: FaceModel, state: PoseState, limits: Array, trust: float = 0.0) -> "PointTerm":
        """Return the term with its targets limited to their reach (``ReachTerm``), and relaxed across the pulls."""
        term = copy(self)
        origins = state.pixels[self._points]
        drawn = self._targets - origins
        pulls, mobility = drawn.copy(), np.ones(len(drawn))
        for camera in dict.fromkeys(self._cameras):
            in_view = np.array([own == camera for own in self._cameras])
            reach = reach_of_points(model, state, self._points[in_view], camera, limits)
            pulls[in_view] = (1.0 - trust) * reach.limited(pulls[in_view]) + trust * pulls[in_view]
            mobility[in_view] = reach.mobility
        term.lost, term.mobility = float(np.hypot(*(drawn - pulls).T).mean()), float(mobility.mean())
        term._targets = origins + pulls
        lengths = np.sqrt(np.einsum("nk,nk->n", pulls, pulls))
        far = lengths > 1e-6
        along = pulls[far] / lengths[far, None]
        term._axes = self._axes.copy()
        term._axes[far, 0] = along
        term._axes[far, 1] = along[:, ::-1] * _QUARTER_TURN
        slack = (1.0 - trust) * _SLACK * min(1.0, _FEW / len(lengths)) * lengths
        term.weights = self.weights.copy()
        term.weights[1::2] /= 1.0 + (slack / SIGMA_PX) ** 2
        return term

    def residual(self, state: PoseState) -> Array:
        """Return pixel minus target, along and across the pull, shape (2 n,)."""
        return np.einsum("nij,nj->ni", self._axes, state.pixels[self._points] - self._targets).ravel()

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the residuals, shape (2 n, r)."""
        jacobian = self._axes @ state.pixel_jacobian(self._points)
        return jacobian.reshape(-1, jacobian.shape[-1])

    def pull_back(self, state: PoseState, by_residual: Array) -> Array:
        """Return jacobian^T ``by_residual``, shape (r,)."""
        by_pixel = np.einsum("nij,ni->nj", self._axes, by_residual.reshape(-1, 2))
        return state.pull_back(self._points, by_pixel)
