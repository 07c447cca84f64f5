"""Constraint that shapes a feature of the face as drawn, without a source stroke (Gunnarsson and Maddock 2010)."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from faceposer.files.json_documents import JsonError, JsonObject, convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.geometry.mirror import SurfaceMirror, mirrored_camera, mirrored_pixels
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_in_view import FaceInView
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES, MIRRORED_POINTS, Feature, FeatureCurve, feature_curves
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson, PlaceNames
from faceposer.solve.constraints.sketch_contour import ON_CONTOUR, beside_contour
from faceposer.solve.constraints.sketch_matching import cleaned, correspondence, distances
from faceposer.solve.constraints.sketch_term import SketchTargets, SketchTerm
from faceposer.solve.constraints.stroke import Pixels, as_pixels
from faceposer.solve.term import Array, Indices, Term

#: Ways from sketches to a face: as constraints of the solve, or by the paper's statistical mapping, from whose face the
#: solve of the other constraints then starts.
SketchMethod = Literal["map", "paper"]
SKETCH_METHODS: tuple[SketchMethod, ...] = get_args(SketchMethod)
#: Largest number of points of a stroke.
MOST_STROKE_POINTS = 10_000
_MOST_MATCHED = 32
# Largest number of points of the face between two feature points.
_PER_PIECE = 7


class _MatchedJson(JsonObject):
    feature_point: str
    pixel: codec.Pixel


_Matched = Annotated[list[_MatchedJson], Meta(min_length=1, max_length=_MOST_MATCHED)]


class _SketchJson(ConstraintJson, kw_only=True):
    stroke: Annotated[tuple[codec.Pixel, ...], Meta(min_length=2, max_length=MOST_STROKE_POINTS)]
    camera: codec.CameraJson
    feature: str
    points: _Matched

    def __post_init__(self) -> None:
        if self.feature not in FEATURES:
            raise JsonError(f"must be the name of a feature: {', '.join(FEATURES)}", "feature")
        known, names = FEATURES[self.feature].points, [point.feature_point for point in self.points]
        if len(set(names)) < len(names) or not set(names) <= set(known):
            raise JsonError(
                f"must name feature points of the {self.feature}, each once; these are {', '.join(known)}", "points"
            )
        if not np.ptp(self.stroke, axis=0).max() > 0:
            raise JsonError("must have a length", "stroke")


@dataclass(frozen=True, eq=False)
class TracedSketch:
    """The points of a face that a sketch moves, and their targets.

    Attributes:
        points: Points of the surface, shape (m,).
        targets: Places on the stroke, shape (m, 2).
        tangents: Unit tangents of the stroke there, shape (m, 2).
        matched: Mask of the matched feature points, shape (m,).
        chains: Index of the feature's chain of each point, shape (m,).
        parameters: Parameter of each point on the curve of that chain, shape (m,); see ``FeatureCurve``.
    """

    points: SurfacePoints
    targets: Array
    tangents: Array
    matched: NDArray[np.bool_]
    chains: Indices
    parameters: Array

    def joined(self, other: "TracedSketch") -> "TracedSketch":
        """Return these points followed by those of ``other``."""
        return TracedSketch(
            self.points.joined(other.points),
            np.concatenate([self.targets, other.targets]),
            np.concatenate([self.tangents, other.tangents]),
            np.concatenate([self.matched, other.matched]),
            np.concatenate([self.chains, other.chains]),
            np.concatenate([self.parameters, other.parameters]),
        )


@dataclass(frozen=True)
class SketchConstraint(ConstraintBase):
    """Shapes a feature of the face so that it appears as the stroke.

    Attributes:
        stroke: Points of the stroke in the order of drawing, at least two, in the pixels of ``camera``.
        camera: The camera under which it was drawn.
        feature: Name of the feature that it depicts, one of ``FEATURES``.
        matched: Names of feature points of the feature with their places on the stroke, at least one.
        traced: Points and targets on one character; None until they are ``resolved``.
    """

    kind: ClassVar[str] = "sketch"
    noun: ClassVar[str] = "sketch"
    icon: ClassVar[str] = "sketch"
    # A hand shifts whole strokes; see ``SketchTerm``.
    notable_px: ClassVar[float] = 10.0

    stroke: Pixels
    camera: Camera
    feature: str
    matched: tuple[tuple[str, tuple[float, float]], ...]
    # It follows from the other fields and the character.
    traced: TracedSketch | None = field(default=None, compare=False, repr=False)

    @property
    def on_face(self) -> TracedSketch:
        """Points and targets on the character.

        Raises:
            RuntimeError: If they are unresolved; see ``resolved``.
        """
        if self.traced is None:
            raise RuntimeError("the sketch is not resolved to points of the face yet")
        return self.traced

    @property
    def points(self) -> SurfacePoints:
        """The points of the face along the part of the feature that is drawn."""
        return self.on_face.points

    @property
    def places(self) -> SurfacePoints | None:
        """None: a file stores no points of the surface, as they follow from the feature."""
        return None

    @cached_property
    def line(self) -> Array:
        """The stroke, evenly spaced and without tremor, shape (n, 2).

        Raises:
            ValueError: If the stroke has no length.
        """
        return cleaned(np.array(self.stroke), FEATURES[self.feature].closed)

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "SketchConstraint":
        """Return the constraint for another version of the character, its camera moved by ``frame``."""
        return replace(self, camera=self.camera.following(frame), traced=None, rest=None)

    def resolved(self, model: FaceModel, p: ArrayLike) -> "SketchConstraint":
        """Return the constraint with its points on the character of ``model``, which do not depend on the pose ``p``.

        Raises:
            ValueError: If the stroke has no length or is far from the face in its camera, the camera does not have the
                face in front of it, or the character lacks the feature.
        """
        FaceInView.of(model.character, self.camera).check_near(self.stroke)
        return replace(self, traced=_traced(self, model))

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the mean distance from the points of the face ``p`` to the stroke, in pixels."""
        return self.residual_of(self.camera.project(model.positions_at(self.points, p)))

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given the projected ``pixels`` of the constraint's points, shape (n, 2)."""
        return self.residual_of(pixels)

    def residual_of(self, pixels: Array) -> float:
        """Return the mean distance from ``pixels``, shape (n, 2), to the stroke."""
        return float(distances(pixels, self.line).mean())

    @staticmethod
    def terms(constraints: Sequence["SketchConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return a term for all ``constraints``; ``slots`` are the indices of their points in the state."""
        pairs = zip(constraints, slots, strict=True)
        return [_term(tuple((sketch.on_face, sketch.weight, sketch.camera, int(at[0])) for sketch, at in pairs))]

    def nudged(self, offset: tuple[float, float]) -> "SketchConstraint":
        """Return the constraint with its stroke moved by ``offset`` pixels."""
        traced = self.traced
        return replace(
            self,
            stroke=as_pixels(np.add(self.stroke, offset)),
            matched=tuple((name, (u + offset[0], v + offset[1])) for name, (u, v) in self.matched),
            traced=None if traced is None else replace(traced, targets=traced.targets + offset),
        )

    def place(self, names: PlaceNames) -> str:
        """Return the name of the feature."""
        return self.feature

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> "SketchConstraint | None":
        """Return the mirrored constraint, or None if the character lacks the feature on the other side.

        The stroke moves with the other side of the neutral face, so that asymmetry of the character is kept; that of
        the pose is not, since the stroke states how the feature should look.
        """
        opposite = FEATURES[self.feature].mirror
        if opposite not in feature_curves(model.character):
            return None
        camera = mirrored_camera(self.camera)
        vertices, ids = model.character.vertices, model.character.feature_points
        names = [name for name, _ in self.matched]
        here = mirrored_pixels(self.camera.project(vertices[[ids[name] for name in names]]), self.camera)
        there = camera.project(vertices[[ids[MIRRORED_POINTS[name]] for name in names]])
        offset = (there - here).mean(axis=0)
        pixels = mirrored_pixels([pixel for _, pixel in self.matched], self.camera) + offset
        image = replace(
            self,
            stroke=as_pixels(mirrored_pixels(self.stroke, self.camera) + offset),
            camera=camera,
            feature=opposite,
            matched=tuple(zip((MIRRORED_POINTS[name] for name in names), as_pixels(pixels), strict=True)),
            locked=False,
        )
        return image.resolved(model, p)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form of the constraint."""
        return {
            "type": self.kind,
            "stroke": [list(pixel) for pixel in self.stroke],
            "camera": codec.camera_to_json(self.camera),
            "feature": self.feature,
            "points": [{"feature_point": name, "pixel": list(pixel)} for name, pixel in self.matched],
            **self.switches_to_json(),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "SketchConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; ``where`` names the place.
        """
        form = convert(data, _SketchJson, where)
        matched = tuple((point.feature_point, point.pixel) for point in form.points)
        return cls(form.stroke, form.camera.camera(), form.feature, matched, **form.switches)


@lru_cache(maxsize=4)
def _term(sketches: tuple[tuple[TracedSketch, float, Camera, int], ...]) -> SketchTerm:
    """Return the term of sketches, given with their weights, cameras and the indices of their first points.

    It is cached, since sketches stay as they are while other constraints are dragged.
    """
    return SketchTerm(
        [
            SketchTargets(first + np.arange(len(on.points)), on.targets, on.tangents, on.matched, weight, camera)
            for on, weight, camera, first in sketches
        ]
    )


def _traced(sketch: SketchConstraint, model: FaceModel) -> TracedSketch:
    """Return the points of the face of ``model`` along the feature of ``sketch``, with their targets."""
    character, feature = model.character, FEATURES[sketch.feature]
    missing = [name for name in feature.points if name not in character.feature_points]
    if missing:
        raise ValueError(f"the character has no {feature.name}: it lacks the feature points {', '.join(missing)}")
    pieces: list[TracedSketch] = []
    for i, curve in enumerate(feature_curves(character)[feature.name]):
        kept = _kept(curve)
        pixels = sketch.camera.project(curve.points.positions(character.vertices, model.triangles))
        matched = _matched_on(sketch, feature, feature.chains[i])
        found = correspondence(pixels, curve.parameters, feature.closed, sketch.line, matched)
        chosen = np.isin(found.indices, kept)
        indices = found.indices[chosen]
        at_point = np.isin(indices, curve.knots[found.used])
        places, tangents = found.places[chosen], found.tangents[chosen]
        if feature.name in ON_CONTOUR and len(indices) > 1:
            in_space = curve.points.subset(indices).positions(character.vertices, model.triangles)
            covered, moved = beside_contour(sketch.line, pixels[indices], in_space, character, sketch.camera)
            if covered.any():
                indices, at_point = indices[covered], at_point[covered]
                places, tangents = moved[covered], tangents[covered]
        pieces.append(
            TracedSketch(
                curve.points.subset(indices),
                places,
                tangents,
                at_point,
                np.full(len(indices), i),
                curve.parameters[indices],
            )
        )
    whole = pieces[0]
    for piece in pieces[1:]:
        whole = whole.joined(piece)
    if not len(whole.points):
        raise ValueError("its stroke does not meet the feature")
    return whole


def _matched_on(sketch: SketchConstraint, feature: Feature, chain: tuple[str, ...]) -> dict[int, Array]:
    """Return the places of the matched points on ``chain`` by their index.

    A chain with fewer than two takes those at the same place of the other one: a line along the closed mouth is on both
    lips, whichever it was matched with.
    """
    places = {name: np.array(pixel) for name, pixel in sketch.matched}
    own = {i: places[name] for i, name in enumerate(chain) if name in places}
    if len(own) > 1 or len(feature.chains) == 1:
        return own
    for other in feature.chains:
        own |= {i: places[name] for i, name in enumerate(other) if name in places and i not in own}
    return own


def _kept(curve: FeatureCurve) -> Indices:
    """Return the indices of the points of ``curve`` that are used: all feature points, and some between them."""
    pieces = [
        np.linspace(a, b, min(b - a, _PER_PIECE) + 1).round().astype(np.intp)
        for a, b in zip(curve.knots[:-1].tolist(), curve.knots[1:].tolist(), strict=True)
    ]
    return np.unique(np.concatenate(pieces))
