"""From performances to what is known of how the ARKit weights move together.

One performer's takes are not the space of faces: left and right move as one, some shapes hardly occur, gaze and blinks
go with whatever was said. They are therefore cleaned, then augmented, before a mixture is fitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.coupling import BROWS, GAZE, LIDS, learn_coupling, region_of_shape
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.muscles import mirrored_pairs, muscle_of_shape
from faceposer.training.capture import Capture
from faceposer.training.mfa import MixtureOfFactorAnalyzers

Array = NDArray[np.float64]

_ITERATIONS = 60


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
        folds: Number of stretches of the performance, each left out once, on which the coupling of muscles is judged.
        believed: Share of the coupling found that is believed: one performer's habits are not everybody's.
        others: Share of examples made of performances of other people, where there are any.
        n_kept: Number of examples that are kept as they are.
        seed: Of everything random.
    """

    rest_percentile: float = 5.0
    jump: float = 0.3
    n_examples: int = 12_000
    halves: float = 0.5
    sides: float = 0.5
    extras: float = 0.15
    n_components: int = 60
    n_factors: int = 20
    fit_shrinkage: float = 0.0
    blend: float = 0.0
    folds: int = 10
    believed: float = 0.85
    others: float = 0.25
    n_kept: int = 4000
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


def couple(frames: Array, shape_names: Sequence[str], recipe: Recipe, metric: Array | None = None) -> Array:
    """Return how far regions tell of each other in the ``frames`` of a performance, (F, S), as a matrix, (S, S).

    Each of ``recipe.folds`` contiguous stretches, for neighbouring frames are alike, is predicted from the others; both
    are augmented, since that is what the prior sees.

    Args:
        frames: Cleaned frames, in their order.
        shape_names: Names of the S weights.
        recipe: How examples are made of them.
        metric: See ``learn_coupling``.
    """
    rng = np.random.default_rng(recipe.seed)
    stretches = np.array_split(frames, recipe.folds)
    learned = replace(recipe, n_examples=max(recipe.n_examples // 2, 2))
    unseen = replace(recipe, n_examples=max(recipe.n_examples // 6, 2), seed=recipe.seed + 1)
    folds = []
    for i, stretch in enumerate(stretches):
        others = np.concatenate([other for j, other in enumerate(stretches) if j != i])
        tested = augment(stretch, shape_names, unseen)
        one, other = rng.integers(0, len(tested), (2, 2 * len(tested)))
        folds.append((augment(others, shape_names, learned), tested[one] - tested[other]))
    coupling = learn_coupling(folds, [muscle_of_shape(name) for name in shape_names], metric)
    return recipe.believed * coupling + (1.0 - recipe.believed) * mirrored_pairs(shape_names)


def fit_statistics(
    examples: Array, shape_names: Sequence[str], recipe: Recipe, credits: str, coupling: Array | None = None
) -> ExpressionStatistics:
    """Return the statistics of ``examples``, (n, S): their moments, and a mixture of factor analyzers.

    Args:
        examples: Augmented examples.
        shape_names: Names of the S weights.
        recipe: Of the fit.
        credits: Where the examples come from.
        coupling: Of the regions, shape (S, S), as ``couple`` returns it; if None, they are independent.
    """
    mixture = MixtureOfFactorAnalyzers(
        recipe.n_components,
        recipe.n_factors,
        shrinkage=recipe.fit_shrinkage,
        reg_covar=1e-5,
        max_iter=_ITERATIONS,
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
        tuple(muscle_of_shape(name) for name in shape_names),
        coupling,
        examples[_spaced(len(examples), recipe.n_kept)],
    )


def _spaced(n: int, kept: int) -> NDArray[np.intp]:
    """Return ``kept`` of the indices below ``n``, or all, evenly spaced."""
    return np.linspace(0, n - 1, min(n, kept)).round().astype(np.intp)


def learn_from_frames(
    frames: Array,
    shape_names: Sequence[str],
    recipe: Recipe,
    credits: str = "",
    metric: Array | None = None,
    others: Sequence[Array] = (),
) -> ExpressionStatistics:
    """Return the statistics of cleaned ``frames``, (F, S), in their order, and of the ``others``; see ``learn``."""
    examples = augment(add_others(frames, others, recipe), shape_names, recipe)
    return fit_statistics(examples, shape_names, recipe, credits, couple(frames, shape_names, recipe, metric))


def learn(
    captures: Sequence[Capture],
    recipe: Recipe | None = None,
    credits: str = "",
    metric: Array | None = None,
    others: Sequence[Sequence[Capture]] = (),
) -> ExpressionStatistics:
    """Return the statistics of performances by ``recipe``, each with a rest of its own.

    The statistics are of all shapes that some capture has, and of their counterparts on the other side. A shape rests
    in a capture that has no channel for it; a side that no capture has learns from the mirror image of the other.

    Args:
        captures: The performances.
        recipe: How they are learned from.
        credits: Where they come from.
        metric: Inner products of a face's shapes, shape (S, S), to measure errors by; see ``learn_coupling``.
        others: Performances of other people, a sequence for each. ``recipe.others`` of the examples are made of these,
            each person counting alike; the coupling is learned from ``captures`` alone.

    Raises:
        ValueError: If there is no capture.
    """
    recipe = recipe or Recipe()
    if not captures:
        raise ValueError("at least one capture is needed")
    shape_names = shapes_of(captures)

    def frames_of(takes: Sequence[Capture]) -> Array:
        return np.concatenate([clean(take.with_shapes(shape_names), recipe) for take in takes])

    frames = frames_of(captures)
    return learn_from_frames(frames, shape_names, recipe, credits, metric, [frames_of(takes) for takes in others])


def add_others(frames: Array, others: Sequence[Array], recipe: Recipe) -> Array:
    """Return ``frames``, (F, S), with those of ``others`` repeated so that they make up ``recipe.others`` of all."""
    if not others or recipe.others <= 0:
        return frames
    wanted = round(recipe.others / (1.0 - recipe.others) * len(frames) / len(others))
    return np.concatenate([frames, *(other[np.arange(wanted) % len(other)] for other in others)])


def shapes_of(captures: Sequence[Capture]) -> tuple[str, ...]:
    """Return the shapes that some of the ``captures`` have, with their counterparts on the other side."""
    present = dict.fromkeys(name for capture in captures for name in capture.shape_names)
    for name in list(present):
        for side, other in (("Left", "Right"), ("Right", "Left")):
            if name.endswith(side):
                present[name.removesuffix(side) + other] = None
    known = [name for name in ARKIT_SHAPES if name in present]
    return (*known, *(name for name in present if name not in known))
