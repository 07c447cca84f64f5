"""A registered export format is offered in the window, on the command line and in Python, with no other change."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import faceposer
from faceposer.errors import FacePoserError
from faceposer.gui.features.export.feature import ExportFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.interchange.formats import FORMATS, register, write
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from tests.command_line import run
from tests.made_up import CLOUD, registered_formats
from tests.windows import OpenWindow

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def made_up() -> Iterator[None]:
    with registered_formats():
        yield


@pytest.fixture
def robot(made_up: None, open_window: OpenWindow) -> Robot:
    return open_window()


def choose(robot: Robot, name: str) -> None:
    robot.key("Ctrl+A")
    robot.type(name)
    robot.click_widget("files:accept")


def test_it_is_unknown_before_and_after(low: FaceModel, tmp_path: Path) -> None:
    known = dict(FORMATS)
    with registered_formats():
        write(tmp_path / "a.xyz", low, low.neutral())
        with pytest.raises(ValueError, match=r"'\.xyz' is not a new, lower-case suffix"):
            register(CLOUD)
    assert known == FORMATS
    assert list(known) == list(FORMATS)
    with pytest.raises(FacePoserError, match="must end in one of"):
        write(tmp_path / "b.xyz", low, low.neutral())
    assert [path.name for path in tmp_path.iterdir()] == ["a.xyz"]


@pytest.mark.gl
def test_the_dialog_offers_it_and_writes_it(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    pose = app.session.model.coefficients_of({"jawOpen": 0.8})
    with app.session.edit("Pose"):
        app.session.set_start(pose)
    robot.frames(2)
    app.actions["export-other"].run()
    robot.frames(6)
    robot.click_widget("export:xyz")
    assert "export:size" not in app.widget_rects, "no options of pictures"
    robot.click_widget("export:accept")
    choose(robot, "face")
    assert app.notice == "Saved face.xyz"
    np.testing.assert_allclose(np.loadtxt(tmp_path / "face.xyz"), app.session.model.surface(pose), atol=1e-5)


@pytest.mark.gl
def test_the_dialog_has_the_options_of_a_film_for_it(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    app.actions["export-other"].run()
    robot.frames(6)
    robot.click_widget("export:flip")
    robot.frames(2)
    assert {"export:size", "export:seconds", "export:rate"} <= set(app.widget_rects)
    form = app.feature(ExportFeature).form
    form.width, form.height, form.seconds = 120, 80, 3.0
    robot.click_widget("export:accept")
    choose(robot, "face")
    robot.frames(3)
    assert (tmp_path / "face.flip").read_text() == "frames 1 turn 3 size 120x80\n"


@pytest.mark.usefixtures("made_up")
def test_the_command_writes_it(low: FaceModel, tmp_path: Path, capsys: Capture) -> None:
    assert run("export", "low", "-o", tmp_path / "a.xyz") == 0
    assert capsys.readouterr().out == f"{tmp_path / 'a.xyz'} written\n"
    np.testing.assert_allclose(np.loadtxt(tmp_path / "a.xyz"), low.character.vertices, atol=1e-5)
    take = tmp_path / "take.json"
    write(take, low, Performance(np.linspace(0, 1, 3)[:, None] * low.coefficients_of({"jawOpen": 1.0}), 30.0))
    assert run("export", "low", "--animation", take, "-o", tmp_path / "take", "--sequence", "xyz") == 0
    assert sorted(path.name for path in (tmp_path / "take").iterdir()) == ["0001.xyz", "0002.xyz", "0003.xyz"]
    assert run("export", "low", "--animation", take, "-o", tmp_path / "b.xyz") == 2
    assert "holds one pose" in capsys.readouterr().err
    assert run("export", "low", "--turntable", "2", "-o", tmp_path / "a.flip") == 0
    assert (tmp_path / "a.flip").read_text() == "frames 1 turn 2 size 640x640\n"
    assert run("export", "low", "-o", tmp_path / "a.horse") == 2
    assert ".xyz" in capsys.readouterr().err


@pytest.mark.usefixtures("made_up")
def test_the_help_of_the_command_names_it(capsys: Capture) -> None:
    assert run("export", "--help") == 0
    shown = capsys.readouterr().out
    assert CLOUD.purpose in shown
    assert all(form.suffix in shown for form in FORMATS.values())


@pytest.mark.usefixtures("made_up")
def test_python_writes_it(tmp_path: Path) -> None:
    face = faceposer.load("low")
    face.set_weights({"jawOpen": 0.8})
    assert face.export(tmp_path / "a.xyz") == tmp_path / "a.xyz"
    np.testing.assert_allclose(np.loadtxt(tmp_path / "a.xyz"), face.vertices, atol=1e-5)
    face.save(tmp_path / "b.xyz")
    assert (tmp_path / "b.xyz").read_bytes() == (tmp_path / "a.xyz").read_bytes()
    face.export(tmp_path / "a.flip", turn=2.0)
    assert (tmp_path / "a.flip").read_text() == "frames 1 turn 2 size 640x640\n"
    with pytest.raises(FacePoserError, match="turns in videos only"):
        face.export(tmp_path / "c.xyz", turn=2.0)
