"""Crops of photos, and files of places."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.face_places import FacePlaces, LandmarkErrors, read_face_places
from faceposer.identity.photos.landmark_fit import PhotoFace
from faceposer.landmarks.points import N_POINTS, Landmarks


def test_the_camera_of_a_crop_is_that_of_the_photo(face_camera: FaceCamera) -> None:
    points = np.zeros((N_POINTS, 3))
    points[:, :2] = np.random.default_rng(0).uniform((200.0, 300.0), (700.0, 900.0), (N_POINTS, 2))
    found = Landmarks(points, np.zeros((2, 5, 3)), 1.0, np.array([200.0, 300.0, 700.0, 900.0]), 20.0)
    pixels = np.random.default_rng(1).integers(0, 256, (1200, 1000, 3)).astype(np.uint8)
    crop = FaceCrop.of(PhotoFace(found, (1000, 1200), 1500.0, 0.3), pixels)
    assert crop.image.shape[:2] == crop.face.size[::-1]
    places = np.random.default_rng(2).normal(0.0, 5.0, (10, 3))
    whole = crop.whole(face_camera.camera)
    expected = face_camera.project(places) / crop.factor + crop.corner
    np.testing.assert_allclose(whole.project(places), expected, atol=1e-9)
    assert whole.size == (1000, 1200)
    # Landmarks and the optical axis go along.
    np.testing.assert_allclose(crop.face.landmarks.points[:, :2] / crop.factor + crop.corner, points[:, :2])
    np.testing.assert_allclose(np.array(crop.face.centre) / crop.factor + crop.corner, (500.0, 600.0))


def test_places_come_back_from_their_file(places: FacePlaces, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    errors = LandmarkErrors(rng.normal(size=(N_POINTS, 2)), rng.normal(size=(4, N_POINTS, 2)), np.full(N_POINTS, 0.2))
    path = tmp_path / "places.npz"
    replace(places, errors=errors, credits="made here").save(path)
    read = read_face_places(path)
    np.testing.assert_array_equal(read.points.faces, places.points.faces)
    np.testing.assert_allclose(read.errors.modes, errors.modes, atol=2e-3)
    assert read.credits == "made here"


def test_a_damaged_file_of_places_is_refused(places: FacePlaces, tmp_path: Path) -> None:
    path = tmp_path / "places.npz"
    few = LandmarkErrors(np.zeros((5, 2)), np.zeros((0, 5, 2)), np.ones(5))
    replace(places, errors=few).save(path)
    with pytest.raises(FacePoserError, match="its arrays do not belong together"):
        read_face_places(path)
