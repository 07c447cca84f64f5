"""Relaxed curves are as smooth as the paper says; brushes cover what they should; mirrors find what lies across."""

import itertools

import numpy as np
import pytest

from faceposer.geometry.camera import OrbitView
from faceposer.geometry.curves import curve_at, even_parameters, nearest_parameter, relaxed_bezier
from faceposer.geometry.mirror import mirrored_camera, mirrored_pixels
from faceposer.geometry.strokes import enclosed, resampled, smoothed, stroke_pixels


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
