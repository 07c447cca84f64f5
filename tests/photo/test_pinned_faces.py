"""Faces in photos whose landmarks are moved to pins, or found at them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.landmarks.feature_points import feature_pixels
from faceposer.photo.faces import FaceInPhoto, read_face
from tests.landmarks.photos import grace_hopper


@pytest.fixture(scope="module")
def photo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("photos") / "me.png"
    Image.fromarray(grace_hopper()).save(path)
    return path


@pytest.fixture(scope="module")
def plain(photo: Path) -> FaceInPhoto:
    return read_face(photo)


def test_pins_where_the_landmarks_are_move_nothing(photo: Path, plain: FaceInPhoto) -> None:
    found = read_face(photo, pins=plain.features())
    np.testing.assert_allclose(found.face.landmarks.points, plain.face.landmarks.points, atol=1e-6)


def test_landmarks_move_to_pins_and_the_pupil_takes_the_iris(photo: Path, plain: FaceInPhoto) -> None:
    places = feature_pixels(plain.face.landmarks)
    wanted = {name: (places[name][0] + 3.0, places[name][1] - 2.0) for name in ("8.3", "3.6")}
    found = read_face(photo, pins=wanted)
    moved = feature_pixels(found.face.landmarks)
    for name, pixel in wanted.items():
        assert np.hypot(*np.subtract(moved[name], pixel)) < 1.3, name
    # What is saved of them is exactly where they were placed.
    for name, pixel in wanted.items():
        assert found.features()[name] == pytest.approx(pixel, abs=1e-9)
    np.testing.assert_allclose(found.face.landmarks.iris[0] - plain.face.landmarks.iris[0], [[3.0, -2.0, 0.0]] * 5)
    # The other corner of the mouth stays.
    assert np.hypot(*np.subtract(moved["8.4"], places["8.4"])) < 0.5


def test_pins_say_which_of_two_faces_is_meant(tmp_path: Path, plain: FaceInPhoto) -> None:
    picture = grace_hopper()
    two = np.hstack([picture, np.asarray(Image.fromarray(picture).resize((410, 600)))])
    path = tmp_path / "two.png"
    Image.fromarray(two).save(path)
    places = feature_pixels(plain.face.landmarks)
    pins = {name: (512.0 + 0.8 * u, v) for name, (u, v) in places.items()}
    found = read_face(path, pins=pins)
    assert found.face.landmarks.points[:, 0].mean() > 512.0
