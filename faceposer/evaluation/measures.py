"""How far a face is from the truth, from its constraints, and from what faces do."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.trials import Trial, region_vertices, skin_vertices
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.stroke import StrokeConstraint

Array = NDArray[np.float64]

# So many vertices of the skin say how natural a face is, compared with so many frames.
_PROBES, _REAL_FRAMES, _CLOSEST = 400, 1500, 8
# Principal components of the frames that a likelihood is about; beyond them, this much is noise (in the mesh's unit).
_LIKELIHOOD_COMPONENTS, _LIKELIHOOD_NOISE = 20, 0.01


@dataclass(frozen=True)
class Score:
    """What came of one trial.

    Attributes:
        error: Mean distance of the vertices from the truth, in the mesh's unit.
        neutral_error: The same of the neutral face.
        by_region: Error and neutral error of each region.
        error_2d_px: Mean residual of the constraints.
        to_real: Mean distance of probes on the skin from those of the nearest real frame of the test take.
        log_likelihood: Log-density per component under one Gaussian of the test take, which no method knows.
        ms: Time of the solve.
    """

    error: float
    neutral_error: float
    by_region: dict[str, tuple[float, float]]
    error_2d_px: float
    to_real: float
    log_likelihood: float
    ms: float


class Evaluator:
    """Compares faces with the truth."""

    def __init__(self, setting: StudyContext, frames: Array) -> None:
        """Evaluator on the face of a ``setting``, by the rig weights of the test take's ``frames``, shape (F, S)."""
        self._setting = setting
        self._frames = frames

    @cached_property
    def _regions(self) -> dict[str, NDArray[np.intp]]:
        return region_vertices(self._setting.character)

    @cached_property
    def _probes(self) -> NDArray[np.intp]:
        """Vertices of the skin, shape (n,), that some shape moves, evenly spread over their order."""
        character = self._setting.character
        skin = skin_vertices(character)
        motion = np.abs(character.shapes[:, skin].astype(np.float32)).max(axis=(0, 2))
        moving = skin[motion > 0.05 * motion.max()]
        chosen: NDArray[np.intp] = moving[np.linspace(0, len(moving) - 1, _PROBES).round().astype(np.intp)]
        return chosen

    @cached_property
    def _real(self) -> Array:
        """The probes of real frames relative to the neutral face, shape (F', 3 n)."""
        frames = self._frames[np.unique(np.linspace(0, len(self._frames) - 1, _REAL_FRAMES).round().astype(np.intp))]
        shapes = self._setting.character.shapes[:, self._probes].astype(np.float64)
        return frames @ shapes.reshape(len(shapes), -1)

    @cached_property
    def _gaussian(self) -> tuple[Array, Array, Array]:
        """Mean, principal axes and standard deviations of the real frames' probes."""
        mean = self._real.mean(axis=0)
        _, values, axes = np.linalg.svd(self._real - mean, full_matrices=False)
        kept = slice(0, _LIKELIHOOD_COMPONENTS)
        noise = _LIKELIHOOD_NOISE * np.sqrt(self._real.shape[1])
        return mean, axes[kept], np.sqrt(values[kept] ** 2 / len(self._real) + noise**2 / _LIKELIHOOD_COMPONENTS)

    def naturalness(self, vertices: ArrayLike) -> tuple[float, float]:
        """Return the distance of ``vertices``, (N, 3), to the nearest real frame, and their log-density."""
        neutral = self._setting.character.vertices
        probes = (np.asarray(vertices, dtype=np.float64) - neutral)[self._probes].ravel()
        squared = ((self._real - probes) ** 2).sum(axis=1)
        # The nearest by mean distance is among the nearest by squared distance.
        closest = self._real[np.argpartition(squared, _CLOSEST)[:_CLOSEST]]
        to_real = np.linalg.norm((closest - probes).reshape(_CLOSEST, -1, 3), axis=2).mean(axis=1).min()
        mean, axes, deviations = self._gaussian
        inside = axes @ (probes - mean)
        outside = float(((probes - mean) ** 2).sum() - inside @ inside)
        noise = _LIKELIHOOD_NOISE * np.sqrt(len(probes))
        squares = float(((inside / deviations) ** 2).sum()) + max(outside, 0.0) / noise**2
        density = -0.5 * squares - np.log(deviations).sum() - 0.5 * len(deviations) * np.log(2 * np.pi)
        return float(to_real), float(density) / len(deviations)

    def score(self, trial: Trial, vertices: ArrayLike, ms: float) -> Score:
        """Return what came of ``trial`` where a method found ``vertices``, shape (N, 3), in ``ms`` milliseconds."""
        setting = self._setting
        truth, vertices = setting.shown(setting.vertices_of(trial.weights)), setting.shown(vertices)
        error = np.linalg.norm(np.asarray(vertices) - truth, axis=1)
        neutral = np.linalg.norm(setting.character.vertices - truth, axis=1)
        to_real, log_likelihood = self.naturalness(vertices)
        return Score(
            float(error.mean()),
            float(neutral.mean()),
            {name: (float(error[ids].mean()), float(neutral[ids].mean())) for name, ids in self._regions.items()},
            float(np.mean([residual_px(setting, constraint, vertices) for constraint in trial.constraints])),
            to_real,
            log_likelihood,
            ms,
        )


def residual_px(setting: StudyContext, constraint: Constraint, vertices: ArrayLike) -> float:
    """Return how many pixels ``constraint`` is from being met by any ``vertices``, shape (N, 3), of the character.

    Raises:
        TypeError: If it is none of those that are evaluated.
    """
    if not isinstance(constraint, PointConstraint | DistanceConstraint | StrokeConstraint):
        raise TypeError(f"constraints of the kind '{constraint.kind}' are not evaluated")
    points = constraint.points.positions(np.asarray(vertices, dtype=np.float64), setting.character.triangles)
    pixels = constraint.camera.project(points)
    return constraint.residual_of(pixels)
