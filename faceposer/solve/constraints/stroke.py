"""A group of points that should collectively project to where a stroke was drawn (Lau et al. 2009, section 4.3)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from faceposer.files.json_documents import JsonObject, convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.geometry.mirror import SurfaceMirror, mirrored_camera, mirrored_pixels
from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.strokes import StrokeShape, stroke_pixels
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson
from faceposer.solve.constraints.stroke_terms import StrokeDistanceTerm, StrokeImageTerm
from faceposer.solve.term import Array, Indices, Term

Pixels = tuple[tuple[float, float], ...]
StrokeEnergy = Literal["distance", "image"]
STROKE_ENERGIES: tuple[StrokeEnergy, ...] = get_args(StrokeEnergy)
WIDEST = 200.0
# So many points of a stroke say as much as all of them.
_SAMPLES = 200


class _PaintedJson(JsonObject):
    anchors: codec.Anchors


class _StrokeJson(ConstraintJson, kw_only=True):
    source: _PaintedJson | codec.Pixels
    target: codec.Pixels
    width: Annotated[float, Meta(ge=1.0, le=WIDEST)]
    camera: codec.CameraJson
    shape: StrokeShape = "line"
    energy: StrokeEnergy = "distance"


@dataclass(frozen=True)
class StrokeConstraint(ConstraintBase):
    """The points ``source`` of the face cover together the pixels of the stroke ``target``.

    Attributes:
        source: What a brush painted on the face; in a file it may also be the pixels along the brush's way, which are
            then looked up on the face that editing starts from.
        target: Pixels along the way of the brush that drew where the source should be.
        width: Diameter of the brush in pixels.
        camera: The camera under which both were drawn.
        shape: Whether the target's way is a line, closes itself, or encloses a filled region.
        energy: "distance" measures from each point to the nearest of the other stroke, both ways; "image" is the
            paper's difference of two binary images with a pull between their centres.
    """

    kind: ClassVar[str] = "stroke"
    noun: ClassVar[str] = "stroke"
    icon: ClassVar[str] = "stroke"

    source: SurfacePoints | Pixels
    target: Pixels
    width: float
    camera: Camera
    shape: StrokeShape = "line"
    energy: StrokeEnergy = "distance"

    @property
    def placed(self) -> SurfacePoints:
        """All points of the source.

        Raises:
            RuntimeError: If they have not been looked up yet; see ``resolved``.
        """
        if not isinstance(self.source, SurfacePoints):
            raise RuntimeError("the source of the stroke has not been looked up on the face yet")
        return self.source

    @cached_property
    def points(self) -> SurfacePoints:
        """The points that the energy looks at."""
        return self.placed if self.energy == "image" else self.placed.subset(_spread(len(self.placed)))

    @cached_property
    def target_pixels(self) -> Array:
        """Centres of the pixels that the target covers, shape (m, 2)."""
        return stroke_pixels(self.target, self.width, self.shape)

    @property
    def places(self) -> SurfacePoints | None:
        """All points of the source, or None if they are still to be looked up."""
        return self.source if isinstance(self.source, SurfacePoints) else None

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "StrokeConstraint":
        """Return the constraint at ``places`` of another version of the character, its camera moved by ``frame``."""
        return replace(
            self, source=self.source if places is None else places, camera=self.camera.following(frame), rest=None
        )

    def resolved(self, model: FaceModel, p: ArrayLike) -> "StrokeConstraint":
        """Return the constraint with its source on the face: if it was pixels, looked up on the face ``p``.

        Raises:
            ValueError: If the source does not lie on the face.
        """
        if isinstance(self.source, SurfacePoints):
            self.source.check(model.triangles)
            return self
        points, met = model.pick(p, self.camera, stroke_pixels(self.source, self.width, self.shape))
        if not met.any():
            raise ValueError("its source does not touch the face")
        return replace(self, source=points)

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return how far the two strokes lie apart: the mean distance to the nearest of the other, in pixels."""
        return self.residual_of(self.camera.project(model.positions_at(self.points, p)))

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given where the points of the constraint appear, shape (n, 2)."""
        return self.residual_of(pixels)

    def residual_of(self, pixels: Array) -> float:
        """Return how far the strokes lie apart where ``points`` appear at ``pixels``, shape (n, 2)."""
        # The window's start does not wait for search trees.
        from scipy.spatial import cKDTree

        target = self.target_pixels[_spread(len(self.target_pixels))]
        to_target, _ = cKDTree(self.target_pixels).query(pixels)
        to_source, _ = cKDTree(pixels).query(target)
        return float(0.5 * (to_target.mean() + to_source.mean()))

    @staticmethod
    def terms(constraints: Sequence["StrokeConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return a term for each of ``constraints``, whose points have the indices ``slots`` in the state."""
        return [
            StrokeImageTerm(constraint.target_pixels, points, constraint.weight)
            if constraint.energy == "image"
            else StrokeDistanceTerm(
                constraint.target_pixels[_spread(len(constraint.target_pixels))], points, constraint.weight
            )
            for constraint, points in zip(constraints, slots, strict=True)
        ]

    def nudged(self, offset: tuple[float, float]) -> "StrokeConstraint":
        """Return the constraint with its target moved by ``offset`` pixels."""
        return replace(self, target=as_pixels(np.add(self.target, offset)))

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> "StrokeConstraint | None":
        """Return the constraint that does across what this one does to the face ``p``, or None where it cannot be."""
        across = mirror.points(self.placed)
        if across is None:
            return None
        camera = mirrored_camera(self.camera)
        here = mirrored_pixels(self.camera.project(model.positions_at(self.placed, p)), self.camera)
        there = camera.project(model.positions_at(across, p))
        target = mirrored_pixels(self.target, self.camera) + there.mean(axis=0) - here.mean(axis=0)
        return replace(self, source=across, target=as_pixels(target), camera=camera, locked=False)

    def to_json(self) -> dict[str, Any]:
        """Return the constraint as the session file has it."""
        source: Any
        if isinstance(self.source, SurfacePoints):
            source = {"anchors": codec.points_to_json(self.source)}
        else:
            source = [list(pixel) for pixel in self.source]
        return {
            "type": self.kind,
            "source": source,
            "target": [list(pixel) for pixel in self.target],
            "width": self.width,
            "shape": self.shape,
            "energy": self.energy,
            "camera": codec.camera_to_json(self.camera),
            **self.switches_to_json(),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "StrokeConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong kind; ``where`` names the place.
        """
        form = convert(data, _StrokeJson, where)
        source = codec.points_of(form.source.anchors) if isinstance(form.source, _PaintedJson) else form.source
        camera = form.camera.camera()
        return cls(source, form.target, form.width, camera, form.shape, form.energy, **form.switches)


def as_pixels(points: ArrayLike) -> Pixels:
    """Return ``points``, shape (n, 2), as the constraints keep pixels."""
    return tuple((u, v) for u, v in np.asarray(points, dtype=np.float64).reshape(-1, 2).tolist())


def _spread(count: int) -> Indices:
    """Return at most ``_SAMPLES`` indices spread evenly over ``count``."""
    return np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).round().astype(np.intp))
