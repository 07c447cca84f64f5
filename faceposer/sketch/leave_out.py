"""Numbers of components and dimensions of the paper's models, chosen by leaving training poses out.

Strokes of the poses left out are imitated: the feature points of a few features, with a hand's error, are completed
to a pose and mapped to a mesh. Without that error the choice would fall on as many dimensions as there are poses, which
magnify the errors of a hand.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.mapping import MeshMapping
from faceposer.sketch.ppca import PPCAMixture
from faceposer.sketch.training_poses import TrainingPoses

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Features drawn together, as far as the character has them.
_DRAWN = (
    ("left brow", "right brow"),
    ("outer upper lip", "outer lower lip"),
    ("left upper lid", "left lower lid", "right upper lid", "right lower lid"),
    ("left brow", "right brow", "outer upper lip", "outer lower lip", "left upper lid", "right upper lid"),
)
_FOLDS, _LEAST_POSES = 3, 9
_COMPONENTS, _DIMENSIONS = (1, 2, 3), (4, 8, 12, 20, 30)
_JOINT_COMPONENTS, _JOINT_DIMENSIONS = (1, 2), (20, 40, 60)
# Of the mapping's dimensions, the most are taken whose error exceeds the least by no more than this share: they
# reconstruct poses from all of their feature points.
_TOLERATED = 0.02


@dataclass(frozen=True)
class Sizes:
    """Sizes of the paper's models.

    Attributes:
        components: K of the mixture over poses of feature points.
        dimensions: Its q.
        joint_components: K of the mixture over the joint latent variables.
        joint_dimensions: q_P and q_V of the mapping; less where the poses have fewer.
        completion_error: Mean squared error of completion of the poses left out, relative to that of the neutral face.
        mesh_error: The same of the coefficients of the mesh.
    """

    components: int
    dimensions: int
    joint_components: int
    joint_dimensions: int
    completion_error: float = np.nan
    mesh_error: float = np.nan


def observed(training: TrainingPoses, points: tuple[str, ...]) -> Ids:
    """Return the indices of the coordinates of feature ``points`` in a flat pose, shape (3 m,)."""
    ids = np.array([training.index[point] for point in points], dtype=np.intp)
    return (3 * ids[:, None] + np.arange(3)).ravel()


def chosen_sizes(training: TrainingPoses, hand_error: float, seed: int = 0) -> Sizes:
    """Return the sizes of least error on poses left out in turn; as many dimensions as there are of very few poses.

    Args:
        training: Training poses.
        hand_error: Standard deviation of a hand's error.
        seed: Seed of the folds and of the errors.
    """
    if len(training) < _LEAST_POSES:
        return Sizes(1, max(len(training) - 2, 1), 1, max(_JOINT_DIMENSIONS))
    splits = list(_splits(training, hand_error, seed))
    errors: dict[tuple[int, int], float] = {}
    for dimensions in _DIMENSIONS:
        errors[1, dimensions] = _completion_error(splits, 1, dimensions, hand_error)
    dimensions = min(errors, key=lambda key: errors[key])[1]
    for components in _COMPONENTS[1:]:
        errors[components, dimensions] = _completion_error(splits, components, dimensions, hand_error)
    best = min(errors, key=lambda key: errors[key])
    completed = [_Completed.of(split, *best, hand_error) for split in splits]
    mapped: dict[tuple[int, int], float] = {}
    for dimensions in _JOINT_DIMENSIONS:
        mapped[1, dimensions] = _mesh_error(completed, 1, dimensions)
    allowed = (1.0 + _TOLERATED) * min(mapped.values())
    dimensions = max(key[1] for key, error in mapped.items() if error <= allowed)
    for components in _JOINT_COMPONENTS[1:]:
        mapped[components, dimensions] = _mesh_error(completed, components, dimensions)
    # A single component unless more are clearly better.
    joint = min((k for k in mapped if k[1] == dimensions), key=lambda k: mapped[k] * (1.0 + _TOLERATED * (k[0] > 1)))
    return Sizes(*best, *joint, errors[best], mapped[joint])


@dataclass(frozen=True, eq=False)
class _Split:
    """Poses to fit to, poses left out, and their drawn feature points with errors: dimensions and values."""

    fitted: TrainingPoses
    left_out: TrainingPoses
    drawn: tuple[tuple[Ids, Array], ...]

    @property
    def truth(self) -> Array:
        return self.left_out.points.reshape(len(self.left_out), -1)


@dataclass(frozen=True, eq=False)
class _Completed:
    """A split with completed poses, those without a hand's error last."""

    split: _Split
    poses: tuple[Array, ...]

    @classmethod
    def of(cls, split: _Split, components: int, dimensions: int, hand_error: float) -> "_Completed":
        flat = split.fitted.points.reshape(len(split.fitted), -1)
        mixture = PPCAMixture.fit(flat, components, dimensions, least_variance=hand_error**2)
        return cls(split, (*(mixture.completed(*drawn, keep=False) for drawn in split.drawn), split.truth))

    def completion_error(self) -> float:
        neutral = self.split.fitted.neutral.ravel()
        total = ((self.split.truth - neutral) ** 2).sum()
        return float(np.mean([((pose - self.split.truth) ** 2).sum() / total for pose in self.poses[:-1]]))

    def mesh_error(self, components: int, dimensions: int) -> float:
        fitted, truth = self.split.fitted, self.split.left_out.coefficients
        mapping = MeshMapping.fit(fitted.points, fitted.coefficients, (dimensions, dimensions), components)
        shape = (-1, *fitted.points.shape[1:])
        errors = [((mapping.coefficients(pose.reshape(shape)) - truth) ** 2).sum() for pose in self.poses]
        return float(np.mean(errors) / (truth**2).sum())


def _completion_error(splits: list[_Split], components: int, dimensions: int, hand_error: float) -> float:
    return float(np.mean([_Completed.of(s, components, dimensions, hand_error).completion_error() for s in splits]))


def _mesh_error(completed: list["_Completed"], components: int, dimensions: int) -> float:
    return float(np.mean([each.mesh_error(components, dimensions) for each in completed]))


def _splits(training: TrainingPoses, hand_error: float, seed: int) -> Iterator[_Split]:
    """Yield the folds; the neutral face, which comes first, is never left out."""
    rng = np.random.default_rng(seed)
    order = 1 + rng.permutation(len(training) - 1)
    features = [tuple(name for name in names if name in training.features) for names in _DRAWN]
    sets = [tuple(dict.fromkeys(p for name in names for p in FEATURES[name].points)) for names in features if names]
    dimensions = [observed(training, points) for points in sets] or [observed(training, training.names)]
    for fold in range(_FOLDS):
        out = np.sort(order[fold::_FOLDS])
        left_out = training.subset(out)
        truth = left_out.points.reshape(len(out), -1)
        drawn = [(d, truth[:, d] + hand_error * rng.standard_normal((len(out), len(d)))) for d in dimensions]
        yield _Split(training.subset(np.setdiff1d(np.arange(len(training)), out)), left_out, tuple(drawn))
