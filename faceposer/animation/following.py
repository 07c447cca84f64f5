"""Performances from trajectories: the maximum a posteriori pose of every frame, smooth over time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.animation.smoothing import smooth_poses
from faceposer.animation.terms import SmoothnessTerm, TrackTerm, smoothness_metric
from faceposer.animation.trajectories import Trajectories
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import solve
from faceposer.solve.priors import MixturePrior, Prior
from faceposer.solve.problem import RECORDED_SPREAD, PoseProblem
from faceposer.solve.reach import reach_of_rows
from faceposer.solve.term import Array

# Number of frames smoothed at once. The last _OVERLAP of them, which later frames still affect, are smoothed again with
# those; the influence of frames farther away is negligible.
_WINDOW, _OVERLAP = 600, 60
# Weight of the prior conditioned on the start, relative to that conditioned on the previous frame. Without it, the path
# to a pose would permanently affect all directions that the points do not determine.
_START_PRIOR = 0.1
# Points tracked in images may move beyond a face's natural range by this factor.
_SLACK = 1.5


def solve_trajectories(
    model: FaceModel,
    trajectories: Trajectories,
    *,
    smoothness: float = 1.0,
    prior_weight: float = 1.0,
    prior: Prior = "regions",
    spread: float = RECORDED_SPREAD,
    start: ArrayLike | None = None,
    constraints: Sequence[Constraint] = (),
    look_ahead: bool = True,
    progress: Progress | None = None,
) -> Performance:
    """Return the performance whose points follow ``trajectories``.

    Each frame is the maximum a posteriori pose (paper, eq. (20)), initialised with that of the previous frame, on which
    most of the prior is conditioned as well: it describes the continuation of the motion, not departures from the
    start. Then the sum of the energies of all frames and of the cost of velocity changes (section 7) is minimised over
    all poses at once, so that later frames affect earlier ones. Frames without any visible point are interpolated.

    Args:
        model: The face model.
        trajectories: Target positions of points.
        smoothness: Weight of velocity changes, at least 0, in the unit of ``smoothness_metric``.
        prior_weight: Weight of the prior, at least 0.
        prior: Kind of the prior; see ``PoseProblem``.
        spread: Share of the face that follows its points; see ``PoseProblem``.
        start: Pose before the first frame, shape (r,), to which undetermined parts of the face return; None for the
            neutral face.
        constraints: Additional constraints for all frames.
        look_ahead: True to optimise all frames jointly. If False, each frame is final once solved, with its velocity
            change since the two previous frames, as in the paper.
        progress: Receives a report after each frame, and can also cancel while frames are smoothed.

    Raises:
        CancelledError: If the progress was cancelled.
        ValueError: If a point is not on the face.
    """
    progress = progress or Progress()
    metric = smoothness_metric(model, smoothness, trajectories.rate)
    pose = np.array(model.neutral() if start is None else start, dtype=np.float64)
    frames = _FrameProblems(
        model, _within_range(model, trajectories, pose), prior_weight, prior, spread, tuple(constraints), pose
    )
    poses = np.tile(pose, (len(trajectories), 1))
    visible = np.asarray(trajectories.seen.any(axis=1))
    first = 0
    problems: list[PoseProblem] = []
    for frame in range(len(poses)):
        problem = frames.problem(frame, pose)
        if not look_ahead and smoothness > 0 and frame > 1:
            problem.add(SmoothnessTerm(metric, poses[frame - 2], pose))
        poses[frame] = pose = solve(problem, pose).coefficients
        progress.at(f"Frame {frame + 1} of {len(poses)}", (frame + 1) / len(poses))
        if not look_ahead or smoothness <= 0:
            continue
        problems.append(problem)
        if len(problems) == _WINDOW or frame == len(poses) - 1:
            window = slice(first, frame + 1)
            for i, between in _interpolated(poses[window], visible[window]):
                poses[first + i] = between
                problems[i] = frames.problem(first + i, between)
            poses[window] = smooth_poses(problems, metric, poses[window], poses[max(first - 2, 0) : first], progress)
            del problems[:-_OVERLAP]
            first = frame + 1 - len(problems)
            pose = poses[frame]
    return Performance(poses, trajectories.rate)


def residuals(model: FaceModel, trajectories: Trajectories, performance: Performance) -> Array:
    """Return the distance of each point from its target, shape (F, P), NaN where it was not seen.

    In pixels of the camera, or in space in the unit of the face.
    """
    rows, neutral = model.jacobian_at(trajectories.points)
    distances = np.full(trajectories.positions.shape[:2], np.nan)
    for frame, pose in enumerate(performance.coefficients):
        places = neutral + rows @ pose
        if trajectories.camera is not None:
            places = trajectories.camera.project(places)
        distances[frame] = np.linalg.norm(places - trajectories.positions[frame], axis=1)
    return distances


@dataclass(frozen=True)
class _FrameProblems:
    """The optimisation problems of single frames."""

    model: FaceModel
    trajectories: Trajectories
    prior_weight: float
    prior: Prior
    spread: float
    constraints: tuple[Constraint, ...]
    start: Array

    def problem(self, frame: int, reference: Array) -> PoseProblem:
        """Return the problem of a ``frame`` with the prior conditioned on the pose ``reference``, shape (r,)."""
        trajectories = self.trajectories
        seen = trajectories.seen[frame]
        rows, neutral = self.model.jacobian_at(trajectories.points)
        track = TrackTerm(
            rows[seen],
            neutral[seen],
            trajectories.positions[frame, seen],
            trajectories.weights_at(frame)[seen],
            trajectories.camera,
        )
        evidence = [track] if seen.any() else []
        problem, start_problem = (
            PoseProblem(
                self.model,
                self.constraints,
                pose,
                self.prior_weight,
                prior=self.prior,
                extra_terms=evidence,
                spread=self.spread,
                home=self.start,
            )
            for pose in (reference, self.start)
        )
        # The prior "plain" does not depend on the reference.
        if self.prior_weight > 0 and self.prior != "plain":
            problem.add(MixturePrior(start_problem.mixture, _START_PRIOR * self.prior_weight))
        return problem


def _within_range(model: FaceModel, trajectories: Trajectories, start: Array) -> Trajectories:
    """Return ``trajectories`` in an image, limited to the natural range of the face from the pose ``start``, (r,)."""
    camera = trajectories.camera
    if camera is None or not len(trajectories.points):
        return trajectories
    rows, neutral = model.jacobian_at(trajectories.points)
    reach = reach_of_rows(model, start, rows, neutral, camera)
    pixels = camera.project(neutral + rows @ start)
    limited = np.array([pixels + _SLACK * reach.limited((frame - pixels) / _SLACK) for frame in trajectories.positions])
    return replace(trajectories, positions=limited)


def _interpolated(poses: Array, visible: NDArray[np.bool_]) -> list[tuple[int, Array]]:
    """Return the frames that are not ``visible``, (F,), with poses interpolated from the nearest visible ones."""
    known = np.flatnonzero(visible)
    unknown = np.flatnonzero(~visible)
    if not len(known):
        return []
    after = np.searchsorted(known, unknown).clip(max=len(known) - 1)
    before = (np.searchsorted(known, unknown) - 1).clip(min=0)
    interpolated = []
    for frame, a, b in zip(unknown.tolist(), known[before].tolist(), known[after].tolist(), strict=True):
        share = min(max((frame - a) / (b - a), 0.0), 1.0) if b > a else 0.0
        interpolated.append((frame, (1.0 - share) * poses[a] + share * poses[b]))
    return interpolated
