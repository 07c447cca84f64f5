"""The maximum a posteriori problem: constraints and a prior over one face (Lau et al. 2009, eqs. (3) and (20))."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.model.local_moments import LocalMoments
from faceposer.model.mixture import GaussianMixture
from faceposer.model.muscles import dependent_pairs
from faceposer.sized_cache import sized_cache, weak_cache
from faceposer.solve.constraints.registry import CONSTRAINTS, Constraint
from faceposer.solve.coverage import coverage
from faceposer.solve.gaze_terms import HeldGaze, ParallelGaze, eye_turns, gaze_differences, moves_eyes
from faceposer.solve.least_motion import LeastMotion, LinearisedEnergy
from faceposer.solve.opposition import fading
from faceposer.solve.priors import MixturePrior, Prior, WeightBounds, prior_at
from faceposer.solve.reach import ReachTerm, limits_around
from faceposer.solve.term import AnchoredPoints, Array, Indices, PoseState, QuadraticTerm, ResidualTerm, Term, reduced

#: Spread of a new session, from 0 (local) to 1 (the whole face).
SPREAD = 0.5
#: Spread for measurements of a real face, such as recorded trajectories, which show how the whole face moved.
RECORDED_SPREAD = 1.0
# Factors on the prior's weight, for the Gaussian and for the bounds.
_GAUSSIAN, _BOUNDS = 0.7, 1.5
# Least motion: its strength at a spread of 0 and of 1, and the exponent in between (1.5 at the default spread).
_MOTION, _LEAST_MOTION, _MOTION_POWER = 5.0, 0.3, 1.97
# Above this spread, the prior blends towards the examples' own expressions.
_WHOLE_FROM = 0.75
# Least weight of the rig's limits and of parallel gaze, whatever the prior's weight.
_LEAST_HOLD = 1.0
# Energy of the informative terms above which these weights grow.
_FIRM = 1500.0
# Least weight of the prior, so that unconstrained parts of the face keep still.
_LEAST_WEIGHT = 0.02
# Keeps the problem bounded where neither constraints nor the prior do, and is negligible elsewhere.
_RIDGE = 1e-6
# Largest memory in bytes and number of the points, and of the states at start poses, that are cached.
_CACHED = (32 << 20, 8)


class Ridge(QuadraticTerm):
    """A faint attraction to the start, so that the solution is unique even at a prior weight of 0."""

    def __init__(self, start: Array, scale: Array) -> None:
        """Attract to ``start``, shape (r,), with strength ``scale``, shape (r,)."""
        self._start, self._scale = start, scale

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient with respect to the coefficients, shape (r,)."""
        offset = state.p - self._start
        scaled = self._scale * offset
        return float(offset @ scaled), 2.0 * scaled

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative, shape (r, r)."""
        return np.diag(2.0 * self._scale)


class PoseProblem:
    """E(p) = sum of the constraints' energies + prior_weight * E_prior(p).

    The rows of the basis at all constrained points are gathered once, so that the cost of an evaluation is independent
    of the size of the mesh.

    Attributes:
        start: The pose on which the prior is conditioned, shape (r,): the given one, with the eyes turned, without
            what the constraints pull against.
        limits: Limits of the weights of the model's density, widened to the home pose, shape (W, 2); None if the
            problem has none.
        trust: Share from 0 to 1 by which targets count unlimited; see ``ReachTerm.within_reach``.
    """

    def __init__(
        self,
        model: FaceModel,
        constraints: Sequence[Constraint],
        start: ArrayLike | None = None,
        prior_weight: float = 1.0,
        mixture: GaussianMixture | None = None,
        prior: Prior = "regions",
        extra_terms: Sequence[Term] = (),
        passive_terms: Sequence[Term] = (),
        offset: ArrayLike | None = None,
        spread: float = SPREAD,
        bare: bool = False,
        home: ArrayLike | None = None,
    ) -> None:
        """Gather the problem.

        Args:
            model: The face.
            constraints: All constraints; disabled ones count only in ``residuals_px``.
            start: The pose of the untouched face, shape (r,); the neutral face if None.
            prior_weight: Weight of the prior, at least 0.
            mixture: A density over coefficients that replaces the prior; if None, the prior is the model's own density
                conditioned on the start, with bounds on the rig's weights.
            prior: "regions" or "whole" to condition the model's density on the start, by region or of the whole face;
                "plain" for the density as it was learned, as in the paper.
            extra_terms: Further informative terms that are not constraints, such as points tracked in a video. They
                depend on the coefficients alone.
            passive_terms: Further terms on which the prior is not conditioned, such as gaze.
            offset: Offset of the start that is not penalised by the prior, such as gaze, shape (r,).
            spread: Extent of the response to the constraints, from 0, as local as possible, to 1, all motion that
                usually accompanies it in the training data.
            home: The first pose of a sequence solved frame by frame, shape (r,); the start if None. The rig's limits
                are widened to this pose only; widened to every frame, they would drift.
            bare: True for the constraints alone, without prior, bounds or limits on the reach of targets.

        Raises:
            ValueError: If a constraint refers to a point that the face does not have.
        """
        begin = np.array(model.neutral() if start is None else start, dtype=np.float64)
        self.start = begin if offset is None else begin + np.asarray(offset, dtype=np.float64)
        self.model = model
        self.prior_weight = prior_weight
        self.constraints = tuple(constraints)
        for constraint in self.constraints:
            if constraint.enabled:
                self.start = constraint.offset_start(model, self.start)
        self._anchored, self._slots = gather_points(model, self.constraints)
        slots = self._slots
        self._terms: list[Term] = []
        informative: list[Term] = list(extra_terms)
        for kind in CONSTRAINTS.values():
            chosen = [i for i, c in enumerate(self.constraints) if isinstance(c, kind) and c.enabled and c.weight > 0]
            if chosen:
                group = [self.constraints[i] for i in chosen]
                terms = kind.terms(group, [slots[i] for i in chosen], model)
                self._terms += terms
                informative += terms if kind.informs_prior else []
        self._terms += [*extra_terms, *passive_terms]
        centred = mixture is None and prior != "plain"
        # Without constraints the start is the minimum of a prior conditioned on it.
        self.at_rest = centred and not self._terms
        self.mixture = model.mixture if mixture is None else mixture
        self.limits: Array | None = None
        self.trust = 1.0 if bare else 0.0
        self._home = self.start if home is None else np.asarray(home, dtype=np.float64)
        wholeness = max(0.0, (spread - _WHOLE_FROM) / (1.0 - _WHOLE_FROM)) if centred else 0.0
        covered, fade = 0.0, None
        if centred and informative and not bare:
            rows, residual = _linearised(informative, self._start_state)
            # A spread below the default reduces the coverage, to keep the response local.
            covered = min(1.0, spread / SPREAD) * coverage(model, begin, rows)
            if prior == "regions" and home is None and not extra_terms:
                fade = fading(model, begin, rows, residual, (1.0 - wholeness) * (1.0 - covered))
                self.start = self.start if fade is None else self.start - fade
        self._terms.insert(0, Ridge(self.start, _RIDGE / model.subspace.variances.clip(1e-9)))
        if bare:
            return
        if mixture is None:
            self.trust = 1.0 - (1.0 - wholeness) * (1.0 - covered)
            self._apply_reach(informative)
        local = centred and prior == "regions" and wholeness < 1.0
        if local and not extra_terms and not moves_eyes(model.character, self.constraints):
            weight = (1.0 - wholeness) * max(prior_weight, _LEAST_HOLD)
            self._terms.append(HeldGaze(eye_turns(model), self.start, weight))
        if centred:
            moments = prior_at(model, begin, prior, wholeness)
            self._add_prior(
                moments if fade is None else moments.about(begin - fade), prior, spread, covered, informative
            )
        elif prior_weight > 0:
            self._terms.append(MixturePrior(self.mixture, prior_weight))
        if mixture is None:
            self._add_bounds(informative)

    @property
    def terms(self) -> tuple[Term, ...]:
        """All terms of the energy."""
        return tuple(self._terms)

    def add(self, term: Term) -> None:
        """Add ``term`` to the energy."""
        self._terms.append(term)
        self.__dict__.pop("_quadratic_form", None)

    def _apply_reach(self, informative: list[Term]) -> None:
        """Widen the rig's limits to the home pose, and limit the targets of points to their reach."""
        self.limits = _limits_at(self.model, self._home.tobytes())
        for i, term in enumerate(informative):
            if isinstance(term, ReachTerm):
                limited = term.within_reach(self.model, self._start_state, self.limits, self.trust)
                self._terms[self._terms.index(term)] = informative[i] = limited

    def _add_bounds(self, informative: Sequence[Term]) -> None:
        """Add the terms that apply at every weight of the prior: the rig's limits and parallel gaze.

        Their weight grows with the energy of the ``informative`` terms: exceeding a limit by a third costs about as
        much as all of these together.
        """
        energy = sum(_energy(term, self._start_state) for term in informative)
        weight = max(self.prior_weight, _LEAST_HOLD, energy / _FIRM)
        directions, limits = _bounded_weights(self.model)
        self._terms.append(WeightBounds(directions, limits, _BOUNDS * weight, self._home))
        self._terms.append(ParallelGaze(gaze_differences(self.model), self.start, weight))

    def _add_prior(
        self, moments: LocalMoments, prior: Prior, spread: float, covered: float, informative: Sequence[Term]
    ) -> None:
        """Add the model's density conditioned on a pose and the ``informative`` terms, and least motion.

        An offset of the start translates this density without changing its shape.
        """
        rows, residual = reduced(*_linearised(informative, self._start_state))
        self.mixture = moments.near(rows, residual, covered)
        if not np.array_equal(self.start, moments.start):
            self.mixture = self.mixture.translated_by(self.start - moments.start)
        weight = max(self.prior_weight, _LEAST_WEIGHT)
        self._terms.append(MixturePrior(self.mixture, _GAUSSIAN * weight))
        strength = weight * (_LEAST_MOTION + (_MOTION - _LEAST_MOTION) * (1.0 - spread) ** _MOTION_POWER)
        if strength > 0 and len(rows) and prior == "regions" and self.limits is not None:
            energy = LinearisedEnergy(rows, residual)
            precision = 0.5 * _GAUSSIAN * weight * self.mixture.precisions[0]
            limits = self.limits
            if self._home is not self.start:
                limits = limits_around(limits, self.model.rig_density.directions @ self.start)
            self._terms.append(LeastMotion(self.model, self.start, energy, precision, strength, limits))

    def state(self, p: Array) -> PoseState:
        """Return the anchored points at coefficients ``p`` of shape (r,)."""
        return PoseState(self._anchored, p)

    @property
    def _start_state(self) -> PoseState:
        return _state_at(self._anchored, self.start.tobytes())

    @cached_property
    def _quadratic_form(self) -> tuple[float, Array, Array, tuple[Term, ...]]:
        """Value, gradient and curvature at the start of the sum of all quadratic terms, and the other terms."""
        value, slope, curvature = 0.0, np.zeros_like(self.start), np.zeros((len(self.start),) * 2)
        others = []
        for term in self._terms:
            if isinstance(term, QuadraticTerm) and term.is_quadratic:
                own, own_slope = term.value_and_gradient(self._start_state)
                value += own
                slope += own_slope
                curvature += term.curvature(self._start_state)
            else:
                others.append(term)
        return value, slope, curvature, tuple(others)

    def energy_and_gradient(self, p: Array) -> tuple[float, Array]:
        """Return E(p) and its gradient, shape (r,), at ``p`` of shape (r,)."""
        return self.energy_and_gradient_at(self.state(p))

    def energy_and_gradient_at(self, state: PoseState) -> tuple[float, Array]:
        """Return E and its gradient for the ``state`` at p, whose cached values ``curvature_at`` can reuse."""
        value, slope, curvature, others = self._quadratic_form
        change = state.p - self.start
        bent = curvature @ change
        energy, gradient = value + float(change @ (slope + 0.5 * bent)), slope + bent
        for term in others:
            own, own_slope = term.value_and_gradient(state)
            energy += own
            gradient += own_slope
        return energy, gradient

    def curvature(self, p: Array) -> Array:
        """Return the Gauss-Newton estimate of the second derivative of E at ``p``, shape (r, r), positive definite."""
        return self.curvature_at(self.state(p))

    def curvature_at(self, state: PoseState, bounded: bool = True) -> Array:
        """Return the curvature for the ``state`` at p, without that of ``bounds`` unless ``bounded``."""
        _, _, total, others = self._quadratic_form
        for term in others:
            if bounded or not isinstance(term, WeightBounds):
                total = total + term.curvature(state)
        return total

    @property
    def bounds(self) -> tuple[WeightBounds, ...]:
        """The terms that are bounds."""
        return tuple(term for term in self._quadratic_form[3] if isinstance(term, WeightBounds))

    def conditional_means(self) -> Array:
        """Return the component means conditioned on the constraints, linearised at the start pose, shape (K, r)."""
        state = self._start_state
        others = [term for term in self._terms if not isinstance(term, MixturePrior)]
        priors = sum(t.weight for t in self._terms if isinstance(t, MixturePrior) and t.mixture is self.mixture)
        curvature = np.sum([term.curvature(state) for term in others], axis=0)
        gradient = np.sum([term.value_and_gradient(state)[1] for term in others], axis=0)
        if priors <= 0:
            return (self.start - np.linalg.solve(curvature, gradient))[None]
        precisions = priors * self.mixture.precisions
        towards = np.einsum("kij,kj->ki", precisions, self.mixture.means - self.start)
        steps = np.linalg.solve(curvature + precisions, (towards - gradient)[:, :, None])
        means: Array = self.start + steps[:, :, 0]
        return means

    def residuals_px(self, p: Array) -> tuple[float, ...]:
        """Return the residual of each constraint, enabled or not, at ``p``, in pixels."""
        return self.residuals_px_at(self.state(p))

    def residuals_px_at(self, state: PoseState) -> tuple[float, ...]:
        """Return the residual of each constraint for the ``state`` at p, in pixels."""
        return tuple(
            constraint.residual_at(state.pixels[slots], self.model, state.p)
            for constraint, slots in zip(self.constraints, self._slots, strict=True)
        )


def gather_points(model: FaceModel, constraints: Sequence[Constraint]) -> tuple[AnchoredPoints, tuple[Indices, ...]]:
    """Return the points of all ``constraints`` with a camera, and the indices of each constraint's points among them.

    The result is cached, since dragging targets leaves the points of the face unchanged.
    """
    places = tuple(None if c.camera is None else (c.points, c.camera) for c in constraints)
    return _gathered(model, places)


@sized_cache(lambda gathered, model, places: gathered[0].nbytes, *_CACHED, weak=True)
def _gathered(
    model: FaceModel, places: tuple[tuple[SurfacePoints, Camera] | None, ...]
) -> tuple[AnchoredPoints, tuple[Indices, ...]]:
    rows: list[Array] = [np.zeros((0, model.n_coefficients))]
    neutral: list[Array] = [np.zeros((0, 3))]
    slots: list[Indices] = []
    views: dict[Camera, list[Indices]] = {}
    end = 0
    for place in places:
        begin = end
        if place is not None:
            points, camera = place
            own_rows, own_neutral = model.jacobian_at(points)
            rows.append(own_rows.reshape(-1, model.n_coefficients))
            neutral.append(own_neutral)
            end += len(own_neutral)
            views.setdefault(camera, []).append(np.arange(begin, end))
        slots.append(np.arange(begin, end))
    anchored = AnchoredPoints(
        np.concatenate(rows),
        np.concatenate(neutral),
        tuple((camera, np.concatenate(indices)) for camera, indices in views.items()),
    )
    return anchored, tuple(slots)


@sized_cache(lambda state, anchored, pose: state.nbytes, *_CACHED)
def _state_at(anchored: AnchoredPoints, pose: bytes) -> PoseState:
    """Return the state at a ``pose``, cached since dragging targets leaves the start pose unchanged."""
    return PoseState(anchored, np.frombuffer(pose))


@weak_cache(8)
def _limits_at(model: FaceModel, pose: bytes) -> Array:
    """Return the limits of the weights of the model's density, widened to a ``pose``, shape (W, 2)."""
    density = model.rig_density
    limits = limits_around(density.limits, density.directions @ np.frombuffer(pose))
    limits.setflags(write=False)
    return limits


@weak_cache(4)
def _bounded_weights(model: FaceModel) -> tuple[Array, Array]:
    """Return the bounded weights as linear functions of the coefficients, (n, r), and their limits, (n, 2).

    These are the weights of all shapes, and the differences between dependent shapes and those that they depend on.
    """
    limits, directions = model.character.shape_limits, model.subspace.directions
    for shape, other, beyond in dependent_pairs(model.character.shape_names):
        directions = np.vstack([directions, directions[shape] - directions[other]])
        limits = np.vstack([limits, [-limits[other, 1], beyond]])
    bounded = limits[:, 1] > limits[:, 0]
    return np.ascontiguousarray(directions[bounded]), np.ascontiguousarray(limits[bounded])


def _energy(term: Term, state: PoseState) -> float:
    """Return the value of a ``term``, without computing its gradient where possible."""
    if isinstance(term, ResidualTerm):
        residual = term.residual(state)
        return float(term.weights @ (residual * residual))
    return term.value_and_gradient(state)[0]


def _linearised(terms: Sequence[Term], state: PoseState) -> tuple[Array, Array]:
    """Return J, (m, r), and r, (m,), such that |J d + r|^2 approximates the ``terms`` for a change d from ``state``."""
    n = len(state.p)
    rows: list[Array] = [np.zeros((0, n))]
    residuals: list[Array] = [np.zeros(0)]
    for term in terms:
        if isinstance(term, ResidualTerm):
            own_rows, own = term.linearised(state)
            rows.append(own_rows)
            residuals.append(own)
        else:
            slope, curvature = term.value_and_gradient(state)[1], term.curvature(state)
            faint = 1e-9 * np.trace(curvature) / n + 1e-12
            lower = np.linalg.cholesky(0.5 * curvature + faint * np.eye(n))
            rows.append(lower.T)
            residuals.append(np.asarray(np.linalg.solve(lower, 0.5 * slope), dtype=np.float64))
    return np.concatenate(rows), np.concatenate(residuals)
