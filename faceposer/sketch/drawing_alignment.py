"""Alignment of a drawing to a face by a similarity in the image, and joint assignment of its strokes to features.

The samples of a stroke are linear in the similarity theta = (s cos a, s sin a, x, y). The log ratio of the densities of
a feature and of a stroke that depicts nothing is thus quadratic in theta: it is evaluated for thousands of similarities
by one product of matrices, and the best similarity of an assignment is the solution of four equations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from faceposer.progress import Progress
from faceposer.sketch.feature_templates import Gaussian, mutually_exclusive, variants_of

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Divides log ratios, since the errors of samples are less independent than assumed.
_TEMPERATURE = 2.0
# Largest rotation of a drawing and its standard deviation, in radians.
_STEEPEST, _TILT = 0.6, 0.12
# Size of a drawing in units of the hand: the face has 720.
_SMALLEST, _LARGEST = 300.0, 6000.0
# Numbers of strokes from which similarities are proposed, of proposals refined, and of rounds of refinement.
_PROPOSING, _REFINED, _ROUNDS = 60, 40, 12
_CHUNK = 256
# Least and greatest width of a stroke as a share of that of its feature.
_NARROWEST, _WIDEST = 0.28, 3.0
# Rounds of the fixed-point iteration for the scale.
_GROWTHS = 5
#: Number of independent coordinates of a stroke; those of its samples are not, because strokes are smooth.
DIMENSIONS = 7.0
#: The usual similarity of a drawing whose size is 1, about its middle.
USUAL = np.array([650.0, 0.0, 0.0, 0.0])
# Features of both sides by whose pairs similarities are proposed.
_PAIRED = ("brow", "upper lid", "lower lid", "eye outline")
# Prior log odds of a feature in a drawing, and of one that is rarely drawn.
_ODDS, _RARE = -1.0, {"cheek line": -2.5, "inner upper lip": -1.5, "inner lower lip": -1.5}


@dataclass(frozen=True)
class Assignment:
    """Strokes with their features.

    Attributes:
        features: Index of a stroke by feature.
        score: Log ratio of the assignment to that of no feature at all.
    """

    features: Mapping[str, int]
    score: float


class StrokeEvidence:
    """Log ratios of all strokes and features as functions of the similarity."""

    def __init__(
        self,
        lines: Sequence[Array],
        density: Mapping[str, Gaussian],
        closed: Mapping[str, bool],
        nothing: Gaussian,
        known: Mapping[int, str],
    ) -> None:
        """Prepare the quadratics.

        Args:
            lines: Lines of a drawing, each of shape (n, 2).
            density: Density of each feature.
            closed: True for features that end where they begin.
            nothing: Density of strokes that depict no feature.
            known: Features of strokes that are known.
        """
        self.names = tuple(density)
        self.count = len(lines)
        rows, strokes, allowed = [], [], []
        for i, line in enumerate(lines):
            is_closed, variants = variants_of(line)
            for samples in variants:
                rows.append(samples)
                strokes.append(i)
                wanted = known.get(i)
                allowed.append([closed[n] == is_closed if wanted is None else n == wanted for n in self.names])
        self.stroke = np.array(strokes, dtype=np.intp)
        self.allowed = np.array(allowed, dtype=bool).reshape(len(rows), len(self.names))
        self.samples = np.stack(rows)
        moves = np.stack([stroke_moves(samples) for samples in rows])
        self._widths = np.array([np.ptp(gaussian.mean.reshape(-1, 2)[:, 0]) for gaussian in density.values()])
        systems, rights, constants = [], [], []
        for gaussian in density.values():
            pulled = gaussian.precision @ moves
            systems.append(np.einsum("ria,rib->rab", moves, pulled))
            rights.append(np.einsum("ria,i->ra", pulled, gaussian.mean))
            constants.append(float(gaussian.mean @ gaussian.precision @ gaussian.mean) - 2.0 * gaussian.log_peak)
        self.systems, self.rights = np.stack(systems, axis=1), np.stack(rights, axis=1)
        places = moves @ USUAL
        other = nothing.log_peak - 0.5 * np.einsum("ri,ij,rj->r", places, nothing.precision, places)
        odds = np.array([_RARE.get(name.removeprefix("left ").removeprefix("right "), _ODDS) for name in self.names])
        constant = (-0.5 * np.array(constants) - other[:, None]) / _TEMPERATURE + odds
        a, b = np.triu_indices(4)
        quadratic = -0.5 * self.systems[..., a, b] * np.where(a == b, 1.0, 2.0) / _TEMPERATURE
        self._coefficients = np.concatenate([quadratic, self.rights / _TEMPERATURE, constant[..., None]], axis=-1)

    def ratios(self, thetas: Array) -> Array:
        """Return the log ratios under each of ``thetas``, (h, 4): shape (h, rows, features), -inf where excluded."""
        i, j = np.triu_indices(4)
        monomials = np.concatenate([thetas[:, i] * thetas[:, j], thetas, np.ones((len(thetas), 1))], axis=1)
        flat = monomials @ self._coefficients.reshape(-1, 15).T
        ratios = flat.reshape(len(thetas), *self.allowed.shape)
        ratios += (DIMENSIONS / _TEMPERATURE * log_size(thetas))[:, None, None]
        ratios[:, ~self.allowed] = -np.inf
        return ratios

    def by_stroke(self, theta: Array) -> Array:
        """Return the log ratios of strokes and features under ``theta``, the best order of each stroke.

        They are -inf for strokes that are far too narrow or wide, such as wrinkles beside the mouth for a lip.
        """
        ratios = self.ratios(theta[None])[0]
        turned = self.samples[..., 0] * theta[0] - self.samples[..., 1] * theta[1]
        shares = np.ptp(turned, axis=1)[:, None] / self._widths
        ratios[(shares < _NARROWEST) | (shares > _WIDEST)] = -np.inf
        found = np.full((self.count, len(self.names)), -np.inf)
        np.maximum.at(found, self.stroke, ratios)
        return found

    def proposals(self) -> Array:
        """Return similarities by which one stroke, or a pair of strokes, is a feature, or a pair; shape (h, 4)."""
        rows = np.arange(len(self.stroke))
        if self.count > _PROPOSING:
            chosen = np.random.default_rng(0).permutation(self.count)[:_PROPOSING]
            rows = rows[np.isin(self.stroke, chosen)]
        spans = np.maximum(np.linalg.norm(np.ptp(self.samples, axis=1), axis=1), 1e-9)
        found = []
        row, feature = np.nonzero(self.allowed[rows])
        row = rows[row]
        found.append(solved(self.systems[row, feature], self.rights[row, feature], DIMENSIONS))
        index = {name: i for i, name in enumerate(self.names)}
        for pair in _PAIRED:
            left, right = index.get(f"left {pair}"), index.get(f"right {pair}")
            if left is None or right is None:
                continue
            a, b = np.meshgrid(rows[self.allowed[rows, left]], rows[self.allowed[rows, right]], indexing="ij")
            ratio = spans[a] / spans[b]
            apart = (self.stroke[a] != self.stroke[b]) & (ratio < 1.8) & (ratio > 1.0 / 1.8)
            a, b = a[apart], b[apart]
            systems = self.systems[a, left] + self.systems[b, right]
            found.append(solved(systems, self.rights[a, left] + self.rights[b, right], 2 * DIMENSIONS))
        return np.concatenate(found)

    def refined(self, theta: Array) -> Array:
        """Return ``theta`` after rounds of expectation-maximisation over assignment and similarity."""
        for _ in range(_ROUNDS):
            ratios = self.ratios(theta[None])[0]
            top = np.zeros(self.count)
            np.maximum.at(top, self.stroke, ratios.max(axis=1))
            shares = np.exp(ratios - top[self.stroke, None])
            totals = np.exp(-top)
            np.add.at(totals, self.stroke, shares.sum(axis=1))
            shares /= totals[self.stroke, None]
            # No feature is drawn twice.
            shares /= np.maximum(shares.sum(axis=0), 1.0)
            if shares.sum() < 1e-3:
                return theta
            theta = self.solved(shares)
        return theta

    def solved(self, shares: Array) -> Array:
        """Return the similarity that suits the assignment with these ``shares``, (rows, features)."""
        system = np.einsum("rf,rfab->ab", shares, self.systems)
        right = np.einsum("rf,rfa->a", shares, self.rights)
        return solved(system[None], right[None], float(shares.sum()) * DIMENSIONS)[0]

    def rows_of(self, features: Mapping[str, int], theta: Array) -> dict[str, int]:
        """Return the row of each stroke of ``features`` whose order of samples suits it best under ``theta``."""
        ratios = self.ratios(theta[None])[0]
        found = {}
        for name, stroke in features.items():
            rows = np.flatnonzero(self.stroke == stroke)
            found[name] = int(rows[int(np.argmax(ratios[rows, self.names.index(name)]))])
        return found

    def of_assignment(self, assignment: Assignment, theta: Array) -> Array:
        """Return the similarity that suits ``assignment``, with the orders of strokes that are best under ``theta``."""
        shares = np.zeros(self.allowed.shape)
        for name, row in self.rows_of(assignment.features, theta).items():
            shares[row, self.names.index(name)] = 1.0
        return self.solved(shares) if shares.any() else theta


def aligned(evidence: StrokeEvidence, progress: Progress) -> list[tuple[Array, Assignment]]:
    """Return similarities with assignments of great joint probability, the best first, as if features were independent.

    Args:
        evidence: The evidence of the strokes of a drawing whose size is 1.
        progress: Receives the progress.
    """
    thetas = _distinct(_plausible(evidence.proposals()))
    scores = [np.zeros(0)]
    for i in range(0, len(thetas), _CHUNK):
        progress.at("Aligning the drawing", 0.4 * i / len(thetas))
        part = thetas[i : i + _CHUNK]
        scores.append(_bound(evidence.ratios(part)) + _log_prior(part))
    order = np.argsort(-np.concatenate(scores), kind="stable")[:_REFINED]
    found = []
    for i, theta in enumerate(thetas[order]):
        progress.at("Aligning the drawing", 0.4 + 0.3 * i / len(order))
        for fitted in _plausible(evidence.refined(theta)[None]):
            found.append((fitted, assigned(evidence.by_stroke(fitted), evidence.names)))
    found.sort(key=lambda pair: -pair[1].score)
    kept: list[tuple[Array, Assignment]] = []
    for theta, assignment in found:
        if all(dict(assignment.features) != dict(other.features) for _, other in kept):
            kept.append((theta, assignment))
    return kept


def assigned(ratios: Array, names: Sequence[str]) -> Assignment:
    """Return the assignment of strokes to features of greatest joint probability, each at most once.

    Args:
        ratios: Log ratios of strokes and features, shape (strokes, features).
        names: Names of the features.
    """
    # Imported late to shorten the start of the window.
    from scipy.optimize import linear_sum_assignment  # noqa: TID251  # an assignment, not a pose

    best = Assignment({}, 0.0)
    exclusive = [pair for pair in mutually_exclusive(names) if _drawn(ratios, names, pair[0])]
    for choice in product((0, 1), repeat=len(exclusive)):
        left_out: set[str] = set()
        for pair, kept in zip(exclusive, choice, strict=True):
            left_out |= pair[1 - kept]
        columns = [i for i, name in enumerate(names) if name not in left_out]
        # The line along the closed mouth and the outline of the lips share no component, but both may be drawn.
        gains = np.maximum(ratios[:, columns], 0.0)
        strokes, features = linear_sum_assignment(-gains)
        chosen = [(names[columns[f]], int(s)) for s, f in zip(strokes, features, strict=True) if gains[s, f] > 0.0]
        score = float(sum(gains[s, f] for s, f in zip(strokes, features, strict=True)))
        if score > best.score:
            best = Assignment(dict(chosen), score)
    return best


def _drawn(ratios: Array, names: Sequence[str], wanted: frozenset[str]) -> bool:
    return any(ratios[:, i].max(initial=-np.inf) > 0.0 for i, name in enumerate(names) if name in wanted)


def similar(points: Array, theta: Array) -> Array:
    """Return ``points``, shape (n, 2), moved by the similarity ``theta``."""
    a, b, x, y = theta
    return points @ np.array([[a, b], [-b, a]]) + np.array([x, y])


def stroke_moves(samples: Array) -> Array:
    """Return the derivatives of moved ``samples`` by the similarity, shape (2 SAMPLES, 4)."""
    x, y = samples.T
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.stack([x, -y, one, zero, y, x, zero, one], axis=1).reshape(-1, 4)


def log_size(thetas: Array) -> Array:
    """Return the logarithm of the scale of each of ``thetas``, (h, 4), relative to the usual one."""
    return np.asarray(np.log(np.maximum(np.hypot(thetas[:, 0], thetas[:, 1]), 1e-9) / USUAL[0]))


def solved(systems: Array, rights: Array, dimensions: float) -> Array:
    """Return the similarities of greatest density in the drawing, shape (h, 4).

    The density of a stroke in the drawing is that in the face times the scale to the power of its ``dimensions``,
    without which small drawings would be the most probable. The equations are solved by fixed-point iteration.

    Args:
        systems: Sums of the matrices of the quadratics, shape (h, 4, 4).
        rights: Their right sides, shape (h, 4).
        dimensions: Number of coordinates of the strokes.
    """
    scale = np.trace(systems, axis1=1, axis2=2)[:, None, None]
    inverse = np.linalg.inv(systems + 1e-9 * scale * np.eye(4))
    plain = thetas = np.einsum("hab,hb->ha", inverse, rights)
    for _ in range(_GROWTHS):
        squared = np.maximum((thetas[:, :2] ** 2).sum(axis=1, keepdims=True), 1.0)
        grown = np.zeros_like(thetas)
        grown[:, :2] = dimensions * thetas[:, :2] / squared
        thetas = plain + np.einsum("hab,hb->ha", inverse, grown)
    return thetas


def _plausible(thetas: Array) -> Array:
    """Return those of ``thetas`` that hardly turn a drawing whose size is 1 and make it about as large as a face."""
    size = np.hypot(thetas[:, 0], thetas[:, 1])
    turn = np.abs(np.arctan2(thetas[:, 1], thetas[:, 0]))
    return thetas[np.isfinite(thetas).all(axis=1) & (size > _SMALLEST) & (size < _LARGEST) & (turn < _STEEPEST)]


def _log_prior(thetas: Array) -> Array:
    return np.asarray(-0.5 * (np.arctan2(thetas[:, 1], thetas[:, 0]) / _TILT) ** 2)


def _bound(ratios: Array) -> Array:
    """Return a bound on the score of an assignment for each similarity; ``ratios`` has shape (h, rows, features)."""
    gains = np.maximum(ratios, 0.0)
    # Rows of one stroke follow each other, but the best of a feature needs no grouping.
    return np.asarray(gains.max(axis=1, initial=0.0).sum(axis=1))


def _distinct(thetas: Array) -> Array:
    """Return one of each group of similar ``thetas``."""
    size = np.hypot(thetas[:, 0], thetas[:, 1])
    turn = np.arctan2(thetas[:, 1], thetas[:, 0])
    coarse = np.stack([np.log(size) / 0.06, turn / 0.06, thetas[:, 2] / 12.0, thetas[:, 3] / 12.0], axis=1).round()
    return thetas[np.sort(np.unique(coarse, axis=0, return_index=True)[1])]
