"""A photo beside the face: its pins, the camera that took it and how it is shown (docs/photo.md)."""

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec

Pixel = tuple[float, float]
Place = str | SurfacePoint | int

MAX_PHOTOS = 100
_MAX_PINS = 1000
_MAX_SIDE = 65536
_MAX_FOCAL = 1e6


@dataclass(frozen=True)
class Pin:
    """A place of the face and where the photo shows it.

    Attributes:
        place: Name of a feature point, a surface point, or the index of a vertex.
        pixel: (u, v) in the photo, from its top left.
        rest: Where a place that has no name lies on the neutral face, in a file; None while the pin is edited.
    """

    place: Place
    pixel: Pixel
    rest: tuple[float, float, float] | None = field(default=None, compare=False)

    def with_rest(self, model: FaceModel) -> "Pin":
        """Return the pin as a file keeps it, with its rest position unless it has a name."""
        if isinstance(self.place, str):
            return replace(self, rest=None)
        positions = SurfacePoints.of([self.place]).positions(model.subject.vertices, model.triangles)
        x, y, z = codec.rest_to_json(positions)[0]
        return replace(self, rest=(x, y, z))

    def to_json(self) -> dict[str, Any]:
        """Return the pin as files have it."""
        if isinstance(self.place, str):
            return {"point": self.place, "pixel": list(self.pixel)}
        data = {"anchor": codec.anchor_to_json(self.place), "pixel": list(self.pixel)}
        return data if self.rest is None else data | {"rest": list(self.rest)}

    @classmethod
    def from_json(cls, data: Any, where: str) -> "Pin":
        """Return the pin that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong kind; ``where`` names the place.
        """
        rest = None
        if isinstance(data, dict) and "anchor" in data:
            codec.check_keys(data, {"anchor", "pixel"}, {"rest"}, where)
            place: Place = codec.anchor_from_json(data["anchor"], f"{where}.anchor")
            if "rest" in data:
                x, y, z = codec.numbers_from_json(data["rest"], 3, f"{where}.rest")
                rest = (x, y, z)
        else:
            codec.check_keys(data, {"point", "pixel"}, set(), where)
            if not isinstance(data["point"], str) or not data["point"]:
                raise FacePoserError(f'{where}.point must be the name of a feature point, such as "8.3".')
            place = data["point"]
        return cls(place, codec.pixel_from_json(data["pixel"], f"{where}.pixel"), rest)


def pins_from_json(value: Any, where: str) -> tuple[Pin, ...]:
    """Return the pins in the list ``value``, no place twice, or raise ``FacePoserError``."""
    if not isinstance(value, list) or len(value) > _MAX_PINS:
        raise FacePoserError(f"{where} must be a list of at most {_MAX_PINS} pins.")
    pins = tuple(Pin.from_json(item, f"{where}[{i}]") for i, item in enumerate(value))
    seen: set[Place] = set()
    for i, pin in enumerate(pins):
        if pin.place in seen:
            raise FacePoserError(f"{where}[{i}] pins a place that another one pins already.")
        seen.add(pin.place)
    return pins


@dataclass(frozen=True)
class Photo:
    """A picture that the face is posed after.

    Attributes:
        path: Of its file, from everywhere while it is edited, and in a session as seen from where that lies.
        size: Width and height in pixels, upright as the file's EXIF data says.
        pins: In the order in which they were set, no place twice.
        camera: The camera that took it, in the photo's pixels, as far as the pins tell; None before it was sought.
        focal: Its focal length in pixels, where it is known; else it is found with the camera.
        opacity: Of what lies in front, 0 to 1: the photo, or else the face.
        front: Whether the photo lies before the face.
        visible: Whether it is shown.
    """

    path: str
    size: tuple[int, int]
    pins: tuple[Pin, ...] = ()
    camera: Camera | None = None
    focal: float | None = None
    opacity: float = 0.6
    front: bool = False
    visible: bool = True

    @property
    def name(self) -> str:
        """Name of its file."""
        return Path(self.path).name

    def pin_of(self, place: Place) -> int | None:
        """Return the index of the pin of ``place``, or None."""
        return next((i for i, pin in enumerate(self.pins) if pin.place == place), None)

    def with_pin(self, pin: Pin) -> "Photo":
        """Return the photo with ``pin``, in the stead of one of the same place."""
        index = self.pin_of(pin.place)
        if index is None:
            return replace(self, pins=(*self.pins, pin))
        return replace(self, pins=(*self.pins[:index], pin, *self.pins[index + 1 :]))

    def without_pin(self, index: int) -> "Photo":
        """Return the photo without the pin ``index``."""
        return replace(self, pins=(*self.pins[:index], *self.pins[index + 1 :]))

    def with_rest(self, model: FaceModel) -> "Photo":
        """Return the photo as a session's file keeps it, with the rest positions of its pins."""
        return replace(self, pins=tuple(pin.with_rest(model) for pin in self.pins))

    def to_json(self) -> dict[str, Any]:
        """Return the photo as a session has it."""
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
        return data

    @classmethod
    def from_json(cls, data: Any, where: str) -> "Photo":
        """Return the photo that ``data`` describes; its file is not looked for.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong kind; ``where`` names the place.
        """
        optional = {"pins", "camera", "focal", "opacity", "front", "visible"}
        codec.check_keys(data, {"path", "size"}, optional, where)
        if not isinstance(data["path"], str) or not data["path"]:
            raise FacePoserError(f"{where}.path must be the path of a picture.")
        if not isinstance(data["size"], list) or len(data["size"]) != 2:
            raise FacePoserError(f"{where}.size must be a list of 2 whole numbers.")
        width, height = (codec.index_from_json(side, f"{where}.size[{i}]") for i, side in enumerate(data["size"]))
        if not (0 < width <= _MAX_SIDE and 0 < height <= _MAX_SIDE):
            raise FacePoserError(f"{where}.size must be from 1 to {_MAX_SIDE} pixels each way.")
        camera = codec.camera_from_json(data["camera"], f"{where}.camera") if "camera" in data else None
        if camera is not None and camera.size != (width, height):
            raise FacePoserError(f"{where}.camera is of a picture of another size than the photo.")
        focal = codec.number_from_json(data["focal"], f"{where}.focal", 1.0, _MAX_FOCAL) if "focal" in data else None
        return cls(
            data["path"],
            (width, height),
            pins_from_json(data.get("pins", []), f"{where}.pins"),
            camera,
            focal,
            codec.number_from_json(data.get("opacity", 0.6), f"{where}.opacity", 0.0, 1.0),
            codec.flag_from_json(data.get("front", False), f"{where}.front"),
            codec.flag_from_json(data.get("visible", True), f"{where}.visible"),
        )


def photos_from_json(value: Any, where: str) -> tuple[Photo, ...]:
    """Return the photos in the list ``value``, or raise ``FacePoserError``."""
    if not isinstance(value, list) or len(value) > MAX_PHOTOS:
        raise FacePoserError(f"{where} must be a list of at most {MAX_PHOTOS} photos.")
    return tuple(Photo.from_json(item, f"{where}[{i}]") for i, item in enumerate(value))


def whole_path(path: str, folder: Path) -> str:
    """Return ``path`` as seen from ``folder``, from everywhere."""
    return os.path.normpath((folder / Path(path).expanduser()).absolute())
