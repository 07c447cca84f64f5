"""Poses of a character from which recognition and the statistical mapping of sketches are learned.

Gunnarsson and Maddock (2010, section 4.1) use 36 poses with 46 feature points each: neutral, expressions and visemes.
Here they come with each character: its neutral face, the poses of a library, its shapes, and draws from its prior. A
second set of several hundred is what their future work asks for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES

Array = NDArray[np.float64]

#: Number of training poses in the paper, and the default.
FEW_POSES, MANY_POSES = 36, 300
# Largest share of the poses that are shapes, besides the neutral face and the library.
_SHAPES = 0.5


@dataclass(frozen=True, eq=False)
class TrainingPoses:
    """Poses of a character with the positions of its feature points.

    Attributes:
        coefficients: Coefficients p of each pose, the neutral face first, shape (n, r).
        points: Positions of the feature points in each pose, in the character's unit, shape (n, F, 3).
        names: Names of the feature points, shape (F,).
        neutral: Positions on the neutral face, shape (F, 3).
        rows: Derivatives of the positions with respect to p, shape (F, 3, r).
    """

    coefficients: Array
    points: Array
    names: tuple[str, ...]
    neutral: Array
    rows: Array

    @classmethod
    def of(
        cls, model: FaceModel, count: int = MANY_POSES, library: Sequence[Array] = (), seed: int = 0
    ) -> "TrainingPoses":
        """Gather ``count`` poses of a character: neutral, library, shapes, and draws from the prior.

        Args:
            model: The character's model.
            count: Number of poses; the library is cut if it has more.
            library: Coefficients of the poses of a library, each of shape (r,).
            seed: Seed of the choice among the prior's draws.
        """
        names = skin_points(model.character)
        rows, neutral = model.rows_of(SurfacePoints.at_vertices([model.character.feature_points[n] for n in names]))
        given = np.reshape(np.asarray(list(library), dtype=np.float64), (-1, model.n_coefficients))
        first = np.concatenate([model.neutral()[None], given])[:count]
        shapes = _shape_poses(model, rows)[: int(_SHAPES * (count - len(first)))]
        draws = model.rig_density.draws
        left = count - len(first) - len(shapes)
        chosen = np.random.default_rng(seed).permutation(len(draws))[:left]
        drawn = draws[np.sort(chosen)] @ model.rig_density.projection.T
        coefficients = np.concatenate([first, shapes, drawn])
        return cls(coefficients, neutral + np.einsum("fdr,nr->nfd", rows, coefficients), names, neutral, rows)

    def __len__(self) -> int:
        return len(self.coefficients)

    @cached_property
    def index(self) -> dict[str, int]:
        """Index of each feature point by its name."""
        return {name: i for i, name in enumerate(self.names)}

    @cached_property
    def drawable(self) -> tuple[str, ...]:
        """Names of the feature points of the features that this character has, in the order of ``names``."""
        drawn = {name for feature in self.features for name in FEATURES[feature].points}
        return tuple(name for name in self.names if name in drawn)

    @cached_property
    def features(self) -> tuple[str, ...]:
        """Names of the features all of whose feature points this character has."""
        return tuple(name for name, feature in FEATURES.items() if all(point in self.index for point in feature.points))

    def positions(self, p: Array) -> Array:
        """Return the positions of the feature points, shape (F, 3), on the face with coefficients ``p``, (r,)."""
        return np.asarray(self.neutral + self.rows @ p)

    def subset(self, poses: NDArray[np.intp]) -> "TrainingPoses":
        """Return the poses with indices ``poses``, shape (m,)."""
        return TrainingPoses(self.coefficients[poses], self.points[poses], self.names, self.neutral, self.rows)


def skin_points(character: Character) -> tuple[str, ...]:
    """Return the names of the feature points on the skin; those on eyes, teeth and tongue do not take part.

    The paper leaves out teeth and tongue, too. A pupil moves farther than any place of the skin and says little about
    the expression.
    """
    skin = np.zeros(len(character.vertices), dtype=bool)
    for part in character.parts:
        if part.material == "skin":
            skin[slice(*part.vertices)] = True
    drawn = {name for feature in FEATURES.values() for name in feature.points}
    return tuple(name for name, vertex in character.feature_points.items() if skin[vertex] or name in drawn)


def _shape_poses(model: FaceModel, rows: Array) -> Array:
    """Return the poses of single shapes at the ends of their natural range, (m, r), by decreasing motion of ``rows``.

    Principal modes have two ends; the shapes of a rig have one that is not neutral.
    """
    density = model.rig_density
    lower, upper = density.limits.T
    free = upper <= lower
    lower = np.where(free, density.draws.min(axis=0), lower)
    upper = np.where(free, density.draws.max(axis=0), upper)
    poses = np.concatenate([upper[:, None] * density.projection.T, lower[:, None] * density.projection.T])
    motion = np.einsum("fdr,nr->nfd", rows, poses)
    size = np.sqrt((motion**2).sum(axis=(1, 2)))
    order = np.argsort(-size, kind="stable")
    return np.asarray(poses[order[size[order] > 1e-6 * model.character.height]])
