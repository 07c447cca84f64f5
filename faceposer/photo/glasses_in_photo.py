"""Glasses in a photo: they move with the head, not with the brows and the skin around the eyes."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.identity.photos.glasses import FrontView
from faceposer.photo.extending import smooth_step
from faceposer.photo.head_in_photo import HeadInPhoto

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Distance from frames, in heights of the head, over which skin goes from their motion to its own, and over which
# what is drawn ends.
_AROUND, _EDGE = 0.11, 0.008
# Least cosine between the skin and the view where glasses are looked for, and least brightness.
_FACING, _BLACK = 0.3, 0.02
# Usual distance between the eyes, the place between them, and height over them where hats begin, in centimetres.
_EYES, _MIDDLE, _TOP = 6.3, np.array([0.0, 1.7, 7.8]), 2.8
_EARS = ("ear_left", "ear_right")
_LIDS, _BROWS = ("lids_left", "lids_right"), ("brow_left", "brow_right")
# Margin of what is found and width of gaps in it, in heights of the head, and the least share of pieces among all.
_MARGIN, _GAP, _LEAST = 0.006, 0.008, 0.05

_known: WeakKeyDictionary[HeadInPhoto, Mask] = WeakKeyDictionary()


def glasses_in(head: HeadInPhoto) -> Mask:
    """Return which pixels of the grid of ``head`` show glasses, shape (h, w)."""
    if head not in _known:
        _known[head] = _found(head)
    return _known[head]


@dataclass(frozen=True, eq=False)
class Glasses:
    """The glasses in a photo, before a changed head.

    Attributes:
        offsets: From each pixel of the grid to the place of the photo that shows it, if it is one of the glasses, in
            pixels, shape (h, w, 2).
        near: How much each pixel belongs to the glasses, 0 to 1, less with the distance from them, shape (h, w).
        frame: How much it shows them, shape (h, w).
    """

    offsets: Array
    near: Array
    frame: Array

    @classmethod
    def before(cls, head: HeadInPhoto, vertices: Array) -> "Glasses | None":
        """Return those of ``head`` in its photo before other ``vertices``, (N, 3), or None if it wears none."""
        mask = glasses_in(head)
        if not mask.any():
            return None
        height, width = mask.shape
        rows, columns = np.mgrid[:height, :width] + 0.5
        offsets = _rigid_offsets(head, vertices, columns, rows)
        away = ndimage.distance_transform_edt(~mask) / head.head_height
        at = [rows - 0.5 + offsets[..., 1], columns - 0.5 + offsets[..., 0]]
        away = ndimage.map_coordinates(away, at, order=1, mode="nearest")
        return cls(offsets, 1.0 - smooth_step(away, (0.0, _AROUND)), 1.0 - smooth_step(away, (0.0, _EDGE)))


def _rigid_offsets(head: HeadInPhoto, vertices: Array, columns: Array, rows: Array) -> Array:
    """Return the offsets by the similarity that brings what holds glasses back to its place, shape (h, w, 2)."""
    regions, places = head.character.regions, head.character.vertices
    nose = regions["nose"]
    # Glasses sit on its upper half.
    parts = [*(regions[name] for name in _EARS), nose[places[nose, 1] > np.median(places[nose, 1])]]
    ids, weights = np.concatenate(parts), np.concatenate([np.full(len(part), 1.0 / len(part)) for part in parts])
    before, after = (head.camera.project(each[ids]) @ (1.0, 1j) for each in (head.vertices, vertices))
    weights /= weights.sum()
    a0, b0 = weights @ after, weights @ before
    turn = (weights * np.conj(after - a0)) @ (before - b0) / max(float(weights @ np.abs(after - a0) ** 2), 1e-9)
    moved = turn * (columns + 1j * rows - a0) + b0 - (columns + 1j * rows)
    return np.stack([moved.real, moved.imag], axis=-1)


def _found(head: HeadInPhoto) -> Mask:
    width, height = head.camera.size
    result = np.zeros(width * height, dtype=bool)
    regions = head.character.regions
    if any(name not in regions for name in (*_EARS, *_LIDS, *_BROWS, "nose")):
        return result.reshape(height, width)
    surface, character = head.surface, head.character
    towards = surface.of_vertices(-head.normals_of(head.vertices)[:, 2:])[:, 0]
    chosen = towards > _FACING
    colours = surface.colours(character, chosen) * surface.of_vertices(head.light_on(head.vertices))[chosen]
    photo = head.picture.reshape(-1, 3)[surface.at[chosen]]
    logs = np.log(np.maximum(photo, _BLACK)) - np.log(np.maximum(colours, _BLACK))
    brows = np.zeros((len(character.vertices), 1))
    brows[np.concatenate([regions[name] for name in _BROWS])] = 1.0
    eyes = np.stack([character.vertices[regions[name]].mean(axis=0) for name in _LIDS])
    places = surface.of_vertices(character.vertices.astype(np.float64))[chosen]
    # The view looks at the middle of a head in centimetres.
    middle, scale = eyes.mean(axis=0), _EYES / max(abs(float(eyes[0, 0] - eyes[1, 0])), 1e-6)
    places, eyes = scale * (places - middle) + _MIDDLE, scale * (eyes - middle) + _MIDDLE
    view = FrontView(places, surface.of_vertices(brows)[chosen, 0], eyes)
    weights = smooth_step(towards[chosen], (_FACING, 0.6)) * (places[:, 1] < _MIDDLE[1] + _TOP)
    kept = view.kept(logs, weights)
    if kept is not None:
        result[surface.at[chosen]] = kept < 0.5
    # What is found has a margin, and may show skin that shines.
    near = ndimage.distance_transform_edt(~result.reshape(height, width)) < _GAP * head.head_height
    inner = ndimage.distance_transform_edt(near) > (_GAP + _MARGIN) * head.head_height
    parts, number = ndimage.label(inner)
    sizes = np.bincount(parts.reshape(-1), minlength=number + 1)
    return inner & (sizes > _LEAST * sizes[1:].sum())[parts]
