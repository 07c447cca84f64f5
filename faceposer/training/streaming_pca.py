"""Principal components of meshes too many for memory, of one or of several regions at once.

Subspace iteration on the second moments of the displacements from the neutral face, with Rayleigh-Ritz steps, started
from the components of a sample (Halko, Martinsson and Tropp, "Finding structure with randomness", SIAM Review 53, 2011,
algorithm 4.4). A pass multiplies each chunk of frames twice and adds up; nothing of the size of all frames is held.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.training.frames import FrameStore

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

_MOST_PASSES = 8
# The iteration ends when no kept energy rises by more than this share in a pass.
_SETTLED = 1e-5
# A larger rise than this in the last pass is worth telling; noise without a direction makes for small ones for ever.
_UNSETTLED = 1e-4
_SPARE = 8


@dataclass(frozen=True, eq=False)
class Region:
    """A part of the face with a metric of its own.

    Attributes:
        ids: Its vertices, shape (n,).
        mask: How much of each vertex's displacement is the region's, 0 to 1, shape (n,).
        metric: Weight of each vertex's squared displacement, shape (n,).
    """

    ids: NDArray[np.intp]
    mask: Floats
    metric: Floats

    def weigh(self, frames: Floats) -> Floats:
        """Return masked displacements in the region's metric, shape (f, 3 n), of ``frames``, (f, N, 3)."""
        scaled = frames.take(self.ids, axis=1)
        scaled *= (self.mask * np.sqrt(self.metric))[None, :, None]
        return scaled.reshape(len(frames), -1)


@dataclass(frozen=True, eq=False)
class Components:
    """Principal components of one region.

    Attributes:
        directions: Orthonormal in the weighted displacements, shape (k, 3 n).
        energies: Mean squared score along each, descending, shape (k,).
        total: Mean squared length of all weighted displacements.
        settled: Whether the iteration had converged.
    """

    directions: Floats
    energies: Array
    total: float
    settled: bool = True

    def kept(self, count: int) -> float:
        """Return the share of the energy that the first ``count`` components have."""
        return float(self.energies[:count].sum() / self.total) if self.total > 0 else 1.0


def regional_pca(store: FrameStore, regions: Sequence[Region], sample: Floats, n_components: int) -> list[Components]:
    """Return the leading ``n_components`` principal components of each region, or as many as the frames have.

    Args:
        store: All frames.
        regions: Whose components are wanted.
        sample: Some of the frames, from which the iteration starts, shape (s, N, 3).
        n_components: At most how many of each region.
    """
    rng = np.random.default_rng(0)
    bases = []
    for region in regions:
        width = 3 * len(region.ids)
        wanted = min(n_components + _SPARE, store.n_frames, width)
        start = _leading_rows(region.weigh(sample), wanted)
        if len(start) < wanted:
            start = np.vstack([start, rng.standard_normal((wanted - len(start), width)).astype(np.float32)])
        bases.append(np.linalg.qr(start.T)[0].astype(np.float32))
    found = [Components(basis.T, np.zeros(basis.shape[1]), 0.0, False) for basis in bases]
    for _ in range(_MOST_PASSES):
        sums = store.total(_pass, regions, bases)
        largest = 0.0
        for i, (product, inner, squared) in enumerate(zip(sums[0::3], sums[1::3], sums[2::3], strict=True)):
            total = float(squared)
            energies, rotation = np.linalg.eigh(inner / store.n_frames)
            energies, rotation = np.maximum(energies[::-1], 0.0), rotation[:, ::-1]
            before = found[i].energies[:n_components].sum()
            mean = max(total / store.n_frames, np.finfo(float).tiny)
            rise = float(energies[:n_components].sum() - before) / mean
            largest = max(largest, rise)
            directions = (bases[i].astype(np.float64) @ rotation).T.astype(np.float32)
            found[i] = Components(directions, energies, total / store.n_frames, rise <= _UNSETTLED)
            # What lies along the leading directions already need not be found again.
            bases[i] = np.linalg.qr(product.T @ rotation)[0].astype(np.float32)
        if largest <= _SETTLED:
            break
    return [_leading(components, n_components) for components in found]


def scores_of(store: FrameStore, regions: Sequence[Region], components: Sequence[Components]) -> Array:
    """Return the scores of all frames on all components, region by region, shape (F, sum of k)."""
    bases = [np.ascontiguousarray(part.directions.T) for part in components]
    return np.concatenate(list(store.run(_project, regions, bases))).astype(np.float64)


def _leading(components: Components, most: int) -> Components:
    # Directions without energy are what the numbers of single precision are rounded to.
    real = int((components.energies > 1e-9 * max(components.total, np.finfo(float).tiny)).sum())
    count = max(1, min(most, real))
    directions = components.directions[:count]
    # The sign of a component is arbitrary: its largest entry is made positive, so that results repeat.
    largest = np.argmax(np.abs(directions), axis=1)
    signs = np.where(directions[np.arange(count), largest] < 0.0, -1.0, 1.0).astype(np.float32)
    return Components(directions * signs[:, None], components.energies[:count], components.total, components.settled)


def _leading_rows(weighted: Floats, most: int) -> Floats:
    """Return at most ``most`` leading principal directions of few rows, (s, d), of any length, shape (k, d)."""
    values, axes = np.linalg.eigh(weighted.astype(np.float64) @ weighted.T.astype(np.float64))
    real = np.flatnonzero(values > 1e-7 * max(float(values[-1]), np.finfo(float).tiny))[::-1][:most]
    rows: Floats = (axes[:, real] / np.sqrt(values[real])).astype(np.float32).T @ weighted
    return rows


def _pass(frames: Floats, regions: Sequence[Region], bases: Sequence[Floats]) -> list[Array]:
    """Return of each region (X Q)^T X, (X Q)^T X Q and the squared length of its weighted displacements X."""
    sums = []
    for region, basis in zip(regions, bases, strict=True):
        weighted = region.weigh(frames)
        scores = weighted @ basis
        # Row by row, so that single precision adds few numbers at a time.
        squared = np.sum([np.dot(row, row) for row in weighted], dtype=np.float64)
        sums += [(scores.T @ weighted).astype(np.float64), scores.T.astype(np.float64) @ scores, np.asarray(squared)]
    return sums


def _project(frames: Floats, regions: Sequence[Region], bases: Sequence[Floats]) -> Floats:
    return np.hstack([region.weigh(frames) @ basis for region, basis in zip(regions, bases, strict=True)])
