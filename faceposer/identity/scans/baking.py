"""The texture of a scan in the layout of our heads.

Each vertex of the scan gets the texture coordinates of the closest point of the fitted head. The scan's triangles,
drawn at these coordinates, carry its own colours there. Where the scan has none, the man's skin is taken: the smooth
part of the quotient of both is continued from where both are known (pull and push over a pyramid; Gortler et al., "The
Lumigraph", SIGGRAPH 1996, section 3.4), so that colours agree at the seam, and the last pixels before it fade.
"""

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh import TriangleMesh, VertexNormals
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.texture_images import DECODER_ERRORS
from faceposer.identity.scans.basis import HeadBasis
from faceposer.landmarks.drawing import PaintedMesh, visible_triangles
from faceposer.model.character import Character

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Side of the texture, and of the grid on which colours are continued, in pixels.
_SIDE, _COARSE = 2048, 256
# Largest side of the scan's images that is used.
_LARGEST_IMAGE = 4096
# Farthest distance in centimetres, and least cosine between the normals, of a vertex of the scan and of the head.
_FARTHEST, _LEAST_COSINE = 0.3, 0.5
# Trust in the scan below which its colours are not taken.
_LEAST_TRUST = 0.05
# Longest edge of a triangle of the scan in the layout, as a share of its side, per centimetre.
_STRETCH = 0.2
# Width of the fading at the border of the scan, in pixels, and pixels of it that are left out.
_FADE, _LEFT_OUT = 28.0, 4.0
# Width of gaps that the nearest colours fill, where the head lies on the scan, and beside the layout, in pixels.
_GAP, _BESIDE = 72.0, 100.0
# Least and largest factor on the man's colours.
_FACTORS = (0.15, 4.0)
_QUALITY = 92


@dataclass(frozen=True, eq=False)
class Layer:
    """Colours of a scan in the layout.

    Attributes:
        colours: 0 to 255, shape (side, side, 3).
        known: Mask of the pixels with a colour, shape (side, side).
    """

    colours: Image32
    known: Mask


def has_colours(mesh: PaintedMesh) -> bool:
    """Return True if ``mesh`` has a texture or colours of its vertices."""
    return bool(mesh.images) or mesh.colours.ndim == 2


def baked_layer(
    basis: HeadBasis, character: Character, posed: Array, skin: Mask, scan: TriangleMesh, mesh: PaintedMesh
) -> Layer:
    """Return the colours of a scan in the layout of ``character``.

    Args:
        basis: The model.
        character: The character whose layout is used; the skin is its first part.
        posed: The fitted head on the scan, shape (N, 3).
        skin: Mask of the vertices of the head that take colours of the scan, shape (N,).
        scan: The scan in the frame of the model.
        mesh: The scan with its colours and the same triangles, in either order of their corners.
    """
    n_triangles = len(basis.triangles)
    uv = character.uv.astype(np.float64)
    corner_uvs = character.triangle_uvs[:n_triangles]
    nearest = NearestSurface(posed, basis.triangles, np.arange(n_triangles), 12)
    points, distances = nearest.points(np.asarray(scan.vertices, dtype=np.float64))
    corners = points.corners(basis.triangles)
    own = np.einsum("nc,ncd->nd", points.barycentric, basis.normals(posed)[corners].astype(np.float64))
    theirs = VertexNormals(scan.triangles, len(scan.vertices))(scan.vertices)
    facing = np.einsum("nd,nd->n", own, theirs) > _LEAST_COSINE * np.linalg.norm(own, axis=1)
    good = facing & (distances < _FARTHEST) & skin[corners].all(axis=1)
    places = np.einsum("nc,ncd->nd", points.barycentric, uv[corner_uvs[points.faces]])
    triangles = np.asarray(mesh.triangles)
    vertices = np.asarray(scan.vertices)
    onward = np.roll(triangles, 1, axis=1)
    edges, lengths = (np.linalg.norm(v[triangles] - v[onward], axis=2) for v in (places, vertices))
    stretched = (edges > _STRETCH * np.maximum(lengths, 0.02)).any(axis=1)
    kept = np.flatnonzero(good[triangles].all(axis=1) & ~stretched)
    pixels = np.stack([places[:, 0], 1.0 - places[:, 1]], axis=1) * _SIDE
    faces, weights = visible_triangles(pixels, 1000.0 + distances, triangles[kept], (_SIDE, _SIDE))
    covered = np.flatnonzero(faces >= 0)
    colours = np.zeros((_SIDE * _SIDE, 3), dtype=np.float32)
    colours[covered] = _colours_at(mesh, kept[faces[covered]], weights[covered])
    known = (faces >= 0).reshape(_SIDE, _SIDE)
    return _closed(colours.reshape(_SIDE, _SIDE, 3), known, _laid_out(uv, corner_uvs, basis, skin))


def _laid_out(uv: Array, corner_uvs: NDArray[np.integer], basis: HeadBasis, skin: Mask) -> NDArray[np.int8]:
    """Return 1 where the layout has skin that lies on the scan, 0 where other skin, and -1 beside it, (side, side)."""
    pixels = np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1) * _SIDE
    faces, _ = visible_triangles(pixels, np.ones(len(uv)), corner_uvs, (_SIDE, _SIDE))
    on_scan = np.asarray(skin[basis.triangles].all(axis=1), dtype=np.int8)
    return np.where(faces >= 0, on_scan[np.maximum(faces, 0)], -1).astype(np.int8).reshape(_SIDE, _SIDE)


def _closed(colours: Image32, known: Mask, layout: NDArray[np.int8]) -> Layer:
    """Return the layer without narrow gaps: along seams of the layout, which no triangle of the scan crosses."""
    distances, nearest = ndimage.distance_transform_edt(~known, return_indices=True)
    gap = ~known & (((layout == 1) & (distances < _GAP)) | ((layout == -1) & (distances < _BESIDE)))
    rows, columns = nearest[:, gap]
    colours[gap] = colours[rows, columns]
    return Layer(colours, known | gap)


def blended(layers: list[Layer], base: bytes) -> bytes:
    """Return the encoded texture, JPEG, of the ``layers`` over the encoded skin ``base``.

    Raises:
        FacePoserError: If ``base`` cannot be decoded.
    """
    from PIL import Image

    under = _picture(base, _SIDE)
    if under is None:
        raise FacePoserError("The skin of the built-in man cannot be read; install Face Poser again.")
    weights = [_faded(layer.known) for layer in layers]
    share = np.zeros((_SIDE, _SIDE), dtype=np.float32)
    for weight in weights:
        share += weight
    image = np.empty((_SIDE, _SIDE, 3), dtype=np.uint8)
    # One channel at a time, for the memory's sake.
    for channel in range(3):
        total = np.zeros((_SIDE, _SIDE), dtype=np.float32)
        for layer, weight in zip(layers, weights, strict=True):
            total += weight * layer.colours[..., channel]
        total /= np.maximum(share, 1e-6)
        below = under[..., channel].astype(np.float32)
        if share.max() > 0.0:
            below *= _factors(total, share, below)
        total -= below
        total *= np.minimum(share, 1.0)
        total += below
        image[..., channel] = np.rint(np.clip(total, 0.0, 255.0, out=total), out=total)
    out = io.BytesIO()
    Image.fromarray(image).save(out, format="JPEG", quality=_QUALITY, subsampling=0)
    return out.getvalue()


def _faded(known: Mask) -> Image32:
    """Return the opacity of a layer with colours where they are ``known``, falling to its border, (side, side)."""
    weight = ndimage.distance_transform_edt(known).astype(np.float32)
    weight -= _LEFT_OUT
    weight /= _FADE
    np.clip(weight, 0.0, 1.0, out=weight)
    result: Image32 = weight * weight * (3.0 - 2.0 * weight)
    return result


def _factors(colours: Image32, share: Image32, under: Image32) -> Image32:
    """Return the smooth factors that bring a channel of the skin ``under`` to that of the scan, (side, side)."""
    step = _SIDE // _COARSE
    weights = _reduced(share[..., None], step)[..., 0]
    known = np.maximum(weights, 1e-6)[..., None]
    ours, theirs = (_reduced((image * share)[..., None], step) / known for image in (colours, under))
    logs: Image32 = np.log(np.maximum(ours, 2.0) / np.maximum(theirs, 2.0)).astype(np.float32)
    # Lips and brows of the two do not lie on each other: differences of detail are no differences of tone.
    if (weights > 0.5).any():
        low, high = np.quantile(logs[weights > 0.5], (0.05, 0.95), axis=0).astype(np.float32)
        logs = np.clip(logs, low, high).astype(np.float32)
    filled = _pulled_and_pushed(logs, np.minimum(weights, 1.0).astype(np.float32))
    zoom = ndimage.zoom(filled[..., 0], step, order=1, grid_mode=True, mode="nearest")
    factors: Image32 = np.clip(np.exp(zoom, out=zoom), *_FACTORS, out=zoom)
    return factors


def _reduced(image: Image32, step: int) -> Image32:
    height, width, channels = image.shape
    reduced: Image32 = image.reshape(height // step, step, width // step, step, channels).mean(axis=(1, 3))
    return reduced


def _pulled_and_pushed(values: Image32, weights: Image32) -> Image32:
    """Return ``values``, (n, n, c), with those of no weight, (n, n), continued smoothly; n is a power of two."""
    if len(values) == 1:
        return values
    sums = _reduced(values * weights[..., None], 2)
    shares = _reduced(weights[..., None], 2)
    means: Image32 = (sums / np.maximum(shares, 1e-6)).astype(np.float32)
    coarse = _pulled_and_pushed(means, np.minimum(1.0, 4.0 * shares[..., 0]).astype(np.float32))
    wide = ndimage.zoom(coarse, (2, 2, 1), order=1, grid_mode=True, mode="nearest")
    opacity = weights[..., None]
    result: Image32 = opacity * values + (1.0 - opacity) * wide
    return result


def _colours_at(mesh: PaintedMesh, faces: NDArray[np.int64], weights: Array) -> Image32:
    """Return the colours, 0 to 255, at points of the triangles ``faces``, (p,), with ``weights``, shape (p, 3)."""
    if mesh.colours.ndim == 1:
        colours = np.tile(mesh.colours.astype(np.float32), (len(faces), 1))
    else:
        colours = np.einsum("pc,pcd->pd", weights, mesh.colours[np.asarray(mesh.triangles)[faces]]).astype(np.float32)
    for number, data in enumerate(mesh.images):
        chosen = np.flatnonzero(mesh.image_of[faces] == number)
        image = _decoded(data, None) if chosen.size else None
        if image is None:
            continue
        height, width = image.shape[:2]
        uv = np.einsum("pc,pcd->pd", weights[chosen], mesh.uv[faces[chosen]]) % 1.0
        at = [(1.0 - uv[:, 1]) * height - 0.5, uv[:, 0] * width - 0.5]
        for channel in range(3):
            colours[chosen, channel] = ndimage.map_coordinates(image[..., channel], at, order=1, mode="nearest")
    return colours


def _decoded(data: bytes, side: int | None) -> Image32 | None:
    """Return the pixels of an encoded image as `_picture`, as decimal numbers."""
    picture = _picture(data, side)
    return None if picture is None else picture.astype(np.float32)


def _picture(data: bytes, side: int | None) -> NDArray[np.uint8] | None:
    """Return the pixels of an encoded image, 0 to 255, resized to ``side`` if given, or None if it is damaged."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            image.draft("RGB", (_LARGEST_IMAGE, _LARGEST_IMAGE))
            image.thumbnail((_LARGEST_IMAGE, _LARGEST_IMAGE))
            converted = image.convert("RGB")
            if side is not None and converted.size != (side, side):
                converted = converted.resize((side, side), Image.Resampling.BICUBIC)
            return np.asarray(converted)
    except (OSError, *DECODER_ERRORS):
        return None
