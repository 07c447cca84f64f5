"""The pose carried to another character, in the window."""

import json
from pathlib import Path

import numpy as np
import pytest

from faceposer.gui.app import App
from faceposer.gui.features.transfer.feature import TransferFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.transfer.pairs import DEFAULT_PAIRS, PAPER_PAIRS, pairs_to_json
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    robot = open_window("low", (800, 600))
    session = robot.app.session
    with session.edit("Smile"):
        session.set_start(session.model.coefficients_of({"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8}))
    robot.frames(2)
    return robot


def state_of(robot: Robot) -> TransferFeature:
    return next(f for f in robot.app.features._features if isinstance(f, TransferFeature))


def weight(app: App, name: str) -> float:
    model = app.session.model
    return float(model.weights_of(app.session.coefficients)[model.character.shape_names.index(name)])


def begin(robot: Robot, to: str) -> TransferFeature:
    robot.click_widget("menu:Edit")
    robot.click_widget("menu:transfer")
    robot.click_widget("transfer:to")
    robot.click_widget(f"transfer:to:{to}")
    robot.frames(2)
    return state_of(robot)


@pytest.mark.slow
def test_a_smile_goes_to_another_face_as_a_new_pose(robot: Robot) -> None:
    app = robot.app
    state = begin(robot, "woman")
    assert app.is_modal
    drawn = [scene.images_rendered for scene in state.scenes]
    robot.frames(5)
    assert [scene.images_rendered for scene in state.scenes] == drawn
    robot.click_widget("transfer:open")
    # What was there is not saved.
    robot.frames(2)
    assert app.session.model.character.name == "low"
    robot.click_widget("choice:1")
    robot.frames(2)
    assert app.session.model.character.name == "woman"
    assert app.session.document.character == "woman"
    assert 0.5 < weight(app, "mouthSmileLeft") < 1.1
    assert app.session.dirty
    assert not app.is_modal


def test_the_small_picture_and_the_lengths_follow_the_pairs_that_count(robot: Robot) -> None:
    state = begin(robot, "creature")
    before = state.result
    assert before is not None
    assert len(state.lengths[1]) == len(DEFAULT_PAIRS)
    robot.click_widget("transfer:preset:paper")
    assert state.pairs == PAPER_PAIRS
    assert state.result is not None
    assert not np.allclose(before, state.result)
    robot.click_widget("transfer:pair:0")
    assert [pair.enabled for pair in state.pairs] == [False, True, True]
    robot.click_widget("transfer:pair:1:remove")
    assert state.pairs[1] == PAPER_PAIRS[2]
    robot.click_widget("transfer:add")
    assert (state.pairs[0].first, state.pairs[0].second) == ("8.3", "8.4")
    assert state.lengths[0][0] == pytest.approx(5.6, abs=0.8)


def test_a_face_without_the_shapes_is_told_and_nothing_can_be_opened(robot: Robot) -> None:
    state = begin(robot, "creature")
    robot.click_widget("transfer:method:1")
    assert "none of ARKit's shapes" in state.error
    robot.click_widget("transfer:open")
    assert state.open
    robot.key("Esc")
    assert not state.open
    assert robot.app.session.model.character.name == "low"


def test_lists_are_read_and_written(robot: Robot, tmp_path: Path) -> None:
    state = begin(robot, "woman")
    path = tmp_path / "pairs.json"
    path.write_text(json.dumps(pairs_to_json(PAPER_PAIRS)))
    state.load_pairs(path)
    assert state.pairs == PAPER_PAIRS
    state.enable(1, False)
    state.save_pairs(path)
    assert json.loads(path.read_text())["pairs"][1]["enabled"] is False
    path.write_text("{")
    state.load_pairs(path)
    robot.frames(2)
    assert robot.app.dialogs.open
    robot.key("Enter")
    robot.frames(2)
    assert state.open
    assert "transfer:open" in robot.app.widget_rects


@pytest.mark.slow
def test_a_file_is_chosen_over_the_dialog_which_comes_back(robot: Robot) -> None:
    state = begin(robot, "woman")
    robot.click_widget("transfer:to:file")
    assert robot.app.file_dialogs.open
    assert "transfer:open" not in robot.app.widget_rects
    robot.key("Esc")
    robot.frames(2)
    assert "transfer:open" in robot.app.widget_rects
    assert state.to == "woman"
