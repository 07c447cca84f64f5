"""What a photo does not show of a changed head: mouths, eyeballs, lids, the inner sides of lips.

Lips get colours of lips in the photo, and the others those of the model, in the light and the tone of the photo.

Each part is drawn several times as fine as the grid and averaged, so that teeth and edges are smooth.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.photo.extending import blurred, extended, smooth_step
from faceposer.photo.following import Following, cells_of, seen_in
from faceposer.photo.head_in_photo import HeadInPhoto, part_of_camera
from faceposer.photo.light_in_parts import (
    depth_in,
    light_in_mouth,
    light_on_eyes,
    no_brighter,
    tone_of_eyes,
    tone_of_lids,
    tone_of_teeth,
)
from faceposer.photo.surface_in_picture import SurfaceInPicture

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Box = tuple[int, int, int, int]

# Growth of the area of lids in the picture between which they are no longer stretched from the photo.
_LIDS = (1.6, 3.0)
# Shares of the inside of the mouth that the photo shows between which it is taken from there, teeth and all.
_COVERED = (0.6, 0.7)
# Opening of the mouth, in heights of the head, up to which closed lips stay closed.
_OPENING = (0.006, 0.012)
# Cosines between lips and view in the photo between which it shows them, and growth of it from which they are drawn.
# Also the distances from the mouth in the photo between which it is no longer theirs, in heights of the head.
_LIPS = (0.02, 0.04)
_INNER, _TURNED = (0.1, 0.4), (0.1, 0.35)
# Width, in heights of the head, of the edges of eyes in the photo, which lashes and lids darken.
_RIM = 0.008
# Width of the edges of lips that the inside of the mouth or the line between the lips shines through, in heights of the
# head and in pixels of the photo, the larger counts.
_EDGE, _BLURRED = 0.008, 1.2
# Width over which colours of lips are smoothed, in heights of the head, and the least weight of their means; how far
# from the mouth they are taken, relative to the edges of the lips.
_SMOOTH, _LEAST, _REACH = 0.006, 0.05, 3.0
# Margin of drawn parts in pixels, and pixels drawn per pixel, along each side.
_MARGIN, _FINE = 3, 3
# Softness of the edges of drawn parts, in heights of the head.
_SOFT = 0.002
# Blur of the photo, in its pixels, that drawn colours have, too.
_BLUR = 0.5
# Side of the squares whose averages are extended beside drawn parts, in heights of the head.
_CELL = 0.004


@dataclass(frozen=True, eq=False)
class DrawnParts:
    """Drawn parts of a head on the grid of its photo.

    Attributes:
        share: Their share of each pixel, shape (h, w).
        colours: Their colours, 0 to 1, also beside them, shape (h, w, 3).
    """

    share: Array
    colours: Array

    @classmethod
    def of(cls, head: HeadInPhoto, vertices: Array, following: Following) -> "DrawnParts":
        """Return those of ``head`` with other ``vertices``, (N, 3), whose photo is ``following`` it."""
        width, height = head.camera.size
        drawing = _Drawing(
            head,
            vertices,
            _growth_of_lids(head, vertices),
            _share_of_mouth(head, following),
            np.stack([-head.normals_of(each)[:, 2] for each in (head.vertices, vertices)], axis=1),
            following.light,
        )
        shares = drawing.shares(following.surface, following.before, following.seen)
        drawn = np.zeros(height * width, dtype=bool)
        drawn[following.surface.at[shares > 0.0]] = True
        share, colours = np.zeros((height, width)), np.zeros((height, width, 3))
        for left, top, right, bottom in _boxes(drawn.reshape(height, width)):
            part = (slice(top, bottom), slice(left, right))
            share[part], colours[part] = drawing.part((left, top, right, bottom))
        known = share > 0.0
        if not known.any():
            return cls(share, colours)
        smooth, _ = blurred(colours, share, _BLUR * head.pixel)
        share = ndimage.gaussian_filter(share, _SOFT * head.head_height)
        return cls(share, extended(smooth, known, _CELL * head.head_height))


def _boxes(mask: Mask) -> list[Box]:
    """Return disjoint boxes around the parts of a ``mask``, (h, w): left, top, right and bottom."""
    grown = ndimage.binary_dilation(mask, iterations=_MARGIN)
    result: list[Box] = []
    for rows, columns in ndimage.find_objects(ndimage.label(grown)[0]):
        one = (columns.start, rows.start, columns.stop, rows.stop)
        while met := [b for b in result if b[0] < one[2] and one[0] < b[2] and b[1] < one[3] and one[1] < b[3]]:
            result = [box for box in result if box not in met]
            left, top, right, bottom = zip(one, *met, strict=True)
            one = (min(left), min(top), max(right), max(bottom))
        result.append(one)
    return result


def _growth_of_lids(head: HeadInPhoto, vertices: Array) -> Array:
    """Return by which factor the area around each vertex of the lids grows in the picture, 1 for others, (N, 1)."""
    lids = head.character.triangles[head.lids]
    sums = []
    for each in (head.vertices, vertices):
        a, b, c = np.moveaxis(head.camera.project(each)[lids], 1, 0)
        areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        sums.append(np.bincount(lids.reshape(-1), np.repeat(areas, 3), len(vertices)))
    return np.where(sums[0] > 0.0, sums[1] / np.maximum(sums[0], 1e-9), 1.0)[:, None]


def _share_of_mouth(head: HeadInPhoto, following: Following) -> float:
    """Return how much of the mouth's inside is drawn: all of it or nothing, since teeth of both kinds do not match."""
    surface = following.surface
    mouth = head.inside[surface.faces[surface.at]]
    if not mouth.any():
        return 0.0
    widest = depth_in(mouth, surface, head.camera.size).max(), head.depth_in_mouth.max()
    # Lips that were closed stay closed, and none are drawn apart that are only a little so.
    opened = smooth_step(2.0 * max(widest) / head.head_height, _OPENING)
    return float(1.0 - smooth_step(following.seen[mouth].mean(), _COVERED)) * float(opened)


@dataclass(frozen=True, eq=False)
class _Drawing:
    """Draws parts of a changed head.

    Attributes:
        head: The head in the photo.
        vertices: The changed ones, shape (N, 3).
        growth: That of the lids, shape (N, 1).
        mouth: Share of the inside of the mouth that is drawn.
        facing: Cosines between skin and view, before and after, shape (N, 2).
        light: Logarithm of the change of light on the grid, shape (h, w, 3).
    """

    head: HeadInPhoto
    vertices: Array
    growth: Array
    mouth: float
    facing: Array
    light: Array

    def shares(self, surface: SurfaceInPicture, points: Array, seen: Mask) -> Array:
        """Return the share of drawn colours at the pixels of ``surface``, (n,), ``points`` of the head in the photo."""
        head = self.head
        triangles = surface.faces[surface.at]
        result = np.where(head.inside[triangles], self.mouth, np.where(head.eyes[triangles] & ~seen, 1.0, 0.0))
        lids = head.lids[triangles]
        result[lids] = smooth_step(surface.of_vertices(self.growth)[lids, 0], _LIDS)
        # The inner side of the lips comes to light.
        lips = head.lips[triangles]
        before, after = surface.of_vertices(self.facing)[lips].T
        turned = (1.0 - smooth_step(before, _INNER)) * smooth_step(after - before, _TURNED)
        shares = np.where(seen[lips], turned, smooth_step(after - before, (0.0, _TURNED[1])))
        column, row, _ = cells_of(head, points[lips])
        away = head.away_from_mouth[row, column] / head.head_height
        result[lips] = self.mouth * shares * (1.0 - smooth_step(away, _LIPS))
        return result

    def part(self, box: Box) -> tuple[Array, Array]:
        """Return shares, (h, w), and colours, (h, w, 3), of the pixels of a box of the grid."""
        head, (left, top, right, bottom) = self.head, box
        size = (_FINE * (right - left), _FINE * (bottom - top))
        surface = SurfaceInPicture.of(
            head.character, self.vertices, part_of_camera(head.camera, (left, top), float(_FINE), size)
        )
        height = _FINE * head.head_height
        before = surface.of_vertices(head.vertices)
        shares = self.shares(surface, before, seen_in(head, surface, before))
        triangles = surface.faces[surface.at]
        inside, eyes = head.inside[triangles], head.eyes[triangles]
        edge = depth_in(eyes, surface, size) / height
        lips = head.lips[triangles]
        shares[lips] = np.maximum(shares[lips], self._edges_of_lips(before[lips]))
        shares[eyes] = np.maximum(shares[eyes], self._rims(before[eyes], edge[eyes]))
        light = surface.of_vertices(head.light_on(self.vertices))
        lids = head.lids[triangles]
        if lids.any():
            # Folds have normals of all directions.
            light[lids] = 0.5 * (light[lids] + light[lids].mean(axis=0))
        light[inside] = light_in_mouth(head, surface, light, surface.of_vertices(self.vertices), size, height)[inside]
        light[eyes] = light_on_eyes(head, surface, light, size, height)[eyes]
        colours = surface.colours(head.character) * light
        colours[inside] *= np.exp(tone_of_teeth(head))
        colours[eyes] = no_brighter(head, colours[eyes] * np.exp(tone_of_eyes(head)))
        colours[lids] *= np.exp(tone_of_lids(head, before[lids]))
        red = surface.of_vertices(head.redness[:, None])[lips]
        colours[lips] = self._colours_of_lips(before[lips], red, surface.at[lips], box)
        share, painted = np.zeros(len(surface.faces)), np.zeros((len(surface.faces), 3))
        share[surface.at], painted[surface.at] = shares, shares[:, None] * np.clip(colours, 0.0, 1.0)
        cells = (bottom - top, _FINE, right - left, _FINE)
        mean, sums = share.reshape(cells).mean(axis=(1, 3)), painted.reshape(*cells, 3).mean(axis=(1, 3))
        return mean, sums / np.maximum(mean, 1e-9)[..., None]

    @cached_property
    def _width(self) -> float:
        """Width of the edges of the lips in the photo, in pixels of the grid."""
        return max(_EDGE * self.head.head_height, _BLURRED * self.head.pixel)

    def _edges_of_lips(self, before: Array) -> Array:
        """Return how much of lips at points ``before`` is drawn, where teeth or the lip line shine through, (n,)."""
        column, row, _ = cells_of(self.head, before)
        away = self.head.away_from_mouth[row, column] / self._width
        result: Array = self.mouth * (1.0 - smooth_step(away, (0.5, 1.0)))
        return result

    def _colours_of_lips(self, before: Array, red: Array, at: NDArray[np.int64], box: Box) -> Array:
        """Return colours of lips at points ``before``, which pixels ``at`` of a ``box`` show, (n, 3).

        They are those of the nearest lips in the photo that neither teeth nor the line of the lips shine through, as
        far as they are ``red``, (n, 1), and of the skin around them.
        """
        head, (left, top, right, _) = self.head, box
        column, row, _ = cells_of(head, before)
        width = _FINE * (right - left)
        light = self.light[top + at // width // _FINE, left + at % width // _FINE]
        lips, skin = self._clear
        result: Array = (red * lips[row, column] + (1.0 - red) * skin[row, column]) * np.exp(light)
        return result

    @cached_property
    def _clear(self) -> tuple[Array, Array]:
        """The photo's colours of the nearest lips, and of the nearest skin around them, off the mouth, (h, w, 3)."""
        head = self.head
        away = head.away_from_mouth / self._width
        triangles = head.surface.faces[head.surface.at]
        red, around = head.red_of_lips[triangles], head.lips[triangles] & ~head.red_of_lips[triangles]
        return self._taken(red, (away >= 1.0) & (away < _REACH)), self._taken(around, away >= 1.0)

    def _taken(self, part: Mask, clear: Mask) -> Array:
        """Return the photo's colours of a ``part`` of the surface, (n,), from where it is ``clear``, (h, w, 3)."""
        head = self.head
        mask = np.zeros(clear.size, dtype=bool)
        mask[head.surface.at] = part
        weight = (clear & mask.reshape(clear.shape)).astype(np.float64)
        smooth, total = blurred(head.picture.astype(np.float64), weight, _SMOOTH * head.head_height)
        return extended(smooth, total > _LEAST)

    def _rims(self, before: Array, edge: Array) -> Array:
        """Return how much of eyes at points ``before`` is drawn, since lids darken them in the photo, (n,).

        Those at the ``edge`` of the eye, in heights of the head, still are.
        """
        head = self.head
        column, row, _ = cells_of(head, before)
        then = head.depth_in_eyes[row, column] / head.head_height
        pixel = 1.0 / head.head_height
        result: Array = (1.0 - smooth_step(then, (0.5 * _RIM, _RIM))) * smooth_step(
            edge - then, (pixel, pixel + 0.5 * _RIM)
        )
        return result
