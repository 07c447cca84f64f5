"""From performances to what is known of how the ARKit weights move together.

One performer's takes are not the space of faces: left and right move as one, some shapes hardly occur, gaze and blinks
go with whatever was said. They are therefore cleaned, then augmented, before a mixture is fitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.capture import Capture
from faceposer.model.coupling import BROWS, GAZE, LIDS, region_of_shape
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.mfa import MixtureOfFactorAnalyzers
from faceposer.model.subject import ARKIT_SHAPES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recipe:
    """How statistics are made from performances.

    Attributes:
        rest_percentile: Percentile of each channel over a take that is taken for the performer's rest.
        jump: Frames in which a channel, blinks aside, changes by more than this are taken for tracking errors.
        n_examples: Number of augmented examples.
        halves: Share of examples whose upper face comes from another frame.
        sides: Share of examples whose left and right get different strengths.
        extras: Share of examples to which one shape is added by itself.
        n_components: Number K of factor analyzers.
        n_factors: Number q of factors of each.
        fit_shrinkage: Of the fit; see ``MixtureOfFactorAnalyzers``.
        blend: Share of the covariance of all examples in each component's, after the fit.
        seed: Of everything random.
    """

    rest_percentile: float = 5.0
    jump: float = 0.3
    n_examples: int = 12_000
    halves: float = 0.5
    sides: float = 0.5
    extras: float = 0.15
    n_components: int = 24
    n_factors: int = 10
    fit_shrinkage: float = 0.1
    blend: float = 0.5
    seed: int = 0


def clean(capture: Capture, recipe: Recipe) -> Array:
    """Return the weights of a take, (F', S), above the performer's rest, without frames that jump."""
    return capture.without_jumps(recipe.jump).from_rest(recipe.rest_percentile).weights


def mirror_indices(shape_names: Sequence[str]) -> NDArray[np.intp]:
    """Return, for each shape, the index of the same shape of the other side."""
    swap = {"Left": "Right", "Right": "Left"}
    indices = []
    for name in shape_names:
        end = next((side for side in swap if name.endswith(side)), None)
        other = name if end is None else name[: -len(end)] + swap[end]
        indices.append(list(shape_names).index(other))
    return np.array(indices, dtype=np.intp)


def augment(frames: Array, shape_names: Sequence[str], recipe: Recipe) -> Array:
    """Return ``n_examples`` examples, (n, S), made from the ``frames`` of a performance, (F, S).

    Frames are mirrored; the upper half of one goes with the lower half of another; left and right get different
    strengths; gaze comes from elsewhere always; expressions come in all strengths down to none; and now and then one
    shape is added by itself, since some hardly occur in a capture but must be to hand.
    """
    rng = np.random.default_rng(recipe.seed)
    n = recipe.n_examples
    regions = np.array([region_of_shape(name) for name in shape_names])
    lower, upper, eyes = (frames[rng.integers(0, len(frames), n)] for _ in range(3))
    examples: Array = lower.copy()

    other_half = rng.random(n) < recipe.halves
    is_upper = np.isin(regions, [BROWS, LIDS])
    examples[np.ix_(other_half, is_upper)] = upper[np.ix_(other_half, is_upper)]
    examples[:, regions == GAZE] = eyes[:, regions == GAZE]

    uneven = rng.random(n) < recipe.sides
    strengths = rng.uniform(0.2, 1.0, (2, n, 1))
    for side, strength in zip(("Left", "Right"), strengths, strict=True):
        on_side = np.array([name.endswith(side) for name in shape_names])
        examples[np.ix_(uneven, on_side)] *= strength[uneven]

    mirrored = rng.random(n) < 0.5
    examples[mirrored] = examples[mirrored][:, mirror_indices(shape_names)]
    examples *= np.sqrt(rng.uniform(0.0, 1.1, (n, 1)))

    alone = np.flatnonzero(rng.random(n) < recipe.extras)
    examples[alone, rng.integers(0, len(shape_names), len(alone))] += rng.uniform(0.0, 0.8, len(alone))
    return np.clip(examples, 0.0, 1.0)


def fit_statistics(examples: Array, shape_names: Sequence[str], recipe: Recipe, credits: str) -> ExpressionStatistics:
    """Return the statistics of ``examples``, (n, S): their moments, and a mixture of factor analyzers."""
    mixture = MixtureOfFactorAnalyzers(
        recipe.n_components,
        recipe.n_factors,
        shrinkage=recipe.fit_shrinkage,
        reg_covar=1e-5,
        max_iter=60,
        tol=1e-3,
        random_state=recipe.seed,
    ).fit(examples)
    covariance = np.cov(examples.T) + 1e-5 * np.eye(examples.shape[1])
    return ExpressionStatistics(
        tuple(shape_names),
        mixture.weights_,
        mixture.means_,
        (1.0 - recipe.blend) * mixture.covariances_ + recipe.blend * covariance,
        examples.mean(axis=0),
        covariance,
        credits,
    )


def learn(captures: Sequence[Capture], recipe: Recipe | None = None, credits: str = "") -> ExpressionStatistics:
    """Return the statistics of performances by ``recipe``, each with a rest of its own.

    The statistics are of all shapes that some capture has, and of their counterparts on the other side. A shape rests
    in a capture that has no channel for it; a side that no capture has learns from the mirror image of the other.

    Raises:
        ValueError: If there is no capture.
    """
    recipe = recipe or Recipe()
    if not captures:
        raise ValueError("at least one capture is needed")
    shape_names = shapes_of(captures)
    frames = np.concatenate([clean(capture.with_shapes(shape_names), recipe) for capture in captures])
    return fit_statistics(augment(frames, shape_names, recipe), shape_names, recipe, credits)


def shapes_of(captures: Sequence[Capture]) -> tuple[str, ...]:
    """Return the shapes that some of the ``captures`` have, with their counterparts on the other side."""
    present = dict.fromkeys(name for capture in captures for name in capture.shape_names)
    for name in list(present):
        for side, other in (("Left", "Right"), ("Right", "Left")):
            if name.endswith(side):
                present[name.removesuffix(side) + other] = None
    known = [name for name in ARKIT_SHAPES if name in present]
    return (*known, *(name for name in present if name not in known))
