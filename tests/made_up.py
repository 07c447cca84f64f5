"""A constraint kind and two export formats that the program does not know, for tests of what an addition takes."""

from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from faceposer.files.atomic import atomic_folder, write_text
from faceposer.files.json_documents import convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.geometry.mirror import SurfaceMirror
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.interchange import formats
from faceposer.interchange.formats import Format, Output
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.solve.constraints import codec, registry
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson, PlaceNames
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, Indices, PoseState, ResidualTerm, Term


class _MidpointJson(ConstraintJson, kw_only=True):
    anchors: tuple[codec.Anchor, codec.Anchor]
    target: codec.Pixel
    camera: codec.CameraJson


@dataclass(frozen=True)
class MidpointConstraint(ConstraintBase):
    """The middle of what the camera shows of two points lies at the pixel ``target``."""

    kind: ClassVar[str] = "midpoint"
    noun: ClassVar[str] = "midpoint"
    icon: ClassVar[str] = "curve"

    anchors: tuple[SurfacePoint | int, SurfacePoint | int]
    target: tuple[float, float]
    camera: Camera

    @cached_property
    def points(self) -> SurfacePoints:
        return SurfacePoints.of(list(self.anchors))

    def nudged(self, offset: tuple[float, float]) -> "MidpointConstraint":
        return replace(self, target=(self.target[0] + offset[0], self.target[1] + offset[1]))

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "MidpointConstraint":
        assert places is not None
        return replace(self, anchors=(places[0], places[1]), camera=self.camera.following(frame), rest=None)

    def place(self, names: PlaceNames) -> str:
        return f"middle of {names.pair(self.anchors)}"

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        middle = self.camera.project(model.positions_at(self.points, p)).mean(axis=0)
        return float(np.hypot(*(middle - self.target)))

    @staticmethod
    def terms(constraints: Sequence["MidpointConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        return [MidpointTerm(constraint, slot) for constraint, slot in zip(constraints, slots, strict=True)]

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> None:
        return None

    def to_json(self) -> dict[str, Any]:
        return {
            "type": self.kind,
            "anchors": codec.points_to_json(self.points),
            "target": list(self.target),
            "camera": codec.camera_to_json(self.camera),
            **self.switches_to_json(),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "MidpointConstraint":
        form = convert(data, _MidpointJson, where)
        first, second = form.anchors
        return cls((first.anchor(), second.anchor()), form.target, form.camera.camera(), **form.switches)


class MidpointTerm(ResidualTerm):
    """w / sigma^2 |(y_1(p) + y_2(p)) / 2 - z|^2 of two pixels y and a target z."""

    def __init__(self, constraint: MidpointConstraint, points: Indices) -> None:
        super().__init__(np.full(2, constraint.weight / SIGMA_PX**2))
        self._target, self._points = np.array(constraint.target), points

    def residual(self, state: PoseState) -> Array:
        middle: Array = state.pixels[self._points].mean(axis=0) - self._target
        return middle

    def jacobian(self, state: PoseState) -> Array:
        jacobian: Array = state.pixel_jacobian(self._points).mean(axis=0)
        return jacobian


@contextmanager
def registered_constraint(kind: type[registry.Constraint] = MidpointConstraint) -> Iterator[None]:
    """Let the program know the kind of constraint ``kind`` until the block ends."""
    registry.register(kind)
    try:
        yield
    finally:
        del registry.CONSTRAINTS[kind.kind]


def _rows(vertices: ArrayLike) -> str:
    return "".join(f"{x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in np.asarray(vertices).tolist())


def _write_cloud(output: Output) -> Generator[float, None, None]:
    write_text(output.path, _rows(output.model.surface(output.motion, output.options.contact)), "point cloud")
    yield 1.0


def _write_clouds(output: Output) -> Generator[float, None, None]:
    assert isinstance(output.motion, Performance)
    with atomic_folder(output.path) as temporary:
        for i, pose in enumerate(output.motion.coefficients, 1):
            (temporary / f"{i:04}.xyz").write_text(_rows(output.model.surface(pose)))
            yield i / len(output.motion)


def _write_flip_book(output: Output) -> Generator[float, None, None]:
    frames = len(output.motion) if isinstance(output.motion, Performance) else 1
    turn, (width, height) = output.options.turn, output.options.size
    write_text(output.path, f"frames {frames} turn {turn:g} size {width}x{height}\n", "flip book")
    yield 1.0


#: The posed vertices as text, one pose a file.
CLOUD = Format(".xyz", "XYZ", "the posed vertices, for tests", "pose", _write_cloud, _write_clouds)
#: What a film is made of: how many frames, how long the camera turns, how large.
FLIP_BOOK = Format(".flip", "Flip book", "the face in motion, for tests", "film", _write_flip_book, drawn=True)


@contextmanager
def registered_formats() -> Iterator[None]:
    """Let the program know the two formats until the block ends."""
    for form in (CLOUD, FLIP_BOOK):
        formats.register(form)
    try:
        yield
    finally:
        for form in (CLOUD, FLIP_BOOK):
            del formats.FORMATS[form.suffix]
