"""Faces of photos: read in any form, or refused in one sentence; and their expressions on characters."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.errors import FacePoserError
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
