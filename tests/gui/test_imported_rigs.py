"""Real rigs of other people, imported and posed like the faces that come with the program."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from faceposer.geometry.mesh_io import read_mesh
from faceposer.gui.features.guide.feature import GuideFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.character import Character
from faceposer.model.character_file import save_character
from faceposer.model.expression_lines import expression_lines
from faceposer.session.opening import open_session
from tests.windows import OpenWindow

RIGS = os.environ.get("FACEPOSER_RIGS")
pytestmark = pytest.mark.skipif(not RIGS, reason="FACEPOSER_RIGS names no folder of rigs")


@pytest.fixture(scope="module", params=["facecap", "facecap_multi"])
def character(request: pytest.FixtureRequest) -> Character:
    from faceposer.training.request import TrainingRequest, train

    return train(TrainingRequest("rig", Path(RIGS or "") / f"{request.param}.glb", request.param, request.param))


Start = Callable[[str], Robot]


@pytest.fixture
def start(tmp_path: Path, open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch) -> Start:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    def call(what: str) -> Robot:
        return open_window(what, journal=True, welcome_done=False)

    return call


@pytest.fixture
def robot(character: Character, start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Robot:
    """The program with the rig, named as seen from the folder that it was started in."""
    work = tmp_path / "work"
    work.mkdir()
    save_character(work / "head.npz", character)
    monkeypatch.chdir(work)
    return start("head.npz")


def test_expression_lines_are_found(character: Character) -> None:
    lines = expression_lines(character)
    assert lines is not None
    for shape, zone in (("browOuterUpLeft", "forehead_outer_left"), ("mouthSmileLeft", "nasolabial_lower_left")):
        vertices = character.vertices + character.shapes[character.shape_names.index(shape)]
        assert lines.by_zone(vertices)[zone] > 0.7


def test_tools_know_the_face(character: Character, robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    work = tmp_path / "work"
    assert app.settings.recent == [str(work / "head.npz")]
    neutral = app.scene.vertices.copy()

    # The guided pose finds its places.
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 12, y - 14))
    assert app.features[GuideFeature].step is not None
    assert app.features[GuideFeature].step.name == "brow"
    assert app.point_name(0) in ("left mouth corner", "inner left mouth corner")
    weights = dict(zip(character.shape_names, app.session.model.weights_of(app.session.coefficients), strict=True))
    assert weights["mouthSmileLeft"] > 0.2
    robot.key("R")

    robot.key("X")
    x, y = robot.at("4.3")
    robot.drag((x, y), (x, y - 10))
    points = [character.feature_points["4.3"], character.feature_points["4.4"]]
    left, right = (app.scene.vertices - neutral)[points, 1]
    assert left > 0.1
    assert right == pytest.approx(left, rel=0.35)
    robot.key("X")
    robot.key("R")

    eyes = sum(part.material == "eye" for part in character.parts)
    assert ("tool-gaze" in app.widget_rects) == (eyes == 2)
    robot.key("D")
    robot.frames(3)
    assert sum(mark.startswith("measure:") for mark in app.widget_rects) == 6
    robot.key("H")
    robot.frames(3)
    assert {"hold:Mouth", "hold:Brows", "hold:Cheeks", "hold:Jaw"} <= set(app.widget_rects)


def test_posed_saved_and_recovered(
    character: Character, robot: Robot, start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    app = robot.app
    neutral = app.scene.vertices.copy()
    robot.click_widget("tab:Shapes")
    robot.frames(4)
    left_edge, top, _, bottom = app.widget_rects["shape:browInnerUp"]
    robot.drag((left_edge + 12, 0.5 * (top + bottom)), (left_edge + 70, 0.5 * (top + bottom)))
    assert np.abs(app.scene.vertices - neutral).max() > 0.1
    pose = app.session.coefficients.copy()

    # The mesh has the file's own vertices and unit; so has the session's character its place.
    app.files._export(tmp_path / "posed.obj")
    assert character.origin is not None
    assert len(read_mesh(tmp_path / "posed.obj").vertices) == len(character.origin.neutral)
    saved = tmp_path / "elsewhere" / "far" / "pose.json"
    saved.parent.mkdir(parents=True)
    app.files._save(saved)
    robot.click_widget("tab:Pose")
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 12, y - 14))
    unsaved = app.session.document
    app.close()
    monkeypatch.chdir(tmp_path)
    again = open_session(str(saved))
    np.testing.assert_allclose(again.coefficients, pose, atol=1e-9)

    robot = start("man")
    robot.frames(2)
    assert robot.app.dialogs.waiting[0].title == "Recover pose.json?"
    robot.click_widget("choice:0")
    robot.frames(2)
    assert robot.app.session.model.character.name == character.name
    assert robot.app.session.document.same_input(unsaved)
