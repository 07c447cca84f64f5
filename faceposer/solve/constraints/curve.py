"""Constraint on a curve of the face, edited by its control points (Lau et al. 2009, section 4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import UNSET, Meta, UnsetType
from numpy.typing import ArrayLike

from faceposer.errors import counted
from faceposer.files.json_documents import JsonError, convert, given
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.geometry.curves import curve_at, even_parameters, relaxed_bezier
from faceposer.geometry.mirror import SurfaceMirror, mirrored_camera, mirrored_pixels
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.across_along import AcrossAlongTerm
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.constraints.stroke import Pixels, as_pixels
from faceposer.solve.term import Array, Indices, Term

MOST_POINTS = 64
# Points of the face per piece of the curve.
_PER_PIECE = 12
# Weight of offsets along the target relative to those across it: a curve prescribes the course of a lip more strictly
# than the position of each point on it.
_ALONG = 0.25


_ControlPoints = Annotated[tuple[codec.Pixel, ...], Meta(min_length=2, max_length=MOST_POINTS)]


class _CurveJson(ConstraintJson, kw_only=True):
    source: _ControlPoints
    target: _ControlPoints
    camera: codec.CameraJson
    anchors: codec.Anchors | UnsetType = UNSET
    parameters: list[codec.Coordinate] | UnsetType = UNSET

    def __post_init__(self) -> None:
        if len(self.source) != len(self.target):
            raise JsonError("must have as many points as its source", "target")
        if (self.anchors is UNSET) != (self.parameters is UNSET):
            raise JsonError("must have both of the keys 'anchors' and 'parameters', or neither")
        if self.anchors is UNSET or self.parameters is UNSET:
            return
        if len(self.parameters) != len(self.anchors):
            raise JsonError(f"must be a list of {counted(len(self.anchors), 'number')}, one per anchor", "parameters")
        if not 0.0 <= min(self.parameters) <= max(self.parameters) <= len(self.source) - 1:
            raise JsonError(f"must be from 0 to {len(self.source) - 1}, the number of pieces", "parameters")


@dataclass(frozen=True)
class CurveConstraint(ConstraintBase):
    """Moves the points of the face under the relaxed curve through ``source`` onto the curve through ``target``.

    Attributes:
        source: Control points, at least two, in the pixels of ``camera``.
        target: Control points of the target, as many as in ``source``.
        camera: The camera under which both were drawn.
        anchors: Points of the face along the source; None in a file without them, until they are resolved.
        parameters: Curve parameter of each anchor, from 0 to the number of pieces.
    """

    kind: ClassVar[str] = "curve"
    noun: ClassVar[str] = "curve"
    icon: ClassVar[str] = "curve"

    source: Pixels
    target: Pixels
    camera: Camera
    anchors: SurfacePoints | None = None
    parameters: tuple[float, ...] = ()

    @property
    def points(self) -> SurfacePoints:
        """The points of the face along the source.

        Raises:
            RuntimeError: If the source is unresolved; see ``resolved``.
        """
        if self.anchors is None:
            raise RuntimeError("the source of the curve is not resolved to points of the face yet")
        return self.anchors

    @cached_property
    def targets(self) -> tuple[Array, Array]:
        """Target position of each point, and the unit tangent of the target there, each (m, 2)."""
        positions, derivatives = curve_at(relaxed_bezier(self.target), self.parameters)
        lengths = np.hypot(derivatives[:, 0], derivatives[:, 1])[:, None]
        return positions, np.where(lengths > 1e-9, derivatives / np.maximum(lengths, 1e-9), (1.0, 0.0))

    @property
    def places(self) -> SurfacePoints | None:
        """The points of the face along the source, or None if the source is unresolved."""
        return self.anchors

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "CurveConstraint":
        """Return the constraint at ``places`` of another version of the character, its camera moved by ``frame``."""
        return replace(self, anchors=places, camera=self.camera.following(frame), rest=None)

    def resolved(self, model: FaceModel, p: ArrayLike) -> "CurveConstraint":
        """Return the constraint with points along its source, picked on the face ``p`` if it has none.

        Raises:
            ValueError: If the source does not lie on the face.
        """
        if self.anchors is not None:
            self.anchors.check(model.triangles)
            return self
        parameters = even_parameters(len(self.source) - 1, _PER_PIECE)
        positions, _ = curve_at(relaxed_bezier(self.source), parameters)
        points, met = model.pick(p, self.camera, positions)
        if len(points) < 2:
            raise ValueError("its source does not touch the face")
        return replace(self, anchors=points, parameters=tuple(parameters[met].tolist()))

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the mean distance between the points of the face ``p`` and the target, in pixels."""
        pixels = self.camera.project(model.positions_at(self.points, p))
        return float(np.hypot(*(pixels - self.targets[0]).T).mean())

    @staticmethod
    def terms(constraints: Sequence["CurveConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return a term for each of ``constraints``; ``slots`` are the indices of their points in the state."""
        return [CurveTerm(constraint, points) for constraint, points in zip(constraints, slots, strict=True)]

    def with_target(self, index: int, pixel: tuple[float, float]) -> "CurveConstraint":
        """Return the constraint with control point ``index`` of the target at ``pixel``."""
        return replace(self, target=(*self.target[:index], pixel, *self.target[index + 1 :]))

    def nudged(self, offset: tuple[float, float]) -> "CurveConstraint":
        """Return the constraint with its target moved by ``offset`` pixels."""
        return replace(self, target=as_pixels(np.add(self.target, offset)))

    def with_point_at(self, parameter: float) -> "CurveConstraint":
        """Return the constraint with a control point inserted into both curves at ``parameter``."""
        piece = min(max(int(parameter), 0), len(self.source) - 2)
        share = min(max(parameter - piece, 1e-3), 1.0 - 1e-3)

        def split(points: Pixels) -> Pixels:
            between = as_pixels(curve_at(relaxed_bezier(points), [piece + share])[0])
            return (*points[: piece + 1], *between, *points[piece + 1 :])

        old = np.array(self.parameters)
        local = old - piece
        inside = np.where(local < share, local / share, 1.0 + (local - share) / (1.0 - share))
        new = np.where(local <= 0.0, old, np.where(local >= 1.0, old + 1.0, piece + inside))
        return replace(self, source=split(self.source), target=split(self.target), parameters=tuple(new.tolist()))

    def without_point(self, index: int) -> "CurveConstraint":
        """Return the constraint without control point ``index``; removing an end point removes its piece.

        Raises:
            ValueError: If the curve has only two control points.
        """
        count = len(self.source)
        if count <= 2:
            raise ValueError("a curve needs at least two control points")
        old = np.array(self.parameters)
        keep = np.ones(len(old), dtype=bool)
        if index == 0:
            keep, new = old >= 1.0, old - 1.0
        elif index == count - 1:
            keep, new = old <= count - 2, old
        else:
            local = old - (index - 1)
            new = np.where(local <= 0.0, old, np.where(local >= 2.0, old - 1.0, index - 1 + local / 2.0))
        return replace(
            self,
            source=(*self.source[:index], *self.source[index + 1 :]),
            target=(*self.target[:index], *self.target[index + 1 :]),
            anchors=self.points.subset(keep),
            parameters=tuple(new[keep].tolist()),
        )

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> "CurveConstraint | None":
        """Return the mirrored constraint for the face ``p``, or None if its points have no mirror image."""
        opposite = mirror.points(self.points)
        if opposite is None:
            return None
        camera = mirrored_camera(self.camera)
        pixels = mirrored_pixels(self.camera.project(model.positions_at(self.points, p)), self.camera)
        offset = (camera.project(model.positions_at(opposite, p)) - pixels).mean(axis=0)
        source, target = (
            as_pixels(mirrored_pixels(points, self.camera) + offset) for points in (self.source, self.target)
        )
        return replace(self, source=source, target=target, camera=camera, anchors=opposite, locked=False)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form of the constraint."""
        data: dict[str, Any] = {
            "type": self.kind,
            "source": [list(pixel) for pixel in self.source],
            "target": [list(pixel) for pixel in self.target],
            "camera": codec.camera_to_json(self.camera),
        }
        if self.anchors is not None:
            data |= {"anchors": codec.points_to_json(self.anchors), "parameters": list(self.parameters)}
        return data | self.switches_to_json()

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "CurveConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; ``where`` names the place.
        """
        form = convert(data, _CurveJson, where)
        anchors = None if form.anchors is UNSET else codec.points_of(form.anchors)
        parameters = tuple(given(form.parameters) or ())
        return cls(form.source, form.target, form.camera.camera(), anchors, parameters, **form.switches)


class CurveTerm(AcrossAlongTerm):
    """w C / (m sigma^2) sum over i of (n_i . (y_i - z_i))^2 + a (t_i . (y_i - z_i))^2, for C control points.

    z_i is the point of the target with the parameter of y_i on the source, t_i its tangent and n_i its normal. The
    paper treats curves as strokes, without correspondences; curves edited by control points have them.
    """

    def __init__(self, constraint: CurveConstraint, points: Indices) -> None:
        """Prepare the term for ``constraint``; ``points`` are the indices of its points in the state."""
        scale = constraint.weight * len(constraint.source) / (len(points) * SIGMA_PX**2)
        across = np.full(len(points), scale)
        super().__init__(points, *constraint.targets, across, _ALONG * across)
