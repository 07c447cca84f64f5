"""Drawing of meshes without OpenGL: small pictures with the surface point under each pixel.

Landmarks of a mesh are found in pictures of it. Imports must work on systems without OpenGL, and pictures of a few
hundred pixels take NumPy a fraction of a second.
"""

import io
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals

Array = NDArray[np.float64]
Ints = NDArray[np.integer]

# Grey of the background; light from everywhere, and from a lamp near the camera, up and to its right.
_BACKGROUND, _AMBIENT, _DIFFUSE = 115, 0.45, 0.6
_LAMP = np.array([0.25, -0.35, -0.9]) / np.linalg.norm([0.25, -0.35, -0.9])
#: Colour of surfaces without one, 0 to 255.
PLAIN = (200.0, 170.0, 155.0)
# Pairs of a pixel and a triangle that are compared at a time, and in all.
_AT_A_TIME, _MOST_PAIRS = 1_000_000, 60_000_000
_LARGEST_TEXTURE = 1024


@dataclass(frozen=True, eq=False)
class PaintedMesh:
    """A mesh with its colours.

    Attributes:
        vertices: Positions, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        colours: Colour of each vertex, 0 to 255, shape (N, 3), or (3,) for one colour.
        uv: Texture coordinates of the corners of the triangles, v up, shape (T, 3, 2); empty without textures.
        image_of: Index into ``images`` of the texture of each triangle, or -1, shape (T,); empty without textures.
        images: Encoded images.
    """

    vertices: Array
    triangles: Ints
    colours: Array = field(default_factory=lambda: np.array(PLAIN))
    uv: Array = field(default_factory=lambda: np.zeros((0, 3, 2)))
    image_of: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    images: tuple[bytes, ...] = ()

    @cached_property
    def normals(self) -> NDArray[np.float32]:
        """Unit normals of the vertices, shape (N, 3)."""
        return VertexNormals(self.triangles, len(self.vertices))(self.vertices)

    @cached_property
    def vertex_colours(self) -> Array:
        """Colours of the vertices, 0 to 255, shape (N, 3), those of textures included."""
        colours = np.broadcast_to(self.colours, (len(self.vertices), 3)).astype(np.float64)
        for corner in range(3):
            shares = np.zeros((len(self.triangles), 3))
            shares[:, corner] = 1.0
            faces = np.arange(len(self.triangles))
            colours[self.triangles[:, corner]] = _colours(self, faces, self.triangles, shares)
        return colours

    @cached_property
    def textures(self) -> tuple[NDArray[np.uint8], ...]:
        """The decoded images, reduced to at most 1024 pixels, top row first, each of shape (h, w, 3)."""
        return tuple(map(_decoded, self.images))


@dataclass(frozen=True, eq=False)
class Drawing:
    """A picture of a mesh.

    Attributes:
        image: Colours, shape (h, w, 3).
        faces: Triangle under the middle of each pixel, or -1, shape (h, w).
        places: Surface point under the middle of each pixel, NaN where there is none, shape (h, w, 3).
        facing: Cosine between the surface and the view, 1 where it faces the camera, 0 where there is none, (h, w).
    """

    image: NDArray[np.uint8]
    faces: NDArray[np.int64]
    places: Array
    facing: Array


def draw(mesh: PaintedMesh, camera: Camera) -> Drawing:
    """Return the picture of ``mesh`` from ``camera``."""
    width, height = camera.size
    pixels, depths = camera.project(mesh.vertices), camera.to_camera(mesh.vertices)[:, 2]
    faces, weights = visible_triangles(pixels, depths, mesh.triangles, (width, height))
    covered = np.flatnonzero(faces >= 0)
    corners = mesh.triangles[faces[covered]]
    shares = weights[covered]
    places = np.full((width * height, 3), np.nan)
    places[covered] = np.einsum("pc,pcd->pd", shares, mesh.vertices[corners])
    normals = np.einsum("pc,pcd->pd", shares, mesh.normals[corners].astype(np.float64)) @ camera.rotation.T
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    # Both sides are drawn, since the faces of many files point inwards.
    normals *= np.where(normals[:, 2:] > 0.0, -1.0, 1.0)
    facing = np.zeros(width * height)
    facing[covered] = -normals[:, 2]
    light = _AMBIENT + _DIFFUSE * np.maximum(normals @ _LAMP, 0.0)
    image = np.full((width * height, 3), _BACKGROUND, dtype=np.uint8)
    colours = _colours(mesh, faces[covered], corners, shares) * light[:, None]
    image[covered] = np.clip(colours, 0.0, 255.0).astype(np.uint8)
    return Drawing(
        image.reshape(height, width, 3),
        faces.reshape(height, width),
        places.reshape(height, width, 3),
        facing.reshape(height, width),
    )


def visible_triangles(
    pixels: Array, depths: Array, triangles: Ints, size: tuple[int, int]
) -> tuple[NDArray[np.int64], Array]:
    """Return the frontmost triangle at each pixel of an image of ``size``, or -1, and the weights of its corners there.

    Args:
        pixels: Projected vertices, shape (N, 2).
        depths: Their depths, shape (N,); triangles that reach behind the camera are left out.
        triangles: Vertex ids, shape (T, 3).
        size: Width and height.
    """
    width, height = size
    faces, weights = np.full(width * height, -1, dtype=np.int64), np.zeros((width * height, 3))
    nearest = np.full(width * height, np.inf)
    drawn = np.flatnonzero((depths[triangles] > 0.0).all(axis=1))
    corners = pixels[triangles[drawn]]
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, size).astype(np.int64)
    high = np.clip(np.floor(corners.max(axis=1) - 0.5), -1, np.array(size) - 1).astype(np.int64)
    extent = np.maximum(high - low + 1, 0)
    counts = extent[:, 0] * extent[:, 1]
    kept = np.flatnonzero(counts)
    ends = np.cumsum(counts[kept])
    begin = 0
    while begin < len(kept) and ends[begin] - counts[kept[begin]] < _MOST_PAIRS:
        done = int(ends[begin] - counts[kept[begin]])
        end = max(begin + 1, int(np.searchsorted(ends, done + _AT_A_TIME, side="right")))
        chosen = kept[begin:end]
        number = counts[chosen]
        which = np.repeat(chosen, number)
        place = np.arange(int(number.sum())) - np.repeat(np.cumsum(number) - number, number)
        columns = low[which, 0] + place % extent[which, 0]
        rows = low[which, 1] + place // extent[which, 0]
        shares, inside = _weights_at(corners[which], columns + 0.5, rows + 0.5)
        which, shares, at = which[inside], shares[inside], (rows * width + columns)[inside]
        # Linear in the picture is the inverse of the depth.
        shares /= depths[triangles[drawn[which]]]
        depth = 1.0 / shares.sum(axis=1)
        np.minimum.at(nearest, at, depth)
        front = depth <= nearest[at]
        faces[at[front]] = drawn[which[front]]
        weights[at[front]] = shares[front] * depth[front, None]
        begin = end
    return faces, weights


def _weights_at(corners: Array, x: Array, y: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the barycentric coordinates of pixels in triangles with ``corners``, (n, 3, 2), and which are inside."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    safe = np.where(area == 0.0, 1.0, area)
    second = ((x - a[:, 0]) * (c[:, 1] - a[:, 1]) - (y - a[:, 1]) * (c[:, 0] - a[:, 0])) / safe
    third = ((b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (b[:, 1] - a[:, 1]) * (x - a[:, 0])) / safe
    weights = np.stack([1.0 - second - third, second, third], axis=1)
    return weights, (weights >= -1e-9).all(axis=1) & (area != 0.0)


def _colours(mesh: PaintedMesh, faces: Ints, corners: Ints, shares: Array) -> Array:
    """Return the colours, (p, 3), at points of the triangles ``faces``, (p,), with ``corners`` and weights, (p, 3)."""
    if mesh.colours.ndim == 1:
        colours = np.tile(mesh.colours, (len(faces), 1))
    else:
        colours = np.einsum("pc,pcd->pd", shares, mesh.colours[corners])
    if not mesh.images:
        return colours
    image_of = mesh.image_of[faces]
    uv = np.einsum("pc,pcd->pd", shares, mesh.uv[faces])
    for number, texture in enumerate(mesh.textures):
        textured = np.flatnonzero(image_of == number)
        if textured.size and texture.size:
            height, width = texture.shape[:2]
            repeated = uv[textured] % 1.0
            columns = np.minimum((repeated[:, 0] * width).astype(np.intp), width - 1)
            rows = np.minimum(((1.0 - repeated[:, 1]) * height).astype(np.intp), height - 1)
            colours[textured] = texture[rows, columns]
    return colours


def _decoded(data: bytes) -> NDArray[np.uint8]:
    """Return the pixels of an encoded image, or none if it is damaged."""
    from PIL import Image

    from faceposer.geometry.texture_images import DECODER_ERRORS

    try:
        with Image.open(io.BytesIO(data)) as image:
            image.draft("RGB", (_LARGEST_TEXTURE, _LARGEST_TEXTURE))
            image.thumbnail((_LARGEST_TEXTURE, _LARGEST_TEXTURE))
            return np.asarray(image.convert("RGB"), dtype=np.uint8)
    except (OSError, *DECODER_ERRORS):
        return np.zeros((0, 0, 3), dtype=np.uint8)
