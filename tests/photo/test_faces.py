"""Faces of photos: read in any form, or refused in one sentence; and their expressions on characters."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.identity.photos.landmark_fit import PhotoFace
from faceposer.model.face_model import FaceModel
from faceposer.photo.automatic import expression_of
from faceposer.photo.faces import FaceInPhoto, read_face
from tests.landmarks.photos import astronaut

_ORIENTATION = 0x0112


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo in many forms."""
    folder = tmp_path_factory.mktemp("photos")
    image = Image.fromarray(astronaut())
    image.save(folder / "plain.jpg", quality=95)
    image.convert("L").save(folder / "grey.png")
    image.convert("CMYK").save(folder / "cmyk.jpg", quality=95)
    turned = image.transpose(Image.Transpose.ROTATE_90)
    exif = Image.Exif()
    exif[_ORIENTATION] = 6
    turned.save(folder / "exif.jpg", quality=95, exif=exif)
    image.resize((64, 64)).save(folder / "tiny.png")
    Image.new("RGB", (300, 200), (90, 120, 90)).save(folder / "nobody.png")
    return folder


@pytest.fixture(scope="module")
def plain(folder: Path) -> FaceInPhoto:
    return read_face(folder / "plain.jpg")


@pytest.mark.parametrize("name", ["grey.png", "cmyk.jpg", "exif.jpg"])
def test_photos_in_other_forms_have_the_same_face(folder: Path, plain: FaceInPhoto, name: str) -> None:
    found = read_face(folder / name)
    off = np.linalg.norm(found.face.landmarks.points - plain.face.landmarks.points, axis=1)
    assert found.face.size == (512, 512)
    assert off.mean() < 2.0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("tiny.png", r"The face in '.*tiny\.png' is \d+ pixels high, and at least 60|No face was found in"),
        ("nobody.png", r"No face was found in '.*nobody\.png'; use a photo in which"),
    ],
)
def test_photos_without_a_face_are_refused(folder: Path, name: str, message: str) -> None:
    with pytest.raises(FacePoserError, match=message):
        read_face(folder / name)


def test_a_large_photo_is_reduced_and_its_camera_is_that_of_the_file(plain: FaceInPhoto, tmp_path: Path) -> None:
    Image.fromarray(astronaut()).resize((3072, 3072)).save(tmp_path / "large.jpg", quality=80)
    found = read_face(tmp_path / "large.jpg")
    assert max(found.pixels.shape) == 2048
    assert found.factor == pytest.approx(1.5)
    off = found.factor * found.face.landmarks.points[:, :2] / 6.0 - plain.face.landmarks.points[:, :2]
    assert np.linalg.norm(off, axis=1).mean() < 2.0


def test_of_a_large_photo_the_part_around_the_face_is_kept(plain: FaceInPhoto) -> None:
    canvas, shift = np.zeros((2304, 2600, 3), dtype=np.uint8), np.array([1500, 900])
    canvas[900:1412, 1500:2012] = plain.pixels
    marks = plain.face.landmarks
    moved = replace(
        marks,
        points=marks.points + (*shift, 0.0),
        iris=marks.iris + (*shift, 0.0),
        box=marks.box + np.tile(shift, 2),
    )
    face = PhotoFace(moved, (2600, 2304), 3000.0, 0.1)
    file = replace(plain.file, size=(5200, 4608))
    large = FaceInPhoto(plain.path, file, canvas, face, {"8.3": (1700.0, 1100.0)})
    cut = large.cut()
    assert plain.cut() is plain
    assert cut.pixels.nbytes < 0.1 * canvas.nbytes
    assert cut.factor == large.factor == 2.0
    x, y = (cut.face.landmarks.points[4, :2] - 0.5).astype(int)
    u, v = (moved.points[4, :2] - 0.5).astype(int)
    np.testing.assert_array_equal(cut.pixels[y, x], canvas[v, u])
    for name, pixel in large.features().items():
        assert cut.features()[name] == pytest.approx(pixel, abs=1e-6)
    # One camera, in pixels of either, is one camera of the photo.
    rotation, translation = np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 90.0])
    whole = Camera(rotation, translation, 3000.0, (2600, 2304))
    u, v = whole.principal_point - cut.corner
    size = cut.face.size
    part = Camera(rotation, translation, 3000.0, size, (u - size[0] / 2.0, v - size[1] / 2.0))
    assert cut.face.centre == pytest.approx((u, v))
    point = np.array([[3.0, -2.0, 4.0]])
    np.testing.assert_allclose(cut.full_camera(part).project(point), large.full_camera(whole).project(point))
    np.testing.assert_allclose(large.full_camera(whole).project(point), 2.0 * whole.project(point))


def test_a_smile_is_taken_by_the_woman(plain: FaceInPhoto, woman: FaceModel) -> None:
    """The astronaut smiles with an open mouth and looks into the camera."""
    taken = expression_of(plain, woman)
    weights = dict(zip(woman.character.shape_names, woman.weights_of(taken.pose), strict=True))
    for side in ("Left", "Right"):
        assert weights[f"mouthSmile{side}"] > 0.15
        assert weights[f"mouthFrown{side}"] < 0.1
        assert weights[f"eyeBlink{side}"] < 0.5
    assert taken.photo.camera is not None
    assert len(taken.photo.pins) > 20
    pixels = taken.photo.camera.project(woman.instance(taken.pose)[[woman.character.feature_points["9.3"]]])
    # The tip of the nose.
    assert np.abs(pixels - (224.4, 128.0)).max() < 8.0
