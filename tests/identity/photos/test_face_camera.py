"""Cameras about faces."""

import numpy as np

from faceposer.identity.photos.face_camera import N_CAMERA, FaceCamera

_STEP = 1e-6


def test_the_usual_form_projects_alike(face_camera: FaceCamera) -> None:
    points = np.random.default_rng(0).normal(0.0, 8.0, (20, 3))
    np.testing.assert_allclose(face_camera.camera.project(points), face_camera.project(points), atol=1e-9)


def test_a_crop_shows_the_same(face_camera: FaceCamera) -> None:
    points = np.random.default_rng(0).normal(0.0, 8.0, (20, 3))
    cropped = face_camera.scaled(1.5, (30.0, 12.0), (200, 210))
    expected = (face_camera.project(points) - (30.0, 12.0)) * 1.5
    np.testing.assert_allclose(cropped.project(points), expected, atol=1e-9)


def test_derivatives_match_finite_differences(face_camera: FaceCamera) -> None:
    points = np.random.default_rng(1).normal(0.0, 6.0, (9, 3))
    local = face_camera.local(points)
    by_place, by_camera = face_camera.derivatives(local)
    for axis in range(3):
        step = _STEP * np.eye(3)[axis]
        slope = (face_camera.pixels(local + step) - face_camera.pixels(local - step)) / (2.0 * _STEP)
        np.testing.assert_allclose(by_place[:, :, axis], slope, atol=1e-5)
    for number in range(N_CAMERA):
        step = _STEP * np.eye(N_CAMERA)[number]
        slope = (face_camera.moved(step).project(points) - face_camera.moved(-step).project(points)) / (2.0 * _STEP)
        np.testing.assert_allclose(by_camera[:, :, number], slope, atol=2e-4)
