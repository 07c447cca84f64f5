"""Maximum a posteriori fit of a linear model of heads to scans with landmarks, coarse to fine.

With the coefficients b of a head x(b) and, of each scan j, the weights w_j of expressions and the similarity T_j from
the scan to the model's frame, the fit minimises half of

    Σ_j Σ_v r_v ((n_v · (x_v(b, w_j) - T_j c_v))² + κ ‖x_v - T_j c_v‖²) / s²     closest points c_v with normals n_v
    + Σ_j Σ_l ‖x_l(b, w_j) - T_j p_l‖² / s_l²                                    landmarks p_l
    + ‖b‖² + Σ_k ‖β_k‖² / τ² + Σ_j Σ_e 2 λ w_je / m_e                            prior

(Blanz and Vetter 1999, sections 3 and 4, with distances in place of grey values). In the last stages, v are the scan's
vertices and c_v their closest points on the head, κ is 0, and s is estimated from the distances; if these are still
large, each segment k gets its own coefficients b + β_k, blended by a partition of unity. The weights 0 ≤ w ≤ 1 have an
exponential prior in terms of their means m, under which most are zero, so that a neutral face is not explained by
expressions. In each round, closest points and their weights r are fixed and T is linear in a small rotation,
translation and scale; the normal equations are solved for all unknowns at once, those of w with bounds.

r is the trust of the vertex, 0 where the closest point is far, faces another way or lies at a border, and falls with
the residual as in the M-estimator of Geman and McClure, as hair and clothes lie on the scan but not on the model. It
contains the share of independent errors, since those of neighbours are alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.identity.scan_surface import ScanSurface
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.equations import System, bounded, moved, pose_columns
from faceposer.identity.scans.residuals import INDEPENDENT, Unknowns, from_head, from_scan
from faceposer.progress import Progress

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Rate of the exponential prior of the weights of expressions, as a multiple of the inverse of their means.
_RATE = 1.0
# Standard deviation of points that somebody has placed, in centimetres.
_EXACT = 0.15


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
        by_scan: True if the scan's vertices are laid on the head, with a standard deviation that is estimated, and is
            ``surface_sigma`` at least; False if the head's vertices are laid on the scan.
        above: The stage is left out if the distances before it have a smaller standard deviation, in centimetres.
    """

    rounds: int
    modes: float
    surface_sigma: float | None
    landmark_sigma: float
    farthest: tuple[float, float] = (2.0, 2.0)
    expressions: bool = True
    segments: bool = False
    by_scan: bool = False
    above: float = 0.0


STAGES = (
    Stage(3, 0.2, None, 0.35),
    Stage(6, 0.4, 0.2, 0.4, (2.0, 1.0)),
    Stage(6, 1.0, 0.08, 0.5, (1.0, 0.6)),
    Stage(6, 1.0, 0.04, 0.8, (0.6, 0.4)),
    Stage(6, 1.0, 0.004, 3.0, (0.4, 0.2), by_scan=True),
    Stage(4, 1.0, 0.008, 0.8, (0.3, 0.3), expressions=False, segments=True, above=0.015),
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
        spread: Standard deviation of the distances between the surfaces in the last round, in centimetres.
    """

    frame: Similarity
    weights: Array
    used: Mask
    spread: float = float("inf")


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
    watch: Callable[[HeadFit], None] | None = None,
) -> HeadFit:
    """Return the most likely head of ``scans`` of one person; ``watch`` is called with the fit after each round.

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
        if max(state.spread for state in fit.scans) < stage.above:
            continue
        unknowns = Unknowns.of(basis, max(1, round(stage.modes * n_modes)), stage.segments, chosen)
        for number in range(stage.rounds):
            progress.at("Fitting the model", done / total)
            share = number / max(stage.rounds - 1, 1)
            farthest = stage.farthest[0] * (stage.farthest[1] / stage.farthest[0]) ** share
            fit = _round(fit, scans, stage, unknowns, chosen, farthest)
            done += 1
            if watch is not None:
                watch(fit)
    return fit


def _round(
    fit: HeadFit,
    scans: Sequence[ScanData],
    stage: Stage,
    unknowns: Unknowns,
    chosen: NDArray[np.int64],
    farthest: float,
) -> HeadFit:
    basis = fit.basis
    n_shape, n_weights = len(unknowns.modes), len(basis.expressions)
    each = n_weights + 7
    system = System(n_shape + each * len(scans))
    neutral = fit.neutral
    current = np.concatenate([fit.shape[: unknowns.n_modes], *(fit.local if unknowns.segments else ())])
    measured = []
    for j, (scan, before) in enumerate(zip(scans, fit.scans, strict=True)):
        state = before
        own = np.arange(n_shape + each * j, n_shape + each * (j + 1))
        where = np.concatenate([np.arange(n_shape), own])
        head = neutral + basis.offsets(state.weights)
        known = np.concatenate([current, state.weights, np.zeros(7)])
        sigma = stage.surface_sigma
        if sigma is not None:
            if stage.by_scan:
                rows = from_scan(basis, head, scan.surface, state.frame, unknowns, sigma, farthest)
            else:
                rows = from_head(basis, head, scan.surface, state.frame, unknowns, chosen, sigma, farthest)
            state = replace(state, used=rows.used, spread=rows.spread)
            system.add(where, rows.columns, rows.values + rows.columns @ known)
        measured.append(state)
        columns, values = _landmark_rows(basis, head, scan, state.frame, unknowns, stage)
        system.add(where, columns, values + columns @ known)
    system.matrix[np.arange(n_shape), np.arange(n_shape)] += unknowns.precision
    firsts = n_shape + each * np.arange(len(scans))
    free = np.concatenate([first + np.arange(n_weights) for first in firsts])
    system.right[free] -= np.tile(_RATE / basis.expression_means, len(scans))
    system.matrix[free, free] += 1.0
    held = None if stage.expressions else np.concatenate([state.weights for state in fit.scans])
    theta = bounded(system, free, held)
    shape, local = np.zeros(len(basis.modes)), np.zeros_like(fit.local)
    shape[: unknowns.n_modes] = theta[: unknowns.n_modes]
    if unknowns.segments:
        local = theta[unknowns.n_modes : n_shape].reshape(fit.local.shape)
    states = []
    for first, state in zip(firsts, measured, strict=True):
        weights, pose = theta[first : first + n_weights], theta[first + n_weights : first + each]
        states.append(replace(state, frame=moved(state.frame, pose), weights=weights))
    return replace(fit, shape=shape, local=local, scans=tuple(states))


def _landmark_rows(
    basis: HeadBasis, head: Array, scan: ScanData, frame: Similarity, unknowns: Unknowns, stage: Stage
) -> tuple[Array, Array]:
    """Return weighted rows, (3 m, P + E + 7), and values, (3 m,), of the landmarks."""
    places = frame.apply(scan.places)
    apart = places - np.einsum("mcd,mc->md", head[scan.rows], scan.shares)
    sigma = np.where(scan.exact, _EXACT, np.hypot(stage.landmark_sigma, scan.spreads))
    robust = 1.0 / (1.0 + (np.linalg.norm(apart, axis=1) / (3.0 * sigma)) ** 2) ** 2
    root = np.sqrt(np.where(scan.exact, 1.0, INDEPENDENT * robust)) / sigma
    modes, expressions = unknowns.at(basis, scan.rows, scan.shares)
    jacobian = np.concatenate([modes, expressions, -pose_columns(places)])
    return (jacobian * root[:, None]).reshape(len(jacobian), -1).T, (apart * root[:, None]).ravel()
