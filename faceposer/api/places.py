"""Conversion of the places and pixels that callers give to the form that constraints take."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_names import feature_vertex, region_vertices
from faceposer.solve.constraints.stroke import as_pixels

#: A place on a face: the name of a feature point, a vertex index, a surface point, or a pixel.
Place = str | int | SurfacePoint | tuple[float, float]
Pixels = Sequence[tuple[float, float]] | ArrayLike


def point_at(model: FaceModel, p: ArrayLike, place: Place, camera: Camera) -> SurfacePoint | int:
    """Return the surface point at ``place``; a pixel of ``camera`` is picked on the face in the pose ``p``, shape (r,).

    Raises:
        FacePoserError: If there is no such place.
    """
    if isinstance(place, str):
        return feature_vertex(model.character, place)
    if isinstance(place, SurfacePoint):
        try:
            SurfacePoints.of([place]).check(model.triangles)
        except ValueError as error:
            raise FacePoserError(f"The place is not on '{model.character.title}': {error}.") from error
        return place
    if isinstance(place, (int, np.integer)):
        return int(_vertices(model.character, [place])[0])
    points, met = model.pick(p, camera, pixels_of([place]))
    if not met[0]:
        raise FacePoserError(f"The camera does not see the face at the pixel ({place[0]:g}, {place[1]:g}).")
    return points[0]


def fixed_vertices(character: Character, what: str | ArrayLike) -> NDArray[np.int64]:
    """Return the vertex indices, shape (n,), of a region or feature point by name, or check those given.

    Raises:
        FacePoserError: If there is no such region, feature point or vertex.
    """
    if not isinstance(what, str):
        return _vertices(character, what)
    try:
        return region_vertices(character, what).astype(np.int64)
    except FacePoserError as no_region:
        try:
            return np.array([feature_vertex(character, what)])
        except FacePoserError:
            raise no_region from None


def pixels_of(points: Pixels) -> tuple[tuple[float, float], ...]:
    """Convert ``points``, shape (n, 2) with n >= 1, to the form in which constraints store pixels.

    Raises:
        FacePoserError: If ``points`` have another shape or are not finite.
    """
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0)
    if array.ndim != 2 or array.shape[1] != 2 or not len(array) or not np.isfinite(array).all():
        raise FacePoserError("Pixels must be pairs of numbers (u, v), at least one.")
    return as_pixels(array)


def _vertices(character: Character, indices: ArrayLike) -> NDArray[np.int64]:
    array = np.atleast_1d(np.asarray(indices))
    if array.ndim != 1 or not len(array) or array.dtype.kind not in "iu":
        raise FacePoserError("Vertices must be a list of indices, at least one.")
    outside = array[(array < 0) | (array >= len(character.vertices))]
    if len(outside):
        raise FacePoserError(
            f"'{character.title}' has the vertices 0 to {len(character.vertices) - 1}, but no vertex {outside[0]}."
        )
    return array.astype(np.int64)
