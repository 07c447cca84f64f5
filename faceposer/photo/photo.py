"""Reference photos: pins, camera and display of an image next to the face (docs/photo.md)."""

import os
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import UNSET, Meta, UnsetType, field
from numpy.typing import ArrayLike, NDArray

from faceposer.files.json_documents import JsonError, JsonObject, given
from faceposer.files.paths import expand_user
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec

Pixel = tuple[float, float]
Place = str | SurfacePoint | int

MAX_PHOTOS = 100
_MAX_PINS = 1000
_MAX_FOCAL = 1e6
_DIGITS = 6
_MAX_WEIGHT, _MAX_SHAPES = 100.0, 10_000


_PointName = Annotated[str, Meta(min_length=1, description='the name of a feature point, such as "8.3"')]


class _PinJson(JsonObject, kw_only=True):
    point: _PointName | UnsetType = UNSET
    anchor: codec.Anchor | UnsetType = UNSET
    pixel: codec.Pixel
    rest: codec.Triple | UnsetType = UNSET

    def __post_init__(self) -> None:
        if (self.point is UNSET) == (self.anchor is UNSET):
            raise JsonError("must have one of the keys 'point' and 'anchor'")
        if self.rest is not UNSET and self.anchor is UNSET:
            raise JsonError("may have the key 'rest' only with the key 'anchor'")

    def pin(self) -> "Pin":
        if self.anchor is not UNSET:
            return Pin(self.anchor.anchor(), self.pixel, given(self.rest))
        return Pin(given(self.point) or "", self.pixel)


_Weight = Annotated[float, Meta(ge=-_MAX_WEIGHT, le=_MAX_WEIGHT)]
_ExpressionJson = Annotated[dict[str, _Weight], Meta(max_length=_MAX_SHAPES)]
PinsJson = Annotated[list[Annotated[_PinJson, Meta(title="pins")]], Meta(max_length=_MAX_PINS)]


class PhotoJson(JsonObject, kw_only=True):
    """A photo in a session file; see ``Photo``."""

    path: Annotated[str, Meta(min_length=1, description="the path of an image")]
    size: codec.PictureSize
    pins: PinsJson = field(default_factory=list)
    camera: codec.CameraJson | UnsetType = UNSET
    focal: Annotated[float, Meta(ge=1.0, le=_MAX_FOCAL)] | UnsetType = UNSET
    opacity: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.6
    front: bool = False
    visible: bool = True
    expression: _ExpressionJson | UnsetType = UNSET

    def __post_init__(self) -> None:
        """Check that the camera has the size of the photo, and that no place is pinned twice."""
        if self.camera is not UNSET and self.camera.size != self.size:
            raise JsonError("must have the size of the photo", "camera")
        check_places(self.pins, "pins")

    def photo(self) -> "Photo":
        """Return the photo."""
        pins = tuple(pin.pin() for pin in self.pins)
        camera = None if self.camera is UNSET else self.camera.camera()
        expression = None if self.expression is UNSET else tuple(self.expression.items())
        focal = given(self.focal)
        return Photo(self.path, self.size, pins, camera, focal, self.opacity, self.front, self.visible, expression)


PhotosJson = Annotated[list[Annotated[PhotoJson, Meta(title="photos")]], Meta(max_length=MAX_PHOTOS)]


def check_places(pins: list[_PinJson], key: str) -> None:
    """Raise ``JsonError`` if two of ``pins``, the value of ``key``, have the same place."""
    seen: set[Place] = set()
    for i, pin in enumerate(pins):
        place = pin.pin().place
        if place in seen:
            raise JsonError("has the same place as an earlier pin", f"{key}[{i}]")
        seen.add(place)


@dataclass(frozen=True)
class Pin:
    """A place of the face with its position in the photo.

    Attributes:
        place: Name of a feature point, a surface point, or the index of a vertex.
        pixel: (u, v) in the photo, from its top left corner.
        rest: Position on the neutral face of a place without a name, in a file; None in memory.
    """

    place: Place
    pixel: Pixel
    rest: tuple[float, float, float] | None = dataclass_field(default=None, compare=False)

    def with_rest(self, model: FaceModel) -> "Pin":
        """Return the pin with its rest position for a file, unless its place has a name."""
        if isinstance(self.place, str):
            return replace(self, rest=None)
        positions = SurfacePoints.of([self.place]).positions(model.character.vertices, model.triangles)
        x, y, z = codec.rest_to_json(positions)[0]
        return replace(self, rest=(x, y, z))

    def to_json(self) -> dict[str, Any]:
        """Return the pin as written in files."""
        if isinstance(self.place, str):
            return {"point": self.place, "pixel": list(self.pixel)}
        data = {"anchor": codec.anchor_to_json(self.place), "pixel": list(self.pixel)}
        return data if self.rest is None else data | {"rest": list(self.rest)}


@dataclass(frozen=True)
class Photo:
    """A reference photo for posing.

    Attributes:
        path: Path of the image: absolute in memory, in a session file relative to its folder where possible.
        size: Width and height in pixels, with the orientation of the EXIF data applied.
        pins: Pins in order of creation, at most one per place.
        camera: Camera of the photo in its pixels, estimated from the pins; None before the first estimate.
        focal: Focal length in pixels if known; None to estimate it with the camera.
        opacity: Opacity of the layer in front, 0 to 1: the photo or the face.
        front: True if the photo is in front of the face.
        visible: True if the photo is displayed.
        expression: Names of shapes with the weights by which the character has the expression of the photo; those that
            are left out are 0. None if it is unknown.
    """

    path: str
    size: tuple[int, int]
    pins: tuple[Pin, ...] = ()
    camera: Camera | None = None
    focal: float | None = None
    opacity: float = 0.6
    front: bool = False
    visible: bool = True
    expression: tuple[tuple[str, float], ...] | None = None

    @property
    def name(self) -> str:
        """Name of the image file."""
        return Path(self.path).name

    def pin_of(self, place: Place) -> int | None:
        """Return the index of the pin of ``place``, or None."""
        return next((i for i, pin in enumerate(self.pins) if pin.place == place), None)

    def with_pin(self, pin: Pin) -> "Photo":
        """Return the photo with ``pin`` added, replacing one of the same place."""
        index = self.pin_of(pin.place)
        if index is None:
            return replace(self, pins=(*self.pins, pin))
        return replace(self, pins=(*self.pins[:index], pin, *self.pins[index + 1 :]))

    def without_pin(self, index: int) -> "Photo":
        """Return the photo without the pin ``index``."""
        return replace(self, pins=(*self.pins[:index], *self.pins[index + 1 :]))

    def with_expression(self, model: FaceModel, pose: ArrayLike) -> "Photo":
        """Return the photo in which the character of ``model`` has the expression ``pose``, shape (r,)."""
        weights = np.round(model.weights_of(pose), _DIGITS).tolist()
        named = zip(model.character.shape_names, weights, strict=True)
        return replace(self, expression=tuple((name, weight) for name, weight in named if weight))

    def pose_of(self, model: FaceModel) -> NDArray[np.float64] | None:
        """Return the expression of the photo on the character of ``model``, shape (r,), or None if it is unknown."""
        if self.expression is None:
            return None
        known = set(model.character.shape_names)
        return model.coefficients_of({name: weight for name, weight in self.expression if name in known})

    def with_rest(self, model: FaceModel) -> "Photo":
        """Return the photo with the rest positions of its pins, for a session file."""
        return replace(self, pins=tuple(pin.with_rest(model) for pin in self.pins))

    def to_json(self) -> dict[str, Any]:
        """Return the photo as written in a session file."""
        data: dict[str, Any] = {
            "path": self.path,
            "size": list(self.size),
            "pins": [pin.to_json() for pin in self.pins],
            "opacity": self.opacity,
            "front": self.front,
            "visible": self.visible,
        }
        if self.camera is not None:
            data["camera"] = codec.camera_to_json(self.camera)
        if self.focal is not None:
            data["focal"] = self.focal
        if self.expression is not None:
            data["expression"] = dict(self.expression)
        return data


def absolute_path(path: str, folder: Path) -> str:
    """Return ``path``, relative to ``folder``, as an absolute path."""
    return os.path.normpath((folder / expand_user(path)).absolute())
