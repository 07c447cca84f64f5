"""How far a point of the face can go: the reach of a pull, and of places that only move along with others."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.model.muscles import dependent_pairs
from faceposer.solve.term import Array, Indices, PoseState

# A shape that moves a point by less than the first share of what it moves elsewhere cannot be meant by a pull on it;
# from the second share on it can.
_ALONG, _MEANT = 0.25, 0.6
# A place that these shapes move by less than the first many centimetres hardly moves; by the second many, it does.
_BONE_CM, _FLESH_CM = 0.08, 0.3
# A pull is met nearly whole up to its reach, and not at all beyond.
_SHARPNESS = 8.0
#: Mobility below which a part of the face hardly moves.
HARDLY_MOVES = 0.2
# How far a weight without limits can go.
_FAR = 3.0
# Pixels by which a hand misses: so far a point that can move at all goes, whatever its reach.
_TREMOR_PX = 1.5


@dataclass(frozen=True, eq=False)
class Reach:
    """How far n points can go from where they are, in the picture of one camera.

    Attributes:
        steps: Pixels that each point moves, in (u, v), where one rig weight goes to its least or greatest value,
            of those shapes that a pull on the point can mean, shape (n, 2 W, 2).
        mobility: From 0, the point only moves along with others, to 1, shape (n,).
        scale: Pixels that a centimetre across the line of sight has at each point, shape (n,).
    """

    steps: Array
    mobility: Array
    scale: Array

    @cached_property
    def _lengths(self) -> Array:
        lengths: Array = np.maximum(np.sqrt(np.einsum("nwk,nwk->nw", self.steps, self.steps)), 1e-12)
        return lengths

    def pixels(self, directions: Array) -> Array:
        """Return how far each point can go in its unit direction of ``directions``, (n, 2), in pixels, shape (n,)."""
        along = np.maximum(np.einsum("nwk,nk->nw", self.steps, directions), 0.0)
        # What also goes elsewhere counts the less, the more it does: a^2 / |s| for a step s that goes by a this way.
        forward = along * along / self._lengths
        # What hardly moves does not move at all: a pull on it would show elsewhere.
        reach: Array = self.mobility * (np.sqrt(np.einsum("nw,nw->n", forward, forward)) + _TREMOR_PX)
        return reach

    def outline(self, index: int, n: int = 36) -> Array:
        """Return the border of what point ``index`` can reach, as ``n`` displacements in pixels, shape (n, 2).

        Steps J_w, each taken by a share of 0 to 1, with squares of the shares summing to at most 1, reach a convex
        region. ``pixels`` is its support function h; its border where the direction u points outwards is
        sum_w max(0, u . J_w) J_w / h(u).
        """
        return self.border(index, _directions(n))

    def border(self, index: int, directions: Array) -> Array:
        """Return the points of the ``outline`` with the outward unit ``directions``, (n, 2), shape (n, 2)."""
        forward = np.maximum(directions @ self.steps[index].T, 0.0)
        support = np.sqrt(np.einsum("nw,nw->n", forward, forward))
        border: Array = (forward @ self.steps[index]) / np.maximum(support, 1e-9)[:, None]
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
    """Return how far ``points`` of the face with coefficients ``p``, shape (r,), can go in the picture of ``camera``.

    Args:
        model: The face.
        p: The pose that they are in.
        points: Points of its surface, n of them.
        camera: Where they are seen.
        limits: Of the weights of the model's density, shape (W, 2); its own, widened to the pose, if None.
    """
    rows, neutral = model.rows_of(points)
    return reach_of_rows(model, p, rows, neutral, camera, limits)


def reach_of_points(model: FaceModel, state: PoseState, points: Indices, camera: Camera, limits: Array) -> Reach:
    """Return the same for ``points`` of a ``state``, given by their indices, (n,).

    It is remembered: while points are dragged, the pose that they are pulled from stays.
    """
    return _reach_of_points(model, state, points.tobytes(), camera, limits.tobytes())


@lru_cache(maxsize=32)
def _reach_of_points(model: FaceModel, state: PoseState, points: bytes, camera: Camera, limits: bytes) -> Reach:
    rows, neutral = state.anchored_at(np.frombuffer(points, dtype=np.intp))
    return reach_of_rows(model, state.p, rows, neutral, camera, np.frombuffer(limits).reshape(-1, 2))


def reach_of_rows(
    model: FaceModel, p: Array, rows: Array, neutral: Array, camera: Camera, limits: Array | None = None
) -> Reach:
    """Return the same for points given by their derivatives, (n, 3, r), and neutral positions, (n, 3)."""
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
    meant = _smooth_step((shares - _ALONG) / (_MEANT - _ALONG))
    _, by_place = camera.project_with_jacobian(neutral + rows @ p)
    pixels = np.einsum("nik,nkw->nwi", by_place, moves) * meant[:, :, None]
    free = np.concatenate([(upper - weights).clip(0.0, _FAR), -(weights - lower).clip(0.0, _FAR)])
    steps = np.concatenate([pixels, pixels], axis=1) * free[None, :, None]
    scale = np.sqrt(0.5 * np.einsum("nik,nik->n", by_place, by_place))
    own = np.sqrt(np.einsum("nw,nw->n", sizes * meant, sizes * meant))
    return Reach(steps, _smooth_step((own - _BONE_CM) / (_FLESH_CM - _BONE_CM)), scale)


@lru_cache(maxsize=4)
def _directions(n: int) -> Array:
    angles = np.arange(n) * (2.0 * np.pi / n)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _smooth_step(t: Array) -> Array:
    within = t.clip(0.0, 1.0)
    step: Array = within * within * (3.0 - 2.0 * within)
    return step


def limits_around(limits: Array, weights: Array) -> NDArray[np.float64]:
    """Return ``limits``, (W, 2), of rig weights widened to where the ``weights``, (W,), are.

    A captured pose may go beyond what a rig's weights are meant for; as a start it stays as it is. Where both limits
    are the same, there are none, and those returned are infinite.
    """
    lower, upper = limits.T
    bounded = upper > lower
    return np.stack(
        [np.where(bounded, np.minimum(lower, weights), -np.inf), np.where(bounded, np.maximum(upper, weights), np.inf)],
        axis=1,
    )
