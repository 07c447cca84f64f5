"""The timeline and trajectories in the window, driven by pointer and keys alone."""

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.animation.keyframes import Keyframes
from faceposer.gui.features.animation_files.feature import AnimationFilesFeature
from faceposer.gui.features.export.feature import ExportFeature
from faceposer.gui.features.timeline.editor import TimelineEditor
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.trajectories.feature import TrajectoriesFeature
from faceposer.gui.testing.scripted_user import Position, Robot
from faceposer.gui.widgets.dialogs import Question
from faceposer.interchange.weights_json import write_weights
from faceposer.model.face_model import FaceModel
from faceposer.progress import Progress
from faceposer.session.document import read_document
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

CORNER, BROW = "8.3", "4.1"
CTRL, SHIFT = frozenset({"ctrl"}), frozenset({"shift"})


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("man", (1000, 560))


def timeline(robot: Robot) -> TimelineEditor:
    return robot.app.features[TimelineFeature].editor


def frames(robot: Robot) -> tuple[int, ...]:
    return timeline(robot).keyframes.frames


def here(robot: Robot) -> int:
    return robot.app.session.document.frame


def scrub(robot: Robot, frame: int) -> None:
    robot.click(robot.app.features[TimelineFeature].track.ruler_place(frame))


def place(robot: Robot, frame: int) -> Position:
    return robot.app.features[TimelineFeature].track.place(frame)


def pull(robot: Robot, feature: str, dx: float, dy: float) -> None:
    x, y = robot.at(feature)
    robot.drag((x, y), (x + dx, y + dy), steps=3)


def animate(robot: Robot) -> None:
    """Make a smile at frame 1, a neutral face at 15 and raise a brow at 30, as users count."""
    pull(robot, CORNER, 12, -14)
    robot.key("I")
    robot.frames(2)
    scrub(robot, 14)
    robot.key("R")
    scrub(robot, 29)
    pull(robot, BROW, 0, -15)
    scrub(robot, 0)
    assert frames(robot) == (0, 14, 29)


def test_the_strip_comes_with_the_first_key_and_changes_become_keys(robot: Robot) -> None:
    app = robot.app
    height = app.viewport.size[1]
    assert not timeline(robot).shown
    pull(robot, CORNER, 12, -14)
    assert frames(robot) == ()
    robot.key("I")
    robot.frames(2)
    assert frames(robot) == (0,)
    assert app.viewport.size[1] < height
    assert timeline(robot).animation.shown == "key"
    scrub(robot, 14)
    assert here(robot) == 14
    assert app.session.document.constraints == ()
    robot.key("R")
    assert frames(robot) == (0, 14)
    np.testing.assert_allclose(app.scene.vertices, app.session.model.character.vertices, atol=1e-4)
    robot.click_widget("auto-key")
    scrub(robot, 29)
    pull(robot, BROW, 0, -15)
    assert timeline(robot).animation.shown == "changed"
    scrub(robot, 20)
    assert app.notice.startswith("The pose at frame 30 had no key")
    robot.key("Ctrl+Z")
    assert here(robot) == 29
    robot.click_widget("set-key")
    assert frames(robot) == (0, 14, 29)
    robot.key("A")
    robot.frames(2)
    assert app.viewport.size[1] == height


def test_scrubbing_poses_the_face_and_is_no_edit(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    animate(robot)
    app.session.save(tmp_path / "a.json")
    label = app.session.undo_label
    track = robot.app.features[TimelineFeature].track
    smile = app.scene.vertices.copy()
    robot.move(track.ruler_place(0))
    robot.press()
    seen = set()
    for step in range(15):
        robot.move(track.ruler_place(step))
        seen.add(here(robot))
        assert app.session.undo_label == label
    robot.release()
    assert seen == set(range(15))
    assert np.abs(app.scene.vertices - smile).max() > 0.3
    assert not app.session.dirty
    assert not app.files.title.count("*")
    again = read_document(tmp_path / "a.json")
    assert again.keyframes is not None
    assert again.keyframes.same(timeline(robot).keyframes)
    app.files.open(str(tmp_path / "a.json"))
    robot.frames(2)
    assert frames(robot) == (0, 14, 29)
    assert timeline(robot).shown


def test_keys_are_moved_copied_and_deleted(robot: Robot) -> None:
    app = robot.app
    animate(robot)
    robot.drag(place(robot, 14), place(robot, 20))
    assert frames(robot) == (0, 20, 29)
    assert timeline(robot).selected == {20}
    robot.key("Ctrl+Z")
    assert frames(robot) == (0, 14, 29)
    robot.drag(place(robot, 14), place(robot, 40), modifiers=CTRL)
    assert frames(robot) == (0, 14, 29, 40)
    robot.drag(place(robot, 26), place(robot, 45))
    assert timeline(robot).selected == {29, 40}
    robot.click(place(robot, 14), modifiers=SHIFT)
    assert timeline(robot).selected == {14, 29, 40}
    assert here(robot) == 0, "to select more does not go there"
    robot.drag(place(robot, 29), place(robot, 32))
    assert frames(robot) == (0, 17, 32, 43)
    robot.key("Delete")
    assert frames(robot) == (0,)
    robot.key("Ctrl+Z")
    assert frames(robot) == (0, 17, 32, 43)
    robot.click(place(robot, 55))
    assert timeline(robot).selected == frozenset()
    robot.click(place(robot, 32), button="right")
    assert frames(robot) == (0, 17, 43)
    robot.click(place(robot, 17))
    assert here(robot) == 17
    robot.key("Ctrl+C")
    scrub(robot, 50)
    robot.key("Ctrl+V")
    assert frames(robot) == (0, 17, 43, 50)
    np.testing.assert_array_equal(app.session.coefficients, timeline(robot).keyframes.at(17).pose)
    robot.move(place(robot, 50))
    robot.press()
    robot.move(place(robot, 55), 3)
    robot.key("Esc")
    robot.release()
    assert frames(robot) == (0, 17, 43, 50), "Esc lets keys stay where they were"
    robot.key("Ctrl+A")
    assert timeline(robot).selected == {0, 17, 43, 50}
    pull(robot, CORNER, 8, -8)
    assert timeline(robot).selected == frozenset(), "a selected point takes over"
    robot.key("Delete")
    assert app.session.document.constraints == ()
    assert {0, 17, 43, 50} <= set(frames(robot))


def test_frames_by_keys(robot: Robot) -> None:
    animate(robot)
    seen = []
    for key in (".", ".", ".", ",", "End", "Alt+.", "Alt+,", "Home", ","):
        robot.key(key)
        seen.append(here(robot))
    assert seen == [14, 29, 29, 14, 59, 59, 58, 0, 0]


def test_playing_keeps_time_loops_and_stops_on_a_press(robot: Robot) -> None:
    app = robot.app
    animate(robot)
    timeline(robot).change(replace(timeline(robot).keyframes, length=20, rate=20.0), "Change the length", merges=True)
    robot.key("Shift+Space")
    begun = robot.time()
    assert timeline(robot).playing
    for _ in range(6):
        robot.frames(5)
        assert here(robot) == pytest.approx((robot.time() - begun) * 20.0, abs=2.0)
    assert not app.actions["undo"].enabled()
    assert not app.actions["set-key"].enabled()
    robot.frames(35)
    assert not timeline(robot).playing
    assert here(robot) == 19
    robot.click_widget("loop")
    robot.key("Shift+Space")
    robot.frames(65)
    assert timeline(robot).playing
    assert here(robot) < 10
    left, top, _, bottom = app.widget_rects["view"]
    view = app.viewport.view
    robot.drag((left + 30.0, (top + bottom) / 2), (left + 60.0, (top + bottom) / 2), button="middle")
    assert app.viewport.view != view
    assert timeline(robot).playing, "the view can be turned meanwhile"
    steps = app.session.undo_label
    robot.click(robot.at(CORNER))
    assert not timeline(robot).playing
    assert app.session.undo_label == steps, "the press that stops does not pose"
    assert app.session.document.constraints == ()
    robot.click(robot.at(CORNER))
    assert len(app.session.document.constraints) == 1


def test_length_and_rate_are_set_in_the_strip(robot: Robot) -> None:
    app = robot.app
    animate(robot)
    robot.click_widget("rate")
    robot.click_widget("rate:29.97")
    assert timeline(robot).keyframes.rate == 30000 / 1001
    robot.key("Ctrl+Z")
    robot.click_widget("rate")
    for name in ("23.976", "25", "48", "59.94", "120", "other"):
        assert f"rate:{name}" in app.widget_rects
    robot.click_widget("rate:24")
    assert timeline(robot).keyframes.rate == 24.0
    left, top, _, bottom = app.widget_rects["length"]
    robot.drag((left + 20.0, (top + bottom) / 2), (left + 120.0, (top + bottom) / 2))
    assert timeline(robot).keyframes.length > 60
    robot.key("Ctrl+Z")
    assert timeline(robot).keyframes.length == 60
    robot.key("Ctrl+Z")
    assert timeline(robot).keyframes.rate == 30.0


def test_inbetweens_are_chosen_in_the_strip_and_in_the_menu(open_window: OpenWindow) -> None:
    robot = open_window("man", (1360, 560))
    app = robot.app
    animate(robot)
    scrub(robot, 7)
    between = app.session.coefficients.copy()
    robot.click_widget("inbetweens-shown")
    robot.click_widget("inbetweens:feature points")
    assert timeline(robot).keyframes.inbetweens == "feature points"
    moved = app.session.coefficients
    assert np.abs(moved - between).max() > 1e-4, "the shown frame follows"
    assert timeline(robot).animation.performance is not None
    np.testing.assert_allclose(timeline(robot).animation.performance.coefficients[7], moved, atol=1e-9)
    robot.key("Ctrl+Z")
    assert timeline(robot).keyframes.inbetweens == "poses"
    np.testing.assert_array_equal(app.session.coefficients, between)
    app.actions["inbetweens"].run()
    assert timeline(robot).keyframes.inbetweens == "feature points"
    app.actions["inbetweens"].run()
    assert timeline(robot).keyframes.inbetweens == "poses"


def test_the_wheel_zooms_and_the_middle_button_moves_along(robot: Robot) -> None:
    animate(robot)
    track = robot.app.features[TimelineFeature].track
    robot.move(track.place(29))
    robot.wheel(5)
    assert track.x_of(30) - track.x_of(29) > 15.0
    assert track.frame_at(robot.position[0]) == pytest.approx(29.0, abs=0.1)
    x, y = robot.position
    robot.drag((x, y), (x + 100.0, y), button="middle")
    assert track.frame_at(x + 100.0) == pytest.approx(29.0, abs=0.2)
    robot.wheel(-20)
    assert track.frame_at(track.x_of(0)) == 0.0
    assert track.x_of(59) > track.x_of(0) + 400.0


def draw(robot: Robot, feature: str, dx: float, dy: float, steps: int) -> None:
    x, y = robot.at(feature)
    robot.drag((x, y), (x + dx, y + dy), steps=steps)


def settle(robot: Robot) -> None:
    following = robot.app.features[TrajectoriesFeature]
    while following.job is not None:
        following.job.join()
        robot.frames()


def test_the_face_follows_drawn_trajectories(robot: Robot) -> None:
    app = robot.app
    following = app.features[TrajectoriesFeature]
    robot.key("J")
    draw(robot, CORNER, 14, -16, 30)
    draw(robot, BROW, 0, -12, 12)
    assert len(following.tool.drawn) == 2
    wanted = [one.pixels[-1] + app.viewport.origin for one in following.tool.drawn]
    robot.key("Enter")
    settle(robot)
    keyframes = timeline(robot).keyframes
    assert timeline(robot).shown
    assert keyframes.length == max(len(following.positions(one)) for one in following.tool.drawn)
    assert 2 <= len(keyframes.keys) < keyframes.length
    assert app.session.undo_label == "Follow 2 trajectories"
    np.testing.assert_allclose(app.session.coefficients, 0.0, atol=0.05)
    scrub(robot, keyframes.length - 1)
    height = app.viewport.origin[1]
    for feature, target in zip((CORNER, BROW), wanted, strict=True):
        seen = robot.at(feature)
        # The strip has come since; the view keeps its middle.
        assert seen[1] > height
        now = following.tool.drawn[0 if feature == CORNER else 1].seen_in(app.viewport.camera)
        assert now is not None
        assert np.hypot(*(now[-1] + app.viewport.origin - seen)) < 6.0, target
    robot.key("Ctrl+Z")
    assert frames(robot) == ()
    assert len(following.tool.drawn) == 2
    keys = keyframes.frames
    for count in (1, 0):
        robot.key("Ctrl+Z")
        assert len(following.tool.drawn) == count
    for count in (1, 2):
        robot.key("Ctrl+Y")
        assert (len(following.tool.drawn), frames(robot)) == (count, ())
    robot.key("Ctrl+Y")
    assert frames(robot) == keys
    assert len(following.tool.drawn) == 2


def test_an_even_pace_every_frame_and_other_keys_stay(robot: Robot) -> None:
    app = robot.app
    animate(robot)
    scrub(robot, 20)
    robot.key("J")
    robot.click_widget("timing:1")
    robot.click_widget("few-keys:1")
    app.features[TrajectoriesFeature].options.frames = 12
    draw(robot, CORNER, 10, -10, 10)
    robot.frames()
    robot.move(app.widget_rects.center("smoothness"))
    robot.wheel(-5.0)
    robot.frames(3)
    robot.click_widget("follow")
    settle(robot)
    assert frames(robot) == (0, 14, *range(20, 32))
    assert here(robot) == 20
    robot.click_widget("clear-trajectories")
    assert app.features[TrajectoriesFeature].tool.drawn == ()


def test_following_can_be_stopped_and_tells_what_went_wrong(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    following = app.features[TrajectoriesFeature]
    robot.key("J")
    draw(robot, CORNER, 10, -10, 20)
    following.solve_drawn()
    following.job.cancel()
    settle(robot)
    assert frames(robot) == ()
    assert not app.dialogs.open
    monkeypatch.setattr("faceposer.animation.following.solve_trajectories", lambda *_args, **_named: 1 / 0)
    following.solve_drawn()
    settle(robot)
    robot.frames(2)
    assert app.dialogs.open
    assert frames(robot) == ()
    robot.key("Enter")

    def full(*_args: object, **_named: object) -> None:
        raise MemoryError

    monkeypatch.setattr("faceposer.animation.following.solve_trajectories", full)
    following.solve_drawn()
    settle(robot)
    robot.frames(2)
    assert app.dialogs.waiting[0].text == "There is not enough memory; use fewer frames."
    assert frames(robot) == ()


def test_an_animation_is_opened_with_as_many_keys_as_one_wants(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    model = app.session.model
    few = Keyframes(length=40).with_key(0, model.neutral()).with_key(39, model.coefficients_of({"jawOpen": 0.6}))
    path = tmp_path / "take.json"
    write_weights(path, model, few.performance(model))
    app.features[AnimationFilesFeature].open_animation(path)
    robot.frames(2)
    assert app.dialogs.open
    assert frames(robot) == (), "nothing happens before one has chosen"
    robot.click_widget("choice:1")
    robot.frames(2)
    assert frames(robot) == tuple(range(40))
    assert timeline(robot).shown
    scrub(robot, 39)
    names = model.character.shape_names
    assert model.weights_of(app.session.coefficients)[names.index("jawOpen")] == pytest.approx(0.6, abs=0.02)
    app.features[AnimationFilesFeature].reduce(0.02)
    assert len(frames(robot)) < 8
    assert app.session.undo_label == "Reduce keys"
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    assert frames(robot) == ()
    app.features[AnimationFilesFeature].open_animation(path)
    robot.frames(2)
    robot.click_widget("choice:0")
    robot.frames(2)
    assert len(frames(robot)) < 8
    path.write_text("{}")
    app.features[AnimationFilesFeature].open_animation(path)
    assert app.dialogs.open
    assert len(frames(robot)) < 8


def test_trajectories_of_a_file_become_the_animation(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    model = app.session.model
    animate(robot)
    vertex = int(model.character.feature_points[CORNER])
    path = tmp_path / "corner.json"
    x, y, z = model.character.vertices[vertex].tolist()
    points = [{"name": CORNER, "positions": [[x + 0.05 * t, y + 0.05 * t, z] for t in range(10)]}]
    path.write_text(json.dumps({"format": "faceposer.trajectories", "version": 1, "rate": 25, "points": points}))
    app.features[AnimationFilesFeature].open_trajectories(path)
    settle(robot)
    assert timeline(robot).keyframes.length == 10
    assert timeline(robot).keyframes.rate == 25.0
    assert app.session.undo_label == "Follow corner.json"
    robot.key("End")
    now = model.instance(app.session.coefficients)[vertex]
    assert np.linalg.norm(now - (x + 0.45, y + 0.45, z)) < 0.25
    robot.key("Ctrl+Z")
    assert frames(robot) == (0, 14, 29)
    path.write_text("{}")
    app.features[AnimationFilesFeature].open_trajectories(path)
    assert app.dialogs.open
    assert app.features[TrajectoriesFeature].job is None


def test_what_a_file_lacks_is_told_in_the_view(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    rows = [f"{40 * i},{min(i, 49 - i) / 25}" for i in range(50) if not 20 <= i < 30]
    path = tmp_path / "take.csv"
    path.write_text("\n".join(["time_ms,jawOpen", *rows]))
    app.features[AnimationFilesFeature].open_animation(path)
    robot.frames(6)
    question = app.dialogs.waiting[0]
    assert isinstance(question, Question)
    assert "The animation has 50 frames at 25 fps, 2.00 s." in question.text
    assert "10 of its 50 frames are missing" in question.text
    robot.click_widget("choice:1")
    robot.frames(2)
    assert (timeline(robot).keyframes.length, timeline(robot).keyframes.rate) == (50, 25.0)
    assert app.notice.startswith("Opened take.csv: 50 frames at 25 fps. 10 of its 50 frames are missing")
    app.actions["messages"].run()
    question = app.dialogs.waiting[0]
    assert isinstance(question, Question)
    assert question.details.startswith("Opened take.csv: 50 frames at 25 fps.")
    robot.key("Esc")
    vertex = int(app.session.model.character.feature_points[CORNER])
    x, y, z = app.session.model.character.vertices[vertex].tolist()
    points = [{"name": CORNER, "positions": [[x, y, z] for _ in range(10)]}]
    path = tmp_path / "corner.json"
    path.write_text(json.dumps({"format": "faceposer.trajectories", "version": 1, "points": points}))
    app.features[AnimationFilesFeature].open_trajectories(path)
    settle(robot)
    assert app.notice.endswith("It does not state a rate; 30 frames per second were assumed.")


def test_a_long_solve_shows_how_far_it_is_and_can_be_cancelled(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    following = app.features[TrajectoriesFeature]
    animate(robot)
    robot.key("J")
    draw(robot, CORNER, 10, -10, 20)

    def slow(
        _model: FaceModel,
        _trajectories: object,
        *,
        progress: Progress,
        **_options: object,
    ) -> None:
        progress.at("Frame 5 of 20", 0.25)
        while True:
            progress.check()
            time.sleep(0.005)

    monkeypatch.setattr("faceposer.animation.following.solve_trajectories", slow)
    robot.click_widget("follow")
    while "following:cancel" not in app.widget_rects:
        robot.frames()
    assert app.is_modal
    assert following.progress.startswith("Frame 5 of")
    label = app.session.undo_label
    robot.key("R")
    assert app.session.undo_label == label, "nothing else is done meanwhile"
    robot.click_widget("following:cancel")
    settle(robot)
    robot.frames(3)
    assert not app.is_modal
    assert not app.dialogs.open
    assert frames(robot) == (0, 14, 29)


def test_files_of_other_kinds_name_their_command(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    (tmp_path / "take.csv").write_text("time,jawOpen\n0,0.5\n0.04,0.6\n")
    (tmp_path / "a.glb").write_text("")
    for name, said in (("take.csv", "Animate > Open animation"), ("a.glb", "File > Import character")):
        app.files.open(str(tmp_path / name))
        question = app.dialogs.waiting[0]
        assert isinstance(question, Question)
        assert said in question.text
        app.dialogs.waiting.clear()
    app.features[ExportFeature].open_pose(tmp_path / "take.csv")
    assert app.notice.endswith("Animate > Open animation reads all frames.")
