"""Performances: sequences of poses at a constant frame rate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Performance:
    """A sequence of poses of one face.

    Attributes:
        coefficients: Coefficients of the pose of each frame, shape (F, r), with F at least 1.
        rate: Frames per second.
    """

    coefficients: Array
    rate: float

    def __post_init__(self) -> None:
        if self.coefficients.ndim != 2 or not len(self.coefficients):
            raise ValueError(f"poses of shape {self.coefficients.shape} where (frames, coefficients) is expected")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise ValueError(f"rate must be a positive number of frames per second, not {self.rate}")

    def __len__(self) -> int:
        return len(self.coefficients)

    @property
    def seconds(self) -> float:
        """Duration in seconds."""
        return len(self) / self.rate

    def weights(self, model: FaceModel) -> Array:
        """Return the rig weights of all frames, shape (F, S), in the character's order; not confined to 0 to 1."""
        return self.coefficients @ model.subspace.directions.T

    @classmethod
    def from_weights(cls, model: FaceModel, weights: Array, rate: float) -> "Performance":
        """Return the performance nearest to rig ``weights``, shape (F, S), in the order of the character's shapes."""
        return cls(np.asarray(weights, dtype=np.float64) @ model.subspace.projection.T, rate)
