"""``faceposer photo SESSION --render``: the picture, and what is refused in one sentence before anything is lost."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import faceposer
from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.photo.photo import Photo
from faceposer.poses.pose_file import Pose, write_pose
from faceposer.session.opening import open_session
from tests.command_line import run

SIZE = (120, 130)
CAMERA = Camera(np.diag([1.0, -1.0, -1.0]), np.array([0.3, -1.0, 130.0]), 500.0, SIZE)
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def session(model: FaceModel, tmp_path: Path) -> Path:
    """A session with a photo, whose pose is known."""
    shot = tmp_path / "shot.png"
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    Image.fromarray(np.stack([rows + 60, columns + 60, 0 * rows + 90], axis=2).astype(np.uint8)).save(shot)
    return written(model, tmp_path / "me.json", Photo(str(shot), SIZE, camera=CAMERA))


def written(model: FaceModel, path: Path, photo: Photo) -> Path:
    """Write a session with ``photo``, which shows the neutral face, to ``path``."""
    with closing(open_session("man")) as opened:
        with opened.edit("Open a photo"):
            opened.replace(replace(opened.document, photos=(photo.with_expression(model, model.neutral()),)))
        opened.wait()
        opened.save(path, photo.camera)
    return path


def refused(capsys: Capture, *words: object) -> str:
    """Check that ``faceposer photo`` refuses ``words`` in one sentence, and return it."""
    assert run("photo", *words) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


def test_the_picture_is_written_and_no_input_lost(session: Path, tmp_path: Path, capsys: Capture) -> None:
    shot, out, mine = tmp_path / "shot.png", tmp_path / "o.png", tmp_path / "mine.json"
    write_pose(mine, Pose("Mine", {"jawOpen": 0.5}))
    before = {path: path.read_bytes() for path in (shot, mine, session)}
    taken = tmp_path / "photo.json"
    taken.symlink_to(shot)
    for words in (
        ("--render", out, "--pose", mine, "-o", mine),
        ("--render", out, "--pose", mine, "-o", tmp_path / "." / ".." / tmp_path.name / "mine.json"),
        ("--render", shot),
        ("--render", out, "-o", taken),
    ):
        assert "is also an input; give the output another name" in refused(capsys, session, *words)
    # A photo of the session is no output when another photo is added, either.
    other = tmp_path / "other.png"
    Image.new("RGB", SIZE, (90, 90, 90)).save(other)
    pins = tmp_path / "pins.json"
    pins.write_text('{"format": "faceposer.pins", "version": 1, "pins": [{"point": "9.3", "pixel": [60, 60]}]}')
    adding = (session, other, "--pins", pins, "-o", tmp_path / "two.json")
    assert "is also an input" in refused(capsys, *adding, "--render", shot)
    out.symlink_to(mine)
    assert "is also an input" in refused(capsys, session, "--render", out, "--pose", mine)
    assert {path: path.read_bytes() for path in before} == before
    out.unlink()
    assert run("photo", session, "--render", out) == 0
    np.testing.assert_array_equal(np.asarray(Image.open(out)), np.asarray(Image.open(shot)))


def test_what_cannot_be_rendered_is_said_with_the_photo(
    session: Path, model: FaceModel, tmp_path: Path, capsys: Capture
) -> None:
    shot, out = tmp_path / "shot.png", tmp_path / "o.png"
    behind = Camera(CAMERA.rotation, CAMERA.translation * (1.0, 1.0, -1.0), CAMERA.focal, SIZE)
    aside = Camera(CAMERA.rotation, CAMERA.translation + (900.0, 0.0, 0.0), CAMERA.focal, SIZE)
    for camera, words in ((behind, "behind the camera of the photo"), (aside, "outside the photo")):
        wrong = written(model, tmp_path / "wrong.json", Photo(str(shot), SIZE, camera=camera))
        said = refused(capsys, wrong, "--render", out)
        assert f"{words} 'shot.png'" in said
        assert "faceposer photo CHARACTER PHOTO --auto" in said
    assert "--focal needs a PHOTO" in refused(capsys, session, "--render", out, "--focal", 0)
    for words in (("--strength", 0), ("--pose", "")):
        adding = ("woman", shot, "--auto", "-o", tmp_path / "two.json", *words)
        assert "change a face in the photo of its session" in refused(capsys, *adding)
    Image.new("RGB", (120, 140), (90, 90, 90)).save(shot)
    said = refused(capsys, session, "--render", out)
    assert "shot.png' has 120 x 140 pixels, but the session was made with 120 x 130; put the photo back, or" in said
    assert not out.exists()


def test_python_overwrites_no_photo_of_the_session(session: Path, tmp_path: Path) -> None:
    shot, link = tmp_path / "shot.png", tmp_path / "link.png"
    before = shot.read_bytes()
    link.symlink_to(shot)
    face = faceposer.Face(open_session(str(session)))
    for path in (shot, link):
        with pytest.raises(FacePoserError, match="is a photo of the session; give the picture another name"):
            face.put_back(0, path)
    assert shot.read_bytes() == before


def test_options_may_be_repeated_and_photos_have_numbers_from_one(
    session: Path, tmp_path: Path, capsys: Capture
) -> None:
    once, twice = tmp_path / "once.json", tmp_path / "twice.json"
    picture = ("--render", tmp_path / "o.png")
    assert run("photo", session, *picture, "-o", once, "--set", "weight=0.5", "age=0.5") == 0
    assert run("photo", session, *picture, "-o", twice, "--set", "weight=0.5", "--set", "age=0.5") == 0
    assert once.read_bytes() == twice.read_bytes()
    capsys.readouterr()
    for number in ("0", "-1", "1.5", "x"):
        assert run("photo", session, *picture, "--photo-number", number) == 2
        assert "is not a whole number from 1 to 100" in capsys.readouterr().err
    assert "The session has no photo 2" in refused(capsys, session, *picture, "--photo-number", "2")
    assert "--add changes the present value: weight is " in refused(capsys, session, *picture, "--add", "weight=9")
