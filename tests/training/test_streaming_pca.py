"""Streamed components are those of a full decomposition, whatever the data lacks and wherever it lies."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import subspace_angles
from scipy.spatial.transform import Rotation

from faceposer.training.frames import sum_of
from faceposer.training.streaming_pca import Components, Region, regional_pca, scores_of

Floats = NDArray[np.float32]
N = 40


class InMemory:
    """A store of frames in chunks of some."""

    def __init__(self, frames: NDArray[np.floating], size: int = 7) -> None:
        self.frames = frames.astype(np.float32)
        self.n_frames, self.n_vertices = frames.shape[:2]
        self.passes = 0
        self._size = size

    def run(self, function: Callable[..., Any], *arguments: Any) -> Iterator[Any]:
        self.passes += 1
        for first in range(0, self.n_frames, self._size):
            yield function(self.frames[first : first + self._size], *arguments)

    def total(self, function: Callable[..., Any], *arguments: Any) -> list[np.ndarray]:
        return sum_of(self.run(function, *arguments))


def frames_of_rank(rank: int, n_frames: int = 60, decay: float = 0.8, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    weights = rng.standard_normal((n_frames, rank)) * decay ** np.arange(rank) + 0.3
    frames = (weights @ rng.standard_normal((rank, 3 * N))).reshape(n_frames, N, 3)
    return frames + noise * rng.standard_normal(frames.shape)


def whole(metric: Floats | None = None) -> Region:
    ones = np.ones(N, dtype=np.float32)
    return Region(np.arange(N), ones, ones if metric is None else metric)


def overlapping() -> list[Region]:
    """Three regions with soft borders and a metric, each with its own vertices only."""
    rng = np.random.default_rng(5)
    x = np.linspace(0, 1, N)
    masks = np.stack([np.clip(1 - 2 * np.abs(x - middle), 0, 1) for middle in (0.0, 0.5, 1.0)])
    metric = rng.uniform(0.2, 2.0, N).astype(np.float32)
    chosen = [np.flatnonzero(mask > 1e-3) for mask in masks]
    return [Region(ids, mask[ids].astype(np.float32), metric[ids]) for ids, mask in zip(chosen, masks, strict=True)]


def exact(frames: np.ndarray, region: Region, count: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return directions, (k, 3 n), energies and their total by NumPy's full decomposition in double precision."""
    scale = region.mask.astype(np.float64) * np.sqrt(region.metric.astype(np.float64))
    weighted = (frames[:, region.ids] * scale[None, :, None]).reshape(len(frames), -1)
    _, singular, rows = np.linalg.svd(weighted, full_matrices=False)
    energies = singular**2 / len(frames)
    return rows[:count], energies[:count], float(energies.sum())


def check(found: Components, frames: np.ndarray, region: Region, count: int, degrees: float = 0.1) -> None:
    rows, energies, total = exact(frames, region, count)
    assert found.converged
    assert found.total == pytest.approx(total, rel=1e-5)
    np.testing.assert_allclose(found.energies, energies, rtol=1e-4, atol=1e-6 * total)
    assert np.rad2deg(subspace_angles(found.directions.T.astype(np.float64), rows.T)[0]) < degrees
    np.testing.assert_allclose(found.directions @ found.directions.T, np.eye(count), atol=1e-5)


def test_one_region_is_as_a_full_decomposition_has_it() -> None:
    frames = frames_of_rank(20, noise=0.01)
    store = InMemory(frames)
    found = regional_pca(store, [whole()], frames[::6].astype(np.float32), 6)
    check(found[0], frames, whole(), 6)
    scores = scores_of(store, [whole()], found)
    np.testing.assert_allclose((scores**2).mean(axis=0), found[0].energies, rtol=1e-4)
    rows, _, _ = exact(frames, whole(), 6)
    # What the components make of the frames is what the exact ones make.
    made = scores @ found[0].directions
    expected = frames.reshape(len(frames), -1) @ rows.T @ rows
    np.testing.assert_allclose(made, expected, atol=2e-3 * np.abs(expected).max())


def test_regions_that_overlap_are_each_exact() -> None:
    frames = frames_of_rank(15, noise=0.01)
    regions = overlapping()
    store = InMemory(frames)
    found = regional_pca(store, regions, frames[:9].astype(np.float32), 4)
    for part, region in zip(found, regions, strict=True):
        check(part, frames, region, 4)
    scores = scores_of(store, regions, found)
    assert scores.shape == (60, 12)
    apart = [scores_of(store, [region], [part]) for part, region in zip(found, regions, strict=True)]
    np.testing.assert_allclose(scores, np.hstack(apart), atol=1e-5)


def test_slowly_falling_energies_settle_on_the_right_ones() -> None:
    frames = frames_of_rank(60, n_frames=400, decay=0.97, seed=2)
    found = regional_pca(InMemory(frames, 50), [whole()], frames[:12].astype(np.float32), 10)[0]
    _, energies, total = exact(frames, whole(), 10)
    # Where neighbours are nearly alike, any mixture of them is as good: what counts is the energy.
    assert found.kept(10) > energies.sum() / total - 1e-3


@pytest.mark.parametrize("rank", [1, 3])
def test_no_more_components_than_the_data_has(rank: int) -> None:
    frames = frames_of_rank(rank)
    found = regional_pca(InMemory(frames), [whole()], frames[:5].astype(np.float32), 12)[0]
    assert len(found.directions) == len(found.energies) == rank
    assert found.kept(rank) == pytest.approx(1.0, abs=1e-5)
    check(found, frames, whole(), rank)


def test_fewer_frames_than_components_and_one_chunk() -> None:
    frames = frames_of_rank(20, n_frames=4)
    found = regional_pca(InMemory(frames, 100), [whole()], frames.astype(np.float32), 12)[0]
    check(found, frames, whole(), 4)


def test_fewer_coordinates_than_components() -> None:
    region = Region(np.array([3, 8]), np.ones(2, dtype=np.float32), np.ones(2, dtype=np.float32))
    frames = frames_of_rank(20)
    found = regional_pca(InMemory(frames), [region], frames[:2].astype(np.float32), 12)[0]
    check(found, frames, region, 6)


def test_identical_frames_have_one_component_and_still_ones_none() -> None:
    frames = np.repeat(frames_of_rank(1, n_frames=1), 30, axis=0)
    found = regional_pca(InMemory(frames), [whole()], frames[:4].astype(np.float32), 5)[0]
    assert found.energies.shape == (1,)
    assert found.kept(1) == pytest.approx(1.0, abs=1e-6)
    still = np.zeros((30, N, 3))
    found = regional_pca(InMemory(still), [whole()], still[:4].astype(np.float32), 5)[0]
    assert found.converged
    assert found.total == 0.0
    assert found.kept(1) == 1.0
    assert np.isfinite(found.directions).all()


def test_start_that_knows_nothing_is_made_good() -> None:
    """The sample has only what is weakest in the frames."""
    frames = frames_of_rank(8, decay=0.6)
    sample = np.zeros((3, N, 3), dtype=np.float32)
    sample[:, 0, 0] = 1.0
    check(regional_pca(InMemory(frames), [whole()], sample, 4)[0], frames, whole(), 4)


def test_turning_and_sizing_everything_changes_nothing_else() -> None:
    frames = frames_of_rank(12, noise=0.01)
    turn = Rotation.from_rotvec([0.3, -1.2, 0.7]).as_matrix()
    moved = 1e-3 * frames @ turn.T
    regions = overlapping()
    here = regional_pca(InMemory(frames), regions, frames[:9].astype(np.float32), 3)
    there = regional_pca(InMemory(moved), regions, moved[:9].astype(np.float32), 3)
    for one, other in zip(here, there, strict=True):
        np.testing.assert_allclose(other.energies, 1e-6 * one.energies, rtol=1e-4)
        assert other.kept(3) == pytest.approx(one.kept(3), rel=1e-5)
    a = scores_of(InMemory(frames), regions, here)
    b = scores_of(InMemory(moved), regions, there)
    np.testing.assert_allclose(np.abs(b), 1e-3 * np.abs(a), atol=2e-6 * np.abs(a).max())


def test_few_passes_suffice_where_the_sample_tells() -> None:
    frames = frames_of_rank(20, n_frames=500, decay=0.7)
    store = InMemory(frames, 100)
    regional_pca(store, [whole()], frames[::5].astype(np.float32), 6)
    assert store.passes <= 3


def test_nearer_to_the_exact_than_incremental_pca() -> None:
    """About the mean, where scikit-learn works."""
    from sklearn.decomposition import IncrementalPCA

    frames = frames_of_rank(40, n_frames=600, decay=0.95, seed=4)
    frames -= frames.mean(axis=0)
    rows, _, _ = exact(frames, whole(), 8)
    ours = regional_pca(InMemory(frames, 60), [whole()], frames[::10].astype(np.float32), 8)[0]
    theirs = IncrementalPCA(8, batch_size=60).fit(frames.reshape(600, -1))
    angle = subspace_angles(ours.directions.T.astype(np.float64), rows.T)[0]
    assert angle < subspace_angles(theirs.components_.T, rows.T)[0]
