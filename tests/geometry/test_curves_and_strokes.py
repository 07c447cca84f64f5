"""Relaxed curves are as smooth as the paper says; brushes cover what they should; mirrors find what lies across."""

import itertools
import tracemalloc

import numpy as np
import pytest
from numpy.typing import ArrayLike

from faceposer.geometry.camera import OrbitView
from faceposer.geometry.curves import curve_at, even_parameters, nearest_parameter, relaxed_bezier
from faceposer.geometry.mirror import mirrored_camera, mirrored_pixels
from faceposer.geometry.strokes import (
    STROKE_SHAPES,
    StrokeShape,
    enclosed,
    resampled,
    smoothed,
    stroke_effort,
    stroke_pixels,
)


def second_derivatives(piece: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b, c, d = piece
    return 6 * (a - 2 * b + c), 6 * (b - 2 * c + d)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 9])
def test_relaxed_curves(count: int) -> None:
    points = np.random.default_rng(count).uniform(0, 100, (count, 2))
    pieces = relaxed_bezier(points)
    assert pieces.shape == (count - 1, 4, 2)
    np.testing.assert_allclose(pieces[:, 0], points[:-1])
    np.testing.assert_allclose(pieces[:, 3], points[1:])
    np.testing.assert_allclose(second_derivatives(pieces[0])[0], 0, atol=1e-9)
    np.testing.assert_allclose(second_derivatives(pieces[-1])[1], 0, atol=1e-9)
    for one, other in itertools.pairwise(pieces):
        np.testing.assert_allclose(one[3] - one[2], other[1] - other[0], atol=1e-9)
        np.testing.assert_allclose(second_derivatives(one)[1], second_derivatives(other)[0], atol=1e-9)


def test_five_points_solve_equation_14() -> None:
    s = np.array([[0.0, 0.0], [10, 20], [30, 10], [40, 40], [60, 0]])
    matrix = np.array([[4, 1, 0], [1, 4, 1], [0, 1, 4]])
    right = np.array([6 * s[1] - s[0], 6 * s[2], 6 * s[3] - s[4]])
    b = np.linalg.solve(matrix, right)
    pieces = relaxed_bezier(s)
    np.testing.assert_allclose(pieces[0, 1], s[0] + (b[0] - s[0]) / 3)
    np.testing.assert_allclose(pieces[1, 2], b[0] + 2 * (b[1] - b[0]) / 3)


def test_two_points_are_a_line_and_one_is_refused() -> None:
    positions, derivatives = curve_at(relaxed_bezier([(0, 0), (30, 60)]), np.linspace(0, 1, 5))
    np.testing.assert_allclose(positions[:, 1], 2 * positions[:, 0])
    np.testing.assert_allclose(derivatives, np.tile([30.0, 60.0], (5, 1)))
    with pytest.raises(ValueError, match="at least two points"):
        relaxed_bezier([(0, 0)])


def test_the_nearest_parameter_is_found() -> None:
    pieces = relaxed_bezier([(0, 0), (50, 30), (100, 0)])
    position, _ = curve_at(pieces, [1.25])
    parameter, distance = nearest_parameter(pieces, position[0] + (0.0, 3.0))
    assert parameter == pytest.approx(1.25, abs=0.05)
    assert distance == pytest.approx(3.0, abs=0.3)
    assert len(even_parameters(3, 12)) == 37


def test_brushes_cover_discs_lines_and_regions() -> None:
    disc = stroke_pixels([(50.0, 50.0)], 21.0)
    assert len(disc) == pytest.approx(np.pi * 10.5**2, rel=0.05)
    assert np.hypot(*(disc - 50.0).T).max() <= 10.5
    line = stroke_pixels([(10.0, 10.5), (110.0, 10.5)], 5.0)
    assert len(line) == pytest.approx(100 * 5 + np.pi * 2.5**2, rel=0.05)
    square = [(0.5, 0.5), (40.5, 0.5), (40.5, 40.5), (0.5, 40.5)]
    closed, filled = (stroke_pixels(square, 3.0, shape) for shape in ("closed", "filled"))
    assert len(closed) == pytest.approx(4 * 40 * 3, rel=0.1)
    assert len(filled) == pytest.approx(43 * 43, rel=0.03)
    assert len(stroke_pixels([(3.3, 4.4), (9.0, 4.4)], 1.0)) >= 6


def test_points_inside_a_polygon_are_told() -> None:
    star = [(0, 0), (10, 4), (20, 0), (16, 10), (20, 20), (10, 16), (0, 20), (4, 10)]
    assert enclosed([(10.0, 10.0)], star).all()
    assert not enclosed([(10.0, 1.0), (-5.0, 10.0)], star).any()


def test_smoothing_takes_the_tremor_and_leaves_the_ends() -> None:
    rng = np.random.default_rng(0)
    x = np.linspace(0, 200, 150)
    true = np.column_stack([x, 30 * np.sin(x / 60)])
    shaken = true + rng.normal(scale=1.2, size=true.shape)
    calm = smoothed(shaken)
    np.testing.assert_allclose(calm[[0, -1]], shaken[[0, -1]])
    off = np.abs(np.interp(calm[:, 0], true[:, 0], true[:, 1]) - calm[:, 1])
    assert off[5:-5].mean() < 0.6
    assert np.abs(np.diff(calm, 2, axis=0)).mean() < 0.3 * np.abs(np.diff(resampled(shaken, 2.0), 2, axis=0)).mean()
    ring = np.column_stack([np.cos(np.linspace(0, 6.2, 80)), np.sin(np.linspace(0, 6.2, 80))]) * 50
    assert np.hypot(*smoothed(ring, closed=True).T) == pytest.approx(50, abs=1.5)
    assert len(smoothed([(1.0, 1.0)])) == 1


def test_a_mirrored_camera_sees_the_mirrored_world() -> None:
    camera = OrbitView((1.0, 2.0, 3.0), 0.5, 0.2, 60.0).camera((640, 480))
    points = np.random.default_rng(1).normal(scale=8, size=(20, 3))
    seen = mirrored_camera(camera).project(points * (-1, 1, 1))
    np.testing.assert_allclose(seen, mirrored_pixels(camera.project(points), camera))
    assert mirrored_camera(mirrored_camera(camera)) == camera


def dense_pixels(points: ArrayLike, width: float, shape: StrokeShape) -> set[tuple[float, float]]:
    """Return the pixels of a stroke by testing every pixel of its box."""
    line = np.asarray(points, dtype=np.float64)
    low, high = np.floor(line.min(axis=0) - width) + 0.5, np.ceil(line.max(axis=0) + width)
    at = np.stack(np.meshgrid(*(np.arange(low[i], high[i]) for i in (0, 1))), axis=-1).reshape(-1, 2)
    ends = np.roll(line, -1, axis=0) if shape != "line" and len(line) > 2 else np.concatenate([line[1:], line[-1:]])
    covered = np.zeros(len(at), dtype=bool)
    for begin, end in zip(line, ends, strict=True):
        along = end - begin
        share = np.clip((at - begin) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        covered |= np.linalg.norm(at - begin - share[:, None] * along, axis=1) <= max(width / 2, np.sqrt(0.5)) + 1e-9
    if shape == "filled" and len(line) > 2:
        covered |= enclosed(at, line)
    return set(map(tuple, at[covered].tolist()))


def test_a_stroke_covers_the_pixels_near_its_path() -> None:
    rng = np.random.default_rng(0)
    for case in range(60):
        path = rng.uniform(-40.0, 40.0, (int(rng.integers(1, 9)), 2))
        path = np.round(2.0 * path) / 2.0 if case % 3 == 0 else path
        width, shape = float(rng.choice([1.0, 1.2, 2.0, 5.5, 20.0])), STROKE_SHAPES[case % 3]
        pixels = stroke_pixels(path, width, shape)
        assert set(map(tuple, pixels.tolist())) == dense_pixels(path, width, shape)
        assert pixels.tolist() == sorted(pixels.tolist(), key=lambda pixel: (pixel[1], pixel[0]))
        assert stroke_effort(path, width, shape) >= len(pixels)


def test_a_stroke_covers_the_pixels_that_its_path_passes_through() -> None:
    for place in [(300.0, 300.0), (0.0, 0.0), (-7.0, 2.5), (300.999, 300.001)]:
        covered = set(map(tuple, stroke_pixels([place], 1.0).tolist()))
        assert (np.floor(place[0]) + 0.5, np.floor(place[1]) + 0.5) in covered
    line = np.linspace((0.3, 0.8), (40.6, 23.1), 4000)
    covered = set(map(tuple, stroke_pixels(line[[0, -1]], 1.0).tolist()))
    assert set(map(tuple, (np.floor(line) + 0.5).tolist())) <= covered


def test_long_strokes_take_memory_by_their_pixels() -> None:
    tracemalloc.start()
    try:
        pixels = stroke_pixels([(0.0, 0.0), (30_000.0, 30_000.0)], 5.0)
        assert 200_000 < len(pixels) < 220_000
        assert len(stroke_pixels([(-5e5, 3.5), (5e5, 3.5)], 1.0)) == 1_000_002
        assert tracemalloc.get_traced_memory()[1] < 400 * 2**20
    finally:
        tracemalloc.stop()
    zigzag = [(k % 2 * 3.0, k % 3 * 1e5) for k in range(3000)]
    for path, width in [([(0.0, 0.0), (1e6, 1e6)], 5.0), ([(0.0, 0.0), (2000.0, 0.0)] * 20_000, 200.0), (zigzag, 1.0)]:
        with pytest.raises(ValueError, match="must not cover more than 4000000"):
            stroke_pixels(path, width, "filled")


@pytest.mark.parametrize("shape", STROKE_SHAPES)
@pytest.mark.parametrize("count", [1, 2, 3, 9])
def test_a_pointer_that_is_held_still_draws_one_point(shape: StrokeShape, count: int) -> None:
    line = smoothed([(40.5, 30.25)] * count, closed=shape != "line")
    assert np.array_equal(np.unique(line, axis=0), [[40.5, 30.25]])
    assert len(stroke_pixels(line, 1.0, shape)) >= 1
