"""Principal modes of a face's regions: the controls of a character that is known by examples alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import vertex_areas
from faceposer.training.frames import FrameStore
from faceposer.training.segments import Segments
from faceposer.training.streaming_pca import Components, Region, regional_pca, scores_of

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

#: A region gets as many modes as have this share of its energy, at most so many.
KEEP = 0.998
MOST_MODES = 20
#: A region gets at most one mode for so many examples: of few, the last components are each one example's own.
FRAMES_PER_MODE = 2
# What moves less than this share of the most moving vertex counts as if it moved so much.
_STILL = 0.04
# A vertex of which a region has less than this is none of its.
_NO_SHARE = 1e-3
_LEAST_AREA = 1e-3
# Share of another region's energy that single precision makes out of nothing.
_ROUNDING = 1e-8


@dataclass(frozen=True, eq=False)
class Modes:
    """Displacements that add up to the examples.

    Attributes:
        names: Such as "upper 1", r of them.
        regions: Segment of each.
        fields: Displacements of all vertices in the file's axes and unit at a weight of one standard deviation (about
            zero, the neutral face), shape (r, M, 3).
        weights: Of the examples, shape (F, r).
        kept: Share of the energy that the modes of each segment have, by segment, in the metric of the components.
        settled: Whether the iteration for the components had converged.
    """

    names: tuple[str, ...]
    regions: tuple[str, ...]
    fields: Floats
    weights: Array
    kept: dict[str, float]
    settled: bool


def local_metric(vertices: Array, triangles: NDArray[np.integer], motion: Array) -> Floats:
    """Return the weight of each vertex in the components, (N,): its area over the square of how far it moves.

    In the plain metric the jaw has nearly all the energy, and a brow is dropped as noise.

    Args:
        vertices: Shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        motion: Mean squared displacement of each vertex, shape (N,).
    """
    area = vertex_areas(vertices, triangles)
    # A vertex at which all triangles are flat must not weigh nothing: displacements are divided by the weights again.
    area = np.maximum(area, _LEAST_AREA * area.mean())
    still = _STILL**2 * max(float(motion.max(initial=0.0)), np.finfo(float).tiny)
    weights = area / (motion + still)
    return (weights / max(float(weights.sum()), np.finfo(float).tiny)).astype(np.float32)


def learn_modes(
    store: FrameStore,
    sample: Floats,
    segments: Segments,
    metric: Floats,
    ids: NDArray[np.integer],
    n_dimensions: int | None = None,
) -> Modes:
    """Return the modes of all ``segments``.

    Args:
        store: Displacements of the file's M vertices in all examples.
        sample: Some of them, shape (s, M, 3).
        segments: Of N vertices.
        metric: Weights of these, shape (N,).
        ids: The file's vertex of each, shape (N,).
        n_dimensions: Number of modes in all; as many as ``KEEP`` asks for if None.
    """
    chosen = [np.flatnonzero(mask > _NO_SHARE) for mask in segments.masks]
    regions = [
        Region(np.asarray(ids[vertices], dtype=np.intp), mask[vertices], metric[vertices])
        for vertices, mask in zip(chosen, segments.masks, strict=True)
    ]
    if n_dimensions is not None:
        most = min(n_dimensions, store.n_frames)
    else:
        most = min(MOST_MODES if len(regions) > 1 else 2 * MOST_MODES, max(2, store.n_frames // FRAMES_PER_MODE))
    found = regional_pca(store, regions, sample, most)
    counts = _counts(found, n_dimensions)
    kept = {name: part.kept(count) for name, part, count in zip(segments.names, found, counts, strict=True)}
    found = [
        Components(part.directions[:count], part.energies[:count], part.total, part.settled)
        for part, count in zip(found, counts, strict=True)
    ]
    scores = scores_of(store, regions, found)
    sizes = np.sqrt((scores**2).mean(axis=0)).clip(np.finfo(np.float32).tiny)
    fields = np.zeros((len(sizes), store.n_vertices, 3), dtype=np.float32)
    row = 0
    for region, part in zip(regions, found, strict=True):
        unscaled = part.directions.reshape(-1, len(region.ids), 3) / np.sqrt(region.metric)[None, :, None]
        fields[row : row + len(unscaled), region.ids] = unscaled * sizes[row : row + len(unscaled), None, None]
        row += len(unscaled)
    names = [f"{name} {i + 1}" for name, count in zip(segments.names, counts, strict=True) for i in range(count)]
    owners = [name for name, count in zip(segments.names, counts, strict=True) for _ in range(count)]
    return Modes(tuple(names), tuple(owners), fields, scores / sizes, kept, all(part.settled for part in found))


def _counts(found: Sequence[Components], n_dimensions: int | None) -> list[int]:
    """Return how many components of each region to keep: none where nothing but rounding moves."""
    moves = [part.total > _ROUNDING * max(other.total for other in found) for part in found]
    if n_dimensions is None:
        shares = [np.cumsum(part.energies) / max(part.total, np.finfo(float).tiny) for part in found]
        return [
            min(int(np.searchsorted(share, KEEP)) + 1, len(share)) if moving else 0
            for share, moving in zip(shares, moves, strict=True)
        ]
    # One each, then always where most energy is still left out.
    counts = [int(moving) for moving in moves]
    while sum(counts) < n_dimensions:
        gains = [
            part.energies[count] if moving and count < len(part.energies) else 0.0
            for part, count, moving in zip(found, counts, moves, strict=True)
        ]
        if max(gains) <= 0.0:
            break
        counts[int(np.argmax(gains))] += 1
    return counts
