"""Maximum a posteriori fit of a linear model of heads to scans with landmarks, coarse to fine.

With the coefficients b of a head x(b) and, of each scan j, the weights w_j of expressions and the similarity T_j from
the scan to the model's frame, the fit minimises half of

    Σ_j Σ_v r_v ((n_v · (x_v(b, w_j) - T_j c_v))² + κ ‖x_v - T_j c_v‖²) / s²     closest points c_v with normals n_v
    + Σ_j Σ_l ‖x_l(b, w_j) - T_j p_l‖² / s_l²                                    landmarks p_l
    + ‖b‖² + Σ_k ‖β_k‖² / τ² + Σ_j Σ_e 2 λ w_je / m_e                            prior

(Blanz and Vetter 1999, sections 3 and 4, with distances in place of grey values). In the last stage each segment k has
its own coefficients b + β_k, blended by a partition of unity. The weights 0 ≤ w ≤ 1 have an exponential prior in terms
of their means m, under which most are zero, so that a neutral face is not explained by expressions. In each round,
closest points and their weights r are fixed and T is linear in a small rotation, translation and scale; the normal
equations are solved for all unknowns at once, those of w as a quadratic programme with bounds.

r is the trust of the vertex, 0 where the closest point is far, faces another way or lies at a border, and falls with
the residual as in the M-estimator of Geman and McClure, as hair and clothes lie on the scan but not on the model. It
contains the share of independent errors, since those of neighbours are alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.identity.scan_surface import ScanSurface
from faceposer.identity.scans.basis import HeadBasis
from faceposer.progress import Progress

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Share of tangential distances, κ: surfaces slide along each other.
_ALONG = 0.005
# Share of independent errors among those of the vertices.
_INDEPENDENT = 0.15
# Least cosine between the normals of model and scan.
_LEAST_COSINE = 0.7
# Least share of the trusted vertices that must find the scan.
_LEAST_USED = 0.05
# Deviations τ of the coefficients of segments from those of the whole head, in standard deviations.
_LOCAL = 0.4
# Rate of the exponential prior of the weights of expressions, as a multiple of the inverse of their means.
_RATE = 1.0
# Sweeps of the coordinate descent, and the change of a weight at which it ends.
_SWEEPS, _SETTLED = 500, 1e-5


@dataclass(frozen=True)
class Stage:
    """A stage of the fit; lengths are in centimetres.

    Attributes:
        rounds: Number of rounds.
        modes: Share of the modes that are free, the first ones.
        surface_sigma: Standard deviation of distances of the surface, or None for landmarks only.
        landmark_sigma: Standard deviation of landmarks.
        farthest: Distances of closest points that still count in the first and in the last round.
        expressions: True if the weights of expressions are free, False if they are held: distances far below the errors
            of the model would be explained by expressions.
        segments: True if each segment has its own coefficients.
    """

    rounds: int
    modes: float
    surface_sigma: float | None
    landmark_sigma: float
    farthest: tuple[float, float] = (2.0, 2.0)
    expressions: bool = True
    segments: bool = False


STAGES = (
    Stage(3, 0.2, None, 0.35),
    Stage(6, 0.4, 0.2, 0.4, (2.0, 1.0)),
    Stage(6, 1.0, 0.08, 0.5, (1.0, 0.6)),
    Stage(6, 1.0, 0.04, 0.8, (0.6, 0.4)),
    Stage(10, 1.0, 0.008, 0.8, (0.4, 0.3), expressions=False),
    Stage(4, 1.0, 0.012, 0.8, (0.3, 0.3), expressions=False, segments=True),
)


@dataclass(frozen=True, eq=False)
class ScanData:
    """A scan with its landmarks, about upright and in centimetres.

    Attributes:
        surface: The surface.
        places: Places of known points, shape (m, 3).
        rows: Their vertices on the model, shape (m, 3).
        shares: Barycentric coordinates there, shape (m, 3).
        spreads: Standard deviations of the places beside those of the stage, shape (m,).
        exact: Mask of the points that somebody has placed, shape (m,).
    """

    surface: ScanSurface
    places: Array
    rows: NDArray[np.int64]
    shares: Array
    spreads: Array
    exact: Mask


@dataclass(frozen=True, eq=False)
class ScanFit:
    """The fit to one of the scans.

    Attributes:
        frame: The similarity from the scan to the model's frame.
        weights: Weights of the expressions, shape (E,).
        used: Mask of the vertices with a say in the last round, shape (N,).
    """

    frame: Similarity
    weights: Array
    used: Mask


@dataclass(frozen=True, eq=False)
class HeadFit:
    """A head fitted to scans.

    Attributes:
        shape: Coefficients in standard deviations, shape (K,).
        local: Their deviations in the segments, shape (S, K).
        scans: The fit to each scan.
        basis: The model.
    """

    shape: Array
    local: Array
    scans: tuple[ScanFit, ...]
    basis: HeadBasis = field(repr=False)

    @property
    def neutral(self) -> Array:
        """The head without expression, shape (N, 3)."""
        return self.basis.head(self.shape, self.local)

    def posed(self, number: int) -> Array:
        """Return the head with the expression of a scan, shape (N, 3)."""
        return self.neutral + self.basis.offsets(self.scans[number].weights)


def fit_head(
    basis: HeadBasis,
    scans: Sequence[ScanData],
    stages: Sequence[Stage] = STAGES,
    progress: Progress | None = None,
) -> HeadFit:
    """Return the most likely head of ``scans`` of one person.

    Raises:
        FacePoserError: If a scan's surface is not where its landmarks are.
        CancelledError: If the user has cancelled the work.
    """
    progress = progress or Progress()
    identity = Similarity(np.eye(3), np.zeros(3), np.array(1.0))
    n_modes, n_segments = len(basis.modes), len(basis.segments)
    nothing = ScanFit(identity, np.zeros(len(basis.expressions)), np.zeros(len(basis.mean), dtype=bool))
    fit = HeadFit(np.zeros(n_modes), np.zeros((n_segments, n_modes)), (nothing,) * len(scans), basis)
    chosen = np.flatnonzero(basis.trust > 0.0)
    chosen = chosen[chosen < basis.n_control]
    total, done = sum(stage.rounds for stage in stages), 0
    for stage in stages:
        unknowns = _Unknowns.of(basis, stage, chosen)
        for number in range(stage.rounds):
            progress.at("Fitting the model", done / total)
            share = number / max(stage.rounds - 1, 1)
            farthest = stage.farthest[0] * (stage.farthest[1] / stage.farthest[0]) ** share
            fit = _round(fit, scans, stage, unknowns, chosen, farthest)
            done += 1
    return fit


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """The columns of the unknowns of the shape and of the expressions.

    Attributes:
        modes: Offsets of the chosen vertices per unknown of the shape, shape (P, n, 3).
        all_modes: Number of modes that are free.
        precision: Precision of the prior of these unknowns, shape (P,).
        expressions: Offsets of the chosen vertices per expression, shape (E, n, 3).
        segments: True if the segments have coefficients of their own.
    """

    modes: Array
    n_modes: int
    precision: Array
    expressions: Array
    segments: bool

    @classmethod
    def of(cls, basis: HeadBasis, stage: Stage, chosen: NDArray[np.int64]) -> "_Unknowns":
        n_modes = max(1, round(stage.modes * len(basis.modes)))
        modes = basis.modes[:n_modes, chosen]
        precision = np.ones(n_modes)
        if stage.segments:
            local = [weights[chosen][:, None] * modes for weights in basis.segments]
            modes = np.concatenate([modes, *local])
            precision = np.concatenate([precision, np.full(len(modes) - n_modes, 1.0 / _LOCAL**2)])
        return cls(modes, n_modes, precision, basis.expressions[:, chosen], stage.segments)

    def at(self, basis: HeadBasis, rows: NDArray[np.int64], shares: Array) -> tuple[Array, Array]:
        """Return the columns of surface points: of the shape, (P, m, 3), and of the expressions, (E, m, 3)."""
        modes = np.einsum("kmcd,mc->kmd", basis.modes[: self.n_modes][:, rows], shares)
        expressions = np.einsum("kmcd,mc->kmd", basis.expressions[:, rows], shares)
        if self.segments:
            weights = np.einsum("smc,mc->sm", basis.segments[:, rows], shares)
            modes = np.concatenate([modes, *(w[:, None] * modes for w in weights)])
        return modes, expressions


class _System:
    """Normal equations H θ = g of all unknowns."""

    def __init__(self, size: int) -> None:
        self.matrix = np.zeros((size, size))
        self.right = np.zeros(size)

    def add(self, where: NDArray[np.int64], rows: Array, values: Array) -> None:
        """Add the weighted ``rows``, (r, p), of the unknowns ``where``, (p,), with right sides ``values``, (r,)."""
        self.matrix[np.ix_(where, where)] += rows.T @ rows
        self.right[where] += rows.T @ values


def _round(
    fit: HeadFit,
    scans: Sequence[ScanData],
    stage: Stage,
    unknowns: _Unknowns,
    chosen: NDArray[np.int64],
    farthest: float,
) -> HeadFit:
    basis = fit.basis
    n_shape, n_weights = len(unknowns.modes), len(basis.expressions)
    each = n_weights + 7
    system = _System(n_shape + each * len(scans))
    neutral = fit.neutral
    current = np.concatenate([fit.shape[: unknowns.n_modes], *(fit.local if unknowns.segments else ())])
    used = []
    for j, (scan, state) in enumerate(zip(scans, fit.scans, strict=True)):
        own = np.arange(n_shape + each * j, n_shape + each * (j + 1))
        where = np.concatenate([np.arange(n_shape), own])
        head = neutral + basis.offsets(state.weights)
        known = np.concatenate([current, state.weights, np.zeros(7)])
        if stage.surface_sigma is not None:
            columns, values, mask = _surface_rows(
                basis, head, scan, state.frame, unknowns, chosen, stage.surface_sigma, farthest
            )
            used.append(mask)
            system.add(where, columns, values + columns @ known)
        else:
            used.append(state.used)
        columns, values = _landmark_rows(basis, head, scan, state.frame, unknowns, stage)
        system.add(where, columns, values + columns @ known)
    system.matrix[np.arange(n_shape), np.arange(n_shape)] += unknowns.precision
    firsts = n_shape + each * np.arange(len(scans))
    free = np.concatenate([first + np.arange(n_weights) for first in firsts])
    system.right[free] -= np.tile(_RATE / basis.expression_means, len(scans))
    system.matrix[free, free] += 1.0
    held = None if stage.expressions else np.concatenate([state.weights for state in fit.scans])
    theta = _bounded(system, free, held)
    shape, local = np.zeros(len(basis.modes)), np.zeros_like(fit.local)
    shape[: unknowns.n_modes] = theta[: unknowns.n_modes]
    if unknowns.segments:
        local = theta[unknowns.n_modes : n_shape].reshape(fit.local.shape)
    states = []
    for first, state, mask in zip(firsts, fit.scans, used, strict=True):
        weights, pose = theta[first : first + n_weights], theta[first + n_weights : first + each]
        states.append(ScanFit(_moved(state.frame, pose), weights, mask))
    return replace(fit, shape=shape, local=local, scans=tuple(states))


def _surface_rows(
    basis: HeadBasis,
    head: Array,
    scan: ScanData,
    frame: Similarity,
    unknowns: _Unknowns,
    chosen: NDArray[np.int64],
    sigma: float,
    farthest: float,
) -> tuple[Array, Array, Mask]:
    """Return weighted rows, (r, P + E + 7), and values, (r,), of the closest points, and the vertices used, (N,)."""
    closest = scan.surface.closest(frame.inverse().apply(head[chosen]))
    places = frame.apply(closest.places)
    normals = closest.normals @ frame.rotation.T
    own_normals = basis.normals(head)[chosen]
    distances = closest.distances * float(frame.scale)
    facing = np.einsum("nd,nd->n", normals, own_normals) > _LEAST_COSINE
    good = facing & (distances < farthest) & ~closest.at_border
    mask = np.zeros(len(head), dtype=bool)
    mask[chosen[good]] = True
    if basis.trust[chosen[good]].sum() < _LEAST_USED * basis.trust[chosen].sum():
        raise FacePoserError(
            "The scan does not match its landmarks: move them to their places, or scan more of the face."
        )
    kept = np.flatnonzero(good)
    apart = places[kept] - head[chosen[kept]]
    across = np.einsum("nd,nd->n", apart, normals[kept])
    tail = max(3.0 * sigma, 2.0 * 1.4826 * float(np.median(np.abs(across))))
    robust = 1.0 / (1.0 + (across / tail) ** 2) ** 2
    root = np.sqrt(_INDEPENDENT * basis.trust[chosen[kept]] * robust) / sigma
    jacobian = np.concatenate([unknowns.modes[:, kept], unknowns.expressions[:, kept], -_pose_columns(places[kept])])
    rows = np.einsum("pnd,nd->np", jacobian, normals[kept]) * root[:, None]
    along = np.sqrt(_ALONG) * root
    flat = (jacobian * along[:, None]).reshape(len(jacobian), -1).T
    values = np.concatenate([across * root, (apart * along[:, None]).ravel()])
    return np.concatenate([rows, flat]), values, mask


def _landmark_rows(
    basis: HeadBasis, head: Array, scan: ScanData, frame: Similarity, unknowns: _Unknowns, stage: Stage
) -> tuple[Array, Array]:
    """Return weighted rows, (3 m, P + E + 7), and values, (3 m,), of the landmarks."""
    places = frame.apply(scan.places)
    apart = places - np.einsum("mcd,mc->md", head[scan.rows], scan.shares)
    sigma = np.where(scan.exact, _EXACT, np.hypot(stage.landmark_sigma, scan.spreads))
    robust = 1.0 / (1.0 + (np.linalg.norm(apart, axis=1) / (3.0 * sigma)) ** 2) ** 2
    root = np.sqrt(np.where(scan.exact, 1.0, _INDEPENDENT * robust)) / sigma
    modes, expressions = unknowns.at(basis, scan.rows, scan.shares)
    jacobian = np.concatenate([modes, expressions, -_pose_columns(places)])
    return (jacobian * root[:, None]).reshape(len(jacobian), -1).T, (apart * root[:, None]).ravel()


# Standard deviation of points that somebody has placed, in centimetres.
_EXACT = 0.15


def _pose_columns(places: Array) -> Array:
    """Return the motion of ``places``, (n, 3), by a small rotation, translation and growth, shape (7, n, 3)."""
    turns = np.cross(np.eye(3)[:, None], places[None])
    shifts = np.broadcast_to(np.eye(3)[:, None], turns.shape)
    return np.concatenate([turns, shifts, places[None]])


def _moved(frame: Similarity, pose: Array) -> Similarity:
    """Return ``frame`` followed by the small motion ``pose``, (7,)."""
    turn, growth = Rotation.from_rotvec(pose[:3]).as_matrix(), float(np.exp(np.clip(pose[6], -0.5, 0.5)))
    return Similarity(
        turn @ frame.rotation, growth * (turn @ frame.translation) + pose[3:6], np.asarray(growth * float(frame.scale))
    )


def _bounded(system: _System, free: NDArray[np.int64], held: Array | None) -> Array:
    """Return the minimiser of ½ θᵀHθ - gᵀθ with the unknowns ``free`` from 0 to 1, or with the values ``held``."""
    size = len(system.right)
    others = np.setdiff1d(np.arange(size), free)
    ridge = 1e-9 * float(np.trace(system.matrix)) / size
    factor = cho_factor(system.matrix[np.ix_(others, others)] + ridge * np.eye(len(others)))
    theta = np.zeros(size)
    cross = system.matrix[np.ix_(others, free)]
    if held is not None:
        theta[free] = held
    elif len(free):
        reduced = system.matrix[np.ix_(free, free)] - cross.T @ cho_solve(factor, cross)
        right = system.right[free] - cross.T @ cho_solve(factor, system.right[others])
        theta[free] = _within_bounds(reduced + ridge * np.eye(len(free)), right)
    theta[others] = cho_solve(factor, system.right[others] - cross @ theta[free])
    return theta


def _within_bounds(matrix: Array, right: Array) -> Array:
    """Return the minimiser of ½ xᵀ M x - rᵀ x over 0 ≤ x ≤ 1 by coordinate descent, which converges for definite M."""
    x = np.zeros(len(right))
    for _ in range(_SWEEPS):
        before = x.copy()
        for i in range(len(x)):
            x[i] = np.clip(x[i] + (right[i] - matrix[i] @ x) / matrix[i, i], 0.0, 1.0)
        if np.abs(x - before).max(initial=0.0) < _SETTLED:
            break
    return x
