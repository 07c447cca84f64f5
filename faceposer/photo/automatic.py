"""Expressions of photos on any character, without pins.

The person in the photo has another head than the character. Head and expression are fitted together with the morphable
model, so that the brows of a person with high brows are not raised; the weights of the expression go to the character's
shapes of the same names.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.identity.photos.face_places import load_face_places
from faceposer.identity.photos.head_basis import head_basis
from faceposer.identity.photos.head_from_photos import check_turns
from faceposer.identity.photos.landmark_fit import LandmarkFit, fit_landmarks
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.face_model import FaceModel
from faceposer.model.shape_names import weight_map
from faceposer.photo.aligning import aligned
from faceposer.photo.faces import FaceInPhoto
from faceposer.photo.photo import Photo, Pin

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PhotoExpression:
    """The expression of a photo on a character.

    Attributes:
        pose: Its coefficients on the character, shape (r,).
        photo: The photo with pins on feature points and its camera for this character.
        fit: The fit of the person's own head.
    """

    pose: Array
    photo: Photo
    fit: LandmarkFit


def check_takes(model: FaceModel, source: str, remedy: str) -> None:
    """Raise FacePoserError, with a ``remedy``, if a character has no shapes for the expressions of a ``source``."""
    character = model.character
    if not weight_map(character.shape_names, ARKIT_SHAPES).any():
        raise FacePoserError(
            f"The character '{character.title}' has none of ARKit's shapes, to which expressions of {source} are "
            f"given; {remedy}."
        )


def pose_of_weights(model: FaceModel, names: Sequence[str], weights: Array) -> Array:
    """Return the pose of a character with the ``weights`` of the shapes ``names`` of another one, within its limits.

    Args:
        model: Model of the character.
        names: Names of the shapes, S' of them.
        weights: Shape (S',), or (F, S') for several poses.

    Returns:
        Coefficients, shape (r,) or (F, r).
    """
    character = model.character
    given = weights @ weight_map(character.shape_names, names).T
    lower, upper = character.shape_limits.T.astype(np.float64)
    limited = np.where(upper > lower, np.clip(given, lower, upper), given)
    pose: Array = limited @ model.subspace.projection.T
    return pose


def expression_of(found: FaceInPhoto, model: FaceModel) -> PhotoExpression:
    """Return the expression of the face ``found`` on the character of ``model``.

    Raises:
        FacePoserError: If the face is turned too far, or the character has none of ARKit's shapes.
    """
    check_takes(model, "photos", "pin its points on the photo instead (--pins)")
    basis = head_basis()
    fit = fit_landmarks([found.face], basis, load_face_places())
    check_turns(fit, [str(found.path)])
    pose = pose_of_weights(model, basis.character.shape_names, basis.model.weights_of(fit.state.views[0].pose))
    pins = tuple(Pin(name, pixel) for name, pixel in found.features().items())
    width, height = found.file.size
    inside = tuple(pin for pin in pins if 0.0 <= pin.pixel[0] <= width and 0.0 <= pin.pixel[1] <= height)
    photo = Photo(str(found.path.absolute()), found.file.size, inside, focal=found.file.focal)
    photo = photo.with_expression(model, pose)
    return PhotoExpression(pose, aligned(photo, model, pose), fit)
