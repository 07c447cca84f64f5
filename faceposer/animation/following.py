"""A face follows trajectories: the most likely pose of every frame, and smooth from frame to frame."""

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

# So many frames are made smooth together, of which the last ones, that later frames still have a say in, are done again
# with those: what is farther away has no influence to speak of.
_TOGETHER, _AGAIN = 600, 60
# Weight of the prior as it is seen from the start, relative to that seen from the frame before: how a face came to a
# pose would else leave its trace, for good, in all that no point tells.
_HOMEWARD = 0.1
# Points that are followed in a picture may go so many times as far as a face usually reaches, and no farther.
_SLACK = 1.5


def follow(
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
    """Return the performance in which the points of the face follow ``trajectories``.

    Each frame is the maximum a posteriori pose (paper, eq. (20)), found from that of the frame before, from which it
    also sees most of the prior: how faces go on from there, not from their start. Then the sum of all frames' energies
    and of the cost of changes of velocity (section 7) is minimised over all poses at once, so that a frame knows what
    comes after it, too. Where no point is seen at all, the face goes on from the pose before to the pose after.

    Args:
        model: The face.
        trajectories: Where points of it should be.
        smoothness: Weight of the changes of velocity, at least 0; ``smoothness_metric`` has its unit.
        prior_weight: Weight of the prior, at least 0.
        prior: How the prior judges; see ``PoseProblem``.
        spread: How much of the face follows its points; see ``PoseProblem``.
        start: The pose before the first frame, which the face comes back to where nothing tells otherwise, shape (r,);
            the neutral face if None.
        constraints: What holds in all frames besides.
        look_ahead: Whether frames know what comes after them. Without, each is final as soon as it is found, with its
            change of velocity since the two frames before, as in the paper.
        progress: Reported to after each frame; it can also cancel while frames are made smooth together.

    Raises:
        CancelledError: If the progress was cancelled.
        ValueError: If a point does not lie on the face.
    """
    progress = progress or Progress()
    metric = smoothness_metric(model, smoothness, trajectories.rate)
    pose = np.array(model.neutral() if start is None else start, dtype=np.float64)
    make = _Frames(
        model, _within_reach(model, trajectories, pose), prior_weight, prior, spread, tuple(constraints), pose
    )
    poses = np.tile(pose, (len(trajectories), 1))
    sighted = np.asarray(trajectories.seen.any(axis=1))
    first = 0
    problems: list[PoseProblem] = []
    for frame in range(len(poses)):
        problem = make.problem(frame, pose)
        if not look_ahead and smoothness > 0 and frame > 1:
            problem.add(SmoothnessTerm(metric, poses[frame - 2], pose))
        poses[frame] = pose = solve(problem, pose).coefficients
        progress.at(f"Frame {frame + 1} of {len(poses)}", (frame + 1) / len(poses))
        if not look_ahead or smoothness <= 0:
            continue
        problems.append(problem)
        if len(problems) == _TOGETHER or frame == len(poses) - 1:
            window = slice(first, frame + 1)
            for at, between in _bridged(poses[window], sighted[window]):
                poses[first + at] = between
                problems[at] = make.problem(first + at, between)
            poses[window] = smooth_poses(problems, metric, poses[window], poses[max(first - 2, 0) : first], progress)
            del problems[:-_AGAIN]
            first = frame + 1 - len(problems)
            pose = poses[frame]
    return Performance(poses, trajectories.rate)


def residuals(model: FaceModel, trajectories: Trajectories, performance: Performance) -> Array:
    """Return how far each point stays from where it should be, shape (F, P), NaN where it was not seen.

    In pixels of the camera, or in space in the unit of the face.
    """
    rows, neutral = model.rows_at(trajectories.points)
    off = np.full(trajectories.positions.shape[:2], np.nan)
    for frame, pose in enumerate(performance.coefficients):
        places = neutral + rows @ pose
        if trajectories.camera is not None:
            places = trajectories.camera.project(places)
        off[frame] = np.linalg.norm(places - trajectories.positions[frame], axis=1)
    return off


@dataclass(frozen=True)
class _Frames:
    """Makes the problems of single frames."""

    model: FaceModel
    trajectories: Trajectories
    prior_weight: float
    prior: Prior
    spread: float
    constraints: tuple[Constraint, ...]
    start: Array

    def problem(self, frame: int, seen_from: Array) -> PoseProblem:
        """Return the problem of a ``frame`` with the prior seen from a pose, shape (r,)."""
        trajectories = self.trajectories
        seen = trajectories.seen[frame]
        rows, neutral = self.model.rows_at(trajectories.points)
        track = TrackTerm(
            rows[seen],
            neutral[seen],
            trajectories.positions[frame, seen],
            trajectories.weights_at(frame)[seen],
            trajectories.camera,
        )
        evidence = [track] if seen.any() else []
        problem, at_home = (
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
            for pose in (seen_from, self.start)
        )
        # As it was learned, the prior looks the same from everywhere.
        if self.prior_weight > 0 and self.prior != "plain":
            problem.add(MixturePrior(at_home.mixture, _HOMEWARD * self.prior_weight))
        return problem


def _within_reach(model: FaceModel, trajectories: Trajectories, start: Array) -> Trajectories:
    """Return ``trajectories`` in a picture with what no face reaches from the pose ``start``, (r,), brought back."""
    camera = trajectories.camera
    if camera is None or not len(trajectories.points):
        return trajectories
    rows, neutral = model.rows_at(trajectories.points)
    reach = reach_of_rows(model, start, rows, neutral, camera)
    here = camera.project(neutral + rows @ start)
    limited = np.array([here + _SLACK * reach.limited((frame - here) / _SLACK) for frame in trajectories.positions])
    return replace(trajectories, positions=limited)


def _bridged(poses: Array, sighted: NDArray[np.bool_]) -> list[tuple[int, Array]]:
    """Return the frames that are not ``sighted``, (F,), with poses between those of the nearest frames that are."""
    known = np.flatnonzero(sighted)
    blind = np.flatnonzero(~sighted)
    if not len(known):
        return []
    after = np.searchsorted(known, blind).clip(max=len(known) - 1)
    before = (np.searchsorted(known, blind) - 1).clip(min=0)
    bridged = []
    for frame, a, b in zip(blind.tolist(), known[before].tolist(), known[after].tolist(), strict=True):
        share = min(max((frame - a) / (b - a), 0.0), 1.0) if b > a else 0.0
        bridged.append((frame, (1.0 - share) * poses[a] + share * poses[b]))
    return bridged
