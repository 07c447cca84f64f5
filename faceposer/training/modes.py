"""Principal modes of the regions of a face: the shapes of a character trained from examples."""

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

#: Share of a region's energy that its modes keep, and the largest number of modes of a region.
KEEP = 0.998
MOST_MODES = 20
#: Least number of examples per mode of a region, since the last components of few examples fit single examples.
FRAMES_PER_MODE = 2
# Least motion of a vertex in the metric, as a share of the largest.
_STILL = 0.04
# Mask below which a vertex does not belong to a region.
_NO_SHARE = 1e-3
_LEAST_AREA = 1e-3
# Share of the largest region's energy below which a region's energy is rounding of single precision.
_ROUNDING = 1e-8


@dataclass(frozen=True, eq=False)
class Modes:
    """Linear modes of the examples' displacements.

    Attributes:
        names: Names of the r modes, such as "upper 1".
        regions: Segment of each mode.
        fields: Displacements of all vertices in the file's axes and unit at a weight of one standard deviation (about
            zero, the neutral face), shape (r, M, 3).
        weights: Weights of the examples, shape (F, r).
        kept: Share of the energy of each segment that its modes keep, in the metric of the components.
        converged: True if the iteration for the components converged.
    """

    names: tuple[str, ...]
    regions: tuple[str, ...]
    fields: Floats
    weights: Array
    kept: dict[str, float]
    converged: bool


def local_metric(vertices: Array, triangles: NDArray[np.integer], motion: Array) -> Floats:
    """Return the weight of each vertex in the components, (N,): its area divided by its mean squared displacement.

    In the plain metric the jaw has nearly all the energy, and brows are dropped as noise.

    Args:
        vertices: Neutral vertices, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        motion: Mean squared displacement of each vertex, shape (N,).
    """
    area = vertex_areas(vertices, triangles)
    # Vertices of degenerate triangles need a positive weight, because displacements are later divided by the weights.
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
        sample: A sample of the displacements, shape (s, M, 3).
        segments: Segments of the N vertices.
        metric: Weights of the vertices, shape (N,).
        ids: The file's vertex of each vertex, shape (N,).
        n_dimensions: Total number of modes; determined by ``KEEP`` if None.
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
        Components(part.directions[:count], part.energies[:count], part.total, part.converged)
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
    return Modes(tuple(names), tuple(owners), fields, scores / sizes, kept, all(part.converged for part in found))


def _counts(found: Sequence[Components], n_dimensions: int | None) -> list[int]:
    """Return the number of components to keep of each region, 0 for regions without motion."""
    moves = [part.total > _ROUNDING * max(other.total for other in found) for part in found]
    if n_dimensions is None:
        shares = [np.cumsum(part.energies) / max(part.total, np.finfo(float).tiny) for part in found]
        return [
            min(int(np.searchsorted(share, KEEP)) + 1, len(share)) if moving else 0
            for share, moving in zip(shares, moves, strict=True)
        ]
    # One for each region, then greedily the component with the most energy.
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
