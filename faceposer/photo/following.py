"""How a photo follows its head: from where each pixel gets its colours, and in what other light.

Before and after, the face is known where it faces the camera. Elsewhere, as at the neck right below a jaw, both are
extended smoothly. So the edge of the jaw in the photo, which is never exactly that of the model, moves with its shadow,
and no seam shows where a jaw covers more or less of the neck. The shapes of faces in photos are changed alike by
T. Leyvand and others, "Data-driven enhancement of facial attractiveness", SIGGRAPH 2008.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.photo.extending import blurred, extended, smooth_step
from faceposer.photo.head_in_photo import HeadInPhoto
from faceposer.photo.surface_in_picture import SurfaceInPicture

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Depth behind the surface, as a share of the head's height, at which a point is hidden.
_HIDDEN = 0.015
# Distances around the head over which the photo is warped, beside it and below it, and the heights above the end of the
# neck between which the one becomes the other, all in heights of the head.
_AROUND, _CLOTHES = (0.5, 0.12), (-0.4, 0.0)
# Side of the squares whose averages are extended, in heights of the head.
_CELL = 0.008
# What is behind the face follows it, rather than itself, up to so many times the offset of the edge of the face,
# between limits in heights of the head. Also in heights of the head: the distance from what is behind the face up to
# which only skin that is well seen counts, the width of the edge of the face, and the smoothing behind the face.
_MOVED, _BEHIND, _BESIDE, _EDGE, _SOFT = 1.3, (0.09, 0.2), 0.015, 0.03, 0.025
# Difference of offsets, in heights of the head, that smoothing makes a continuous one.
_ALIKE = 0.015
# Least cosine between skin and view of skin that is well seen.
_WELL = 0.35
# Least cosine between skin and view at which a pixel is compared with the photo, and that from which its light is
# trusted; limits of the change of light, and the blur of it in heights of the head.
_FACING, _TRUSTED, _CHANGE, _BLUR = 0.2, 0.5, 0.35, 0.016
# How much of the change of its hue is kept.
_HUE = 0.4


@dataclass(frozen=True, eq=False)
class Following:
    """How a photo follows its head, on the grid of the head.

    Attributes:
        surface: What the photo would show of the changed head.
        before: The points of ``surface`` on the head in the photo, shape (n, 3).
        seen: Which of these the photo shows, shape (n,).
        facing: The lesser cosine between skin and view, before and after, shape (n,).
        offsets: From each pixel to the place of the photo whose colours it gets, in pixels, shape (h, w, 2).
        light: Logarithm of the factor on these colours, shape (h, w, 3).
    """

    surface: SurfaceInPicture
    before: Array
    seen: Mask
    facing: Array
    offsets: Array
    light: Array

    @classmethod
    def of(cls, head: HeadInPhoto, vertices: Array) -> "Following":
        """Return that of the photo of ``head`` for other ``vertices``, (N, 3)."""
        surface = SurfaceInPicture.of(head.character, vertices, head.camera)
        before = surface.of_vertices(head.vertices)
        seen, facing = seen_in(head, surface, before), _facing(head, vertices, surface)
        mouth = head.inside[surface.faces[surface.at]]
        shown = ~mouth & seen & (facing > _FACING)
        offsets, known = _offsets(head, surface, before, shown, facing)
        offsets *= _near(head, surface)[..., None]
        change = np.log(head.light_on(vertices)) - np.log(head.light_on(head.vertices))
        grey = change.mean(axis=1, keepdims=True)
        change = grey + _HUE * (change - grey)
        change = head.belonging[:, None] * np.clip(change, -_CHANGE, _CHANGE)
        light = _light(head, surface, change, smooth_step(facing, (_FACING, _TRUSTED)) * known.reshape(-1)[surface.at])
        return cls(surface, before, seen, facing, offsets, light)


def seen_in(head: HeadInPhoto, surface: SurfaceInPicture, before: Array) -> Mask:
    """Return which points ``before`` of the head in the photo, at the pixels of ``surface``, the photo shows, (n,).

    Eyes and the inside of the mouth are seen only between lids and lips, however thin these are, and skin only beside
    them.
    """
    column, row, inside = cells_of(head, before)
    depth = head.camera.to_camera(before)[:, 2]
    result: Mask = inside & (depth < head.surface.depth[row, column] + _HIDDEN * head.character.height)
    now, then = surface.faces[surface.at], head.surface.faces[row * head.camera.size[0] + column]
    for part in (head.inside, head.eyes):
        result &= part[now] == (part[then] & (then >= 0))
    return result


def cells_of(head: HeadInPhoto, points: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], Mask]:
    """Return columns and rows of the pixels of the grid at ``points``, (n, 3), and whether they are in the photo."""
    width, height = head.camera.size
    cells = np.floor(head.camera.project(points)).astype(np.int64)
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    column, row = np.clip(cells, 0, (width - 1, height - 1)).T
    return column, row, np.asarray(inside, dtype=bool)


def _image(head: HeadInPhoto, surface: SurfaceInPicture, mask: Mask) -> Mask:
    """Return the picture of a ``mask`` of the pixels of ``surface``, shape (h, w)."""
    width, height = head.camera.size
    found = np.zeros(height * width, dtype=bool)
    found[surface.at[mask]] = True
    return found.reshape(height, width)


def _near(head: HeadInPhoto, surface: SurfaceInPicture) -> Array:
    """Return how much each pixel follows the nearest ones of the ``surface``, shape (h, w)."""
    width, height = head.camera.size
    away = ndimage.distance_transform_edt(surface.faces.reshape(height, width) < 0) / head.head_height
    # Clothes follow less than hair and hats.
    ends = head.camera.project(head.ends_of_axis)
    down = (ends[1] - ends[0]) / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)
    rows, columns = np.mgrid[:height, :width] + 0.5
    below = ((columns - ends[1, 0]) * down[0] + (rows - ends[1, 1]) * down[1]) / head.head_height
    radius = _AROUND[0] + (_AROUND[1] - _AROUND[0]) * smooth_step(below, _CLOTHES)
    result: Array = 1.0 - smooth_step(away / radius, (0.0, 1.0))
    return result


def _offsets(
    head: HeadInPhoto, surface: SurfaceInPicture, before: Array, shown: Mask, facing: Array
) -> tuple[Array, Mask]:
    """Return the offsets of each pixel, in pixels, (h, w, 2), and where they are known, on the face and far from it."""
    width, height = head.camera.size
    pixels = np.stack([surface.at % width, surface.at // width], axis=1) + 0.5
    own = (head.camera.project(before) - pixels) * surface.of_vertices(head.belonging[:, None])
    offsets = np.zeros((height * width, 2))
    offsets[surface.at] = own
    behind = surface.of_vertices(head.behind[:, None])[:, 0] > 0.5
    front, others = _image(head, surface, shown & ~behind), _image(head, surface, shown & behind)
    cell = _CELL * head.head_height
    if not front.any() or not others.any():
        return extended(offsets.reshape(height, width, 2), front | others, cell), front | others
    # Towards the others, only skin that is well seen tells how the outline moves.
    away_from_others = ndimage.distance_transform_edt(~_image(head, surface, behind)) / head.head_height
    front &= (away_from_others > _BESIDE) | _image(head, surface, facing > _WELL)
    away = ndimage.distance_transform_edt(~front) / head.head_height
    moved = np.linalg.norm(offsets.reshape(height, width, 2)[front & (away_from_others < _EDGE)], axis=1)
    band = np.clip(_MOVED * np.quantile(moved, 0.9) / head.head_height, *_BEHIND) if moved.size else _BEHIND[0]
    image = offsets.reshape(height, width, 2)
    known = front | (others & (away > band))
    result = extended(image, known, cell)
    # Where what is behind the face moves nearly alike, as when all gets slimmer, it follows itself.
    alike = np.linalg.norm(result - image, axis=2) < _ALIKE * head.head_height
    known |= others & alike & ~_image(head, surface, surface.of_vertices(head.underside[:, None])[:, 0] > 0.0)
    result = extended(image, known, cell)
    soft = _SOFT * head.head_height
    smooth = ndimage.gaussian_filter(result, (soft, soft, 0.0))
    return result + smooth_step(away, (0.0, _SOFT))[..., None] * (smooth - result), known


def _light(head: HeadInPhoto, surface: SurfaceInPicture, change: Array, trust: Array) -> Array:
    """Return the logarithm of the ``change`` of light on the vertices, (N, 3), by ``trust``, (n,), shape (h, w, 3)."""
    width, height = head.camera.size
    image, weight = np.zeros((height * width, 3)), np.zeros(height * width)
    image[surface.at], weight[surface.at] = surface.of_vertices(change), trust
    blur = _BLUR * head.head_height
    mean, total = blurred(image.reshape(height, width, 3), weight.reshape(height, width), blur)
    # At the outline, skin is seen along before and after, under the same light.
    around = surface.faces.reshape(height, width) < 0
    mean[around] = 0.0
    return ndimage.gaussian_filter(
        extended(mean, (total > 0.01) | around, _CELL * head.head_height), (0.5 * blur, 0.5 * blur, 0.0)
    )


def _facing(head: HeadInPhoto, vertices: Array, surface: SurfaceInPicture) -> Array:
    """Return the lesser cosine between skin and view, before and after, at the pixels of ``surface``, (n,)."""
    towards = np.stack([-head.normals_of(each)[:, 2] for each in (head.vertices, vertices)], axis=1)
    result: Array = surface.of_vertices(towards).min(axis=1)
    return result
