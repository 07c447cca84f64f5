"""Poses of a character with another head, transferred by key poses, which were made on the character as it is."""

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.transfer.examples import ExampleTransfer

Array = NDArray[np.float64]


def is_same_rig(one: FaceModel, other: FaceModel) -> bool:
    """Return True if both are one character, with any heads: of one name, with the same shapes."""
    first, second = one.character, other.character
    return first is second or (first.name == second.name and first.shape_names == second.shape_names)


def on_character(character: FaceModel, head: FaceModel, poses: Array) -> Array:
    """Return the ``poses``, (m, r), of a ``head`` of a character with the same weights on the character, (m, r')."""
    if head is character:
        return poses
    return (poses @ head.subspace.directions.T) @ character.subspace.projection.T


class HeadTransfer:
    """Transfer by the keys of a character, from poses of any of its heads.

    Attributes:
        keys: Transfer from the character as it is.
    """

    def __init__(self, keys: ExampleTransfer, head: FaceModel) -> None:
        """Transfer poses of the model ``head`` by ``keys``."""
        self.keys, self._head = keys, head

    def converted(self, poses: Array) -> Array:
        """Return the ``poses`` of the head, (m, r), on the character of the keys, (m, r')."""
        return on_character(self.keys.source, self._head, poses)

    def pose(self, coefficients: Array, previous: Array | None = None) -> Array:
        """Return the target's coefficients, shape (r',), for the head's, shape (r,); ``previous`` is not used."""
        return self.keys.pose(self.converted(coefficients[None])[0])
