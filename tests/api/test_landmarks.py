"""Landmarks through the Python interface."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import faceposer
from tests.landmarks.photos import grace_hopper


def test_photo_as_array_and_file(tmp_path: Path) -> None:
    image = grace_hopper()
    found = faceposer.find_landmarks(image)
    assert found is not None
    Image.fromarray(image).save(tmp_path / "face.png")
    again = faceposer.find_landmarks(tmp_path / "face.png")
    assert again is not None
    np.testing.assert_array_equal(found.points, again.points)
    assert len(faceposer.find_all_landmarks(image)) == 1
    u, v = faceposer.feature_pixels(found)["9.3"]
    assert np.hypot(u - found.points[1, 0], v - found.points[1, 1]) < 12


def test_mesh() -> None:
    found = faceposer.find_mesh_landmarks("low")
    assert found is not None
    places = faceposer.feature_places(found)
    assert places["8.3"].title == "left mouth corner"
    assert places["8.3"].place[0] > places["8.4"].place[0]


@pytest.mark.parametrize("image", [np.zeros((3, 3)), np.zeros((0, 3), np.uint8), np.zeros((3, 3, 2), np.uint8)])
def test_other_arrays_get_one_sentence(image: np.ndarray) -> None:
    with pytest.raises(faceposer.FacePoserError, match="photo must"):
        faceposer.find_landmarks(image)
