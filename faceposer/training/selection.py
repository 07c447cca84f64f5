"""Selection of the size of a mixture of factor analyzers by cross-validation."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.mixture import GaussianMixture
from faceposer.progress import Progress
from faceposer.training.mfa import MixtureOfFactorAnalyzers, convergence_recorded

Array = NDArray[np.float64]
Fold = tuple[Array, Array]

_COMPONENTS = (1, 2, 4, 8, 16, 24)
_FACTORS = (3, 6, 10)
_BLENDS = (0.2, 0.5, 0.8, 0.95)
# Least number of samples per component on average; with fewer, the components mostly fit noise.
_SAMPLES_PER_COMPONENT = 25
# Least gain in log-likelihood per frame of a larger mixture.
_WORTH = 0.02
NOISE = 1e-5
_NOT_CONVERGED = (
    "The mixture of the prior did not converge within the iteration limit. It is usable, but may fit the examples "
    "slightly less well."
)
# Least number of samples for cross-validation.
_FEWEST_TO_LEAVE_OUT = 4


@dataclass(frozen=True)
class Choice:
    """The size of a mixture.

    Attributes:
        n_components: Number of factor analyzers.
        n_factors: Number of factors of each.
        blend: Share of the covariance of all samples that is blended into each component's.
        held_out: Mean log-likelihood of held-out frames.
        one_gaussian: Mean log-likelihood of held-out frames under a single Gaussian.
        tried: All sizes that were compared, with their results.
        fixed: True if the user set the number of analyzers or of factors.
        converged: True if the final fit to all frames converged.
    """

    n_components: int
    n_factors: int
    blend: float
    held_out: float
    one_gaussian: float
    tried: tuple[dict[str, Any], ...] = ()
    fixed: bool = False
    converged: bool = True

    @property
    def warnings(self) -> list[str]:
        """Warnings about the fit for the summary of a character."""
        return [] if self.converged else [_NOT_CONVERGED]

    def as_json(self) -> dict[str, Any]:
        """Return the JSON form of the choice."""
        return {
            "components": self.n_components,
            "factors": self.n_factors,
            "blend": self.blend,
            "held_out_log_likelihood": round(self.held_out, 3),
            "one_gaussian": round(self.one_gaussian, 3),
            "fixed_by_user": self.fixed,
            "converged": self.converged,
            "tried": list(self.tried),
        }


def choose_mixture(
    folds: Sequence[Fold],
    progress: Progress,
    n_components: int | None = None,
    n_factors: int | None = None,
    shrinkage: float = 0.1,
    noise: float = NOISE,
) -> Choice:
    """Choose the size of a mixture that maximises the mean log-likelihood of held-out frames.

    The number of components is chosen first, then that of factors. Of equally good sizes, the smallest is chosen.

    Args:
        folds: Pairs of training samples, (n, d), and held-out samples, (m, d): takes, or contiguous blocks.
        progress: Progress to update.
        n_components: Number of components, if fixed by the user.
        n_factors: Number of factors, if fixed by the user.
        shrinkage: Shrinkage of the fit; see ``MixtureOfFactorAnalyzers``.
        noise: Least variance of the samples in any direction.

    Raises:
        FacePoserError: If a fixed number exceeds that of samples or dimensions.
    """
    n_samples, n_dimensions = min(len(train) for train, _ in folds), folds[0][0].shape[1]
    if n_components is not None and n_components > n_samples:
        raise FacePoserError(
            f"{n_components} factor analyzers are too many for {n_samples} examples (the rest are held out); set fewer "
            "with --components."
        )
    if n_factors is not None and n_factors > n_dimensions:
        raise FacePoserError(
            f"{n_factors} factors are too many for {n_dimensions} dimensions; set fewer with --factors."
        )
    most = max(1, n_samples // _SAMPLES_PER_COMPONENT)
    sizes = [k for k in _COMPONENTS if k <= most] if n_components is None else [n_components]
    factors = [q for q in _FACTORS if q < n_dimensions] or [max(1, n_dimensions - 1)]
    usual = factors[-1] if n_factors is None else n_factors
    tried: list[dict[str, Any]] = []
    best: tuple[float, int, int, float] | None = None
    gaussian = _evaluate(folds, 1, usual, shrinkage, noise)
    plan = [(k, usual) for k in sizes]
    done = 0
    while plan:
        k, q = plan.pop(0)
        score, blend = gaussian if (k, q) == (1, usual) else _evaluate(folds, k, q, shrinkage, noise)
        done += 1
        progress.at("Choosing the size of the prior", done / (len(sizes) + len(factors)))
        tried.append({"components": k, "factors": q, "blend": blend, "held_out": round(score, 3)})
        smaller = best is not None and k * q < best[1] * best[2]
        if best is None or score > best[0] + (-_WORTH if smaller else _WORTH):
            best = (score, k, q, blend)
        if not plan and n_factors is None and done == len(sizes):
            plan = [(best[1], other) for other in factors if other != usual]
    assert best is not None
    score, k, q, blend = best
    return Choice(
        k, q, blend, score, gaussian[0], tuple(tried), fixed=n_components is not None or n_factors is not None
    )


def _evaluate(
    folds: Sequence[Fold], n_components: int, n_factors: int, shrinkage: float, noise: float
) -> tuple[float, float]:
    """Return the best mean log-likelihood of the held-out frames over all blends, and the blend."""

    def log_likelihoods(fold: Fold) -> Array:
        train, left_out = fold
        fitted = MixtureOfFactorAnalyzers(
            min(n_components, len(train)),
            n_factors,
            shrinkage=shrinkage,
            reg_covar=noise,
            max_iter=30,
            tol=1e-2,
            random_state=0,
        ).fit(train)
        calm, covariances = calm_covariance(train, noise), fitted.covariances_
        mixtures = (
            GaussianMixture(fitted.weights_, fitted.means_, (1.0 - blend) * covariances + blend * calm)
            for blend in _BLENDS
        )
        return np.array([mixture.log_densities(left_out).sum() for mixture in mixtures])

    count = sum(len(left_out) for _, left_out in folds)
    # The fits end after few iterations, converged or not. NumPy releases the interpreter lock during multiplications.
    with convergence_recorded(), ThreadPoolExecutor(2) as pool:
        totals = np.sum([*pool.map(log_likelihoods, folds)], axis=0)
    best = int(np.argmax(totals))
    return float(totals[best] / count), _BLENDS[best]


def block_folds(samples: Array, n_blocks: int) -> list[Fold]:
    """Return folds that each hold out one of ``n_blocks`` contiguous blocks of ``samples``, (n, d).

    Very few samples give a single fold in which all serve as both training and held-out samples.
    """
    if len(samples) < _FEWEST_TO_LEAVE_OUT:
        return [(samples, samples)]
    blocks = np.array_split(np.arange(len(samples)), min(n_blocks, len(samples)))
    return [(np.delete(samples, block, axis=0), samples[block]) for block in blocks if len(block)]


def calm_covariance(samples: Array, noise: float = NOISE) -> Array:
    """Return the covariance of ``samples``, (n, d), with halved correlations and added ``noise``, shape (d, d).

    Few samples determine correlations poorly, and variances outside their span not at all.
    """
    covariance = np.cov(samples.T, bias=True).reshape(samples.shape[1], -1) + noise * np.eye(samples.shape[1])
    halved: Array = 0.5 * covariance + 0.5 * np.diag(np.diag(covariance))
    return halved
