"""JSON forms shared by the constraints (docs/session-format.md)."""

from typing import Annotated, Any

import numpy as np
from msgspec import UNSET, Meta, UnsetType
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files.json_documents import JsonError, JsonObject, given
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints

#: Largest coordinate of a pixel or a position.
LARGEST_PIXEL = _MAX_COORDINATE = 1e6
_MAX_POINTS = 100_000

Index = Annotated[int, Meta(ge=0, lt=2**31, description="a whole number of at least 0")]
Coordinate = Annotated[float, Meta(ge=-_MAX_COORDINATE, le=_MAX_COORDINATE)]
NotNegative = Annotated[float, Meta(ge=0.0, le=_MAX_COORDINATE)]
Triple = tuple[Coordinate, Coordinate, Coordinate]
Pixel = Annotated[tuple[Coordinate, Coordinate], Meta(title="pixels [u, v]")]
PictureSize = tuple[Annotated[int, Meta(ge=1, le=65536)], Annotated[int, Meta(ge=1, le=65536)]]
Position = Annotated[Triple, Meta(title="positions")]
#: Rest positions, one per anchor.
Rest = Annotated[list[Position], Meta(min_length=1, max_length=_MAX_POINTS)]
#: Weights of shapes, in their order.
ShapeWeights = Annotated[list[Coordinate], Meta(max_length=_MAX_POINTS)]
_Row = Annotated[Triple, Meta(title="rows of 3 numbers")]


class AnchorJson(JsonObject):
    """A vertex, or a point of a triangle."""

    vertex: Index | UnsetType = UNSET
    face: Index | UnsetType = UNSET
    barycentric: Triple | UnsetType = UNSET

    def __post_init__(self) -> None:
        """Check that the keys describe exactly one of the two."""
        on_face = (self.face is not UNSET, self.barycentric is not UNSET)
        if on_face != (self.vertex is UNSET,) * 2:
            raise JsonError("must have either the key 'vertex', or 'face' and 'barycentric'")
        weights = given(self.barycentric)
        if weights is not None and (min(weights) < -1e-6 or abs(sum(weights) - 1.0) > 1e-4):
            raise JsonError("must be three numbers of at least 0 that sum to 1", "barycentric")

    def anchor(self) -> SurfacePoint | int:
        """Return the surface point or the index of the vertex."""
        if self.vertex is not UNSET:
            return self.vertex
        assert self.face is not UNSET
        assert self.barycentric is not UNSET
        return SurfacePoint(self.face, self.barycentric)


Anchor = Annotated[
    AnchorJson,
    Meta(title="anchors", description="an object with the key 'vertex', or with 'face' and 'barycentric'"),
]
Anchors = Annotated[list[Anchor], Meta(min_length=1, max_length=_MAX_POINTS)]
Pixels = Annotated[tuple[Pixel, ...], Meta(min_length=1, max_length=_MAX_POINTS)]


class CameraJson(JsonObject):
    """A camera; see ``Camera``."""

    rotation: tuple[_Row, _Row, _Row]
    translation: Triple
    focal: Annotated[float, Meta(ge=1e-3, le=_MAX_COORDINATE)]
    size: PictureSize
    shift: Pixel = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Check that the numbers describe a valid camera."""
        self.camera()

    def camera(self) -> Camera:
        """Return the camera."""
        return Camera(np.array(self.rotation), np.array(self.translation), self.focal, self.size, self.shift)


def anchor_to_json(anchor: SurfacePoint | int) -> dict[str, Any]:
    """Return the JSON form of a vertex index or a surface point."""
    if isinstance(anchor, int):
        return {"vertex": anchor}
    return {"face": anchor.face, "barycentric": list(anchor.barycentric)}


def points_to_json(points: SurfacePoints) -> list[dict[str, Any]]:
    """Return the JSON form of surface points."""
    return [anchor_to_json(point) for point in points]


def points_of(anchors: list[AnchorJson]) -> SurfacePoints:
    """Return the points of the surface that ``anchors`` describe."""
    return SurfacePoints.of([anchor.anchor() for anchor in anchors])


def weights_to_json(weights: NDArray[np.float64]) -> list[float]:
    """Return the JSON form of shape weights, shape (S,), rounded to a millionth."""
    rounded: list[float] = np.round(weights, 6).tolist()
    return rounded


def rest_to_json(positions: NDArray[np.float64]) -> list[list[float]]:
    """Return the JSON form of rest positions, shape (n, 3), rounded to a ten-thousandth of the unit."""
    rounded: list[list[float]] = np.round(positions, 4).tolist()
    return rounded


def check_rest(rest: NDArray[np.float64] | None, places: SurfacePoints | None, where: str) -> None:
    """Raise ``FacePoserError`` unless ``rest``, shape (n, 3), is None or has a position for each of ``places``."""
    count = 0 if places is None else len(places)
    if rest is not None and len(rest) != count:
        raise FacePoserError(f"{where}.rest must be a list of {counted(count, 'position')}, one per anchor.")


def camera_to_json(camera: Camera) -> dict[str, Any]:
    """Return the JSON form of a camera."""
    data = {
        "rotation": camera.rotation.tolist(),
        "translation": camera.translation.tolist(),
        "focal": float(camera.focal),
        "size": list(camera.size),
    }
    return data if camera.shift == (0.0, 0.0) else data | {"shift": list(camera.shift)}
