"""A model learned from unregistered scans, by bootstrapping (Blanz and Vetter 1999, section 5).

1. Each scan is laid in correspondence: a model is fitted to it, which brings the template close, and non-rigid
   registration adds what lies outside of the model's span. The first model is the given one, or its mean with smooth
   deformations (`faceposer.identity.scans.smooth_modes`).
2. The heads are brought to one position and size, and their mean and principal components are a new model.
3. With it, all scans are fitted again. A few heads say little of how heads differ, so that the first model stays in it:
   with m heads, whose covariance is C, and the covariance C₀ of the first model, heads vary by (m C + κ C₀) / (m + κ),
   as if it had been learned from κ heads (the mean of an inverse Wishart distribution).
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import rigid_alignment
from faceposer.identity.model import IdentityModel
from faceposer.identity.scans.basis import HeadBasis, basis_of
from faceposer.identity.scans.detail import find_detail
from faceposer.identity.scans.fitting import STAGES, Stage, fit_head
from faceposer.identity.scans.head_from_scans import Scan, known_landmarks, marked_scan, read_scan
from faceposer.identity.scans.scan import placed_scan
from faceposer.identity.scans.smooth_modes import smooth_modes
from faceposer.progress import Progress

Array = NDArray[np.float64]

#: Maps a function over items, in order: `map`, or that of a pool of processes or a cluster.
Mapper = Callable[..., Iterable[Array]]

#: Fewest scans from which a model is learned.
FEWEST = 3
# κ: number of heads that the first model counts for.
_PRIOR_HEADS = 10.0
# Stages with smooth deformations, which know little of heads: expressions and segments would explain anything.
_SMOOTH_STAGES = (
    Stage(3, 0.2, None, 0.2, expressions=False),
    Stage(6, 0.5, 0.2, 0.2, (2.0, 1.0), expressions=False),
    Stage(6, 1.0, 0.08, 0.2, (1.0, 0.6), expressions=False),
    Stage(6, 1.0, 0.02, 0.2, (0.6, 0.3), expressions=False, by_scan=True),
)
# Rounds in which the heads are aligned with their mean.
_ALIGNMENTS = 3


@dataclass(frozen=True, eq=False)
class Work:
    """What one round needs of one scan.

    Attributes:
        scan: The scan with its landmarks.
        basis: The model.
        smooth: True if it has smooth deformations.
    """

    scan: Scan
    basis: HeadBasis
    smooth: bool


@dataclass(frozen=True, eq=False)
class LearnedModel:
    """A model, and the heads it was learned from.

    Attributes:
        model: The model.
        heads: The neutral heads of the scans in its frame, shape (m, N, 3).
    """

    model: IdentityModel
    heads: Array


def marked_file(path: str) -> Scan:
    """Return the scan in a file with its landmarks; a function of its own, for pools of processes.

    Raises:
        FacePoserError: If it cannot be read, or no face is found on it.
    """
    return marked_scan(read_scan(path), Progress())


def registered(work: Work) -> Array:
    """Return the neutral head of a scan in correspondence, in the frame of the model, shape (N, 3)."""
    basis, landmarks = work.basis, known_landmarks(work.scan)
    placed = placed_scan(basis, work.scan.mesh, landmarks, work.scan.name)
    fit = fit_head(basis, [placed.data], _SMOOTH_STAGES if work.smooth else STAGES)
    posed, offsets = fit.posed(0), basis.offsets(fit.scans[0].weights)
    detail = find_detail(basis, posed, offsets, placed.moved(fit.scans[0].frame))
    return fit.neutral + detail.offsets


def learning_rounds(
    scans: Sequence[Scan],
    start: IdentityModel,
    rounds: int = 3,
    n_modes: int | None = None,
    from_mean: bool = False,
    mapper: Mapper = map,
    progress: Progress | None = None,
) -> Iterator[LearnedModel]:
    """Yield the model after each round of learning from ``scans`` of different people.

    Args:
        scans: The scans with their landmarks, at least three.
        start: The model of the first round.
        rounds: Number of rounds.
        n_modes: Most modes; one less than the scans if None.
        from_mean: True to begin with the mean of ``start`` alone, which knows nothing of how heads differ.
        mapper: Maps `registered` over the scans of a round.
        progress: Progress to update.

    Raises:
        FacePoserError: If there are too few scans, or one cannot be registered.
        CancelledError: If the user has cancelled the work.
    """
    if len(scans) < FEWEST:
        raise FacePoserError(f"A model needs at least {FEWEST} scans; there are {len(scans)}.")
    progress = progress or Progress()
    basis = basis_of(start)
    if from_mean:
        basis = replace(basis, modes=smooth_modes(basis.mean, np.flatnonzero(basis.trust[: basis.n_control] > 0.0)))
    first, model = basis.modes, start
    share = len(scans) / (len(scans) + _PRIOR_HEADS)
    for number in range(rounds):
        if number:
            basis = basis_of(model)
            modes = np.concatenate([np.sqrt(share) * basis.modes, np.sqrt(1.0 - share) * first])
            basis = replace(basis, modes=modes)
        results: list[Array] = []
        for head in mapper(registered, [Work(scan, basis, from_mean) for scan in scans]):
            results.append(head)
            progress.at("Registering the scans", (number * len(scans) + len(results)) / (rounds * len(scans)))
        heads = aligned_heads(np.stack(results), basis.trust)
        model = _model_of(heads, start, n_modes)
        yield LearnedModel(model, heads)


def learn_model(
    scans: Sequence[Scan],
    start: IdentityModel,
    rounds: int = 3,
    n_modes: int | None = None,
    from_mean: bool = False,
    mapper: Mapper = map,
    progress: Progress | None = None,
) -> LearnedModel:
    """Return the last model of `learning_rounds`, whose arguments these are."""
    *_, last = learning_rounds(scans, start, max(rounds, 1), n_modes, from_mean, mapper, progress)
    return last


def aligned_heads(heads: Array, weights: Array) -> Array:
    """Return ``heads``, (m, N, 3), moved and scaled to their mean, by vertices with ``weights``, shape (N,)."""
    result = heads
    mean = heads[0]
    for _ in range(_ALIGNMENTS):
        result = np.stack([rigid_alignment(head, mean, weights, scale=True).apply(head) for head in heads])
        # The mean keeps the position and the size of the first head.
        mean = rigid_alignment(result.mean(axis=0), heads[0], weights, scale=True).apply(result.mean(axis=0))
    return result


def _model_of(heads: Array, start: IdentityModel, n_modes: int | None) -> IdentityModel:
    template = start.template
    assert template is not None
    names = f"Learned by Face Poser from {len(heads)} scans, on the topology of the built-in man."
    model = IdentityModel(n_modes or len(heads) - 1, template, start.segments, names)
    return model.fit(np.stack([template.control(head) for head in heads]))
