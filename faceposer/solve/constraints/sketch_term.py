"""Energy of sketches: lines that a hand has drawn, with the errors of a hand."""

import weakref
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.reach import ReachTerm, reach_of_points
from faceposer.solve.term import Array, Indices, PoseState, reduced

# Number of points as which a whole line counts: it is drawn in one movement, so that its points are not independent.
_LINE = 2.0
# Weight of a matched point across the line, and weights of offsets along the line relative to those across it: a hand
# meets the course of a line better than places along it.
_MATCHED, _ALONG_LINE, _ALONG_MATCHED = 0.2, 0.05, 0.1
# Standard deviation of the shift of a whole stroke, in pixels, in each direction.
_SHIFT_PX = 4.0
# Reach of the points of a line relative to that of a single point, whose pull is not attributed to shapes that move its
# surroundings more.
_WIDER = 1.5


@dataclass(frozen=True, eq=False)
class SketchTargets:
    """What one sketch contributes to a ``SketchTerm``.

    Attributes:
        points: Indices of its points in the state, at least one, shape (m,).
        targets: Their places on the stroke, shape (m, 2).
        tangents: Unit tangents of the stroke there, shape (m, 2).
        matched: Mask of the matched feature points, shape (m,).
        weight: Weight of the sketch, w, above 0.
        camera: The camera under which it was drawn.
    """

    points: Indices
    targets: Array
    tangents: Array
    matched: NDArray[np.bool_]
    weight: float
    camera: Camera


class SketchTerm(ReachTerm):
    """The sum over all sketches of the least cost of each over its shift d.

    It is the minimum of w / sigma^2 (sum over i of a_i (n_i . (e_i - d))^2 + b_i (t_i . (e_i - d))^2) +
    w |d|^2 / s^2.

    e_i is the offset of point i of the feature's curve from its place on the stroke, t_i and n_i the stroke's tangent
    and normal there. A hand puts a line in the wrong place more than it gives it the wrong shape; the shift d of the
    whole stroke, with the standard deviation s, lets the prior place it. d is linear in the offsets. a_i is L / m for
    each of the m points, and more at matched feature points; b_i is smaller. All sketches are one term, since most of
    the time of a small term is spent between operations.

    The weights were chosen by the error of faces of a performance drawn with a hand's errors (docs/sketching-files.md).
    """

    def __init__(self, sketches: Sequence[SketchTargets]) -> None:
        """Prepare the term of at least one of ``sketches``."""
        counts = [len(sketch.points) for sketch in sketches]
        scales = np.array([sketch.weight for sketch in sketches]) / SIGMA_PX**2
        line: Array = np.repeat(scales * _LINE / counts, counts)
        matched = np.concatenate([sketch.matched for sketch in sketches])
        at_points: Array = np.where(matched, np.repeat(scales * _MATCHED, counts), 0.0)
        across, along = line + at_points, _ALONG_LINE * line + _ALONG_MATCHED * at_points
        self._points = np.concatenate([sketch.points for sketch in sketches])
        self._targets = np.concatenate([sketch.targets for sketch in sketches])
        tangents = np.concatenate([sketch.tangents for sketch in sketches])
        # Normal and tangent of each point, shape (m, 2, 2).
        frames: Array = np.stack([tangents[:, ::-1] * (-1.0, 1.0), tangents], axis=1)
        self._frames = frames
        # First point of each sketch, and the sketch of each point.
        self._firsts = np.cumsum([0, *counts[:-1]])
        self._sketches = np.repeat(np.arange(len(counts)), counts)
        # Weights of the offsets of each point, shape (m, 2, 2).
        self._stiffness: Array = frames.transpose(0, 2, 1) @ (np.stack([across, along], axis=1)[:, :, None] * frames)
        of_shift = np.array([sketch.weight for sketch in sketches]) / _SHIFT_PX**2
        together: Array = np.add.reduceat(self._stiffness, self._firsts) + of_shift[:, None, None] * np.eye(2)
        self._by_force = np.asarray(np.linalg.inv(together), dtype=np.float64)
        super().__init__(np.concatenate([np.stack([across, along], axis=1).ravel(), np.repeat(of_shift, 2)]))
        views: dict[Camera, list[Indices]] = {}
        for first, sketch in zip(self._firsts.tolist(), sketches, strict=True):
            views.setdefault(sketch.camera, []).append(first + np.arange(len(sketch.points)))
        self._views = [(camera, np.concatenate(indices)) for camera, indices in views.items()]
        self._last: tuple[weakref.ref[PoseState], Array, Array] | None = None
        self._limited: tuple[weakref.ref[PoseState], bytes, float, SketchTerm] | None = None

    def _shifted(self, offsets: Array) -> tuple[Array, Array]:
        """Return ``offsets``, (m, 2, k), without the shifts of their sketches, and these shifts, (n, 2, k)."""
        shifts: Array = self._by_force @ np.add.reduceat(self._stiffness @ offsets, self._firsts)
        return offsets - shifts[self._sketches], shifts

    def _turned(self, offsets: Array) -> Array:
        """Return ``offsets``, (m, 2, k), across and along without their shifts, and the shifts, (2 m + 2 n, k)."""
        remaining, shifts = self._shifted(offsets)
        columns = offsets.shape[2]
        return np.concatenate([(self._frames @ remaining).reshape(-1, columns), shifts.reshape(-1, columns)])

    def _offsets(self, state: PoseState) -> Array:
        """Return the offsets of the points from their places on the strokes, shape (m, 2, 1)."""
        return (state.pixels[self._points] - self._targets)[:, :, None]

    def within_reach(self, model: FaceModel, state: PoseState, limits: Array, trust: float = 0.0) -> "SketchTerm":
        """Return the term with its targets limited to their reach (``ReachTerm``), kept for the last state.

        Offsets across and along the stroke are limited by themselves: a hand that errs along it must not be the reason
        for which the line falls short.
        """
        key = limits.tobytes(), trust
        last = self._limited
        if last is not None and last[0]() is state and last[1:3] == key:
            return last[3]
        origins = state.pixels[self._points]
        drawn = self._targets - origins
        pulls, mobility = drawn.copy(), np.ones(len(drawn))
        for camera, indices in self._views:
            reach = reach_of_points(model, state, self._points[indices], camera, limits)
            parts = np.einsum("mij,mj->mi", self._frames[indices], drawn[indices])[:, :, None] * self._frames[indices]
            limited = _WIDER * (reach.limited(parts[:, 0] / _WIDER) + reach.limited(parts[:, 1] / _WIDER))
            pulls[indices] = (1.0 - trust) * limited + trust * drawn[indices]
            mobility[indices] = reach.mobility
        term = copy(self)
        term._targets, term._last, term._limited = origins + pulls, None, None
        across = np.einsum("mj,mj->m", self._frames[:, 0], drawn - pulls)
        term.lost, term.mobility = float(np.abs(across).mean()), float(mobility.mean())
        self._limited = weakref.ref(state), *key, term
        return term

    def residual(self, state: PoseState) -> Array:
        """Return the offsets across and along the strokes without their shifts, and the n shifts, (2 m + 2 n,)."""
        return self._turned(self._offsets(state))[:, 0]

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the residuals, shape (2 m + 2 n, r)."""
        return self._turned(state.pixel_jacobian(self._points))

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient with respect to the coefficients, shape (r,).

        The shifts minimise the cost, so that its gradient is the one with the shifts held.
        """
        offsets = self._offsets(state)
        remaining, _ = self._shifted(offsets)
        force = (self._stiffness @ remaining)[:, :, 0]
        return float(np.vdot(offsets[:, :, 0], force)), state.pull_back(self._points, 2.0 * force)

    def linearised(self, state: PoseState) -> tuple[Array, Array]:
        """Return the rows and residuals of ``ResidualTerm.linearised``, kept for the last state.

        While another constraint is dragged, the sketches and the start of the face stay as they are.
        """
        last = self._last
        if last is None or last[0]() is not state:
            last = self._last = (weakref.ref(state), *reduced(*super().linearised(state)))
        return last[1:]
