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
from faceposer.photo.mouth_in_photo import away_from_mouth, lips_in
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
# Change of the opening of the mouth, in heights of the head, between which the edges of lips are drawn anew.
_CHANGED = (0.004, 0.012)
# Half the width of the line between closed lips that are drawn, in heights of the head and in pixels of the photo, the
# larger counts, and how many times more often lips reflect its light.
_LINE, _LINE_BLURRED, _DARKER = 0.004, 0.5, 1.4
# Width over which shares of lips are smoothed, in heights of the head.
_EVEN = 0.004
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
            *_shares_of_mouth(head, following),
            np.stack([-head.normals_of(each)[:, 2] for each in (head.vertices, vertices)], axis=1),
            following.light,
            following.offsets,
        )
        shares = drawing.shares(following.surface, following.before, following.seen, following.surface.at)
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


def _shares_of_mouth(head: HeadInPhoto, following: Following) -> tuple[float, float]:
    """Return how much of the mouth's inside is drawn, and how much of the edges of the lips.

    Of the inside it is all or nothing, since teeth of both kinds do not match. Lips that open or close get edges.
    """
    surface = following.surface
    mouth = head.inside[surface.faces[surface.at]]
    then = 2.0 * float(head.depth_in_mouth.max()) / head.head_height
    now = 2.0 * float(depth_in(mouth, surface, head.camera.size).max(initial=0.0)) / head.head_height
    edges = float(smooth_step(abs(now - then), _CHANGED))
    if not mouth.any():
        return 0.0, edges
    # Lips that were closed stay closed, and none are drawn apart that are only a little so.
    opened = smooth_step(max(now, then), _OPENING)
    inside = float(1.0 - smooth_step(following.seen[mouth].mean(), _COVERED)) * float(opened)
    return inside, max(inside, edges)


@dataclass(frozen=True, eq=False)
class _Drawing:
    """Draws parts of a changed head.

    Attributes:
        head: The head in the photo.
        vertices: The changed ones, shape (N, 3).
        growth: That of the lids, shape (N, 1).
        mouth: Share of the inside of the mouth that is drawn.
        edges: Share of the edges of lips that is drawn.
        facing: Cosines between skin and view, before and after, shape (N, 2).
        light: Logarithm of the change of light on the grid, shape (h, w, 3).
        offsets: From each pixel of the grid to its place in the photo, shape (h, w, 2).
    """

    head: HeadInPhoto
    vertices: Array
    growth: Array
    mouth: float
    edges: float
    facing: Array
    light: Array
    offsets: Array

    def shares(self, surface: SurfaceInPicture, points: Array, seen: Mask, at: NDArray[np.int64]) -> Array:
        """Return the share of drawn colours at the pixels of ``surface``, (n,).

        Its ``points``, (n, 3), are those of the head in the photo, which may be ``seen``, (n,); ``at`` are its pixels
        on the grid, (n,).
        """
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
        away = away_from_mouth(head)[row, column] / head.head_height
        result[lips] = self.mouth * shares * (1.0 - smooth_step(away, _LIPS))
        result[lips] = np.maximum(result[lips], self._edges_of_lips(points[lips], at[lips]))
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
        rows, columns = np.divmod(surface.at, size[0])
        at = (top + rows // _FINE) * head.camera.size[0] + left + columns // _FINE
        shares = self.shares(surface, before, seen_in(head, surface, before), at)
        triangles = surface.faces[surface.at]
        inside, eyes = head.inside[triangles], head.eyes[triangles]
        edge = depth_in(eyes, surface, size) / height
        lips = head.lips[triangles]
        shares[lips] = _even(shares, lips, surface.at, size, _EVEN * height)
        shares[eyes] = np.maximum(shares[eyes], self._rims(before[eyes], edge[eyes]))
        light = surface.of_vertices(head.light_on(self.vertices))
        lids = head.lids[triangles]
        if lids.any():
            # Folds have normals of all directions.
            light[lids] = 0.5 * (light[lids] + light[lids].mean(axis=0))
        light[inside] = light_in_mouth(head, surface, light, surface.of_vertices(self.vertices), size, height)[inside]
        light[eyes] = light_on_eyes(head, surface, light, size, height)[eyes]
        bare = surface.colours(head.character)
        colours = bare * light
        colours[inside] *= np.exp(tone_of_teeth(head))
        colours[eyes] = no_brighter(head, colours[eyes] * np.exp(tone_of_eyes(head, bare[eyes])))
        colours[lids] *= np.exp(tone_of_lids(head, before[lids]))
        colours[lips] = self._colours_of_lips(before[lips], surface.of_vertices(self._reds)[lips], at[lips])
        # Light between lips has been reflected by them more than once, which makes it redder.
        colours[lips] **= 1.0 + _DARKER * self.edges * self._line(surface, size, height)[lips, None]
        share, painted = np.zeros(len(surface.faces)), np.zeros((len(surface.faces), 3))
        share[surface.at], painted[surface.at] = shares, shares[:, None] * np.clip(colours, 0.0, 1.0)
        cells = (bottom - top, _FINE, right - left, _FINE)
        mean, sums = share.reshape(cells).mean(axis=(1, 3)), painted.reshape(*cells, 3).mean(axis=(1, 3))
        return mean, sums / np.maximum(mean, 1e-9)[..., None]

    @cached_property
    def _width(self) -> float:
        """Width of the edges of the lips in the photo, in pixels of the grid."""
        return max(_EDGE * self.head.head_height, _BLURRED * self.head.pixel)

    def _edges_of_lips(self, before: Array, at: NDArray[np.int64]) -> Array:
        """Return how much of lips is drawn, since teeth or the lip line are or shine through there in the photo, (n,).

        They are at points ``before``, (n, 3), in the photo and at pixels ``at`` of the grid, (n,), whose colours
        come from where these follow it.
        """
        width, height = self.head.camera.size
        away = away_from_mouth(self.head)
        column, row, _ = cells_of(self.head, before)
        places = self.offsets.reshape(-1, 2)[at] + np.stack([at % width, at // width], axis=1) + 0.5
        columns, rows = np.clip(places.astype(np.int64), 0, (width - 1, height - 1)).T
        nearest = np.minimum(away[row, column], away[rows, columns]) / self._width
        result: Array = self.edges * (1.0 - smooth_step(nearest, (0.5, 1.0)))
        return result

    def _line(self, surface: SurfaceInPicture, size: tuple[int, int], height: float) -> Array:
        """Return how near pixels of ``surface`` are to the line where closed lips meet, 0 to 1, (n,)."""
        image = []
        for name in ("lip_upper", "lip_lower"):
            mask = np.zeros(len(surface.faces), dtype=bool)
            mask[surface.at] = (self.head.of_regions((name,)) & ~self.head.inside)[surface.faces[surface.at]]
            image.append(mask.reshape(size[1], size[0]))
        line = ndimage.binary_dilation(image[0]) & ndimage.binary_dilation(image[1])
        # Beside an opening they meet behind it only.
        inside = np.zeros(len(surface.faces), dtype=bool)
        inside[surface.at] = self.head.inside[surface.faces[surface.at]]
        if inside.any():
            line &= ndimage.distance_transform_edt(~inside.reshape(size[1], size[0])) > 2.0 * _LINE * height
        if not line.any():
            return np.zeros(len(surface.at))
        width = max(_LINE * height, _LINE_BLURRED * self.head.pixel * _FINE)
        away = ndimage.distance_transform_edt(~line).reshape(-1)[surface.at]
        result: Array = np.exp(-((away / width) ** 2))
        return result

    @cached_property
    def _reds(self) -> Array:
        """How much vertices belong to the red of the upper and of the lower lip, shape (N, 2)."""
        upper = np.zeros(len(self.vertices))
        upper[self.head.character.regions.get("lip_upper", np.zeros(0, dtype=np.intp))] = 1.0
        return self.head.redness[:, None] * np.stack([upper, 1.0 - upper], axis=1)

    def _colours_of_lips(self, before: Array, reds: Array, at: NDArray[np.int64]) -> Array:
        """Return colours of lips at points ``before``, which pixels ``at`` of the grid show, (n, 3).

        They are those of the nearest parts of the same lip in the photo that neither teeth nor the line of the lips
        shine through, as far as they are red, ``reds``, (n, 2), and of the skin around them.
        """
        column, row, _ = cells_of(self.head, before)
        upper, lower, skin = (colours[row, column] for colours in self._clear)
        result = reds[:, :1] * upper + reds[:, 1:] * lower + (1.0 - reds.sum(axis=1, keepdims=True)) * skin
        return np.asarray(result * np.exp(self.light.reshape(-1, 3)[at]))

    @cached_property
    def _clear(self) -> tuple[Array, Array, Array]:
        """The photo's colours of the nearest upper and lower lip, and of the skin around, off the mouth, (h, w, 3)."""
        head = self.head
        away = away_from_mouth(head) / self._width
        upper, lower = lips_in(head)
        around = head.shown(head.lips & ~head.red_of_lips)
        off, near = away >= 1.0, away < _REACH
        # Thin lips may show nothing that is clear; then the other lip, or all that is off the mouth, stands for it.
        both = (upper | lower) & off
        return (
            self._taken(upper & off & near, both & near, both, around & off),
            self._taken(lower & off & near, both & near, both, around & off),
            self._taken(around & off, both),
        )

    def _taken(self, *clear: Mask) -> Array:
        """Return the photo's colours extended from the first of the masks ``clear`` that shows enough, (h, w, 3)."""
        picture = self.head.picture.astype(np.float64)
        for mask in clear:
            smooth, total = blurred(picture, mask.astype(np.float64), _SMOOTH * self.head.head_height)
            if (total > _LEAST).any():
                return extended(smooth, total > _LEAST)
        return picture

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


def _even(shares: Array, among: Mask, at: NDArray[np.int64], size: tuple[int, int], width: float) -> Array:
    """Return the ``shares``, (n,), smoothed ``among`` the pixels ``at`` of a picture, so none are speckled, (m,)."""
    image, weight = np.zeros(size[0] * size[1]), np.zeros(size[0] * size[1])
    image[at[among]], weight[at[among]] = shares[among], 1.0
    smooth, _ = blurred(image.reshape(size[1], size[0], 1), weight.reshape(size[1], size[0]), width)
    result: Array = smooth.reshape(-1)[at[among]]
    return result
