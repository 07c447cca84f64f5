"""Poses on a face: at any strength, as a whole or by region, mirrored and flipped.

Flip: left and right change places. Mirror: one side becomes the image of the other.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.mirror import SurfaceMirror
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.face_model import FaceModel
from faceposer.model.shape_names import SPLIT_SHAPES, halves_of, whole_of
from faceposer.poses.pose_file import Pose

Array = NDArray[np.float64]
Region = Literal["brows", "eyes", "cheeks", "mouth"]
Side = Literal["both", "left", "right"]
Blend = Literal["replace", "add"]
#: The regions that a pose can be applied to, cheeks with the nose and the mouth with jaw and tongue.
REGIONS: tuple[Region, ...] = ("brows", "eyes", "cheeks", "mouth")
#: Least and greatest strength: -100 and 200 %.
LEAST_STRENGTH, GREATEST_STRENGTH = -1.0, 2.0

_WORDS: dict[Region, tuple[str, ...]] = {
    "brows": ("brow", "forehead"),
    "eyes": ("eye", "lid", "gaze"),
    "cheeks": ("cheek", "nose", "midface"),
    "mouth": ("mouth", "jaw", "tongue", "lip", "chin"),
}
_KNOWN = frozenset((*ARKIT_SHAPES, *SPLIT_SHAPES))
# Shapes that push to a side: they belong to neither.
_SIDEWAYS = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
# Shapes of the eyes that turn towards the nose and away from it: what mirrored would make a squint.
_GAZE_SIDEWAYS = ("eyeLookIn", "eyeLookOut")
# Shares of the head's height and of the vertices: how far a vertex may lie from the image of its partner, and how many
# must have one.
_TOLERANCE, _PAIRED = 0.003, 0.9


def weights_on(pose: Pose, character: Character) -> Array | None:
    """Return the weights of ``pose`` in the order of the ``character``'s shapes, shape (S,), or None if it does not fit.

    Shapes with ARKit's names mean the same on every face, whole or in halves. All others belong to the character that the
    pose was made on.
    """
    given: dict[str, float] = {}
    for name, weight in pose.weights.items():
        if name in _KNOWN or (pose.character == character.name and name in character.shape_names):
            given.update(_as_the_rig_has_it(name, weight, pose.weights, character.shape_names))
    if pose.weights and not given:
        return None
    return np.array([given.get(name, 0.0) for name in character.shape_names])


def _as_the_rig_has_it(
    name: str, weight: float, weights: Mapping[str, float], rig: Collection[str]
) -> dict[str, float]:
    """Return ``name`` with its weight under the names that the ``rig`` has for it, halves for a whole and back."""
    if name in rig:
        return {name: weight}
    halves = halves_of(name)
    if halves and all(half in rig for half in halves):
        return dict.fromkeys(halves, weight)
    whole = whole_of(name)
    if whole != name and whole in rig:
        return {whole: float(np.mean([weights.get(half, 0.0) for half in halves_of(whole)]))}
    return {}


def region_of(shape: str) -> Region | None:
    """Return the region that the shape of this name moves, or None for none of them, as ears."""
    lower = shape.lower()
    for region, words in _WORDS.items():
        if any(lower.startswith(word) for word in words):
            return region
    for region, words in _WORDS.items():
        if any(word in lower for word in words):
            return region
    return None


def side_of(shape: str) -> Side:
    """Return the side of the face that the shape of this name belongs to; "both" for one without a side."""
    words = shape.lower().replace("_", " ").split()
    for side in ("left", "right"):
        if side in words or (shape.endswith(side.title()) and shape not in _SIDEWAYS):
            return "left" if side == "left" else "right"
    return "both"


def chosen_shapes(character: Character, regions: Iterable[Region] | None, side: Side) -> NDArray[np.bool_]:
    """Return which of the ``character``'s shapes move these regions, None for the whole face, on this side, shape (S,).

    A shape without a side, such as the jaw's, moves both sides and belongs to none alone.
    """
    wanted = None if regions is None else frozenset(regions)
    return np.array(
        [
            (wanted is None or region_of(name) in wanted) and (side == "both" or side_of(name) == side)
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
    """Return the face ``start``, shape (r,), with ``pose`` applied, shape (r,).

    Args:
        model: The face.
        start: The pose that it has.
        pose: What is applied.
        strength: 0 leaves the face, 1 gives the pose itself, 2 goes as far again, -1 goes the opposite way.
        regions: Which regions it reaches; None for the whole face.
        side: Which side it reaches.
        blend: "replace" goes from the start towards the pose, "add" puts the pose on top of the start.

    Raises:
        FacePoserError: If the pose does not fit the face, or the strength is out of range.
    """
    if not LEAST_STRENGTH <= strength <= GREATEST_STRENGTH:
        raise FacePoserError(f"The strength of a pose goes from -1 to 2, not {strength:g}.")
    weights = weights_on(pose, model.character)
    if weights is None:
        raise FacePoserError(misfit(pose, model.character))
    before = np.asarray(start, dtype=np.float64)
    chosen = chosen_shapes(model.character, regions, side)
    if chosen.all():
        # In coefficients, so that the start is left behind to the last digit.
        target = model.coefficients_of(weights)
        return before + strength * (target - before if blend == "replace" else target)
    change = weights - model.weights_of(before) if blend == "replace" else weights
    return before + strength * model.coefficients_of(np.where(chosen, change, 0.0))


def misfit(pose: Pose, character: Character) -> str:
    """Return why ``pose`` does not fit ``character``, in a sentence."""
    if all(name in _KNOWN for name in pose.weights):
        return f"The pose '{pose.name}' needs ARKit's shapes, which '{character.title}' does not have."
    return f"The pose '{pose.name}' was made on '{pose.character}' and fits no other face."


def pose_of(model: FaceModel, p: ArrayLike, name: str, tags: tuple[str, ...] = ()) -> Pose:
    """Return the face ``p``, shape (r,), as a pose called ``name``."""
    weights = dict(zip(model.character.shape_names, model.weights_of(p).tolist(), strict=True))
    return Pose(name, weights, model.character.name, tags)


# Left and right


def flipped_pose(model: FaceModel, pose: Pose) -> Pose:
    """Return ``pose`` with left and right exchanged, as the face has it.

    Raises:
        FacePoserError: If it does not fit the face, or that has no left and right.
    """
    neutral = model.neutral()
    weights = pose_of(model, flipped(model, applied(model, neutral, pose)), pose.name).weights
    return replace(pose, name=f"{pose.name}, flipped", weights=weights, character=model.character.name)


def flipped(model: FaceModel, p: ArrayLike) -> Array:
    """Return the face ``p``, shape (r,), with left and right exchanged, shape (r,).

    Raises:
        FacePoserError: If the face has no left and right: neither by the names of its shapes nor by its form.
    """
    weights = model.weights_of(p)
    if _is_named(model.character):
        return model.coefficients_of(weights[_partners(model.character)])
    both, _ = _images(model)
    return model.coefficients_of(both @ weights)


def mirrored(model: FaceModel, p: ArrayLike, source: Literal["left", "right"] = "left") -> Array:
    """Return the face ``p``, shape (r,), with the other side as the image of the side ``source``, shape (r,).

    What pushes jaw and mouth to a side becomes nothing; the eyes go on looking where they look.

    Raises:
        FacePoserError: If the face has no left and right: neither by the names of its shapes nor by its form.
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
    """Return the index of the shape across from each, shape (S,); its own where it has none."""
    names = list(character.shape_names)
    across = []
    for i, name in enumerate(names):
        other = name
        for ending, opposite in (("Left", "Right"), ("Right", "Left")):
            if name.endswith(ending):
                other = name.removesuffix(ending) + opposite
        across.append(names.index(other) if other in names else i)
    return np.array(across, dtype=np.intp)


@lru_cache(maxsize=2)
def _images(model: FaceModel) -> tuple[Array, Array]:
    """Return matrices on the weights, each (S, S): the flip, and the mirror image of the left on the right.

    Both give the weights whose shapes come nearest, in the sum of squared distances, to the displacements as they are
    in the mirror.
    """
    character = model.character
    mirror = SurfaceMirror(character.vertices, character.triangles, _TOLERANCE * character.height)
    partner = mirror.vertices
    paired = partner >= 0
    if paired.mean() < _PAIRED:
        raise FacePoserError(f"'{character.title}' is not symmetric enough to have its left and right exchanged.")
    shapes = character.shapes.astype(np.float64)
    images = np.where(paired[:, None], shapes[:, partner] * (-1.0, 1.0, 1.0), shapes)
    x = character.vertices[:, 0].astype(np.float64)
    # On the plane of symmetry, both sides count half.
    of_left = np.clip(0.5 + x / (2.0 * _TOLERANCE * character.height), 0.0, 1.0)[None, :, None]
    halves = of_left * shapes + (1.0 - of_left) * images
    flat = shapes.reshape(len(shapes), -1)
    inverse = np.linalg.pinv(flat @ flat.T, rcond=1e-8, hermitian=True)
    both = inverse @ (flat @ images.reshape(len(shapes), -1).T)
    return both, inverse @ (flat @ halves.reshape(len(shapes), -1).T)
