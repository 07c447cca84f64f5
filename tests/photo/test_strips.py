"""Changes of large photos: as computed by hand, in little memory, and cancelled."""

import tracemalloc

import numpy as np
import pytest

from faceposer.photo.strips import PhotoChange, with_change
from faceposer.progress import CancelledError, Progress

SIZE, GRID = (1200, 1100), (240, 220)


def wave(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return a smooth picture at ``rows`` and ``columns``, 0 to 255."""
    return 128.0 + 60.0 * np.sin(rows / 40.0) * np.cos(columns / 55.0)


def shifted(down: float, across: float, light: float) -> PhotoChange:
    """Return a change on the grid that takes colours from elsewhere, in pixels of the photo, and scales them."""
    offsets = np.broadcast_to(np.array([across, down]) * GRID[0] / SIZE[0], (*GRID, 2)).copy()
    return PhotoChange(offsets, np.full((*GRID, 3), np.log(light)), np.zeros(GRID), np.zeros((*GRID, 3)))


def test_a_large_photo_changes_in_strips_of_little_memory() -> None:
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    part = np.repeat((wave(rows, columns) + 0.5).astype(np.uint8)[..., None], 3, axis=2)
    shares: list[float] = []
    tracemalloc.start()
    made = with_change(part, shifted(-7.0, 12.0, 0.8), Progress(lambda _, share: shares.append(share)))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    truth = 0.8 * wave(rows - 7, columns + 12)
    inner = (slice(20, -20), slice(20, -20), 0)
    assert np.abs(made[inner] - truth[20:-20, 20:-20]).max() < 1.5
    # In one piece, coordinates and colours of all pixels take 200 MB and more.
    assert peak < 90e6
    assert shares == sorted(shares)
    assert len(shares) > 3


def test_nothing_changes_without_a_change_and_work_can_be_cancelled() -> None:
    part = np.random.default_rng(0).integers(0, 256, (300, 200, 3), dtype=np.uint8)
    np.testing.assert_array_equal(with_change(part, shifted(0.0, 0.0, 1.0)), part)
    with pytest.raises(CancelledError):
        with_change(part, shifted(1.0, 0.0, 1.0), Progress(cancelled=lambda: True))
