"""Points on a surface, and picking of them by pixels."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import Floats, Ints
from faceposer.geometry.pixel_index import PixelIndex

_EPSILON = 1e-12
_TOO_MUCH = "too much of the face lies under its pixels; draw it from farther away, or less of it"
# Number of tests of a pixel against a triangle near it, in all and at a time.
_MOST_TESTS, _TESTS_AT_A_TIME = 5_000_000, 200_000


@dataclass(frozen=True)
class SurfacePoint:
    """A point on a triangle, which moves with the surface (paper, eq. (11)).

    Attributes:
        face: Index of the triangle.
        barycentric: Barycentric coordinates in the triangle, which sum to one.
    """

    face: int
    barycentric: tuple[float, float, float]

    @classmethod
    def at_vertex(cls, triangles: Ints, vertex: int) -> "SurfacePoint":
        """Return the point at ``vertex``, in terms of a triangle that contains it.

        Raises:
            ValueError: If no triangle contains the vertex.
        """
        rows, columns = np.nonzero(triangles == vertex)
        if rows.size == 0:
            raise ValueError(f"vertex {vertex} belongs to no triangle")
        a, b, c = (float(column == columns[0]) for column in range(3))
        return cls(int(rows[0]), (a, b, c))


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """An array of points on a surface, each on a triangle or at a vertex (paper, eq. (11)).

    Attributes:
        faces: Index of each point's triangle, or -1 - v for the vertex v, shape (n,).
        barycentric: Barycentric coordinates in the triangle, shape (n, 3); (1, 0, 0) for vertices.
    """

    faces: NDArray[np.int64]
    barycentric: NDArray[np.float64]

    def __post_init__(self) -> None:
        faces = np.array(self.faces, dtype=np.int64).reshape(-1)
        barycentric = np.array(self.barycentric, dtype=np.float64).reshape(-1, 3)
        if len(faces) != len(barycentric):
            raise ValueError(f"{len(faces)} faces, but {len(barycentric)} barycentric coordinates")
        for name, value in (("faces", faces), ("barycentric", barycentric)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, anchors: Sequence["SurfacePoint | int"]) -> "SurfacePoints":
        """Return the points of ``anchors``, each a surface point or a vertex index."""
        faces = [-1 - anchor if isinstance(anchor, int) else anchor.face for anchor in anchors]
        weights = [(1.0, 0.0, 0.0) if isinstance(anchor, int) else anchor.barycentric for anchor in anchors]
        return cls(np.array(faces, dtype=np.int64), np.array(weights, dtype=np.float64))

    @classmethod
    def at_vertices(cls, vertices: ArrayLike) -> "SurfacePoints":
        """Return the points at the vertices with indices ``vertices``, shape (n,)."""
        faces = -1 - np.asarray(vertices, dtype=np.int64)
        return cls(faces, np.tile([1.0, 0.0, 0.0], (len(faces), 1)))

    @property
    def nbytes(self) -> int:
        """Memory of the points in bytes."""
        return self.faces.nbytes + self.barycentric.nbytes

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, SurfacePoints)
            and np.array_equal(self.faces, other.faces)
            and np.array_equal(self.barycentric, other.barycentric)
        )

    @cached_property
    def _hash(self) -> int:
        # The bytes are not kept: a history has thousands of points.
        return hash((self.faces.tobytes(), self.barycentric.tobytes()))

    def __hash__(self) -> int:
        return self._hash

    def __len__(self) -> int:
        return len(self.faces)

    def __iter__(self) -> "Iterator[SurfacePoint | int]":
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int) -> "SurfacePoint | int":
        face = int(self.faces[index])
        if face < 0:
            return -1 - face
        a, b, c = self.barycentric[index].tolist()
        return SurfacePoint(face, (a, b, c))

    def subset(self, indices: NDArray[np.integer] | NDArray[np.bool_]) -> "SurfacePoints":
        """Return the points selected by ``indices`` or by a mask of shape (n,)."""
        return SurfacePoints(self.faces[indices], self.barycentric[indices])

    def joined(self, other: "SurfacePoints") -> "SurfacePoints":
        """Return these points followed by those of ``other``."""
        return SurfacePoints(
            np.concatenate([self.faces, other.faces]), np.concatenate([self.barycentric, other.barycentric])
        )

    def corners(self, triangles: Ints) -> NDArray[np.int64]:
        """Return the vertices that the barycentric coordinates of each point refer to, shape (n, 3)."""
        on_face = self.faces >= 0
        if on_face.all():
            return np.asarray(triangles)[self.faces].astype(np.int64)
        corners = np.repeat((-1 - self.faces)[:, None], 3, axis=1)
        corners[on_face] = np.asarray(triangles)[self.faces[on_face]]
        return corners

    def check(self, triangles: Ints) -> None:
        """Raise ``ValueError`` unless all points are on a surface with these ``triangles``, shape (T, 3)."""
        if not len(self):
            return
        face, vertex = int(self.faces.max()), int(-1 - self.faces.min())
        if face >= len(triangles):
            raise ValueError(f"triangle {face} does not exist; the character has {len(triangles)}")
        if vertex > int(np.max(triangles, initial=-1)):
            raise ValueError(f"vertex {vertex} belongs to no triangle")

    def positions(self, vertices: Floats, triangles: Ints) -> NDArray[np.float64]:
        """Return the positions of the points, shape (n, 3), for ``vertices`` of shape (N, 3)."""
        corners = np.asarray(vertices)[self.corners(triangles)].astype(np.float64)
        return np.einsum("nk,nkd->nd", self.barycentric, corners)


def surface_positions(
    vertices: Floats, triangles: Ints, points: Sequence[SurfacePoint | int] | SurfacePoints
) -> NDArray[np.float64]:
    """Return the positions of ``points`` on the surface, shape (n, 3), for ``vertices`` of shape (N, 3)."""
    if not len(points):
        return np.zeros((0, 3))
    batch = points if isinstance(points, SurfacePoints) else SurfacePoints.of(points)
    return batch.positions(vertices, triangles)


def pick(vertices: Floats, triangles: Ints, camera: Camera, pixel: Sequence[float]) -> SurfacePoint | None:
    """Return the nearest point under ``pixel`` on a triangle that faces the camera, or None.

    All triangles are tested at once by the method of Moeller and Trumbore (1997).

    Args:
        vertices: Positions, shape (N, 3).
        triangles: Vertex indices, counter-clockwise seen from outside, shape (T, 3).
        camera: Camera of the pixel.
        pixel: Pixel (u, v) from the top left.
    """
    origin, direction = camera.ray(pixel)
    a, edge1, edge2 = _corner_and_edges(vertices, triangles)
    weight1, weight2, distance, determinant = _intersect(origin, direction, a, edge1, edge2)
    with np.errstate(invalid="ignore"):
        hit = (determinant > _EPSILON) & (weight1 >= 0) & (weight2 >= 0) & (weight1 + weight2 <= 1) & (distance > 0)
    if not hit.any():
        return None
    face = int(np.argmin(np.where(hit, distance, np.inf)))
    return SurfacePoint(face, _barycentric(weight1[face], weight2[face]))


def pick_pixels(
    vertices: Floats, triangles: Ints, camera: Camera, pixels: ArrayLike
) -> tuple[SurfacePoints, NDArray[np.bool_]]:
    """Return the nearest points under many ``pixels``, shape (n, 2), and the mask of pixels with a point, (n,).

    Pixels in the order of their cells, in place of the paper's hierarchy of blocks (section 4.3), limit the tests to
    the box of each triangle. Triangles that face away are ignored.

    Raises:
        ValueError: If far too many triangles are near the pixels.
    """
    targets = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    positions, triangles = np.asarray(vertices, dtype=np.float64), np.asarray(triangles)
    low, high = targets.min(axis=0, initial=np.inf), targets.max(axis=0, initial=-np.inf)
    candidates = _front_within(camera.project(positions), triangles, low, high)
    candidates = candidates[(camera.to_camera(positions)[:, 2][triangles[candidates]] > 0).all(axis=1)]
    if not len(targets) or not len(candidates):
        return SurfacePoints(np.zeros(0, dtype=np.int64), np.zeros((0, 3))), np.zeros(len(targets), dtype=bool)
    corners = camera.project(positions)[triangles[candidates]]
    least, most = corners.min(axis=1), corners.max(axis=1)
    index = PixelIndex(targets)
    rows = index.rows(least, most)
    if int(rows.sum()) > _MOST_TESTS:
        raise ValueError(_TOO_MUCH)
    counts = np.concatenate([index.counts(least[part], most[part]) for part in _parts(rows)])
    if int(counts.sum()) > _MOST_TESTS:
        raise ValueError(_TOO_MUCH)
    nearest = np.full(len(targets), np.inf)
    faces, best = np.full(len(targets), -1), np.zeros((len(targets), 3))
    for part in _parts(rows + counts):
        which, pixel = index.inside(least[part], most[part])
        which = which + part.start
        inside = _inside(corners, which, targets[pixel])
        face, pixel = candidates[which[inside]], pixel[inside]
        weights, distance = _along_rays(positions, triangles[face], camera, targets[pixel])
        hit = (weights >= -1e-9).all(axis=1) & (distance > 0)
        face, pixel, weights, distance = face[hit], pixel[hit], weights[hit], distance[hit]
        order = np.lexsort((distance, pixel))
        first = order[np.unique(pixel[order], return_index=True)[1]]
        first = first[distance[first] < nearest[pixel[first]]]
        nearest[pixel[first]], faces[pixel[first]], best[pixel[first]] = distance[first], face[first], weights[first]
    met = faces >= 0
    return SurfacePoints(faces[met], _normalised(best[met])), met


def _parts(work: NDArray[np.intp]) -> Iterator[slice]:
    """Yield consecutive parts of triangles by the number of tests, ``work``, that each of them takes."""
    ends = np.flatnonzero(np.diff(np.cumsum(work) // _TESTS_AT_A_TIME)) + 1
    for first, last in itertools.pairwise([0, *ends.tolist(), len(work)]):
        yield slice(first, last)


def _inside(corners: NDArray[np.float64], which: NDArray[np.intp], pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the mask of ``pixels``, (n, 2), in or very near their triangles ``which``, (n,), of ``corners``."""
    edges = np.roll(corners, -1, axis=1) - corners
    slack = -1e-6 * np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])[which]
    inside = np.ones(len(which), dtype=bool)
    for k in range(3):
        offset, edge = pixels - corners[:, k][which], edges[:, k][which]
        # Triangles that face the camera turn against the clock, as rows count downwards.
        inside &= offset[:, 0] * edge[:, 1] - offset[:, 1] * edge[:, 0] >= slack
    return inside


def _front_within(
    projected: NDArray[np.float64], triangles: Ints, low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Return the triangles that face the camera and whose boxes meet the box from ``low`` to ``high``.

    Args:
        projected: Pixels of the vertices, shape (N, 2).
        triangles: Vertex indices, shape (T, 3).
        low: Least column and row.
        high: Greatest column and row.
    """
    chosen: NDArray[np.intp] = np.arange(len(triangles))
    for axis in range(2):
        # A triangle is outside if all of its corners are on one side.
        below, above = projected[:, axis] < low[axis], projected[:, axis] > high[axis]
        a, b, c = triangles[chosen].T
        chosen = chosen[~((below[a] & below[b] & below[c]) | (above[a] & above[b] & above[c]))]
    corners = projected[triangles[chosen]]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # Pixels count downwards, so that triangles that face the camera have a negative area.
    return chosen[edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0] < -_EPSILON]


def points_on_triangles(
    vertices: Floats, triangles: Ints, faces: ArrayLike, camera: Camera, pixels: ArrayLike
) -> SurfacePoints:
    """Return the point on each triangle of ``faces``, shape (n,), under each of ``pixels``, shape (n, 2).

    An index image determines the triangle at the centre of a pixel; pixels outside their triangle are clamped to its
    edges.
    """
    chosen = np.asarray(faces, dtype=np.int64)
    weights, _ = _along_rays(
        np.asarray(vertices, dtype=np.float64), np.asarray(triangles)[chosen], camera, np.asarray(pixels, dtype=float)
    )
    return SurfacePoints(chosen, _normalised(weights))


def barycentric_on_triangle(
    vertices: Floats, triangles: Ints, face: int, camera: Camera, pixel: Sequence[float]
) -> SurfacePoint:
    """Return the point on triangle ``face`` under ``pixel``; see ``points_on_triangles``."""
    point = points_on_triangles(vertices, triangles, [face], camera, [pixel])[0]
    assert isinstance(point, SurfacePoint)
    return point


def _along_rays(
    vertices: NDArray[np.float64], corners: Ints, camera: Camera, pixels: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the barycentric coordinates (n, 3) of the ray of each pixel on its triangle's plane, and distances (n,).

    The coordinates are a third each for rays parallel to the plane.
    """
    offsets = (pixels - camera.principal_point) / camera.focal
    directions = np.column_stack([offsets, np.ones(len(offsets))]) @ camera.rotation
    a = vertices[corners[:, 0]]
    edge1, edge2 = vertices[corners[:, 1]] - a, vertices[corners[:, 2]] - a
    normal_to_plane = np.cross(directions, edge2)
    determinant = np.einsum("ij,ij->i", edge1, normal_to_plane)
    flat = np.abs(determinant) <= _EPSILON
    inverse = 1.0 / np.where(flat, np.inf, determinant)
    to_origin = camera.center - a
    across = np.cross(to_origin, edge1)
    weight1 = np.einsum("ij,ij->i", to_origin, normal_to_plane) * inverse
    weight2 = np.einsum("ij,ij->i", across, directions) * inverse
    weights = np.column_stack([1.0 - weight1 - weight2, weight1, weight2])
    weights[flat] = 1.0 / 3.0
    return weights, np.einsum("ij,ij->i", edge2, across) * inverse


def _normalised(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    clipped = np.clip(weights, 0.0, 1.0)
    cleaned: NDArray[np.float64] = clipped / clipped.sum(axis=1, keepdims=True)
    return cleaned


def _corner_and_edges(vertices: Floats, triangles: Ints) -> tuple[NDArray[np.float64], ...]:
    corners = np.asarray(vertices, dtype=np.float64)[np.asarray(triangles)]
    a = corners[:, 0]
    return a, corners[:, 1] - a, corners[:, 2] - a


def _intersect(
    origin: NDArray[np.float64],
    direction: NDArray[np.float64],
    a: NDArray[np.float64],
    edge1: NDArray[np.float64],
    edge2: NDArray[np.float64],
) -> tuple[NDArray[np.float64], ...]:
    """Return the weights of the second and third corner, distances, and determinants (positive for front faces)."""
    normal_to_plane = np.cross(direction, edge2)
    determinant = np.einsum("ij,ij->i", edge1, normal_to_plane)
    inverse = 1.0 / np.where(np.abs(determinant) > _EPSILON, determinant, np.inf)
    to_origin = origin - a
    weight1 = np.einsum("ij,ij->i", to_origin, normal_to_plane) * inverse
    across = np.cross(to_origin, edge1)
    weight2 = across @ direction * inverse
    distance = np.einsum("ij,ij->i", edge2, across) * inverse
    return weight1, weight2, distance, determinant


def _barycentric(weight1: float, weight2: float) -> tuple[float, float, float]:
    weights = np.clip([1.0 - weight1 - weight2, weight1, weight2], 0.0, 1.0)
    a, b, c = (weights / weights.sum()).tolist()
    return (a, b, c)
