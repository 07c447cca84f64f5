"""Transfer by the weights of ARKit's shapes, matched by name."""

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.model.name_matching import match_arkit
from faceposer.model.shape_names import makers

Array = NDArray[np.float64]


def arkit_rows(character: Character) -> dict[str, int]:
    """Return the indices of the ``character``'s non-zero ARKit shapes, by the name of the shape or of its half."""
    found = match_arkit(character.shape_names, f"The character {character.label}").shapes
    moving = np.abs(character.shapes).max(axis=(1, 2), initial=0.0) > 0
    return {found[name]: i for i, name in enumerate(character.shape_names) if name in found and moving[i]}


class WeightMap:
    """Mapping of weights by equal names, from a whole shape to its halves, and from halves to their whole.

    Attributes:
        matrix: Matrix from the source's weights to the target's, shape (S', S).
        shared: ARKit names of the target's shapes that receive a weight.
        missing: ARKit names of the source's shapes that the target lacks.
    """

    def __init__(self, source: Character, target: Character) -> None:
        """Match the shapes of ``source`` and ``target``.

        Raises:
            FacePoserError: If one of them has none of ARKit's shapes, or if they share none.
        """
        source_rows, target_rows = arkit_rows(source), arkit_rows(target)
        for character, rows in ((source, source_rows), (target, target_rows)):
            if not rows:
                raise FacePoserError(
                    f"The character {character.label} has none of ARKit's shapes, so that weights cannot be "
                    "transferred; transfer by distances."
                )
        self.matrix = np.zeros((len(target.shape_names), len(source.shape_names)))
        used: set[str] = set()
        for name, row in target_rows.items():
            sources = makers(name, source_rows)
            used.update(sources)
            for maker in sources:
                self.matrix[row, source_rows[maker]] = 1.0 / len(sources)
        self.shared = tuple(name for name, row in target_rows.items() if self.matrix[row].any())
        self.missing = tuple(name for name in source_rows if name not in used)
        if not self.shared:
            raise FacePoserError(
                f"The characters {source.label} and {target.label} have no ARKit shape in common; transfer by "
                "distances."
            )


class WeightTransfer:
    """Transfer of weights by name, clipped to the limits of both rigs."""

    def __init__(self, source: FaceModel, target: FaceModel) -> None:
        """Match the shapes of ``source`` and ``target``.

        Raises:
            FacePoserError: If one of them has none of ARKit's shapes, or if they share none.
        """
        self.source, self.target = source, target
        self.map = WeightMap(source.character, target.character)
        self._lower, self._upper = target.character.shape_limits.T.astype(np.float64)

    def pose(self, coefficients: Array, previous: Array | None = None) -> Array:
        """Return the target's coefficients, shape (r',), for the source's, shape (r,); ``previous`` is not used."""
        from faceposer.solve.weight_fit import fit_weights

        fitted = fit_weights(self.source, coefficients)
        weights = self.map.matrix @ np.array([fitted[name] for name in self.source.character.shape_names])
        return self.target.coefficients_of(np.clip(weights, self._lower, self._upper))
