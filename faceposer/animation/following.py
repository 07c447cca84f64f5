"""A face follows trajectories: the most likely pose of every frame, and smooth from frame to frame."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from faceposer.animation.smoothing import FollowingStopped, smooth_poses
from faceposer.animation.terms import SmoothnessTerm, TrackTerm, smoothness_metric
from faceposer.animation.trajectories import Trajectories
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import solve
from faceposer.solve.priors import Prior
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import Array

# So many frames are made smooth together, of which the last ones, that later frames still have a say in, are done again
# with those: what is farther away has no influence to speak of.
_TOGETHER, _AGAIN = 600, 60


def follow(
    model: FaceModel,
    trajectories: Trajectories,
    *,
    smoothness: float = 1.0,
    prior_weight: float = 1.0,
    prior: Prior = "regions",
    start: ArrayLike | None = None,
    constraints: Sequence[Constraint] = (),
    look_ahead: bool = True,
    on_frame: Callable[[int, Array], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Performance:
    """Return the performance in which the points of the face follow ``trajectories``.

    Each frame is the maximum a posteriori pose (paper, eq. (20)) with a cost on the change of velocity since the two
    frames before, found from the pose of the frame before (section 7). Then the sum of all frames' energies is
    minimised over all their poses at once, so that a frame knows what comes after it, too.

    Args:
        model: The face.
        trajectories: Where points of it should be.
        smoothness: Weight of the changes of velocity, at least 0; ``smoothness_metric`` has its unit.
        prior_weight: Weight of the prior, at least 0.
        prior: How the prior judges; see ``PoseProblem``.
        start: The pose that the face has where nothing pulls, shape (r,); the neutral face if None.
        constraints: What holds in all frames besides.
        look_ahead: Whether frames know what comes after them; without, each is final when it is found, as in the paper.
        on_frame: Called with the number of each frame and its pose, shape (r,), in order, once it is found; what comes
            after it may still change it a little.
        should_stop: Asked after each frame and each step of the last part.

    Raises:
        FollowingStopped: If ``should_stop`` said yes.
        ValueError: If a point does not lie on the face.
    """
    rows, neutral = model.rows_at(trajectories.points)
    metric = smoothness_metric(model, smoothness, trajectories.rate)
    poses = np.zeros((len(trajectories), model.n_coefficients))
    first = 0
    problems: list[PoseProblem] = []
    for frame, targets in enumerate(trajectories.positions):
        seen = trajectories.seen[frame]
        weights = trajectories.weights_at(frame)[seen]
        track = TrackTerm(rows[seen], neutral[seen], targets[seen], weights, trajectories.camera)
        problem = PoseProblem(
            model, constraints, start, prior_weight, prior=prior, evidence=[track] if seen.any() else []
        )
        problems.append(problem)
        smooth = [SmoothnessTerm(metric, poses[frame - 2], poses[frame - 1])] if frame > 1 and smoothness > 0 else []
        poses[frame] = _solved(problem, smooth, poses[frame - 1] if frame else None)
        if on_frame is not None:
            on_frame(frame, poses[frame])
        if should_stop is not None and should_stop():
            raise FollowingStopped
        if look_ahead and smoothness > 0 and (len(problems) == _TOGETHER or frame == len(trajectories) - 1):
            poses[first : frame + 1] = smooth_poses(
                problems, metric, poses[first : frame + 1], poses[max(first - 2, 0) : first], should_stop
            )
            del problems[:-_AGAIN]
            first = frame + 1 - len(problems)
    return Performance(poses, trajectories.rate)


def _solved(problem: PoseProblem, smooth: Sequence[SmoothnessTerm], x0: Array | None) -> Array:
    problem.terms += smooth
    coefficients = solve(problem, x0).coefficients
    if smooth:
        del problem.terms[-len(smooth) :]
    return coefficients
