"""Constraint that projects a group of points onto a drawn stroke (Lau et al. 2009, section 4.3)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from faceposer.files.json_documents import JsonError, JsonObject, convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.geometry.mirror import SurfaceMirror, mirrored_camera, mirrored_pixels
from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.strokes import MOST_EFFORT, MOST_PIXELS, StrokeShape, stroke_effort, stroke_pixels
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson
from faceposer.solve.constraints.stroke_terms import StrokeDistanceTerm, StrokeImageTerm
from faceposer.solve.term import Array, Indices, Term

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Pixels = tuple[tuple[float, float], ...]
StrokeEnergy = Literal["distance", "image"]
STROKE_ENERGIES: tuple[StrokeEnergy, ...] = get_args(StrokeEnergy)
WIDEST = 200.0
# Largest number of points of a stroke that are evaluated.
_SAMPLES = 200
#: Maximum number of pixels at which the source of a stroke is picked.
MOST_PICKED = 20_000


class _PaintedJson(JsonObject):
    anchors: codec.Anchors


class _StrokeJson(ConstraintJson, kw_only=True):
    source: _PaintedJson | codec.Pixels
    target: codec.Pixels
    width: Annotated[float, Meta(ge=1.0, le=WIDEST)]
    camera: codec.CameraJson
    shape: StrokeShape = "line"
    energy: StrokeEnergy = "distance"

    def __post_init__(self) -> None:
        source = () if isinstance(self.source, _PaintedJson) else self.source
        for key, path in (("source", source), ("target", self.target)):
            if path and stroke_effort(path, self.width, self.shape) > MOST_EFFORT:
                raise JsonError(f"must not cover more than {MOST_PIXELS} pixels", key)


@dataclass(frozen=True)
class StrokeConstraint(ConstraintBase):
    """Moves the points ``source`` of the face so that together they cover the pixels of the stroke ``target``.

    Attributes:
        source: Points painted on the face; in a file also the pixels along the path of the brush, which are then picked
            on the face that editing starts from.
        target: Pixels along the path of the brush that drew the target.
        width: Diameter of the brush in pixels.
        camera: The camera under which both were drawn.
        shape: Shape of the target: an open line, a closed line, or a filled region.
        energy: "distance" for nearest-point distances in both directions; "image" for the paper's difference of two
            binary images with an attraction between their centroids.
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
            RuntimeError: If the source is unresolved; see ``resolved``.
        """
        if not isinstance(self.source, SurfacePoints):
            raise RuntimeError("the source of the stroke is not resolved to points of the face yet")
        return self.source

    @cached_property
    def points(self) -> SurfacePoints:
        """The points at which the energy is evaluated."""
        return self.placed if self.energy == "image" else self.placed.subset(_spread(len(self.placed)))

    @cached_property
    def target_pixels(self) -> Array:
        """Centres of the pixels that the target covers, shape (m, 2).

        Raises:
            ValueError: If they are too many.
        """
        return stroke_pixels(self.target, self.width, self.shape)

    @cached_property
    def _target_tree(self) -> "cKDTree":
        # Imported late: the window starts without it.
        from scipy.spatial import cKDTree

        return cKDTree(self.target_pixels)

    @property
    def effort(self) -> float:
        """Upper bound of the pixels that are handled to find what both strokes cover."""
        paths = (self.target,) if isinstance(self.source, SurfacePoints) else (self.source, self.target)
        return sum(stroke_effort(path, self.width, self.shape) for path in paths)

    @property
    def image_effort(self) -> float:
        """Upper bound of the pixels that are compared in each step of the solver; 0 for distances."""
        if self.energy != "image":
            return 0.0
        return self.effort + (len(self.source) if isinstance(self.source, SurfacePoints) else 0)

    @property
    def places(self) -> SurfacePoints | None:
        """All points of the source, or None if the source is unresolved."""
        return self.source if isinstance(self.source, SurfacePoints) else None

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "StrokeConstraint":
        """Return the constraint at ``places`` of another version of the character, its camera moved by ``frame``."""
        return replace(
            self, source=self.source if places is None else places, camera=self.camera.following(frame), rest=None
        )

    def resolved(self, model: FaceModel, p: ArrayLike, most: int = MOST_PICKED) -> "StrokeConstraint":
        """Return the constraint with points as its source, picked on the face ``p`` at up to ``most`` pixels of it.

        Raises:
            ValueError: If the source does not lie on the face, or one of the strokes covers too many pixels.
        """
        _ = self.target_pixels
        if isinstance(self.source, SurfacePoints):
            self.source.check(model.triangles)
            return self
        pixels = stroke_pixels(self.source, self.width, self.shape)
        points, met = model.pick(p, self.camera, pixels[_spread(len(pixels), most)])
        if not met.any():
            raise ValueError("its source does not touch the face")
        return replace(self, source=points)

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the mean nearest-point distance between the two strokes on the face ``p``, in pixels."""
        return self.residual_of(self.camera.project(model.positions_at(self.points, p)))

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given the projected ``pixels`` of the constraint's points, shape (n, 2)."""
        return self.residual_of(pixels)

    def residual_of(self, pixels: Array) -> float:
        """Return the mean nearest-point distance between the ``pixels`` of ``points``, shape (n, 2), and the target."""
        # Imported late: the window starts without it.
        from scipy.spatial import cKDTree

        if not np.isfinite(pixels).all():
            return float("inf")
        target = self.target_pixels[_spread(len(self.target_pixels))]
        to_target, _ = self._target_tree.query(pixels)
        to_source, _ = cKDTree(pixels).query(target)
        return float(0.5 * (to_target.mean() + to_source.mean()))

    @staticmethod
    def terms(constraints: Sequence["StrokeConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return a term for each of ``constraints``; ``slots`` are the indices of their points in the state."""
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
        """Return the mirrored constraint for the face ``p``, or None if its points have no mirror image."""
        opposite = mirror.points(self.placed)
        if opposite is None:
            return None
        camera = mirrored_camera(self.camera)
        pixels = mirrored_pixels(self.camera.project(model.positions_at(self.placed, p)), self.camera)
        opposite_pixels = camera.project(model.positions_at(opposite, p))
        target = mirrored_pixels(self.target, self.camera) + opposite_pixels.mean(axis=0) - pixels.mean(axis=0)
        return replace(self, source=opposite, target=as_pixels(target), camera=camera, locked=False)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form of the constraint."""
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
            FacePoserError: If a key is unknown, missing or of the wrong type; ``where`` names the place.
        """
        form = convert(data, _StrokeJson, where)
        source = codec.points_of(form.source.anchors) if isinstance(form.source, _PaintedJson) else form.source
        camera = form.camera.camera()
        return cls(source, form.target, form.width, camera, form.shape, form.energy, **form.switches)


def as_pixels(points: ArrayLike) -> Pixels:
    """Return ``points``, shape (n, 2), as a tuple of pixels."""
    return tuple((u, v) for u, v in np.asarray(points, dtype=np.float64).reshape(-1, 2).tolist())


def _spread(count: int, most: int = _SAMPLES) -> Indices:
    """Return at most ``most`` evenly spaced indices below ``count``."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))
