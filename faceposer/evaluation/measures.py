"""Errors of a face: to the truth, to its constraints, and to the natural range of faces."""

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

# Naturalness: number of skin vertices, of real frames they are compared with, and of candidates for the nearest frame.
_PROBES, _REAL_FRAMES, _CLOSEST = 400, 1500, 8
# Principal components of the frames in the likelihood, and standard deviation of the noise beyond them (mesh unit).
_LIKELIHOOD_COMPONENTS, _LIKELIHOOD_NOISE = 20, 0.01


@dataclass(frozen=True)
class Score:
    """Measures of one trial.

    Attributes:
        error: Mean distance of the vertices from the truth, in the mesh's unit.
        neutral_error: The same for the neutral face.
        by_region: Error and neutral error of each region.
        error_2d_px: Mean residual of the constraints, in pixels.
        to_real: Mean distance of probes on the skin to those of the nearest real frame of the test take.
        log_likelihood: Log-density per component under one Gaussian of the test take, which no method has access to.
        ms: Time of the solve, in milliseconds.
    """

    error: float
    neutral_error: float
    by_region: dict[str, tuple[float, float]]
    error_2d_px: float
    to_real: float
    log_likelihood: float
    ms: float


class Evaluator:
    """Comparison of faces with the truth."""

    def __init__(self, setting: StudyContext, frames: Array) -> None:
        """Initialise for the face of ``setting`` and the test take's ``frames``, rig weights of shape (F, S)."""
        self._setting = setting
        self._frames = frames

    @cached_property
    def _regions(self) -> dict[str, NDArray[np.intp]]:
        return region_vertices(self._setting.character)

    @cached_property
    def _probes(self) -> NDArray[np.intp]:
        """Skin vertices that some shape moves, evenly spaced in vertex order, shape (n,)."""
        character = self._setting.character
        skin = skin_vertices(character)
        motion = np.abs(character.shapes[:, skin].astype(np.float32)).max(axis=(0, 2))
        moving = skin[motion > 0.05 * motion.max()]
        chosen: NDArray[np.intp] = moving[np.linspace(0, len(moving) - 1, _PROBES).round().astype(np.intp)]
        return chosen

    @cached_property
    def _real(self) -> Array:
        """Probes of real frames relative to the neutral face, shape (F', 3 n)."""
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
        """Return the distance of ``vertices``, (N, 3), to the nearest real frame, and the log-density per component."""
        neutral = self._setting.character.vertices
        probes = (np.asarray(vertices, dtype=np.float64) - neutral)[self._probes].ravel()
        squared = ((self._real - probes) ** 2).sum(axis=1)
        # The nearest frame by mean distance is assumed to be among the nearest by squared distance.
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
        """Return the score of ``vertices``, shape (N, 3), that a method found for ``trial`` in ``ms`` milliseconds."""
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
    """Return the residual of ``constraint`` for ``vertices`` of the character, shape (N, 3), in pixels.

    Raises:
        TypeError: If constraints of this kind are not evaluated.
    """
    if not isinstance(constraint, PointConstraint | DistanceConstraint | StrokeConstraint):
        raise TypeError(f"constraints of the kind '{constraint.kind}' are not evaluated")
    points = constraint.points.positions(np.asarray(vertices, dtype=np.float64), setting.character.triangles)
    pixels = constraint.camera.project(points)
    return constraint.residual_of(pixels)
