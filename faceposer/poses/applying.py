"""Application of poses to a face: at any strength, to the whole face or to regions, mirrored and flipped.

Flip: exchange left and right. Mirror: replace one side by the image of the other.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.character_mirror import character_mirror
from faceposer.model.face_model import FaceModel
from faceposer.model.shape_names import SPLIT_SHAPES, half_shapes_of, whole_shape_of
from faceposer.poses.pose_file import Pose

Array = NDArray[np.float64]
Region = Literal["brows", "eyes", "cheeks", "mouth"]
Side = Literal["both", "left", "right"]
Blend = Literal["replace", "add"]
#: Regions that a pose can be applied to; "cheeks" includes the nose, "mouth" the jaw and the tongue.
REGIONS: tuple[Region, ...] = ("brows", "eyes", "cheeks", "mouth")
#: Minimum and maximum strength: -100 and 200 %.
LEAST_STRENGTH, GREATEST_STRENGTH = -1.0, 2.0

_WORDS: dict[Region, tuple[str, ...]] = {
    "brows": ("brow", "forehead"),
    "eyes": ("eye", "lid", "gaze"),
    "cheeks": ("cheek", "nose", "midface"),
    "mouth": ("mouth", "jaw", "tongue", "lip", "chin"),
}
_KNOWN = frozenset((*ARKIT_SHAPES, *SPLIT_SHAPES))
# Shapes with a side in their name that move both sides.
_SIDEWAYS = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
# Eye shapes towards and away from the nose: mirrored, they would make the eyes squint.
_GAZE_SIDEWAYS = ("eyeLookIn", "eyeLookOut")
# The maximum distance of a vertex from the image of its partner, as a share of the head's height, and the minimum share
# of vertices with a partner.
_TOLERANCE, _PAIRED = 0.003, 0.9


def weights_on(pose: Pose, character: Character) -> Array | None:
    """Return the weights of ``pose`` in the order of the ``character``'s shapes, shape (S,), or None without a match.

    Shapes with ARKit's names have the same meaning on every character, whole or split in halves. All others apply only
    to the character that the pose was made on.
    """
    given: dict[str, float] = {}
    for name, weight in pose.weights.items():
        if name in _KNOWN or (pose.character == character.name and name in character.shape_names):
            given.update(_in_rig_shapes(name, weight, pose.weights, character.shape_names))
    if pose.weights and not given:
        return None
    return np.array([given.get(name, 0.0) for name in character.shape_names])


def _in_rig_shapes(name: str, weight: float, weights: Mapping[str, float], rig: Collection[str]) -> dict[str, float]:
    """Return the weight of the shape ``name`` by the names of the ``rig``: the same, its halves, or its whole."""
    if name in rig:
        return {name: weight}
    halves = half_shapes_of(name)
    if halves and all(half in rig for half in halves):
        return dict.fromkeys(halves, weight)
    whole = whole_shape_of(name)
    if whole != name and whole in rig:
        return {whole: float(np.mean([weights.get(half, 0.0) for half in half_shapes_of(whole)]))}
    return {}


def region_of(shape: str) -> Region | None:
    """Return the region moved by the shape of this name, or None, for instance for ears."""
    lower = shape.lower()
    for region, words in _WORDS.items():
        if any(lower.startswith(word) for word in words):
            return region
    for region, words in _WORDS.items():
        if any(word in lower for word in words):
            return region
    return None


def side_of(shape: str) -> Side:
    """Return the side of the face moved by the shape of this name; "both" for one without a side."""
    words = shape.lower().replace("_", " ").split()
    for side in ("left", "right"):
        if side in words or (shape.endswith(side.title()) and shape not in _SIDEWAYS):
            return "left" if side == "left" else "right"
    return "both"


def shape_mask(character: Character, regions: Iterable[Region] | None, side: Side) -> NDArray[np.bool_]:
    """Return a mask of the ``character``'s shapes in ``regions``, None for all, on this side, shape (S,).

    Shapes without a side, such as those of the jaw, are excluded unless the side is "both".
    """
    chosen = None if regions is None else frozenset(regions)
    return np.array(
        [
            (chosen is None or region_of(name) in chosen) and (side == "both" or side_of(name) == side)
            for name in character.shape_names
        ],
        dtype=bool,
    )


def applied(
    model: FaceModel,
    start: ArrayLike,
    pose: Pose,
    strength: float = 1.0,
    regions: Iterable[Region] | None = None,
    side: Side = "both",
    blend: Blend = "replace",
) -> Array:
    """Return the pose ``start``, shape (r,), with ``pose`` applied, shape (r,).

    Args:
        model: The face model.
        start: Current pose.
        pose: Pose to apply.
        strength: 0 for the start, 1 for the pose, 2 for twice its displacement, -1 for the opposite.
        regions: Affected regions; None for the whole face.
        side: Affected side.
        blend: "replace" to interpolate from the start to the pose, "add" to add the pose to the start.

    Raises:
        FacePoserError: If the pose does not fit the character, or if the strength is out of range.
    """
    if not LEAST_STRENGTH <= strength <= GREATEST_STRENGTH:
        raise FacePoserError(f"The strength of a pose must be from -1 to 2, not {strength:g}.")
    weights = weights_on(pose, model.character)
    if weights is None:
        raise FacePoserError(misfit(pose, model.character))
    before = np.asarray(start, dtype=np.float64)
    chosen = shape_mask(model.character, regions, side)
    if chosen.all():
        # Computed in coefficients, so that at strength 1 nothing of the start remains.
        target = model.coefficients_of(weights)
        return before + strength * (target - before if blend == "replace" else target)
    change = weights - model.weights_of(before) if blend == "replace" else weights
    return before + strength * model.coefficients_of(np.where(chosen, change, 0.0))


def misfit(pose: Pose, character: Character) -> str:
    """Return a message on why ``pose`` does not fit ``character``."""
    if all(name in _KNOWN for name in pose.weights):
        return f"The pose '{pose.name}' needs ARKit's shapes, which '{character.title}' does not have."
    return f"The pose '{pose.name}' was made on '{pose.character}' and does not fit other characters."


def pose_of(model: FaceModel, p: ArrayLike, name: str, tags: tuple[str, ...] = ()) -> Pose:
    """Return the pose ``p``, shape (r,), under the given name."""
    weights = dict(zip(model.character.shape_names, model.weights_of(p).tolist(), strict=True))
    return Pose(name, weights, model.character.name, tags)


# Left and right


def flipped_pose(model: FaceModel, pose: Pose) -> Pose:
    """Return ``pose`` with left and right exchanged, for the character of ``model``.

    Raises:
        FacePoserError: If it does not fit the character, or if the character has no left and right.
    """
    neutral = model.neutral()
    weights = pose_of(model, flipped(model, applied(model, neutral, pose)), pose.name).weights
    return replace(pose, name=f"{pose.name}, flipped", weights=weights, character=model.character.name)


def flipped(model: FaceModel, p: ArrayLike) -> Array:
    """Return the pose ``p``, shape (r,), with left and right exchanged, shape (r,).

    Raises:
        FacePoserError: If the character has no left and right, by the names of its shapes or by symmetry.
    """
    weights = model.weights_of(p)
    if _is_named(model.character):
        return model.coefficients_of(weights[_partners(model.character)])
    both, _ = _images(model)
    return model.coefficients_of(both @ weights)


def mirrored(model: FaceModel, p: ArrayLike, source: Literal["left", "right"] = "left") -> Array:
    """Return the pose ``p``, shape (r,), with the side opposite to ``source`` as its mirror image, shape (r,).

    Sideways shapes of jaw and mouth are set to zero; the gaze remains unchanged.

    Raises:
        FacePoserError: If the character has no left and right, by the names of its shapes or by symmetry.
    """
    weights = model.weights_of(p)
    character = model.character
    if not _is_named(character):
        _, from_left = _images(model)
        both, _ = _images(model)
        if source == "left":
            return model.coefficients_of(from_left @ weights)
        return model.coefficients_of(both @ (from_left @ (both @ weights)))
    partners = _partners(character)
    result = weights.copy()
    for i, name in enumerate(character.shape_names):
        if name in _SIDEWAYS:
            result[i] = 0.0
        elif side_of(name) not in ("both", source) and not name.startswith(_GAZE_SIDEWAYS):
            result[i] = weights[partners[i]]
    return model.coefficients_of(result)


def _is_named(character: Character) -> bool:
    return any(name in _KNOWN for name in character.shape_names)


def _partners(character: Character) -> NDArray[np.intp]:
    """Return the index of the mirror partner of each shape, shape (S,), or its own if it has none."""
    names = list(character.shape_names)
    partners = []
    for i, name in enumerate(names):
        other = name
        for ending, opposite in (("Left", "Right"), ("Right", "Left")):
            if name.endswith(ending):
                other = name.removesuffix(ending) + opposite
        partners.append(names.index(other) if other in names else i)
    return np.array(partners, dtype=np.intp)


@lru_cache(maxsize=2)
def _images(model: FaceModel) -> tuple[Array, Array]:
    """Return matrices on the weights, each (S, S): the flip, and the mirroring of the left side to the right.

    Their weights are the least-squares fit of the shapes to the mirrored displacements.
    """
    character = model.character
    partner = character_mirror(character, _TOLERANCE).vertices
    paired = partner >= 0
    if paired.mean() < _PAIRED:
        raise FacePoserError(f"'{character.title}' is not symmetric enough to exchange left and right.")
    shapes = character.shapes.astype(np.float64)
    images = np.where(paired[:, None], shapes[:, partner] * (-1.0, 1.0, 1.0), shapes)
    x = character.vertices[:, 0].astype(np.float64)
    # Near the plane of symmetry, the sides are blended.
    of_left = np.clip(0.5 + x / (2.0 * _TOLERANCE * character.height), 0.0, 1.0)[None, :, None]
    halves = of_left * shapes + (1.0 - of_left) * images
    flat = shapes.reshape(len(shapes), -1)
    inverse = np.linalg.pinv(flat @ flat.T, rcond=1e-8, hermitian=True)
    both = inverse @ (flat @ images.reshape(len(shapes), -1).T)
    return both, inverse @ (flat @ halves.reshape(len(shapes), -1).T)
