"""Light and tone of what is drawn of a head in a photo: teeth and the mouth behind them, eyeballs, lids.

The light on the skin is known up to the tone of the skin only, so its colour is not taken over as it is: teeth and eyes
are tinted a little like the skin around them, which shines on them, and brought to the tone that they have where the
photo shows them. Lids are brought to the tone of the skin around the eye.
"""

from collections.abc import Callable
from functools import wraps
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.photo.extending import smooth_step
from faceposer.photo.head_in_photo import HeadInPhoto
from faceposer.photo.surface_in_picture import SurfaceInPicture, triangles_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Distance from the edge of the mouth's inside, in heights of the head, at which its pixels are no lips.
_DEEP = 0.01
# Light inside the mouth: depths behind the front teeth, in heights of the head, between which it falls to a share, the
# widths of gaps between teeth that are no darker than these, and the shadow of the lips with its width.
_DEPTHS, _DARK, _GAP, _SHADOW, _SHADOW_WIDTH = (0.02, 0.13), 0.13, 0.006, 0.4, 0.018
# Height of openings, in heights of the head, between which light gets in, and its share in narrow ones.
_OPENING, _NARROW = (0.004, 0.018), 0.3
# Shadow of the lids on the eyes, and its width in heights of the head.
_LID_SHADOW, _LID_WIDTH = 0.35, 0.012
# Largest brightness of eyes relative to skin.
_WHITE = 1.0
# How much of the tint of the skin teeth, the rest of the mouth, teeth in its depth, and eyes have.
_TINT, _WALLS, _DEEP_TINT, _EYE_TINT = 0.35, 0.65, 1.0, 0.6
# Limit of the change of tone of drawn parts, and the share of its hue that is kept.
_TONE, _HUE = 0.7, 0.3
# That of irises and whites; the model's brightness up to which there is a pupil, and those between which an iris
# becomes a white; the share of irises that is darker than the usual one, since they mirror lights beside whites.
_EYE_TONE, _PUPIL, _IRIS, _DARKER = 1.6, 0.2, (0.68, 0.8), 0.3
_BLACK = 0.02
# Least number of pixels that show the photo's teeth, eyes, or skin around them.
_LEAST = 30
# Distance from a lid's middle, in heights of the head, of the skin whose tone it has; the least cosine to the view.
_AROUND_LID, _FACING = 0.11, 0.5


def depth_in(mask: Mask, surface: SurfaceInPicture, size: tuple[int, int]) -> Array:
    """Return the distance of the pixels of ``surface`` in the ``mask``, (n,), from its edge, in pixels, shape (n,)."""
    inside = np.zeros(len(surface.faces), dtype=bool)
    inside[surface.at] = mask
    result: Array = ndimage.distance_transform_edt(inside.reshape(size[1], size[0])).reshape(-1)[surface.at]
    return result


def light_in_mouth(
    head: HeadInPhoto, surface: SurfaceInPicture, light: Array, places: Array, size: tuple[int, int], height: float
) -> Array:
    """Return how much of the ``light``, (n, 3), reaches ``places``, (n, 3), inside the mouth, (n, 3).

    Args:
        head: The head in the photo.
        surface: What a camera shows of it, with n pixels of the surface.
        light: The light on them, if they were skin.
        places: Their places.
        size: Width and height of the picture.
        height: Height of the head in it.
    """
    character = head.character
    inside = head.inside[surface.faces[surface.at]]
    rows = [character.vertices[slice(*part.vertices)] for part in character.parts if part.material == "teeth"]
    front = max((float(vertices[:, 2].max()) for vertices in rows), default=float(character.vertices[:, 2].max()))
    behind = np.zeros(len(surface.faces))
    behind[surface.at] = np.where(inside, smooth_step((front - places[:, 2]) / character.height, _DEPTHS), 0.0)
    # Teeth light up the gaps between them.
    image = ndimage.grey_opening(behind.reshape(size[1], size[0]), 2 * (max(round(_GAP * height), 1),))
    edge = depth_in(inside, surface, size) / height
    shadow = 1.0 - _SHADOW * (1.0 - smooth_step(edge, (0.0, _SHADOW_WIDTH)))
    share = (_into(surface, edge, size, height) * shadow * (1.0 + (_DARK - 1.0) * image.reshape(-1)[surface.at])) ** (
        1.0 / 2.2
    )
    # Light that red walls have reflected is redder.
    teeth = triangles_of(character, ("teeth",))[surface.faces[surface.at]]
    deep = _TINT + (_DEEP_TINT - _TINT) * image.reshape(-1)[surface.at, None] ** 2
    tint = np.where(teeth[:, None], head.tint**deep, head.tint**_WALLS)
    result: Array = (share * light.mean(axis=1))[:, None] * tint
    return result


def _into(surface: SurfaceInPicture, edge: Array, size: tuple[int, int], height: float) -> Array:
    """Return how much light gets through an opening at distances from its ``edge``, in heights of the head, (n,)."""
    widest = np.zeros(len(surface.faces))
    widest[surface.at] = 2.0 * edge
    reach = max(round(1.5 * _OPENING[1] * height), 1)
    opening = ndimage.maximum_filter(widest.reshape(size[1], size[0]), 2 * reach + 1)
    opening = ndimage.gaussian_filter(opening, 0.5 * reach).reshape(-1)[surface.at]
    result: Array = _NARROW + (1.0 - _NARROW) * smooth_step(opening, _OPENING)
    return result


def light_on_eyes(
    head: HeadInPhoto, surface: SurfaceInPicture, light: Array, size: tuple[int, int], height: float
) -> Array:
    """Return how much of the ``light``, (n, 3), reaches eyes; the arguments are those of `light_in_mouth`."""
    edge = depth_in(head.eyes[surface.faces[surface.at]], surface, size) / height
    shadow = 1.0 - _LID_SHADOW * (1.0 - smooth_step(edge, (0.0, _LID_WIDTH)))
    share = (_into(surface, edge, size, height) * shadow) ** (1.0 / 2.2)
    result: Array = (share * light.mean(axis=1))[:, None] * head.tint**_EYE_TINT
    return result


def no_brighter(head: HeadInPhoto, colours: Array) -> Array:
    """Return ``colours`` of eyes, (n, 3), the brightest of which become no brighter than the skin in the photo."""
    usual = _WHITE * head.brightness
    result: Array = colours * ((1.0 + (colours.mean(axis=1, keepdims=True) / usual) ** 4) ** -0.25)
    return result


def once_per_head(work: Callable[[HeadInPhoto], Array]) -> Callable[[HeadInPhoto], Array]:
    """Return ``work`` whose results are kept as long as their heads."""
    known: WeakKeyDictionary[HeadInPhoto, Array] = WeakKeyDictionary()

    @wraps(work)
    def found(head: HeadInPhoto) -> Array:
        if head not in known:
            known[head] = work(head)
        return known[head]

    return found


@once_per_head
def tone_of_teeth(head: HeadInPhoto) -> Array:
    """Return the logarithm of the colour of the photo's teeth relative to those drawn, shape (3,); 0 if it has none."""
    surface, size = head.surface, head.camera.size
    triangles = surface.faces[surface.at]
    deep = depth_in(head.inside[triangles], surface, size) > _DEEP * head.head_height
    teeth = deep & triangles_of(head.character, ("teeth",))[triangles]
    light = surface.of_vertices(head.light_on(head.vertices))
    light = light_in_mouth(head, surface, light, surface.of_vertices(head.vertices), size, head.head_height)
    tone = _tones(head, teeth, light)
    return np.zeros(3) if tone is None else np.median(tone, axis=0)


def tone_of_eyes(head: HeadInPhoto, drawn: Array) -> Array:
    """Return the logarithm of the photo's colours of irises and whites relative to those ``drawn``, (n, 3).

    Args:
        head: The head in the photo.
        drawn: The model's colours of eyes under white light, shape (n, 3); dark ones are irises.
    """
    iris, white = _tones_of_eyes(head)
    share = smooth_step(drawn.mean(axis=1), _IRIS)[:, None]
    return (1.0 - share) * (iris - _hues(drawn)) + share * white


def _hues(colours: Array) -> Array:
    """Return the logarithms of ``colours``, (n, 3), relative to their brightness, (n, 3)."""
    bright = np.maximum(colours, _BLACK)
    result: Array = np.log(bright) - np.log(bright.mean(axis=1, keepdims=True))
    return result


@once_per_head
def _tones_of_eyes(head: HeadInPhoto) -> Array:
    """Return the logarithms of the colours of the photo's irises and whites relative to those drawn, (2, 3).

    They are those of both eyes together, so that these stay alike; 0 if the photo shows none. Irises drawn are grey,
    so that those of one person get no hue from those of another.
    """
    surface = head.surface
    eyes = head.eyes[surface.faces[surface.at]]
    size, height = head.camera.size, head.head_height
    edge = depth_in(eyes, surface, size) / height
    light = light_on_eyes(head, surface, surface.of_vertices(head.light_on(head.vertices)), size, height)
    result = np.zeros((2, 3))
    among = eyes & (edge > _DEEP)
    tone = _tones(head, among, light, _EYE_TONE)
    if tone is None:
        return result
    colours = surface.colours(head.character, among)
    brightness = colours.mean(axis=1)
    iris, white = (brightness > _PUPIL) & (brightness < _IRIS[0]), brightness > _IRIS[1]
    usual = np.median(tone[white] if white.sum() >= _LEAST else tone, axis=0)
    # A white has little hue of its own.
    result[1] = usual.mean() + _HUE * (usual - usual.mean())
    if iris.sum() >= _LEAST:
        result[0] = np.quantile((tone + _hues(colours))[iris], _DARKER, axis=0)
    else:
        result[0] = result[1] + np.median(_hues(colours), axis=0)
    return result


def tone_of_lids(head: HeadInPhoto, points: Array) -> Array:
    """Return the logarithm of the colour of the skin around eyes, as the photo has it, relative to that drawn, (n, 3).

    Args:
        head: The head in the photo.
        points: Points of lids on it, shape (n, 3), each of which gets that of the nearer eye.
    """
    middles = head.middles_of_lids
    if not len(middles):
        return np.zeros((len(points), 3))
    nearest = np.linalg.norm(points[:, None] - middles, axis=2).argmin(axis=1)
    result: Array = _tones_around_eyes(head)[nearest]
    return result


@once_per_head
def _tones_around_eyes(head: HeadInPhoto) -> Array:
    """Return the logarithm of the colour of the photo's skin around each eye relative to that drawn, (n, 3)."""
    surface, middles = head.surface, head.middles_of_lids
    triangles = surface.faces[surface.at]
    skin = triangles_of(head.character, ("skin",))[triangles] & ~head.inside[triangles] & ~head.lids[triangles]
    skin &= surface.of_vertices(-head.normals_of(head.vertices)[:, 2:])[:, 0] > _FACING
    places = surface.of_vertices(head.vertices)
    light = surface.of_vertices(head.light_on(head.vertices))
    result = np.zeros((len(middles), 3))
    for number, middle in enumerate(middles):
        near = np.linalg.norm(places - middle, axis=1) < _AROUND_LID * head.character.height
        tone = _tones(head, skin & near, light)
        if tone is not None:
            # The middle one, in spite of glasses and brows.
            result[number] = np.median(tone, axis=0)
    return result


def _tones(head: HeadInPhoto, among: Mask, light: Array, limit: float = _TONE) -> Array | None:
    """Return logarithms of the photo's colours relative to the model's in ``light``, (n, 3), ``among`` its pixels.

    They are None if there are too few, and go to ``limit`` at most.
    """
    if among.sum() < _LEAST:
        return None
    surface = head.surface
    colours = surface.colours(head.character, among) * light[among]
    photo = head.picture.reshape(-1, 3)[surface.at[among]]
    tone = np.log(np.maximum(photo, _BLACK)) - np.log(np.maximum(colours, _BLACK))
    result: Array = np.clip(tone, -limit, limit)
    return result
