"""The size of a mixture of factor analyzers, chosen by what it makes of frames that it did not see."""

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
# Fewer samples than this for each component, on average, and most of what it learns is noise.
_SAMPLES_PER_COMPONENT = 25
# A larger mixture must be better by this much per frame, or the smaller one is taken.
_WORTH = 0.02
NOISE = 1e-5
_NOT_CONVERGED = (
    "The mixture of the prior had not converged when its learning ended: it can be used, and may fit the examples a "
    "little less well than it could."
)
# Of fewer samples nothing can be left out.
_FEWEST_TO_LEAVE_OUT = 4


@dataclass(frozen=True)
class Choice:
    """The size of a mixture.

    Attributes:
        n_components: Number of factor analyzers.
        n_factors: Number of factors of each.
        blend: Share of the covariance of all samples in each component's.
        held_out: Mean log-likelihood of frames that were left out.
        one_gaussian: The same of a single Gaussian.
        tried: All sizes that were tried, with their results.
        fixed: Whether the user set the number of analyzers or of factors.
        converged: Whether the fit of that size to all frames converged.
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
        """Sentences about the fit for the summary of a character."""
        return [] if self.converged else [_NOT_CONVERGED]

    def as_json(self) -> dict[str, Any]:
        """Return the choice for a JSON file."""
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
    """Return the size of a mixture that gives the frames left out the greatest mean log-likelihood.

    First the number of components is chosen, then that of factors; of sizes that are as good the smaller is taken.

    Args:
        folds: Pairs of samples to learn from, (n, d), and samples left out, (m, d): takes, or contiguous blocks.
        progress: Told how far it is.
        n_components: Taken as it is if given.
        n_factors: Likewise.
        shrinkage: Of the fit; see ``MixtureOfFactorAnalyzers``.
        noise: Least variance of the samples in any direction.

    Raises:
        FacePoserError: If more is wished than there are samples or dimensions.
    """
    n_samples, n_dimensions = min(len(train) for train, _ in folds), folds[0][0].shape[1]
    if n_components is not None and n_components > n_samples:
        raise FacePoserError(
            f"{n_components} factor analyzers are too many for {n_samples} examples (some are left out in turn); ask "
            "for fewer with --components."
        )
    if n_factors is not None and n_factors > n_dimensions:
        raise FacePoserError(
            f"{n_factors} factors are too many for {n_dimensions} dimensions; ask for fewer with --factors."
        )
    most = max(1, n_samples // _SAMPLES_PER_COMPONENT)
    sizes = [k for k in _COMPONENTS if k <= most] if n_components is None else [n_components]
    factors = [q for q in _FACTORS if q < n_dimensions] or [max(1, n_dimensions - 1)]
    usual = factors[-1] if n_factors is None else n_factors
    tried: list[dict[str, Any]] = []
    best: tuple[float, int, int, float] | None = None
    gaussian = _judge(folds, 1, usual, shrinkage, noise)
    plan = [(k, usual) for k in sizes]
    done = 0
    while plan:
        k, q = plan.pop(0)
        score, blend = gaussian if (k, q) == (1, usual) else _judge(folds, k, q, shrinkage, noise)
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


def _judge(
    folds: Sequence[Fold], n_components: int, n_factors: int, shrinkage: float, noise: float
) -> tuple[float, float]:
    """Return the mean log-likelihood of the frames left out and the blend that gives it."""

    def judge(fold: Fold) -> Array:
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
    # Sizes are compared after few iterations. NumPy leaves the interpreter free while it multiplies.
    with convergence_recorded(), ThreadPoolExecutor(2) as pool:
        totals = np.sum([*pool.map(judge, folds)], axis=0)
    best = int(np.argmax(totals))
    return float(totals[best] / count), _BLENDS[best]


def block_folds(samples: Array, n_blocks: int) -> list[Fold]:
    """Return folds that leave out one of ``n_blocks`` contiguous blocks of ``samples``, (n, d); none of very few."""
    if len(samples) < _FEWEST_TO_LEAVE_OUT:
        return [(samples, samples)]
    blocks = np.array_split(np.arange(len(samples)), min(n_blocks, len(samples)))
    return [(np.delete(samples, block, axis=0), samples[block]) for block in blocks if len(block)]


def calm_covariance(samples: Array, noise: float = NOISE) -> Array:
    """Return the covariance of ``samples``, (n, d), with the dimensions half as dependent and ``noise``, shape (d, d).

    Few samples say little of how two dimensions go together, and nothing of what lies across their span.
    """
    covariance = np.cov(samples.T, bias=True).reshape(samples.shape[1], -1) + noise * np.eye(samples.shape[1])
    halved: Array = 0.5 * covariance + 0.5 * np.diag(np.diag(covariance))
    return halved
