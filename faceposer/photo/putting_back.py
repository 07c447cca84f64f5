"""A changed head put back into its photo (Blanz and Vetter 1999, section 6 and figures 6 to 8).

Each pixel that shows the changed head shows a point of its surface. The photo has the colours of that point where the
head had it before; they change as the light on the point does. So an unchanged head gives back the photo itself,
whatever the model does not know, as in the relative changes by which the paper paints. Around the head the photo is
warped along, less with the distance, so that no hole opens where a head gets slimmer, and hair follows. What
the photo did not show, as teeth behind closed lips, is drawn with the model's colours in the photo's light.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from faceposer.photo.head_in_photo import HeadInPhoto
from faceposer.photo.strips import PhotoChange, with_change
from faceposer.photo.surface_in_picture import SurfaceInPicture, triangles_of
from faceposer.progress import Progress

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Depth behind the surface, as a share of the head's height, at which a point is hidden.
_HIDDEN = 0.015
# Distance around the head over which the photo is warped, in heights of the head.
_AROUND = 0.5
# Least cosine between skin and view at which a pixel is compared with the photo, and that from which its light is
# trusted; limits of the change of light, and the blur of it in heights of the head.
_FACING, _TRUSTED, _CHANGE, _BLUR = 0.2, 0.5, 0.5, 0.012
# Distances from skin that the photo shows, in heights of the head, between which skin is no longer stretched from it.
_STRETCHED = (0.08, 0.16)
# Growth of the area of lids in the picture between which they are no longer stretched from the photo.
_LIDS = (2.5, 5.0)
# Shares of the inside of the mouth that the photo shows between which it is taken from there, teeth and all.
_COVERED = (0.6, 0.7)
# Distance from the edge of the mouth's inside, in heights of the head, at which its pixels are no lips.
_DEEP = 0.01
# Light inside the mouth: depths behind the front teeth, in heights of the head, between which it falls to a share, and
# the shadow of the lips with its width.
_DEPTHS, _DARK, _SHADOW, _SHADOW_WIDTH = (0.015, 0.15), 0.12, 0.45, 0.025
# Colour of the light inside, much of which lips and gums have reflected.
_TINT = np.array([1.06, 0.98, 0.92])
# Limit of the change of tone of drawn parts.
_TONE = 0.7
_BLACK = 0.02
# Least number of pixels that show the photo's teeth.
_LEAST_TEETH = 30


def put_back(
    head: HeadInPhoto,
    vertices: NDArray[np.floating],
    skin: Image32 | None = None,
    progress: Progress | None = None,
) -> NDArray[np.uint8]:
    """Return the photo of ``head`` with other vertices, (N, 3), in its light, shape (h, w, 3).

    Args:
        head: The head in the photo.
        vertices: The changed head.
        skin: Logarithm of the change of the skin's colours, in the layout of its texture, shape (size, size, 3); None
            for none.
        progress: Progress and cancellation.

    Raises:
        FacePoserError: If the photo shows too little of the face.
        CancelledError: If the user has cancelled the work.
    """
    change = photo_change(head, np.asarray(vertices, dtype=np.float64), skin)
    left, top, right, bottom = head.box
    result = head.pixels.copy()
    result[top:bottom, left:right] = with_change(head.pixels[top:bottom, left:right], change, progress)
    return result


def photo_change(head: HeadInPhoto, vertices: Array, skin: Image32 | None = None) -> PhotoChange:
    """Return how the photo changes if ``head`` gets ``vertices``, (N, 3); ``skin`` is as for `put_back`."""
    surface = SurfaceInPicture.of(head.character, vertices, head.camera)
    width, height = head.camera.size
    n = height * width
    change = np.log(head.light_on(vertices)) - np.log(head.light_on(head.vertices))
    change = head.belonging[:, None] * np.clip(change, -_CHANGE, _CHANGE)
    before = surface.of_vertices(head.vertices)
    offsets = _offsets(head, surface, before) * surface.of_vertices(head.belonging[:, None])
    triangles = surface.faces[surface.at]
    mouth, eyes = head.inside[triangles], head.eyes[triangles]
    seen, facing = _seen(head, before), _facing(head, vertices, surface)

    def image(mask: Mask) -> Mask:
        found = np.zeros(n, dtype=bool)
        found[surface.at[mask]] = True
        return found.reshape(height, width)

    shown = image(~mouth & seen & (facing > _FACING))
    moved, lit = np.zeros((n, 2)), np.zeros((n, 4))
    moved[surface.at] = offsets
    moved = _extended(moved.reshape(height, width, 2), shown)
    trust = _smooth(facing, (_FACING, _TRUSTED)) * (~mouth & seen)
    lit[surface.at] = np.concatenate([trust[:, None] * surface.of_vertices(change), trust[:, None]], axis=1)
    blur = _BLUR * head.head_height
    lit = ndimage.gaussian_filter(lit.reshape(height, width, 4), (blur, blur, 0.0))
    light = _extended(lit[..., :3] / np.maximum(lit[..., 3:], 1e-6), lit[..., 3] > 0.01)
    if skin is not None:
        light.reshape(-1, 3)[surface.at] += _smooth(facing, (0.0, _TRUSTED))[:, None] * _change_of_skin(
            head, surface, skin
        )
    # Around the head, the photo follows less with the distance.
    away = ndimage.distance_transform_edt(~image(np.ones(len(triangles), dtype=bool))) / head.head_height
    near = (1.0 - _smooth(away, (0.0, _AROUND)))[..., None]
    moved, light = near * moved, near * light

    hidden = ~mouth & ~eyes & ~seen
    drawn = np.zeros(n)
    drawn[surface.at[eyes & ~seen]] = 1.0
    if mouth.any():
        # All of it or nothing: the photo's teeth are not mixed with those that are drawn.
        drawn[surface.at[mouth]] = 1.0 - float(_smooth(seen[mouth].mean(), _COVERED))
    stretched = ndimage.distance_transform_edt(~shown).reshape(-1)[surface.at] / head.head_height
    drawn[surface.at[hidden]] = _smooth(stretched[hidden], _STRETCHED)
    lids = head.lids[triangles]
    growth = _growth(head, vertices, triangles[lids])
    drawn[surface.at[lids]] = np.maximum(drawn[surface.at[lids]], _smooth(growth, _LIDS))
    covered = image(drawn[surface.at] > 0.0)
    if not covered.any():
        return PhotoChange(moved, light, np.zeros((height, width)), np.zeros((height, width, 3)))
    colours = _drawn_colours(head, vertices, surface, moved, light, drawn[surface.at] > 0.0, seen)
    soft = ndimage.gaussian_filter(drawn.reshape(height, width), 0.7)
    return PhotoChange(moved, light, soft, _extended(colours.reshape(height, width, 3), covered))


def _change_of_skin(head: HeadInPhoto, surface: SurfaceInPicture, skin: Image32) -> Array:
    """Return the ``skin``'s change of colours on the face at the pixels of ``surface``, (n, 3)."""
    result = surface.of_vertices(head.face[:, None]) * surface.looked_up(head.character, skin)
    result[head.inside[surface.faces[surface.at]]] = 0.0
    return result


def _offsets(head: HeadInPhoto, surface: SurfaceInPicture, before: Array) -> Array:
    """Return the offsets from the pixels of ``surface`` to where the photo has their points ``before``, (n, 2)."""
    width = head.camera.size[0]
    pixels = np.stack([surface.at % width, surface.at // width], axis=1) + 0.5
    result: Array = head.camera.project(before) - pixels
    return result


def _seen(head: HeadInPhoto, before: Array) -> Mask:
    """Return which points of the head in the photo, (n, 3), the photo shows, (n,)."""
    width, height = head.camera.size
    cells = np.floor(head.camera.project(before)).astype(np.int64)
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    column, row = np.clip(cells, 0, (width - 1, height - 1)).T
    depth = head.camera.to_camera(before)[:, 2]
    result: Mask = inside & (depth < head.surface.depth[row, column] + _HIDDEN * head.character.height)
    return result


def _facing(head: HeadInPhoto, vertices: Array, surface: SurfaceInPicture) -> Array:
    """Return the lesser cosine between skin and view, before and after, at the pixels of ``surface``, (n,)."""
    towards = np.stack([-head.normals_of(each)[:, 2] for each in (head.vertices, vertices)], axis=1)
    result: Array = surface.of_vertices(towards).min(axis=1)
    return result


def _growth(head: HeadInPhoto, vertices: Array, triangles: NDArray[np.integer]) -> Array:
    """Return by which factor the area of ``triangles``, (n,), in the picture grows, (n,)."""
    areas = []
    for each in (head.vertices, vertices):
        a, b, c = np.moveaxis(head.camera.project(each)[head.character.triangles[triangles]], 1, 0)
        areas.append(np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))
    result: Array = areas[1] / np.maximum(areas[0], 1e-9)
    return result


def _depth_in_mouth(head: HeadInPhoto, surface: SurfaceInPicture) -> Array:
    """Return the distance of each pixel of the inside of the mouth from its edge, in pixels, shape (h, w)."""
    inside = np.zeros(len(surface.faces), dtype=bool)
    inside[surface.at] = head.inside[surface.faces[surface.at]]
    width, height = head.camera.size
    result: Array = ndimage.distance_transform_edt(inside.reshape(height, width))
    return result


def _drawn_colours(
    head: HeadInPhoto, vertices: Array, surface: SurfaceInPicture, moved: Array, light: Array, wanted: Mask, seen: Mask
) -> Array:
    """Return the colours of the model in the photo's light, (h * w, 3), at the pixels ``wanted`` of ``surface``."""
    width, height = head.camera.size
    triangles = surface.faces[surface.at]
    mouth, eyes = head.inside[triangles], head.eyes[triangles]
    light_on = surface.of_vertices(head.light_on(vertices))
    light_on[mouth] = _light_in_mouth(head, surface, light_on, surface.of_vertices(vertices))[mouth]
    colours = surface.colours(head.character) * light_on
    # All are brought to the tone that they have where the photo shows them.
    photo = _looked_up(head.picture, surface.at, moved.reshape(-1, 2)[surface.at])
    photo *= np.exp(light.reshape(-1, 3)[surface.at])
    tone = np.clip(np.log(np.maximum(photo, _BLACK)) - np.log(np.maximum(colours, _BLACK)), -_TONE, _TONE)
    if (eyes & seen).any():
        colours[eyes] *= np.exp(np.median(tone[eyes & seen], axis=0))
    colours[mouth] *= np.exp(_tone_of_teeth(head))
    skin = ~mouth & ~eyes
    known, image = np.zeros(height * width, dtype=bool), np.zeros((height * width, 3))
    known[surface.at[skin & seen]] = True
    image[surface.at] = tone
    smooth = _extended(image.reshape(height, width, 3), known.reshape(height, width)).reshape(-1, 3)
    colours[skin] *= np.exp(smooth[surface.at[skin]])
    result = np.zeros((height * width, 3))
    result[surface.at[wanted]] = np.clip(colours[wanted], 0.0, 1.0)
    return result


def _tone_of_teeth(head: HeadInPhoto) -> Array:
    """Return the logarithm of the colour of the photo's teeth relative to those drawn, shape (3,); 0 if it has none."""
    surface = head.surface
    deep = _depth_in_mouth(head, surface).reshape(-1)[surface.at] > _DEEP * head.head_height
    teeth = deep & triangles_of(head.character, ("teeth",))[surface.faces[surface.at]]
    if teeth.sum() < _LEAST_TEETH:
        return np.zeros(3)
    light_on = surface.of_vertices(head.light_on(head.vertices))
    light_on = _light_in_mouth(head, surface, light_on, surface.of_vertices(head.vertices))[teeth]
    colours = surface.colours(head.character, teeth) * light_on
    photo = head.picture.reshape(-1, 3)[surface.at[teeth]]
    tone = np.log(np.maximum(photo, _BLACK)) - np.log(np.maximum(colours, _BLACK))
    result: Array = np.clip(np.median(tone, axis=0), -_TONE, _TONE)
    return result


def _light_in_mouth(head: HeadInPhoto, surface: SurfaceInPicture, light: Array, places: Array) -> Array:
    """Return how much of the ``light``, (n, 3), reaches ``places``, (n, 3), inside the mouth, (n, 3).

    Its colour is not that of the light on the skin, which is known only up to the tone of the skin.
    """
    character = head.character
    teeth = [character.vertices[slice(*part.vertices)] for part in character.parts if part.material == "teeth"]
    front = max((float(vertices[:, 2].max()) for vertices in teeth), default=float(character.vertices[:, 2].max()))
    behind = _smooth((front - places[:, 2]) / character.height, _DEPTHS)
    edge = _depth_in_mouth(head, surface).reshape(-1)[surface.at] / head.head_height
    shadow = 1.0 - _SHADOW * (1.0 - _smooth(edge, (0.0, _SHADOW_WIDTH)))
    share = (shadow * (1.0 + (_DARK - 1.0) * behind)) ** (1.0 / 2.2)
    result: Array = (share * light.mean(axis=1))[:, None] * _TINT
    return result


def _looked_up(picture: NDArray[np.float32], at: NDArray[np.int64], offsets: Array) -> Array:
    """Return the colours of ``picture`` at the pixels ``at`` of its grid, moved by ``offsets``, (n, 2), (n, 3)."""
    width = picture.shape[1]
    places = np.stack([at // width + offsets[:, 1], at % width + offsets[:, 0]])
    return np.stack([ndimage.map_coordinates(picture[..., k], places, order=1, mode="nearest") for k in range(3)], 1)


def _smooth(values: ArrayLike, limits: tuple[float, float]) -> Array:
    t = np.clip((np.asarray(values) - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)
    result: Array = t * t * (3.0 - 2.0 * t)
    return result


def _extended(image: Array, known: Mask) -> Array:
    """Return ``image``, (h, w, k), with smooth values where none is ``known``, by averages at growing scales.

    Known pixels keep theirs (S. Gortler and others, "The lumigraph", SIGGRAPH 1996, section 3.4: pull and push).
    """
    if known.all() or not known.any():
        return image if known.all() else np.zeros_like(image)
    weight = known.astype(np.float64)[..., None]
    small, share = _halved(image * weight), _halved(weight)
    full = share[..., 0] > 0.0
    averages = small / np.maximum(share, 1e-12)
    coarse = _extended(averages, full) if min(full.shape) > 1 else np.where(full[..., None], averages, 0.0)
    large = _enlarged(coarse, (image.shape[0] / coarse.shape[0], image.shape[1] / coarse.shape[1]))
    result: Array = np.where(known[..., None], image, large[: image.shape[0], : image.shape[1]])
    return result


def _halved(image: Array) -> Array:
    """Return the means of 2 x 2 pixels of ``image``, (h, w, k), whose odd ends are repeated."""
    height, width = image.shape[:2]
    padded = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    result: Array = 0.25 * (padded[::2, ::2] + padded[1::2, ::2] + padded[::2, 1::2] + padded[1::2, 1::2])
    return result


def _enlarged(image: Array, factors: tuple[float, float]) -> Array:
    """Return ``image``, (h, w) or (h, w, k), linearly enlarged."""
    if factors == (1.0, 1.0):
        return image
    more = (1.0,) * (image.ndim - 2)
    result: Array = ndimage.zoom(image, (*factors, *more), order=1, mode="nearest", grid_mode=True)
    return result
