"""Reach: the range in the image over which a point of the face can be pulled."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.model.muscles import dependent_pairs, muscle_of_shape, subsiding
from faceposer.sized_cache import sized_cache
from faceposer.solve.term import Array, Indices, PoseState, ResidualTerm

# Motion of a point by a shape, as a share of the shape's largest motion: below the first share a pull on the point is
# not attributed to the shape; above the second it is.
_ALONG, _MEANT = 0.25, 0.6
# Motion in centimetres by these shapes: below the first a point hardly moves by itself; above the second it does.
_BONE_CM, _FLESH_CM = 0.08, 0.3
# Exponent of the soft limit of pulls at the reach.
_SHARPNESS = 8.0
#: Mobility below which a part of the face hardly moves.
HARDLY_MOVES = 0.2
# Range of a weight without limits.
_FAR = 3.0
# Least reach in pixels of a point that can move at all: the error of a hand.
_TREMOR_PX = 1.5
# Largest memory in bytes and number of the cached reaches of points, with the states that they belong to.
_CACHED = (32 << 20, 32)


@dataclass(frozen=True, eq=False)
class Reach:
    """Reach of n points from their positions, in the image of one camera.

    Attributes:
        steps: Displacement of each point in pixels (u, v) when one rig weight goes to its lower or upper limit, for the
            shapes to which a pull on the point is attributed, shape (n, 2 W, 2). Muscles that fade (``opposition``)
            go no lower than 0 in it.
        relaxing: Displacement of each point in pixels when one such muscle relaxes, shape (n, W, 2).
        mobility: Mobility of each point, from 0 (it only moves along with others) to 1, shape (n,).
        scale: Pixels per centimetre across the line of sight at each point, shape (n,).
    """

    steps: Array
    relaxing: Array
    mobility: Array
    scale: Array

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return self.steps.nbytes + self.relaxing.nbytes + self.mobility.nbytes + self.scale.nbytes

    def pixels(self, directions: Array) -> Array:
        """Return the reach of each point in pixels, (n,), along its unit direction in ``directions``, (n, 2)."""
        forward, ended = (_forward(steps, directions) for steps in (self.steps, self.relaxing))
        # An expression ends as a whole; of those that begin, not all reach their limits together.
        reach = ended.sum(axis=1) + np.sqrt(np.einsum("nw,nw->n", forward, forward)) + _TREMOR_PX
        # Points that hardly move are kept still, since a pull on them would show elsewhere.
        reached: Array = self.mobility * reach
        return reached

    def outline(self, index: int, n: int = 36) -> Array:
        """Return the outline of the region that point ``index`` can reach, ``n`` displacements in pixels, shape (n, 2).

        Sums of steps J_w with factors from 0 to 1 whose squares sum to at most 1 form a convex region with the support
        function h (``pixels``). Its boundary point with the outward normal u is sum_w max(0, u . J_w) J_w / h(u). To
        this is added what relaxes.
        """
        return self.border(index, _directions(n))

    def border(self, index: int, directions: Array) -> Array:
        """Return the points of the ``outline`` with the outward unit normals ``directions``, (n, 2), shape (n, 2)."""
        forward = np.maximum(directions @ self.steps[index].T, 0.0)
        support = np.sqrt(np.einsum("nw,nw->n", forward, forward))
        begun = (forward @ self.steps[index]) / np.maximum(support, 1e-9)[:, None]
        border: Array = begun + (directions @ self.relaxing[index].T > 0.0) @ self.relaxing[index]
        return border

    def limited(self, pulls: Array) -> Array:
        """Return ``pulls``, (n, 2) in pixels, each of length l shortened to l / (1 + (l / q)^8)^(1/8) for a reach q."""
        lengths = np.hypot(*pulls.T)
        directions = pulls / np.maximum(lengths, 1e-9)[:, None]
        reach = np.maximum(self.pixels(directions), 1e-6)
        ratio = np.maximum(lengths / reach, 1e-9)
        # Far beyond the reach, powers of the ratio overflow; those of its inverse do not.
        shortened = (
            reach * np.minimum(ratio, 1.0) / (1.0 + np.minimum(ratio, 1.0 / ratio) ** _SHARPNESS) ** (1.0 / _SHARPNESS)
        )
        limited: Array = directions * shortened[:, None]
        return limited


def reach_of(model: FaceModel, p: Array, points: SurfacePoints, camera: Camera, limits: Array | None = None) -> Reach:
    """Return the reach of ``points`` of the face with coefficients ``p``, shape (r,), in the image of ``camera``.

    Args:
        model: The face.
        p: The current pose.
        points: n points of its surface.
        camera: The camera.
        limits: Limits of the weights of the model's density, shape (W, 2); its own, widened to the pose, if None.
    """
    rows, neutral = model.rows_of(points)
    return reach_of_rows(model, p, rows, neutral, camera, limits)


def reach_of_points(model: FaceModel, state: PoseState, points: Indices, camera: Camera, limits: Array) -> Reach:
    """Return the reach of the ``points`` of a ``state`` with the given indices, (n,).

    The result is cached, since dragging points leaves the start pose unchanged.
    """
    return _reach_of_points(model, state, points.tobytes(), camera, limits.tobytes())


class ReachTerm(ResidualTerm):
    """A term of targets in the image, which can be limited to the reach of their points.

    Attributes:
        lost: Mean length by which pulls were shortened, in pixels.
        mobility: Mean mobility of the points, from 0 to 1.
    """

    lost = 0.0
    mobility = 1.0

    def within_reach(self, model: FaceModel, state: PoseState, limits: Array, trust: float = 0.0) -> "ReachTerm":
        """Return the term with its targets limited to their reach from ``state``.

        Args:
            model: The face.
            state: The pose that the pulls start from.
            limits: Limits of the weights of the model's density at the pose, shape (W, 2).
            trust: Share from 0 to 1 by which pulls count unchanged. It is larger the more of the face is constrained,
                and the larger the spread.
        """
        raise NotImplementedError


@sized_cache(
    lambda reach, model, state, *_: state.nbytes + 2 * (reach.steps.nbytes + reach.relaxing.nbytes), *_CACHED, weak=True
)
def _reach_of_points(model: FaceModel, state: PoseState, points: bytes, camera: Camera, limits: bytes) -> Reach:
    rows, neutral = state.anchored_at(np.frombuffer(points, dtype=np.intp))
    return reach_of_rows(model, state.p, rows, neutral, camera, np.frombuffer(limits).reshape(-1, 2))


def reach_of_rows(
    model: FaceModel, p: Array, rows: Array, neutral: Array, camera: Camera, limits: Array | None = None
) -> Reach:
    """Return the reach of points given by their derivatives, (n, 3, r), and neutral positions, (n, 3)."""
    density, samples = model.rig_density, model.motion_samples
    weights = density.directions @ p
    lower, upper = (limits_around(density.limits, weights) if limits is None else limits.copy()).T
    names = [model.character.shape_names[row] for row in density.shape_rows]
    for shape, other, beyond in dependent_pairs(names):
        upper[shape] = max(min(upper[shape], weights[other] + beyond), weights[shape])
    moves = rows @ density.projection
    sizes = np.sqrt(np.einsum("nkw,nkw->nw", moves, moves))
    shares = sizes / density.largest
    sizes = samples.scale * sizes
    attributed = _smooth_step((shares - _ALONG) / (_MEANT - _ALONG))
    _, by_place = camera.project_with_jacobian(neutral + rows @ p)
    pixels = np.einsum("nik,nkw->nwi", by_place, moves) * attributed[:, :, None]
    # What relaxes towards 0, and the rest of the way to the limits.
    ended = np.where(_fading(tuple(names)), weights.clip(0.0, _FAR), 0.0)
    free = np.concatenate([(upper - weights).clip(0.0, _FAR), -(weights - lower - ended).clip(0.0, _FAR)])
    steps = np.concatenate([pixels, pixels], axis=1) * free[None, :, None]
    scale = np.sqrt(0.5 * np.einsum("nik,nik->n", by_place, by_place))
    own = np.sqrt(np.einsum("nw,nw->n", sizes * attributed, sizes * attributed))
    relaxing = -pixels * ended[:, None]
    return Reach(steps, relaxing, _smooth_step((own - _BONE_CM) / (_FLESH_CM - _BONE_CM)), scale)


@lru_cache(maxsize=4)
def _directions(n: int) -> Array:
    angles = np.arange(n) * (2.0 * np.pi / n)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


@lru_cache(maxsize=8)
def _fading(names: tuple[str, ...]) -> NDArray[np.bool_]:
    """Return the mask of the shapes ``names`` whose muscles relax when they are pulled against, shape (W,)."""
    return np.array([subsiding(muscle_of_shape(name)) is not None for name in names], dtype=bool)


def _forward(steps: Array, directions: Array) -> Array:
    """Return how far each of the ``steps``, (n, W, 2), goes along the ``directions``, (n, 2), shape (n, W).

    A step s with component a along the direction counts as a^2 / |s|: oblique steps count less.
    """
    along = np.maximum(np.einsum("nwk,nk->nw", steps, directions), 0.0)
    forward: Array = along * along / np.maximum(np.sqrt(np.einsum("nwk,nwk->nw", steps, steps)), 1e-12)
    return forward


def _smooth_step(t: Array) -> Array:
    within = t.clip(0.0, 1.0)
    step: Array = within * within * (3.0 - 2.0 * within)
    return step


def limits_around(limits: Array, weights: Array) -> NDArray[np.float64]:
    """Return ``limits``, (W, 2), of rig weights, widened to include the ``weights``, (W,).

    A captured pose may exceed the limits of a rig, and is kept as a start. Equal lower and upper limits mean that there
    are none; infinite ones are returned.
    """
    lower, upper = limits.T
    bounded = upper > lower
    return np.stack(
        [np.where(bounded, np.minimum(lower, weights), -np.inf), np.where(bounded, np.maximum(upper, weights), np.inf)],
        axis=1,
    )
