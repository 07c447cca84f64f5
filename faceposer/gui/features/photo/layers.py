"""The photo in the view: behind the face, in front of it, on one side of the wipe, or with the face put back."""

from collections.abc import Callable
from dataclasses import dataclass

import moderngl

from faceposer.geometry.camera import Camera
from faceposer.geometry.picture_view import PictureView
from faceposer.photo.photo import Photo
from faceposer.render.renderer import PhotoLayer

# Rotation of the view in radians over which the photo fades.
_FADE = 0.25
# Least opacity of the photo over the face while pins are set.
_LEAST_PINNING_OPACITY = 0.7


@dataclass(frozen=True)
class Shown:
    """What the user wants to see of a photo.

    Attributes:
        texture: The photo.
        changed: Returns the photo with the face put back, or None if photo and face are shown.
        pinning: True while pins are set.
        split: Place of the wipe as a share of the width of the view, or None without one.
    """

    texture: moderngl.Texture
    changed: Callable[[], moderngl.Texture | None]
    pinning: bool
    split: float | None


def photo_layer(photo: Photo, camera: Camera, view: PictureView, shown: Shown) -> PhotoLayer:
    """Return the layer of ``photo``, taken by ``camera``, in ``view``."""
    near = max(1.0 - max(abs(view.yaw), abs(view.pitch)) / _FADE, 0.0)
    opacity = photo.opacity
    if shown.pinning:
        # The photo must be visible while pins are set.
        least = _LEAST_PINNING_OPACITY
        opacity = max(opacity, least) if photo.front else min(opacity, 1.0 - least)
    behind, before = (0.0, opacity) if photo.front else (1.0, 1.0 - opacity)
    changed, left, split = None, None, 0.0
    if view.aligned and not shown.pinning:
        changed = shown.changed()
        if shown.split is not None:
            # The sides are compared as they are, whatever the opacity.
            left, split, before = shown.texture, shown.split, 0.0
    if changed is not None:
        return PhotoLayer(changed, photo.size, camera.focal, 0.0, 1.0, left, split)
    before = before if view.aligned else 0.0
    return PhotoLayer(shown.texture, photo.size, camera.focal, near * behind, near * before, left, split)
