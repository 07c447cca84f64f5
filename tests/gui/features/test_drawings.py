"""Drawings at the window: dropped, recognised in the background, one step of the history."""

from pathlib import Path

import pytest

from faceposer.gui.events import Drop
from faceposer.gui.features.drawings.feature import DrawingsFeature
from faceposer.gui.testing.scripted_user import Robot
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

DRAWINGS = Path(__file__).resolve().parents[3] / "docs" / "drawings"


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("man", (1100, 900))


def drop(robot: Robot, path: Path) -> None:
    robot.app.window.play_event(Drop((str(path),)))
    robot.frames(2)
    robot.app.feature(DrawingsFeature).join()
    robot.frames(3)


def test_a_dropped_drawing_is_one_step(robot: Robot) -> None:
    app = robot.app
    vertex = app.session.model.character.feature_points["8.3"]
    before = float(app.scene.vertices[vertex, 1])
    drop(robot, DRAWINGS / "sadness.svg")
    robot.frames(5)
    features = {c.feature for c in app.session.document.constraints}  # type: ignore[union-attr]
    assert {"left brow", "right brow", "mouth line"} <= features
    assert float(app.scene.vertices[vertex, 1]) < before - 0.1, "corners of the mouth go down"
    assert app.session.undo_label == "Open the drawing sadness.svg"
    app.session.undo()
    robot.frames(2)
    assert not app.session.document.constraints


def test_a_file_without_a_face_changes_nothing(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "empty.svg"
    path.write_text('<svg xmlns="http://www.w3.org/2000/svg"><text>no lines</text></svg>')
    drop(robot, path)
    assert robot.app.dialogs.open
    assert not robot.app.session.document.constraints


def test_a_drawing_for_which_there_is_no_room_is_reported(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("faceposer.session.effort.MOST_DRAWN", 1)
    drop(robot, DRAWINGS / "sadness.svg")
    assert robot.app.dialogs.open
    assert not robot.app.session.document.constraints
