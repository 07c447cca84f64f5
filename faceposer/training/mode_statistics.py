"""Prior of characters trained from examples: statistics of the weights of their principal modes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.model.coupling import learn_coupling
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.progress import Progress
from faceposer.training.mfa import MixtureOfFactorAnalyzers, convergence_recorded
from faceposer.training.modes import Modes
from faceposer.training.selection import Choice, Fold, block_folds, calm_covariance, choose_mixture

Array = NDArray[np.float64]

# Number of cross-validation blocks: more for few frames, so that enough remain for training.
_BLOCKS, _BLOCKS_OF_MANY, _MANY = 5, 3, 500
_MOST_TO_CHOOSE = 2000
_MOST_TO_FIT = 20_000
_SHRINKAGE = 0.1
_ITERATIONS = 60
# Least variance in any direction, relative to unit variance of the weights, so that no direction is impossible.
_NOISE = 0.02


def statistics_of_modes(
    modes: Modes, n_components: int | None, n_factors: int | None, progress: Progress
) -> tuple[ExpressionStatistics, Choice]:
    """Return the statistics of the weights of ``modes``, and the chosen size of their mixture.

    Args:
        modes: Modes with the examples' weights, in units of their standard deviations.
        n_components: Number of factor analyzers, chosen by cross-validation on contiguous blocks if None.
        n_factors: Number of factors of each, chosen likewise if None.
        progress: Progress to update.
    """
    samples = modes.weights
    step = max(1, len(samples) // _MOST_TO_CHOOSE)
    folds = block_folds(samples[::step], _BLOCKS_OF_MANY if len(samples) > _MANY else _BLOCKS)
    choice = choose_mixture(folds, progress, n_components, n_factors, _SHRINKAGE, _NOISE)
    progress.at("Learning the prior")
    mixture = MixtureOfFactorAnalyzers(
        choice.n_components,
        choice.n_factors,
        shrinkage=_SHRINKAGE,
        reg_covar=_NOISE,
        max_iter=_ITERATIONS,
        tol=1e-3,
        random_state=0,
    )
    with convergence_recorded():
        fitted = mixture.fit(samples[:: max(1, len(samples) // _MOST_TO_FIT)])
    covariance = calm_covariance(samples, _NOISE)
    statistics = ExpressionStatistics(
        modes.names,
        fitted.weights_,
        fitted.means_,
        (1.0 - choice.blend) * fitted.covariances_ + choice.blend * covariance,
        samples.mean(axis=0),
        covariance,
        "Learned from the user's example meshes.",
        modes.regions,
        learn_coupling(_with_differences(folds), modes.regions) if len(folds) > 1 else None,
    )
    return statistics, replace(choice, converged=fitted.converged_)


def _with_differences(folds: Sequence[Fold]) -> list[Fold]:
    """Return folds with the differences between held-out frames added to these."""
    changed = []
    for train, left_out in folds:
        others = np.roll(left_out, 1, axis=0)
        changed.append((train, np.concatenate([left_out, left_out - others]) if len(left_out) > 1 else left_out))
    return changed
