"""Cameras from pins: known ones come back, noise does little harm, few pins give what they can."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picture_view import PictureView
from faceposer.solve import camera_fit
from faceposer.solve.camera_fit import fit_camera

# Corners of the eyes, nose tip, base of the nose, chin, ear lobes, in centimetres.
FACE = np.array(
    [[4.5, 1.6, 7.5], [-4.5, 1.6, 7.5], [1.7, 1.5, 8], [-1.7, 1.5, 8], [0, -2, 10.9], [0, -3.1, 9.8], [0, -9.3, 7.7],
     [7.2, -2.6, -0.6], [-7.2, -2.6, -0.6]]
)  # fmt: skip


def turn(x: float, y: float, z: float) -> NDArray[np.float64]:
    return camera_fit._rotation(np.radians([x, y, z]))


def camera(yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0, focal: float = 1400.0) -> Camera:
    rotation = turn(0, 0, roll) @ turn(pitch, 0, 0) @ turn(0, yaw, 0) @ np.diag([1.0, -1.0, -1.0])
    return Camera(rotation, np.array([6.0, -9.0, 80.0]), focal, (1200, 900))


def guess(focal: float = 1400.0) -> Camera:
    return Camera(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 60.0]), focal, (1200, 900))


@pytest.mark.parametrize(("yaw", "pitch", "roll"), [(0, 0, 0), (25, -10, 12), (-50, 15, -30), (75, 5, 60)])
@pytest.mark.parametrize("count", [5, 9])
def test_a_known_camera_comes_back(yaw: float, pitch: float, roll: float, count: int) -> None:
    known = camera(yaw, pitch, roll)
    places = FACE[[0, 1, 4, 6, 8, 2, 3, 5, 7][:count]]
    found = fit_camera(places, known.project(places), guess())
    assert found.turned
    assert found.residuals_px.max() < 1e-3
    np.testing.assert_allclose(found.camera.rotation, known.rotation, atol=1e-5)
    np.testing.assert_allclose(found.camera.translation, known.translation, atol=1e-3)


def test_the_focal_length_comes_back_from_enough_pins_only() -> None:
    known = camera(20, 5, 8, focal=1900.0)
    found = fit_camera(FACE, known.project(FACE), guess(), focal_spread=5.0, sigma_px=0.01)
    assert found.focal_found
    assert found.camera.focal == pytest.approx(1900.0, rel=1e-3)
    kept = fit_camera(FACE, known.project(FACE), guess(), sigma_px=0.01)
    assert not kept.focal_found
    assert kept.camera.focal == 1400.0
    for few in (FACE[:5], FACE * [1.0, 1.0, 0.02]):
        found = fit_camera(few, known.project(few), guess(), focal_spread=5.0)
        assert not found.focal_found
        assert found.camera.focal == 1400.0


def test_noise_moves_the_camera_little_and_the_likely_focal_length_holds() -> None:
    random = np.random.default_rng(5)
    known = camera(20, 5, 8)
    for _ in range(5):
        pixels = known.project(FACE) + random.normal(0.0, 2.0, (len(FACE), 2))
        found = fit_camera(FACE, pixels, guess(), focal_spread=0.3, sigma_px=2.0).camera
        angle = math.degrees(camera_fit._angle(found.rotation @ known.rotation.T))
        assert angle < 4.0
        assert 0.6 < found.focal / 1400.0 < 1.7
        assert np.abs(found.project(FACE) - known.project(FACE)).max() < 5.0


def test_a_pin_without_weight_counts_for_nothing_and_a_light_one_for_little() -> None:
    known = camera(15, 0, 5)
    pixels = known.project(FACE)
    pixels[6] += (0.0, 60.0)
    weights = np.ones(len(FACE))
    off = []
    for weight in (1.0, 0.1, 0.0):
        weights[6] = weight
        found = fit_camera(FACE, pixels, guess(), weights)
        off.append(np.delete(found.residuals_px, 6).max())
    assert off[0] > off[1] > 1.0
    assert off[2] < 1e-3


def test_few_pins_move_then_roll_and_scale() -> None:
    start = guess()
    one = fit_camera(FACE[:1], [[300.0, 200.0]], start)
    assert not one.turned
    np.testing.assert_array_equal(one.camera.rotation, start.rotation)
    assert one.residuals_px[0] < 1e-6
    depths = [float(c.to_camera(FACE[:1])[0, 2]) for c in (start, one.camera)]
    assert depths[0] == pytest.approx(depths[1])
    known = camera(0, 0, 25)
    two = fit_camera(FACE[:2], known.project(FACE[:2]), start)
    assert not two.turned
    assert two.residuals_px.max() < 0.5
    np.testing.assert_allclose(two.camera.rotation, known.rotation, atol=0.01)


def test_derivatives_agree_with_differences() -> None:
    """One step of the descent from near by goes nearly all the way, which wrong derivatives cannot do."""
    known = camera(20, -5, 8)
    near = replace(known, rotation=turn(1.0, -1.2, 0.7) @ known.rotation, focal=known.focal * 1.02)
    pixels = known.project(FACE)
    before = np.linalg.norm(near.project(FACE) - pixels)
    original, camera_fit._ITERATIONS = camera_fit._ITERATIONS, 2
    try:
        found, _ = camera_fit._minimise(FACE, pixels, np.ones(len(FACE)), near, near, 50.0, 0.0)
    finally:
        camera_fit._ITERATIONS = original
    assert np.linalg.norm(found.project(FACE) - pixels) < 0.02 * before


def test_pins_along_a_line_leave_the_face_turned_as_is_usual() -> None:
    """The corners of the eyes tell hardly more than a line; a pixel of noise must not turn the head over."""
    known = camera()
    pixels = known.project(FACE[:4]) + [[0.0, 3.0], [0.0, 0.0], [0.0, -3.0], [0.0, -2.0]]
    loose = fit_camera(FACE[:4], pixels, guess(), sigma_px=5.0).camera
    usual = fit_camera(FACE[:4], pixels, guess(), sigma_px=5.0, turn_spread=0.5).camera
    angles = [math.degrees(camera_fit._angle(c.rotation @ known.rotation.T)) for c in (loose, usual)]
    assert angles[1] < 15.0
    assert angles[0] > 2.0 * angles[1]


def test_nothing_to_go_by_is_refused() -> None:
    with pytest.raises(ValueError, match="weight"):
        fit_camera(FACE, np.zeros((9, 2)), guess(), np.zeros(9))
    with pytest.raises(ValueError, match="same length"):
        fit_camera(FACE, np.zeros((8, 2)), guess())


def test_a_picture_view_keeps_photo_and_face_together() -> None:
    photo = camera(20, 5, 8)
    view = PictureView.whole(photo, (0.0, 0.0, 0.0))
    pixels = photo.project(FACE)
    for size in ((1200, 900), (500, 900), (900, 500)):
        for seen in (view, view.zoomed(3.0), view.zoomed(2.0).panned(40.0, -30.0, size)):
            window = seen.camera(size)
            scale = seen.scale(size)
            corner = window.principal_point - scale * photo.principal_point
            np.testing.assert_allclose(window.project(FACE), pixels * scale + corner, atol=1e-6)
            assert photo.transferred(pixels[0].tolist(), window) == pytest.approx(tuple(window.project(FACE)[0]))
    assert view.orbited(30.0, 0.0, (1200, 900)) is view
    loose = replace(view, locked=False).orbited(30.0, 10.0, (1200, 900))
    assert not loose.aligned
    middle = loose.camera((1200, 900))
    np.testing.assert_allclose(middle.project([[0, 0, 0]]), photo.project([[0, 0, 0]]), atol=1e-6)
    assert photo.transferred((0.0, 0.0), middle) is None
    assert loose.back() == replace(view, locked=False)
    shown = view.showing(np.array([400.0, 300.0]), np.array([700.0, 600.0]), (900, 900)).camera((900, 900))
    np.testing.assert_allclose(photo.transferred((400.0, 300.0), shown), (0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(photo.transferred((700.0, 600.0), shown), (900.0, 900.0), atol=1e-6)
