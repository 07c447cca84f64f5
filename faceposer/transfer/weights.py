"""The direct way: weights of ARKit's shapes, by their names, where both rigs have them."""

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.model.shape_names import makers, match_arkit

Array = NDArray[np.float64]


def arkit_rows(character: Character) -> dict[str, int]:
    """Return the indices of the ``character``'s moving shapes that are ARKit's, by ARKit's name or that of a half."""
    found = match_arkit(character.shape_names, f"The character '{character.name}'").shapes
    moving = np.abs(character.shapes).max(axis=(1, 2), initial=0.0) > 0
    return {found[name]: i for i, name in enumerate(character.shape_names) if name in found and moving[i]}


class WeightMap:
    """Which weight of the target each of the source's becomes: the same name, halves of a whole, or a whole of halves.

    Attributes:
        matrix: Target's weights from the source's, shape (S', S).
        shared: ARKit's names of the target's shapes that are moved.
        missing: ARKit's names of the source's shapes that the target cannot make.
    """

    def __init__(self, source: Character, target: Character) -> None:
        """Match the shapes of ``source`` and ``target``.

        Raises:
            FacePoserError: If either has none of ARKit's shapes, or they share none.
        """
        ours, theirs = arkit_rows(source), arkit_rows(target)
        for character, rows in ((source, ours), (target, theirs)):
            if not rows:
                raise FacePoserError(
                    f"The character '{character.name}' has none of ARKit's shapes, so weights cannot be carried over by "
                    "name; transfer by distances."
                )
        self.matrix = np.zeros((len(target.shape_names), len(source.shape_names)))
        used: set[str] = set()
        for name, row in theirs.items():
            sources = makers(name, ours)
            used.update(sources)
            for maker in sources:
                self.matrix[row, ours[maker]] = 1.0 / len(sources)
        self.shared = tuple(name for name, row in theirs.items() if self.matrix[row].any())
        self.missing = tuple(name for name in ours if name not in used)
        if not self.shared:
            raise FacePoserError(
                f"The characters '{source.name}' and '{target.name}' share none of ARKit's shapes; transfer by distances."
            )


class WeightTransfer:
    """Gives the target the source's weights, each within the limits of both rigs."""

    def __init__(self, source: FaceModel, target: FaceModel) -> None:
        """Match the shapes of ``source`` and ``target``.

        Raises:
            FacePoserError: If either has none of ARKit's shapes, or they share none.
        """
        self.source, self.target = source, target
        self.map = WeightMap(source.character, target.character)
        self._lower, self._upper = target.character.shape_limits.T.astype(np.float64)

    def pose(self, coefficients: Array, previous: Array | None = None) -> Array:
        """Return the target's coefficients, shape (r',), for the source's, shape (r,); ``previous`` does not matter."""
        from faceposer.solve.weight_fit import fit_weights

        fitted = fit_weights(self.source, coefficients)
        weights = self.map.matrix @ np.array([fitted[name] for name in self.source.character.shape_names])
        return self.target.coefficients_of(np.clip(weights, self._lower, self._upper))
