"""A head in its photo: its surface under the pixels, and the light on it."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.identity.photos.harmonics import fitted_light, harmonics
from faceposer.model.character import Character
from faceposer.photo.surface_in_picture import SurfaceInPicture, inside_of_mouth, triangles_of

Array = NDArray[np.float64]

#: Longest side, in pixels, of the grid on which changes are computed.
SIDE = 800
# Margin around the head, as a share of its height in the photo.
_MARGIN = 0.5
_LIDS, _LIPS = ("lids_left", "lids_right"), ("lip_upper", "lip_lower", "mouth")
# Regions whose skin shows the light, without hair; other characters' whole skin is used.
_BARE = ("nose", "cheek_left", "cheek_right", "mouth", "jaw", "forehead", "brow_left", "brow_right", *_LIDS)
# Width of the edge of the face, as a share of the height of the head.
_EDGE = 0.04
# Least cosine between the skin and the view at which it shows the light, and most samples.
_FACING, _MOST_SAMPLES = 0.35, 20_000
# Least light relative to the usual one.
_DARKEST = 0.2
# Heights above the lower end of the mesh between which the neck begins to belong to the head, as shares of its height.
_NECK = (0.05, 0.25)
# Upward part of normals of the neutral head below which skin joined to the neck is the underside of the jaw.
_UNDERSIDE = -0.45
# How far the angle of the jaw is before the ears, as a share of the head's height.
_ANGLE = 0.05
# Height of the ends of the head, as a share of its own.
_END = 0.02
# Rings of triangles around the neck that belong to it.
_RINGS = 3
_EARS = ("ear_left", "ear_right")
# Regions of the face above the jaw.
_ABOVE = tuple(name for name in _BARE if name != "jaw")
# Limit of the logarithm of the tint of skin.
_MOST_TINT = 0.6
# Most cells of the grid per pixel of the photo, along each side.
_FINEST = 4
# Least height of a head in pixels.
_LEAST_HEIGHT = 40.0
_REMEDY = "take its expression again (Take the expression in the window, or faceposer photo CHARACTER PHOTO --auto)"


@dataclass(frozen=True, eq=False)
class HeadInPhoto:
    """A head as a photo shows it.

    Attributes:
        character: The character with this head.
        vertices: All its vertices in the expression of the photo, shape (N, 3).
        pixels: The photo, shape (h, w, 3).
        box: Left, top, right and bottom of the part around the head, in pixels of the photo.
        camera: Camera of that part on the grid on which changes are computed.
        name: Name of the photo for messages.
    """

    character: Character
    vertices: Array
    pixels: NDArray[np.uint8]
    box: tuple[int, int, int, int]
    camera: Camera
    name: str

    @classmethod
    def of(
        cls,
        character: Character,
        vertices: NDArray[np.floating],
        camera: Camera,
        pixels: NDArray[np.uint8],
        side: int,
        name: str,
    ) -> "HeadInPhoto":
        """Return the head of ``character`` with ``vertices``, (N, 3), in a photo.

        Args:
            character: The character.
            vertices: Its vertices in the expression of the photo.
            camera: Camera of the photo; ``pixels`` may be reduced.
            pixels: The photo, shape (h, w, 3).
            side: Longest side of the grid on which changes are computed.
            name: Name of the photo for messages.

        Raises:
            FacePoserError: If the head is not in the photo, or is too small.
        """
        posed = np.asarray(vertices, dtype=np.float64)
        height, width = pixels.shape[:2]
        camera = _resized(camera, (width, height))
        if camera.to_camera(posed)[:, 2].min() <= 0.0:
            raise FacePoserError(f"The head is behind the camera of the photo '{name}'; {_REMEDY}.")
        places = camera.project(posed)
        low, high = places.min(axis=0), places.max(axis=0)
        margin = _MARGIN * float(high[1] - low[1])
        left, top = (int(max(math.floor(low[k] - margin), 0)) for k in range(2))
        right, bottom = (int(min(math.ceil(high[k] + margin), (width, height)[k])) for k in range(2))
        if right - left < _LEAST_HEIGHT or bottom - top < _LEAST_HEIGHT or high[1] - low[1] < _LEAST_HEIGHT:
            raise FacePoserError(f"The head is outside the photo '{name}' or too small in it; {_REMEDY}.")
        factor = side / max(right - left, bottom - top)
        # A whole number of cells per pixel, so that their means are exact.
        factor = float(min(int(factor), _FINEST)) if factor >= 2.0 else min(factor, 1.0)
        size = (max(round(factor * (right - left)), 1), max(round(factor * (bottom - top)), 1))
        return cls(
            character,
            posed,
            pixels,
            (left, top, right, bottom),
            part_of_camera(camera, (left, top), factor, size),
            name,
        )

    @cached_property
    def pixel(self) -> float:
        """Width of a pixel of the photo on the grid, in pixels of the grid."""
        return self.camera.size[0] / (self.box[2] - self.box[0])

    @cached_property
    def head_height(self) -> float:
        """Height of the head on the grid, in pixels."""
        return float(np.ptp(self.camera.project(self.vertices)[:, 1]))

    @cached_property
    def picture(self) -> NDArray[np.float32]:
        """The part of the photo on the grid, 0 to 1, shape (h, w, 3)."""
        from PIL import Image

        left, top, right, bottom = self.box
        part = Image.fromarray(np.ascontiguousarray(self.pixels[top:bottom, left:right]))
        return (
            np.asarray(
                part.resize(
                    self.camera.size,
                    Image.Resampling.BICUBIC if self.camera.size[0] > part.width else Image.Resampling.BOX,
                ),
                dtype=np.float32,
            )
            / 255.0
        )

    @cached_property
    def surface(self) -> SurfaceInPicture:
        """What the photo shows of the head."""
        return SurfaceInPicture.of(self.character, self.vertices, self.camera)

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """The triangles inside the mouth, shape (T,)."""
        return inside_of_mouth(self.character)

    @cached_property
    def eyes(self) -> NDArray[np.bool_]:
        """The triangles of the eyeballs, shape (T,)."""
        return triangles_of(self.character, ("eye",))

    @cached_property
    def lids(self) -> NDArray[np.bool_]:
        """The triangles of the lids, shape (T,); none if the character has no such regions."""
        return self.of_regions(_LIDS)

    @cached_property
    def middles_of_lids(self) -> Array:
        """The middles of the lids of each eye, shape (n, 3), none if the character has no such regions."""
        regions = [self.character.regions[name] for name in _LIDS if name in self.character.regions]
        return np.array([self.vertices[ids].mean(axis=0) for ids in regions]).reshape(-1, 3)

    @cached_property
    def depth_in_eyes(self) -> Array:
        """Distance of each pixel of the grid that shows an eye from the eye's edge, 0 elsewhere, shape (h, w)."""
        return self._depth_in(self.eyes)

    @cached_property
    def depth_in_mouth(self) -> Array:
        """Distance of each pixel that shows the inside of the mouth from its edge, 0 elsewhere, shape (h, w)."""
        return self._depth_in(self.inside)

    def shown(self, triangles: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which pixels of the grid show one of ``triangles``, a mask of shape (T,), shape (h, w)."""
        width, height = self.camera.size
        faces = self.surface.faces
        result: NDArray[np.bool_] = ((faces >= 0) & triangles[faces]).reshape(height, width)
        return result

    def _depth_in(self, triangles: NDArray[np.bool_]) -> Array:
        """Return the distance of each pixel that shows one of ``triangles``, (T,), from their edge, else 0, (h, w)."""
        result: Array = ndimage.distance_transform_edt(self.shown(triangles))
        return result

    @cached_property
    def _usual_colour(self) -> Array:
        """The middle colour of the face in the photo, 0 to 1, shape (3,); that of all of the head if nothing tells."""
        surface = self.surface
        face = surface.of_vertices(self.face[:, None])[:, 0] > 0.5
        colours = self.picture.reshape(-1, 3)[surface.at[face] if face.any() else surface.at].astype(np.float64)
        result: Array = np.median(colours, axis=0) if len(colours) else np.ones(3)
        return result

    @cached_property
    def brightness(self) -> float:
        """Brightness of the face in the photo, 0 to 1."""
        return max(float(self._usual_colour.mean()), 0.02)

    @cached_property
    def tint(self) -> Array:
        """Colour of the face in the photo relative to its brightness, shape (3,)."""
        usual = np.log(np.maximum(self._usual_colour, 0.02))
        result: Array = np.exp(np.clip(usual - usual.mean(), -_MOST_TINT, _MOST_TINT))
        return result

    @cached_property
    def ends_of_axis(self) -> Array:
        """The middles of its top and its lower end in the photo, shape (2, 3)."""
        height = self.character.vertices[:, 1]
        low, high = float(height.min()), float(height.max())
        return np.stack(
            [self.vertices[np.abs(height - level) <= _END * (high - low)].mean(axis=0) for level in (high, low)]
        )

    @cached_property
    def underside(self) -> Array:
        """1 for the vertices that look down on the neutral head, else 0, shape (N,)."""
        vertices = self.character.vertices.astype(np.float32)
        up = VertexNormals(self.character.triangles, len(vertices))(vertices)[:, 1]
        return (up < _UNDERSIDE).astype(np.float64)

    @cached_property
    def behind(self) -> Array:
        """1 for skin behind the face in the photo: neck and underside of the jaw, else 0, shape (N,).

        It is 0 if the character has no such regions.
        """
        count, regions = len(self.character.vertices), self.character.regions

        def among(names: tuple[str, ...]) -> NDArray[np.bool_]:
            result = np.zeros(count, dtype=bool)
            for name in names:
                result[regions.get(name, np.zeros(0, dtype=np.intp))] = True
            return result

        neck, ears, face = among(("neck",)), among(_EARS), among(_ABOVE)
        places = self.character.vertices.astype(np.float32)
        # The jaw ends below the ears; the sides of the neck are farther back.
        back = places[:, 2] < places[ears, 2].max(initial=-np.inf) + _ANGLE * self.character.height
        back &= places[:, 1] < (places[ears, 1].mean() if ears.any() else -np.inf)
        for _ in range(_RINGS):
            neck[self.character.triangles[neck[self.character.triangles].any(axis=1)]] = True
        under = neck | ((self.underside > 0.0) | back) & ~(face | ears)
        edges = np.concatenate([self.character.triangles[:, [0, 1]], self.character.triangles[:, [1, 2]]])
        edges = edges[under[edges].all(axis=1)]
        links = coo_matrix((np.ones(len(edges), dtype=bool), edges.T), shape=(count, count))
        groups = connected_components(links, directed=False)[1]
        result: Array = (under & np.isin(groups, np.unique(groups[neck]))).astype(np.float64)
        return result

    @cached_property
    def lips(self) -> NDArray[np.bool_]:
        """The triangles of the lips, shape (T,); none if the character has no such regions."""
        return self.of_regions(_LIPS) & ~self.inside

    @cached_property
    def redness(self) -> Array:
        """1 for the vertices of the red of the lips, else 0, shape (N,)."""
        result = np.zeros(len(self.character.vertices))
        result[self.character.triangles[self.red_of_lips]] = 1.0
        return result

    @cached_property
    def red_of_lips(self) -> NDArray[np.bool_]:
        """The triangles of the red of the lips, shape (T,); none if the character has no such regions."""
        return self.of_regions(_LIPS[:2]) & ~self.inside

    def of_regions(self, names: tuple[str, ...]) -> NDArray[np.bool_]:
        """Return the mask of the triangles of the skin in regions with ``names``, shape (T,)."""
        regions = [self.character.regions[name] for name in names if name in self.character.regions]
        found = np.zeros(len(self.character.vertices), dtype=bool)
        found[np.concatenate([*regions, np.zeros(0, dtype=np.int64)]).astype(np.intp)] = True
        result = triangles_of(self.character, ("skin",))
        result &= found[self.character.triangles].all(axis=1)
        return result

    @cached_property
    def face(self) -> Array:
        """How much each vertex belongs to the bare skin of the face, 0 to 1, shape (N,); 0 if nothing tells."""
        regions = [self.character.regions[name] for name in _BARE if name in self.character.regions]
        if not regions:
            return np.zeros(len(self.character.vertices))
        inside = np.zeros(len(self.character.vertices), dtype=bool)
        inside[np.concatenate(regions)] = True
        places = self.character.vertices.astype(np.float64)
        near, _ = cKDTree(places[~inside]).query(places)
        t = np.clip(near / (_EDGE * self.character.height), 0.0, 1.0)
        result: Array = t * t * (3.0 - 2.0 * t)
        return result

    @cached_property
    def belonging(self) -> Array:
        """How much each vertex moves the photo along: 1, falling to 0 at the cut of the neck, shape (N,)."""
        height = self.character.vertices[:, 1] - self.character.vertices[:, 1].min()
        t = np.clip((height / self.character.height - _NECK[0]) / (_NECK[1] - _NECK[0]), 0.0, 1.0)
        result: Array = t * t * (3.0 - 2.0 * t)
        return result

    @cached_property
    def light(self) -> Array:
        """The light on the skin, coefficients of `harmonics` in camera axes, shape (9, 3)."""
        surface, character = self.surface, self.character
        bare = triangles_of(character, ("skin",)) & ~self.inside
        if self.face.any():
            bare &= (self.face > 0.5)[character.triangles].all(axis=1)
        normals = surface.of_vertices(self.normals_of(self.vertices))
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        used = np.flatnonzero(bare[surface.faces[surface.at]] & (normals[:, 2] < -_FACING))
        if len(used) < 100:
            raise FacePoserError(f"The photo '{self.name}' shows too little of the face to know its light; {_REMEDY}.")
        if len(used) > _MOST_SAMPLES:
            used = np.sort(np.random.default_rng(0).choice(used, _MOST_SAMPLES, replace=False))
        chosen = np.zeros(len(surface.at), dtype=bool)
        chosen[used] = True
        colours = self.picture.reshape(-1, 3)[surface.at[used]].astype(np.float64)
        albedo = np.maximum(surface.colours(character, chosen), 0.02)
        return fitted_light(colours, albedo, normals[used], np.ones(len(used)))

    def normals_of(self, vertices: Array) -> Array:
        """Return the unit normals of ``vertices``, (N, 3), in camera axes, shape (N, 3)."""
        normals = VertexNormals(self.character.triangles, len(vertices))(vertices.astype(np.float32))
        return normals.astype(np.float64) @ self.camera.rotation.T

    def light_on(self, vertices: Array) -> Array:
        """Return the light on ``vertices`` of the head, (N, 3), per channel, shape (N, 3)."""
        shade = harmonics(self.normals_of(vertices)) @ self.light
        usual = max(float(np.median(shade)), 1e-3)
        return np.maximum(shade, _DARKEST * usual)


def _resized(camera: Camera, size: tuple[int, int]) -> Camera:
    """Return ``camera`` for an image reduced to ``size``."""
    factor = size[0] / camera.size[0]
    principal = camera.principal_point * factor
    shift = (float(principal[0]) - size[0] / 2.0, float(principal[1]) - size[1] / 2.0)
    return replace(camera, focal=camera.focal * factor, size=size, shift=shift)


def part_of_camera(camera: Camera, corner: tuple[int, int], factor: float, size: tuple[int, int]) -> Camera:
    """Return the camera of the part of an image from ``corner``, enlarged by ``factor`` to ``size``."""
    principal = (camera.principal_point - corner) * factor
    shift = (float(principal[0]) - size[0] / 2.0, float(principal[1]) - size[1] / 2.0)
    return replace(camera, focal=camera.focal * factor, size=size, shift=shift)
