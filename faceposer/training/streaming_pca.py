"""Out-of-core principal components of meshes, for one or several regions at once.

Subspace iteration on the second moments of the displacements from the neutral face, with Rayleigh-Ritz steps, started
from the components of a sample (Halko, Martinsson and Tropp, "Finding structure with randomness", SIAM Review 53, 2011,
algorithm 4.4). A pass multiplies each chunk of frames twice and sums the results; memory is independent of the number
of frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.training.frames import FrameStore

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

_MOST_PASSES = 8
# The iteration ends when the kept energy of no region rises by more than this share in a pass.
_TOLERANCE = 1e-5
# Rise in the last pass above which the iteration has not converged; isotropic noise always causes small rises.
_NOT_CONVERGED = 1e-4
_SPARE = 8


@dataclass(frozen=True, eq=False)
class Region:
    """A part of the face with its own metric.

    Attributes:
        ids: Vertex ids, shape (n,).
        mask: Share of each vertex's displacement that belongs to the region, from 0 to 1, shape (n,).
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
        converged: True if the iteration converged.
    """

    directions: Floats
    energies: Array
    total: float
    converged: bool = True

    def kept(self, count: int) -> float:
        """Return the share of the energy in the first ``count`` components."""
        return float(self.energies[:count].sum() / self.total) if self.total > 0 else 1.0


def regional_pca(store: FrameStore, regions: Sequence[Region], sample: Floats, n_components: int) -> list[Components]:
    """Return the leading ``n_components`` principal components of each region, or fewer if the frames have fewer.

    Args:
        store: All frames.
        regions: The regions.
        sample: Sample of the frames, from which the iteration starts, shape (s, N, 3).
        n_components: Largest number of components of each region.
    """
    rng = np.random.default_rng(0)
    bases = []
    for region in regions:
        width = 3 * len(region.ids)
        count = min(n_components + _SPARE, store.n_frames, width)
        start = _leading_rows(region.weigh(sample), count)
        if len(start) < count:
            start = np.vstack([start, rng.standard_normal((count - len(start), width)).astype(np.float32)])
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
            found[i] = Components(directions, energies, total / store.n_frames, rise <= _NOT_CONVERGED)
            # Rotating to the Ritz vectors before the QR decomposition keeps the directions ordered by energy.
            bases[i] = np.linalg.qr(product.T @ rotation)[0].astype(np.float32)
        if largest <= _TOLERANCE:
            break
    return [_leading(components, n_components) for components in found]


def scores_of(store: FrameStore, regions: Sequence[Region], components: Sequence[Components]) -> Array:
    """Return the scores of all frames on all components, region by region, shape (F, sum of k)."""
    bases = [np.ascontiguousarray(part.directions.T) for part in components]
    return np.concatenate(list(store.run(_project, regions, bases))).astype(np.float64)


def _leading(components: Components, most: int) -> Components:
    # Directions without energy are rounding errors of single precision.
    real = int((components.energies > 1e-9 * max(components.total, np.finfo(float).tiny)).sum())
    count = max(1, min(most, real))
    directions = components.directions[:count]
    # The sign of a component is arbitrary: its largest entry is made positive, so that results repeat.
    largest = np.argmax(np.abs(directions), axis=1)
    signs = np.where(directions[np.arange(count), largest] < 0.0, -1.0, 1.0).astype(np.float32)
    return Components(directions * signs[:, None], components.energies[:count], components.total, components.converged)


def _leading_rows(weighted: Floats, most: int) -> Floats:
    """Return at most ``most`` leading principal directions of few rows, (s, d), unnormalised, shape (k, d)."""
    values, axes = np.linalg.eigh(weighted.astype(np.float64) @ weighted.T.astype(np.float64))
    real = np.flatnonzero(values > 1e-7 * max(float(values[-1]), np.finfo(float).tiny))[::-1][:most]
    rows: Floats = (axes[:, real] / np.sqrt(values[real])).astype(np.float32).T @ weighted
    return rows


def _pass(frames: Floats, regions: Sequence[Region], bases: Sequence[Floats]) -> list[Array]:
    """Return (X Q)^T X, (X Q)^T X Q and the squared norm of the weighted displacements X of each region."""
    sums = []
    for region, basis in zip(regions, bases, strict=True):
        weighted = region.weigh(frames)
        scores = weighted @ basis
        # Row by row, to limit rounding errors of single precision.
        squared = np.sum([np.dot(row, row) for row in weighted], dtype=np.float64)
        sums += [(scores.T @ weighted).astype(np.float64), scores.T.astype(np.float64) @ scores, np.asarray(squared)]
    return sums


def _project(frames: Floats, regions: Sequence[Region], bases: Sequence[Floats]) -> Floats:
    return np.hstack([region.weigh(frames) @ basis for region, basis in zip(regions, bases, strict=True)])
