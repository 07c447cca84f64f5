"""Photos that come into the window: dropped or opened, in each of their three ways, and written again."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.gui.features.guide.feature import GuideFeature
from faceposer.gui.features.photo.feature import PhotoFeature
from faceposer.gui.features.photo.saving import ChangedPhotoFeature
from faceposer.gui.features.photo_head.feature import PhotoHeadFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.dialogs import Question
from faceposer.gui.widgets.file_request import FileRequest
from tests.gui.features.test_photo import drop
from tests.gui.features.test_photo_views import Slow, path, show, slow  # noqa: F401
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("low", (900, 680))


@pytest.fixture
def others(tmp_path: Path) -> list[Path]:
    files = [tmp_path / f"{name}.jpg" for name in ("one", "two")]
    for file in files:
        Image.new("RGB", (60, 80), (90, 90, 90)).save(file)
    return files


def question(robot: Robot) -> Question:
    asked = robot.app.dialogs.waiting[0]
    assert isinstance(asked, Question)
    return asked


def names(robot: Robot) -> list[str]:
    return [photo.name for photo in robot.app.session.document.photos]


def test_a_dropped_photo_goes_behind_the_face_or_becomes_a_head(robot: Robot, path: Path) -> None:  # noqa: F811
    app = robot.app
    head = app.features[PhotoHeadFeature]
    drop(robot, path)
    assert names(robot) == []
    assert "person in it" in question(robot).text
    robot.key("Esc")
    robot.frames(3)
    assert not app.dialogs.open
    assert names(robot) == []
    drop(robot, path)
    robot.click_widget("choice:1")
    robot.frames(4)
    assert head.open
    assert head.files == [str(path)]
    head.close_dialog()
    robot.frames(3)
    drop(robot, path)
    robot.key("Enter")
    robot.frames(3)
    assert names(robot) == ["face.png"]
    assert app.features[PhotoFeature].aligned
    assert "photo-expression" in app.widget_rects, "the tab shows what can be done with it"
    assert app.toolbox.chosen.name == "point"
    # The same photo again is only shown.
    robot.key("1")
    drop(robot, path)
    robot.key("Enter")
    robot.frames(3)
    assert names(robot) == ["face.png"]
    assert app.features[PhotoFeature].aligned


def test_several_photos_are_dropped(robot: Robot, path: Path, others: list[Path]) -> None:  # noqa: F811
    app = robot.app
    drop(robot, path, *others)
    assert question(robot).title == "3 photos"
    robot.click_widget("choice:0")
    robot.frames(3)
    assert names(robot) == ["face.png", "one.jpg", "two.jpg"]
    drop(robot, *others)
    robot.click_widget("choice:1")
    robot.frames(4)
    assert app.features[PhotoHeadFeature].files == [str(file) for file in others]
    # While that dialog is open, photos go there.
    drop(robot, path)
    assert app.features[PhotoHeadFeature].files[-1] == str(path)
    assert not app.dialogs.open


def test_what_cannot_be_used_is_said_in_a_sentence(robot: Robot, path: Path, tmp_path: Path) -> None:  # noqa: F811
    app = robot.app
    bad = [tmp_path / "a.jpg", tmp_path / "b.jpg"]
    for file in bad:
        file.write_text("nothing")
    drop(robot, *bad, path)
    assert "a.jpg" in question(robot).text
    assert question(robot).text.endswith("1 more cannot be opened either.")
    robot.key("Enter")
    robot.frames(4)
    assert question(robot).title == "face.png", "the others are offered"
    robot.key("Esc")
    robot.frames(3)
    session = tmp_path / "session.json"
    session.write_text("{}")
    drop(robot, path, session)
    assert question(robot).text == "Drop the photos alone, and then each of the other files."
    robot.key("Esc")
    robot.frames(3)
    # Another dialog is in the way.
    app.actions["export-other"].run()
    robot.frames(4)
    drop(robot, path)
    assert "dropped onto the window while no dialog is open" in question(robot).text
    assert names(robot) == []


def test_the_empty_tab_names_three_ways(robot: Robot, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    app = robot.app
    photos, head = app.features[PhotoFeature], app.features[PhotoHeadFeature]
    asked: list[FileRequest] = []
    monkeypatch.setattr(app, "ask_for_file", asked.append)
    robot.click_widget("tab:Photo")
    robot.click_widget("photo-to-head")
    robot.frames(3)
    assert head.open
    assert head.files == []
    head.close_dialog()
    robot.frames(3)
    begun: list[str] = []
    monkeypatch.setattr(photos.expression, "start", lambda photo: begun.append(photo.name))
    robot.click_widget("photo-to-expression")
    asked.pop().done(path)
    robot.frames(2)
    assert begun == ["face.png"]
    assert names(robot) == ["face.png"]
    # With a photo, its person is offered as a character, too.
    robot.click_widget("photo-to-head")
    robot.frames(3)
    assert head.files == [str(path)]
    head.close_dialog()
    robot.frames(3)
    robot.key("Ctrl+Z")
    robot.frames(2)
    robot.click_widget("photo-to-pins")
    asked.pop().done(path)
    robot.frames(2)
    assert app.toolbox.chosen.name == "photo"
    assert app.toolbox.photo_tool.place is not None


def test_the_guide_leaves_photos_free(open_window: OpenWindow, path: Path) -> None:  # noqa: F811
    robot = open_window("low", (1400, 700), welcome_done=False)
    app, guide = robot.app, robot.app.features[GuideFeature]
    robot.frames(2)
    assert "guide:skip" in app.widget_rects
    drop(robot, path)
    robot.key("Enter")
    robot.frames(3)
    assert not guide.shown
    guide.show()
    robot.frames(3)
    assert guide.shown
    assert "guide:skip" not in app.widget_rects, "a line below, no card over the photo"
    file = path.with_suffix(".json")
    app.session.save(file, app.viewport.camera)
    app.files.open(str(file))
    robot.frames(3)
    assert not guide.shown


# Written again


@pytest.fixture
def saving(robot: Robot, path: Path, slow: Slow) -> Iterator[ChangedPhotoFeature]:  # noqa: F811
    show(robot, path)
    yield robot.app.features[ChangedPhotoFeature]
    slow.may_go.set()


def test_one_entry_writes_the_changed_photo(robot: Robot, saving: ChangedPhotoFeature) -> None:
    named = [action for action in robot.app.actions if action.label.startswith("Save") and action.menu == "File"]
    assert [action.label for action in named if "photo" in action.label] == ["Save changed photo..."]
    assert not [action for action in named if "picture" in action.label.lower()]
    assert saving.actions()[0].enabled()  # type: ignore[union-attr]


def test_a_picture_is_written_with_progress_or_cancelled(
    robot: Robot,
    saving: ChangedPhotoFeature,
    path: Path,  # noqa: F811
    slow: Slow,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    app, target = robot.app, path.with_name("changed.png")
    asked: list[FileRequest] = []
    monkeypatch.setattr(app, "ask_for_file", asked.append)
    robot.click_widget("photo-save")
    assert asked[0].start == path.with_name("face-changed.png")
    asked[0].done(target)
    assert slow.begun.acquire(timeout=5.0)
    robot.frames(5)
    assert "photo-save:progress" in app.widget_rects
    assert saving.is_modal
    assert saving.blocks_files
    assert saving.quit_question is not None
    robot.click_widget("photo-save:cancel")
    saving.join()
    robot.frames(3)
    assert not saving.is_modal
    assert not target.exists()
    assert not app.dialogs.open
    # The session goes on; the next one is written.
    slow.may_go.set()
    asked[0].done(target)
    saving.join()
    robot.frames(3)
    assert app.notice == "Saved changed.png"
    with Image.open(target) as image:
        assert np.asarray(image)[0, 0].tolist() == [20, 20, 220]
    # Not over the photo itself.
    asked[0].done(path)
    assert saving.job is None
    assert "is a photo of the session" in question(robot).text
