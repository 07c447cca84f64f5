"""Searches for pixels in boxes find what a test of every pixel finds."""

import numpy as np

from faceposer.geometry.pixel_index import PixelIndex


def test_pixels_in_boxes() -> None:
    rng = np.random.default_rng(0)
    pixels = rng.uniform(-20.0, 30.0, (400, 2))
    low = rng.uniform(-40.0, 40.0, (60, 2))
    high = low + rng.uniform(0.0, 30.0, (60, 2))
    index = PixelIndex(pixels)
    which, pixel = index.inside(low, high)
    cells, first, last = np.floor(pixels), np.floor(low), np.floor(high)
    within = ((cells >= first[:, None]) & (cells <= last[:, None])).all(axis=2)
    assert {*zip(which.tolist(), pixel.tolist(), strict=True)} == {
        *zip(*map(np.ndarray.tolist, np.nonzero(within)), strict=True)
    }
    np.testing.assert_array_equal(index.counts(low, high), within.sum(axis=1))
    assert (index.rows(low, high)[within.any(axis=1)] > 0).all()


def test_pixels_far_apart_take_no_memory() -> None:
    index = PixelIndex([[0.5, 0.5], [1e9, 1e9]])
    assert index.inside(np.array([[1e9 - 5, 1e9 - 5.0]]), np.array([[2e9, 2e9]]))[1].tolist() == [1]
