"""The visible contour beside the curve of the jaw: what people draw as the jaw is where the face ends in the image.

From the front, the underside of the chin and the sides of the cheeks reach beyond the curve through the feature points.
"""

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.character import Character
from faceposer.model.face_in_view import FaceInView

Array = NDArray[np.float64]

#: Features that are drawn as the contour of the face.
ON_CONTOUR = ("jaw line",)
# Radius about a point of the curve within which the contour belongs to it, and across which it is opposite to it in
# the image, as shares of the character's height; cosine of the angle to the line of sight up to which skin is contour.
_RADIUS, _OPPOSITE, _GRAZING = 0.09, 0.02, 0.35
# Points over which the distances of the contour are averaged, to each side.
_SMOOTHING = 4
# Distance from the contour up to which a stroke is on it, as a share of the face's height in the image, since the jaw
# fades into the neck; from the second multiple of it on, a stroke moves the jaw by all of its distance.
_TOLERANCE, _FADED = 0.03, 2.5


def beside_contour(
    line: Array, pixels: Array, points: Array, character: Character, camera: Camera
) -> tuple[NDArray[np.bool_], Array]:
    """Return which points of a curve are opposite to a stroke along the contour, (m,), and their targets, (m, 2).

    Points move across the curve only: a contour does not tell places along it. They stay where they are if the stroke
    is between the curve on the neutral face and the contour beside it, or near one of them.

    Args:
        line: The stroke, evenly spaced, shape (n, 2).
        pixels: The points on the neutral face in the image, from end to end, shape (m, 2).
        points: The same in space, shape (m, 3).
        character: The character.
        camera: The camera of the stroke.
    """
    tangents = np.gradient(pixels, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9)
    normals = tangents[:, ::-1] * (-1.0, 1.0)
    # Outwards: away from the middle of the line between the ends.
    middle = 0.5 * (pixels[0] + pixels[-1])
    if float(((pixels - middle) * normals).sum()) < 0.0:
        normals = -normals
    widths = _contour_distances(pixels, points, tangents, normals, character, camera)
    face = FaceInView.of(character, camera).height
    offsets = line[None] - pixels[:, None]
    along = np.abs(np.einsum("mnk,mk->mn", offsets, tangents))
    outside = np.einsum("mnk,mk->mn", offsets, normals)
    opposite = along < _TOLERANCE * face
    # The place on the stroke that is opposite, the nearest one of several.
    nearest = np.where(opposite, along + 0.1 * np.abs(outside), np.inf).argmin(axis=1)
    beyond = outside[np.arange(len(pixels)), nearest]
    off = np.where(beyond > 0.0, np.maximum(beyond - widths, 0.0), beyond)
    size, tolerance = np.abs(off), _TOLERANCE * face
    faded = np.clip((size - tolerance) / ((_FADED - 1.0) * tolerance), 0.0, 1.0)
    moves = np.sign(off) * np.minimum(faded * _FADED * tolerance, size)
    moves = np.where(size > _FADED * tolerance, off, moves)
    return opposite.any(axis=1), np.asarray(pixels + moves[:, None] * normals)


def _contour_distances(
    pixels: Array, points: Array, tangents: Array, normals: Array, character: Character, camera: Camera
) -> Array:
    """Return how far the visible contour lies outside of each point, 0 where there is none near it, shape (m,)."""
    from scipy.spatial import cKDTree

    vertices = character.vertices.astype(np.float64)
    skin = np.unique(character.triangles[character.solid_triangles])
    near = skin[np.isfinite(cKDTree(points).query(vertices[skin], distance_upper_bound=_RADIUS * character.height)[0])]
    towards = camera.center - vertices[near]
    normals_of = VertexNormals(character.triangles, len(vertices))(character.vertices)
    facing = (normals_of[near] * towards).sum(axis=1) / np.linalg.norm(towards, axis=1)
    near = near[np.abs(facing) < _GRAZING]
    if not len(near):
        return np.zeros(len(pixels))
    depth = float(camera.to_camera(points)[:, 2].mean())
    opposite = _OPPOSITE * character.height * camera.focal / max(depth, 1e-9)
    offsets = camera.project(vertices[near])[None] - pixels[:, None]
    along = np.abs(np.einsum("mnk,mk->mn", offsets, tangents))
    outside = np.einsum("mnk,mk->mn", offsets, normals)
    close = np.linalg.norm(vertices[near][None] - points[:, None], axis=2) < _RADIUS * character.height
    found = np.where(close & (along < opposite), outside, 0.0).max(axis=1, initial=0.0)
    padded = np.pad(found, _SMOOTHING, mode="edge")
    return np.convolve(padded, np.full(2 * _SMOOTHING + 1, 1.0 / (2 * _SMOOTHING + 1)), mode="valid")
