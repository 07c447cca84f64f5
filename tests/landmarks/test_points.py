"""Faces are found in photos that are turned, small, large or dark, and nowhere else."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from faceposer.landmarks.crops import Picture, Square
from faceposer.landmarks.points import Landmarks, find_all_landmarks, find_landmarks
from tests.landmarks.photos import astronaut, grace_hopper

Pixels = NDArray[np.uint8]
PHOTOS = [pytest.param(astronaut, id="astronaut"), pytest.param(grace_hopper, id="grace_hopper")]
# Places in the photos as a person sees them, in pixels, and how far off the points may be.
SEEN = {
    "astronaut": {"pupils": [(203.6, 101.0), (247.2, 103.2)], "nose": (224.4, 128.0), "mouth": (222.4, 146.1), "px": 2},
    "grace_hopper": {
        "pupils": [(221.5, 190.0), (307.0, 187.5)],
        "nose": (268.0, 241.0),
        "mouth": (268.5, 277.0),
        "px": 5,
    },
}


def distance(found: Landmarks | None, expected: NDArray[np.float64]) -> float:
    """Return the mean distance of the points from ``expected``, (468, 2), in distances of the eyes' outer corners."""
    assert found is not None
    apart = np.linalg.norm(expected[33] - expected[263])
    return float(np.linalg.norm(found.points[:, :2] - expected, axis=1).mean() / apart)


@pytest.mark.parametrize("photo", PHOTOS)
def test_points_are_where_a_person_sees_them(photo: Callable[[], Pixels]) -> None:
    image, seen = photo(), SEEN[photo.__name__]
    found = find_landmarks(image)
    assert found is not None
    assert found.score > 0.99
    assert found.points.shape == (468, 3)
    assert found.iris.shape == (2, 5, 3)
    np.testing.assert_allclose(found.iris[:, 0, :2], seen["pupils"], atol=seen["px"])
    np.testing.assert_allclose(found.points[1, :2], seen["nose"], atol=2 * seen["px"])
    np.testing.assert_allclose(found.points[[13, 14], :2].mean(axis=0), seen["mouth"], atol=2 * seen["px"])
    # The person's right is at the left; the tip of the nose is nearer than the ears.
    assert found.points[33, 0] < found.points[263, 0]
    assert found.points[1, 2] < found.points[[234, 454], 2].min()
    assert (found.box[:2] <= found.points[:, :2].min(axis=0)).all()


@pytest.mark.parametrize("photo", PHOTOS)
@pytest.mark.parametrize("angle", [-90, 30, 135, 180])
def test_turned_photos(photo: Callable[[], Pixels], angle: int) -> None:
    image = photo()
    upright = find_landmarks(image)
    assert upright is not None
    turned = Image.fromarray(image).rotate(angle, expand=True, resample=Image.Resampling.BICUBIC)
    sin, cos = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    centred = upright.points[:, :2] - np.array(image.shape[1::-1]) / 2
    expected = centred @ np.array([[cos, -sin], [sin, cos]]) + np.array(turned.size) / 2
    assert distance(find_landmarks(np.array(turned)), expected) < 0.02


@pytest.mark.parametrize("photo", PHOTOS)
@pytest.mark.parametrize(
    ("change", "allowed"), [("quarter", 0.04), ("double", 0.01), ("dark", 0.02), ("small", 0.02), ("tight", 0.03)]
)
def test_scaled_dark_small_and_tight_photos(photo: Callable[[], Pixels], change: str, allowed: float) -> None:
    image = photo()
    found = find_landmarks(image)
    assert found is not None
    expected = found.points[:, :2]
    height, width = image.shape[:2]
    if change in ("quarter", "double"):
        scale = 0.25 if change == "quarter" else 2.0
        size = (round(scale * width), round(scale * height))
        changed = np.array(Image.fromarray(image).resize(size, Image.Resampling.LANCZOS))
        expected = expected * scale
    elif change == "dark":
        changed = (image // 16).astype(np.uint8)
    elif change == "small":
        changed = np.full((3 * height, 3 * width, 3), 90, dtype=np.uint8)
        changed[height : 2 * height, 100 : 100 + width] = image
        expected = expected + (100, height)
    else:
        left, top, right, bottom = found.box.astype(int)
        changed = image[top - 5 : bottom + 5, left - 5 : right + 5]
        expected = expected - (left - 5, top - 5)
    assert distance(find_landmarks(changed), expected) < allowed


def test_several_faces() -> None:
    one = grace_hopper()[60:420, 80:440]
    image = np.hstack([one, one[:, ::-1], np.array(Image.fromarray(one).resize((120, 360)))])
    faces = find_all_landmarks(image)
    assert len(faces) >= 2
    middles = sorted(float(face.points[1, 0]) for face in faces)
    assert abs(middles[0] - 188) < 12
    assert abs(middles[1] - (720 - 188)) < 12


def test_images_without_faces() -> None:
    # Of an image without upright faces, all searches are tried.
    rng = np.random.default_rng(0)
    columns, rows = np.meshgrid(np.arange(200), np.arange(150))
    waves = (127 + 120 * np.sin(columns / 9.0) * np.cos(rows / 13.0)).astype(np.uint8)
    noise = rng.integers(0, 256, (150, 200, 3)).astype(np.uint8)
    for image in (waves, noise, np.zeros((1, 1), np.uint8), np.full((5, 300, 3), 255, np.uint8)):
        assert find_all_landmarks(image) == []


def test_other_arrays_are_refused() -> None:
    for image in (
        np.zeros((4, 4)),
        np.zeros((4, 4, 2), np.uint8),
        np.zeros((0, 4, 3), np.uint8),
        np.zeros(4, np.uint8),
    ):
        with pytest.raises(ValueError, match="8-bit"):
            find_landmarks(image)


def test_grey_and_transparent_images_are_read() -> None:
    image = grace_hopper()
    grey = np.asarray(Image.fromarray(image).convert("L"))
    found, expected = find_landmarks(grey), find_landmarks(image)
    assert expected is not None
    assert distance(found, expected.points[:, :2]) < 0.03
    assert find_landmarks(np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])) is not None


def test_crops_sample_where_they_say() -> None:
    columns, rows = np.meshgrid(np.arange(200), np.arange(100))
    picture = Picture(np.dstack([columns, rows, np.zeros_like(rows)]).astype(np.uint8))
    for square in (Square(100, 50, 20), Square(90, 45, 60, 0.7), Square(100, 50, 64, -2.0)):
        pixels = picture.crop(square, 16)
        steps = (np.arange(16) + 0.5) / 16 - 0.5
        places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        np.testing.assert_allclose(pixels.reshape(-1, 3)[:, :2], square.to_image(places) - 0.5, atol=0.51)
    outside = picture.crop(Square(-100, 50, 50), 8, repeat_edge=False)
    assert not outside.any()
