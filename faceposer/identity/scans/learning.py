"""A model learned from unregistered scans, by bootstrapping (Blanz and Vetter 1999, section 5).

1. Each scan is laid in correspondence: by a model, whose fit brings the template close, or in the first round without
   one by landmarks alone; then by non-rigid registration, which adds what lies outside of the model's span.
2. The heads are brought to one position and size, and their mean and principal components are a new model.
3. With it, all scans are fitted again. A model that knows more of the heads gets their features into correspondence
   where closest points alone would let them slide, and so does the next one.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import rigid_alignment
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.model import IdentityModel
from faceposer.identity.registration import LandmarkPairs, RegistrationSettings, register
from faceposer.identity.scans.basis import HeadBasis, basis_of
from faceposer.identity.scans.detail import IDENTITY, faded, find_detail
from faceposer.identity.scans.fitting import Stage, fit_head
from faceposer.identity.scans.head_from_scans import Scan, known_landmarks, marked_scan, read_scan
from faceposer.identity.scans.scan import placed_scan
from faceposer.progress import Progress

Array = NDArray[np.float64]

#: Maps a function over items, in order: `map`, or that of a pool of processes or a cluster.
Mapper = Callable[..., Iterable[Array]]

#: Fewest scans from which a model is learned.
FEWEST = 3
# Registration without a model, from the landmarks alone.
_BY_LANDMARKS = RegistrationSettings(
    stiffness=(3000.0, 1000.0, 300.0, 100.0, 30.0), rounds=2, landmark_weight=3.0, farthest=(1.5, 0.5), ridge=3.0
)
# Farthest that a landmark may lie from the mean head's, and the spread that halves its weight, in centimetres.
_FARTHEST, _USUAL = 1.5, 0.2
# Stages with a model that is still young: its few modes leave more, so that the surface is followed less closely.
_STAGES = (
    Stage(3, 0.4, None, 0.35),
    Stage(5, 1.0, 0.2, 0.4, (2.0, 1.0)),
    Stage(6, 1.0, 0.1, 0.5, (1.0, 0.6), expressions=False),
    Stage(6, 1.0, 0.05, 0.6, (0.6, 0.4), expressions=False),
)
# Rounds in which the heads are aligned with their mean.
_ALIGNMENTS = 3


@dataclass(frozen=True, eq=False)
class Work:
    """What one round needs of one scan.

    Attributes:
        scan: The scan with its landmarks.
        basis: The model, or the mean alone.
        by_model: False in a first round without a model.
    """

    scan: Scan
    basis: HeadBasis
    by_model: bool


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
    if work.by_model:
        fit = fit_head(basis, [placed.data], _STAGES)
        posed, offsets = fit.posed(0), basis.offsets(fit.scans[0].weights)
        detail = find_detail(basis, posed, offsets, placed.moved(fit.scans[0].frame))
        return fit.neutral + detail.offsets
    data = placed.data
    template = TriangleMesh(basis.mean, basis.triangles)
    on_skin = np.flatnonzero(basis.on_skin & np.isfinite(landmarks.points).all(axis=1))
    points = SurfacePoints(basis.landmarks.faces[on_skin], basis.landmarks.barycentric[on_skin])
    places, spreads = data.places[: len(on_skin)], data.spreads[: len(on_skin)]
    apart = np.linalg.norm(places - points.positions(basis.mean, basis.triangles), axis=1)
    # Points in open eyes may have been lifted to a surface behind them.
    pairs = LandmarkPairs(points, places, np.where(apart < _FARTHEST, 1.0 / (1.0 + (spreads / _USUAL) ** 2), 0.0))
    searching = basis.trust > 0.0
    found = register(template, data.surface.mesh, pairs, _BY_LANDMARKS, searching=searching, frame=IDENTITY)
    laid = rigid_alignment(basis.mean[found.used], found.vertices[found.used], scale=True).apply(basis.mean)
    return laid + faded(basis, found.vertices - laid, found.used)


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
    model = start
    for number in range(rounds):
        basis = basis_of(model)
        by_model = number > 0 or not from_mean
        results: list[Array] = []
        for head in mapper(registered, [Work(scan, basis, by_model) for scan in scans]):
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
