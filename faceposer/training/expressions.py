"""Expression statistics from performances: the joint distribution of the ARKit weights.

The takes of one performer do not span the space of faces: left and right move as one, some shapes hardly occur, and
gaze and blinks correlate with whatever was said. The takes are therefore cleaned and augmented before a mixture is
fitted.
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
    """Parameters for learning statistics from performances.

    Attributes:
        rest_percentile: Percentile of each channel over a take that defines the performer's rest.
        jump: Largest change of a channel between frames, except blinks; beyond it frames count as tracking errors.
        n_examples: Number of augmented examples.
        halves: Share of examples with the upper face of another frame.
        sides: Share of examples with different strengths left and right.
        extras: Share of examples to which a single shape is added.
        n_components: Number K of factor analyzers.
        n_factors: Number q of factors of each.
        fit_shrinkage: Shrinkage of the fit; see ``MixtureOfFactorAnalyzers``.
        blend: Share of the covariance of all examples that is blended into each component's, after the fit.
        folds: Number of stretches of the performance, each held out once, that estimate the coupling of muscles.
        believed: Share of the estimated coupling that is used, since one performer's habits do not generalize.
        others: Share of examples from performances of other people, if there are any.
        n_kept: Number of examples that are stored.
        seed: Random seed.
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
    """Return the weights of a take relative to the performer's rest, without frames that jump, shape (F', S)."""
    return capture.without_jumps(recipe.jump).relative_to_rest(recipe.rest_percentile).weights


def mirror_indices(shape_names: Sequence[str]) -> NDArray[np.intp]:
    """Return the index of each shape's counterpart on the other side."""
    swap = {"Left": "Right", "Right": "Left"}
    indices = []
    for name in shape_names:
        end = next((side for side in swap if name.endswith(side)), None)
        other = name if end is None else name[: -len(end)] + swap[end]
        indices.append(list(shape_names).index(other))
    return np.array(indices, dtype=np.intp)


def augment(frames: Array, shape_names: Sequence[str], recipe: Recipe) -> Array:
    """Return ``n_examples`` examples, (n, S), augmented from the ``frames`` of a performance, (F, S).

    Frames are mirrored; the upper half of one is combined with the lower half of another; left and right get different
    strengths; gaze always comes from another frame; expressions are scaled to all strengths; and single shapes are
    added at random, since some hardly occur in a capture but are needed.
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
    """Return the coupling between regions in the ``frames`` of a performance, (F, S), as a matrix, (S, S).

    Each of ``recipe.folds`` stretches is predicted from the others. Stretches are contiguous because neighbouring
    frames are similar, and augmented like the examples of the prior.

    Args:
        frames: Cleaned frames, in temporal order.
        shape_names: Names of the S weights.
        recipe: Parameters of the augmentation.
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
        recipe: Parameters of the fit.
        credits: Source of the examples.
        coupling: Coupling of the regions, shape (S, S), from ``couple``; if None, they are independent.
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
    """Return at most ``kept`` evenly spaced indices below ``n``."""
    return np.linspace(0, n - 1, min(n, kept)).round().astype(np.intp)


def learn_from_frames(
    frames: Array,
    shape_names: Sequence[str],
    recipe: Recipe,
    credits: str = "",
    metric: Array | None = None,
    others: Sequence[Array] = (),
) -> ExpressionStatistics:
    """Return the statistics of cleaned ``frames``, (F, S), in temporal order, and of ``others``; see ``learn``."""
    examples = augment(add_others(frames, others, recipe), shape_names, recipe)
    return fit_statistics(examples, shape_names, recipe, credits, couple(frames, shape_names, recipe, metric))


def learn(
    captures: Sequence[Capture],
    recipe: Recipe | None = None,
    credits: str = "",
    metric: Array | None = None,
    others: Sequence[Sequence[Capture]] = (),
) -> ExpressionStatistics:
    """Return the statistics of performances, each relative to its own rest.

    The statistics cover all shapes of the captures and their counterparts on the other side. A shape without a channel
    in a capture is at rest there; a side without any channel is learned from the mirror image of the other.

    Args:
        captures: The performances.
        recipe: Parameters; the default ``Recipe`` if None.
        credits: Source of the performances.
        metric: Inner products of a face's shapes, shape (S, S), in which errors are measured; see ``learn_coupling``.
        others: Performances of other people, a sequence for each. They make up the share ``recipe.others`` of the
            examples, with equal parts for each person; the coupling is learned from ``captures`` alone.

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
    """Return ``frames``, (F, S), with the frames of ``others`` repeated to make up the share ``recipe.others``."""
    if not others or recipe.others <= 0:
        return frames
    count = round(recipe.others / (1.0 - recipe.others) * len(frames) / len(others))
    return np.concatenate([frames, *(other[np.arange(count) % len(other)] for other in others)])


def shapes_of(captures: Sequence[Capture]) -> tuple[str, ...]:
    """Return the shapes of all ``captures``, with their counterparts on the other side."""
    present = dict.fromkeys(name for capture in captures for name in capture.shape_names)
    for name in list(present):
        for side, other in (("Left", "Right"), ("Right", "Left")):
            if name.endswith(side):
                present[name.removesuffix(side) + other] = None
    known = [name for name in ARKIT_SHAPES if name in present]
    return (*known, *(name for name in present if name not in known))
