"""The maximum a posteriori problem: constraints and a prior over one face (Lau et al. 2009, eqs. (3) and (20))."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.mixture import GaussianMixture
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.registry import CONSTRAINTS, Constraint
from faceposer.solve.priors import MixturePrior, Prior, WeightBounds, centred_at
from faceposer.solve.term import AnchoredPoints, Array, Indices, PoseState, ResidualTerm, Term

# Keeps the problem bounded where neither a constraint nor the prior says anything, far below what either says.
_RIDGE = 1e-6


class Ridge:
    """A faint pull towards the start, so that a prior weight of 0 leaves a problem with one solution."""

    def __init__(self, start: Array, scale: Array) -> None:
        """Pull towards ``start``, shape (r,), with strength ``scale``, shape (r,)."""
        self._start, self._scale = start, scale

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient by the coefficients, shape (r,)."""
        offset = state.p - self._start
        scaled = self._scale * offset
        return float(offset @ scaled), 2.0 * scaled

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative, shape (r, r)."""
        return np.diag(2.0 * self._scale)


class PoseProblem:
    """E(p) = sum of the constraints' energies + prior_weight * E_prior(p).

    The rows of the basis at all constrained points are gathered once, so that an evaluation does not depend on the size
    of the mesh.
    """

    def __init__(
        self,
        model: FaceModel,
        constraints: Sequence[Constraint],
        start: ArrayLike | None = None,
        prior_weight: float = 1.0,
        mixture: GaussianMixture | None = None,
        prior: Prior = "regions",
        evidence: Sequence[Term] = (),
        held: Sequence[Term] = (),
        offset: ArrayLike | None = None,
    ) -> None:
        """Gather the problem.

        Args:
            model: The face.
            constraints: All constraints; those that are not enabled count only in ``residuals_px``.
            start: The pose that an untouched face has, shape (r,); the neutral face if None.
            prior_weight: Weight of the prior, at least 0.
            mixture: A density over coefficients to take as the whole prior; if None, the prior is the model's own
                density seen from the start, with bounds on the rig's weights.
            prior: Whether the model's own density judges region by region, the face as a whole, or, without regard to
                the start and the bounds, as it was learned ("plain", the paper's).
            evidence: Terms that tell of the face as constraints do, but are none, such as points tracked in a film;
                they look at the coefficients alone.
            held: Likewise, but what they ask for tells nothing of the rest of the face, as where the eyes look.
            offset: What is added to the start without a price, as gaze is, shape (r,).

        Raises:
            ValueError: If a constraint names a place that the face does not have.
        """
        begin = np.array(model.neutral() if start is None else start, dtype=np.float64)
        self.start = begin if offset is None else begin + np.asarray(offset, dtype=np.float64)
        self.model = model
        self.prior_weight = prior_weight
        self.constraints = tuple(constraints)
        for constraint in self.constraints:
            if constraint.enabled:
                self.start = constraint.moved_start(model, self.start)
        self._anchored, slots = gather(model, self.constraints)
        self.terms: list[Term] = [Ridge(self.start, _RIDGE / model.subspace.variances.clip(1e-9))]
        pulls: list[Term] = list(evidence)
        for kind in CONSTRAINTS.values():
            chosen = [i for i, c in enumerate(self.constraints) if isinstance(c, kind) and c.enabled and c.weight > 0]
            if chosen:
                group = [self.constraints[i] for i in chosen]
                terms = kind.terms(group, [slots[i] for i in chosen], model)
                self.terms += terms
                # Where the eyes look tells nothing of the face.
                pulls += terms if kind is not GazeConstraint else []
        self.terms += [*evidence, *held]
        if mixture is None and prior == "plain":
            mixture = model.mixture
        # Nothing pulls: seen from the start, the start is the least of all energies.
        self.at_rest = mixture is None and len(self.terms) == 1
        self.mixture = mixture or self._seen_from(begin, prior, pulls)
        if prior_weight > 0:
            self.terms.append(MixturePrior(self.mixture, prior_weight))
            if mixture is None:
                self.terms.append(WeightBounds(model.subspace.directions, model.subject.shape_limits, prior_weight))

    def _seen_from(self, begin: Array, prior: Prior, pulls: Sequence[Term]) -> GaussianMixture:
        """Return the model's density as it looks from the pose ``begin``, in the light of the terms ``pulls``.

        What moves the start keeps the prior as it was seen from before: only its place moves along.
        """
        state = self.state(self.start)
        rows: list[Array] = [np.zeros((0, len(begin)))]
        residuals: list[Array] = [np.zeros(0)]
        for term in pulls:
            if isinstance(term, ResidualTerm):
                roots = np.sqrt(term.weights)
                rows.append(roots[:, None] * term.jacobian(state))
                residuals.append(roots * term.residual(state))
            else:
                slope, curvature = term.value_and_gradient(state)[1], term.curvature(state)
                faint = 1e-9 * np.trace(curvature) / len(begin) + 1e-12
                lower = np.linalg.cholesky(0.5 * curvature + faint * np.eye(len(begin)))
                rows.append(lower.T)
                residuals.append(np.asarray(np.linalg.solve(lower, 0.5 * slope), dtype=np.float64))
        stacked, off = np.concatenate(rows), np.concatenate(residuals)
        if len(off) > len(begin) + 1:
            # Only the products matter: hundreds of rows of a stroke are as good as one more than there are columns.
            reduced: Array = np.asarray(np.linalg.qr(np.column_stack([stacked, off]), mode="r"))
            stacked, off = reduced[:, :-1], reduced[:, -1]
        mixture = centred_at(self.model, begin, prior).near(stacked, off)
        return mixture if self.start is begin else mixture.moved_by(self.start - begin)

    def state(self, p: Array) -> PoseState:
        """Return the anchored points at coefficients ``p`` of shape (r,)."""
        return PoseState(self._anchored, p)

    def energy_and_gradient(self, p: Array) -> tuple[float, Array]:
        """Return E(p) and its gradient, shape (r,), at ``p`` of shape (r,)."""
        state = self.state(p)
        energy, gradient = 0.0, np.zeros_like(p)
        for term in self.terms:
            value, slope = term.value_and_gradient(state)
            energy += value
            gradient += slope
        return energy, gradient

    def curvature(self, p: Array) -> Array:
        """Return the Gauss-Newton estimate of the second derivative of E at ``p``, shape (r, r), positive definite."""
        state = self.state(p)
        return np.sum([term.curvature(state) for term in self.terms], axis=0)

    def conditional_means(self) -> Array:
        """Return each component's mean given the constraints, linearised at the start pose, shape (K, r)."""
        state = self.state(self.start)
        others = [term for term in self.terms if not isinstance(term, MixturePrior)]
        curvature = np.sum([term.curvature(state) for term in others], axis=0)
        gradient = np.sum([term.value_and_gradient(state)[1] for term in others], axis=0)
        if self.prior_weight <= 0:
            return (self.start - np.linalg.solve(curvature, gradient))[None]
        precisions = self.prior_weight * self.mixture.precisions
        towards = np.einsum("kij,kj->ki", precisions, self.mixture.means - self.start)
        steps = np.linalg.solve(curvature + precisions, (towards - gradient)[:, :, None])
        means: Array = self.start + steps[:, :, 0]
        return means

    def residuals_px(self, p: Array) -> tuple[float, ...]:
        """Return how far each constraint, enabled or not, is from being met at ``p``, in pixels."""
        return tuple(constraint.residual_px(self.model, p) for constraint in self.constraints)


def gather(model: FaceModel, constraints: Sequence[Constraint]) -> tuple[AnchoredPoints, list[Indices]]:
    """Return the points of all ``constraints`` that lie in pictures, and the indices of each one's among them."""
    rows: list[Array] = []
    neutral: list[Array] = []
    slots: list[Indices] = []
    views: dict[Camera, list[Indices]] = {}
    end = 0
    for constraint in constraints:
        begin = end
        if constraint.camera is not None:
            constraint_rows, constraint_neutral = model.rows_at(constraint.points)
            rows.append(constraint_rows.reshape(-1, model.n_coefficients))
            neutral.append(constraint_neutral)
            end += len(constraint_neutral)
            views.setdefault(constraint.camera, []).append(np.arange(begin, end))
        slots.append(np.arange(begin, end))
    anchored = AnchoredPoints(
        np.concatenate(rows) if rows else np.zeros((0, model.n_coefficients)),
        np.concatenate(neutral) if neutral else np.zeros((0, 3)),
        tuple((camera, np.concatenate(indices)) for camera, indices in views.items()),
    )
    return anchored, slots
