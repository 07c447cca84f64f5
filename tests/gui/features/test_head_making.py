"""The pages that dialogs of heads have in common: landmarks, the fit, the comparison; driven by pointer and keys."""

import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.gui.events import Drop
from faceposer.gui.features.head_making.contents import Compared, MadeHead
from faceposer.gui.features.head_making.previews import Previews
from faceposer.gui.features.photo_head import marked_photo, work
from faceposer.gui.features.photo_head.feature import PhotoHeadFeature
from faceposer.gui.features.scan.feature import ScanFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.character_file import load_character
from faceposer.progress import Progress
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

POINTS = {"8.3": (40.0, 60.0), "8.4": (60.0, 60.0), "9.3": (50.0, 40.0)}


@dataclass(frozen=True)
class Face:
    """A picture with three landmarks."""

    name: str = "one.png"
    found_pixels: Mapping[str, tuple[float, float]] = field(default_factory=lambda: POINTS)
    placed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    image: np.ndarray = field(default_factory=lambda: np.full((90, 100, 3), 200, dtype=np.uint8))
    note: str = ""

    @property
    def pixels(self) -> dict[str, tuple[float, float]]:
        return {**self.found_pixels, **self.placed}

    @property
    def moved(self) -> frozenset[str]:
        return frozenset(self.placed)

    def with_moved(self, name: str, pixel: tuple[float, float]) -> "Face":
        return replace(self, placed={**self.placed, name: pixel})

    def with_reset(self, names: Collection[str]) -> "Face":
        return replace(self, placed={name: place for name, place in self.placed.items() if name not in names})


@dataclass(frozen=True, eq=False)
class Over(MadeHead):
    """A head over two photos."""

    @property
    def views(self) -> tuple[Compared, ...]:
        return (Compared("a", self.picture, 255 - self.picture), Compared("b", self.picture, self.picture))


def made() -> Over:
    return Over(load_character("low"), "It fits.", np.zeros((90, 100, 3), dtype=np.uint8))


def shown(open_window: OpenWindow, size: tuple[int, int] = (1000, 800), **settings: float) -> Robot:
    robot = open_window("low", size, pictures=False, **settings)
    state = robot.app.features[PhotoHeadFeature]
    state.show()
    state.files = ["one.png", "two.png"]
    state.landmarks.show([Face(), Face("two.png")])
    robot.frames(6)
    return robot


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return shown(open_window)


def at(robot: Robot, pixel: tuple[float, float]) -> tuple[float, float]:
    """Return the place in the window of a pixel of the picture."""
    left, top, right, bottom = robot.app.widget_rects["photo-head:picture"]
    return (left + (right - left) * pixel[0] / 100.0, top + (bottom - top) * pixel[1] / 90.0)


def pixel_at(robot: Robot, place: tuple[float, float]) -> tuple[float, float]:
    left, top, right, bottom = robot.app.widget_rects["photo-head:picture"]
    return (100.0 * (place[0] - left) / (right - left), 90.0 * (place[1] - top) / (bottom - top))


def state_of(robot: Robot) -> PhotoHeadFeature:
    return robot.app.features[PhotoHeadFeature]


def moved(robot: Robot) -> dict[str, tuple[float, float]]:
    face = state_of(robot).landmarks.current
    return dict(face.placed)  # type: ignore[attr-defined]


def test_moves_of_landmarks_are_undone_and_redone(robot: Robot) -> None:
    begin = at(robot, POINTS["8.3"])
    # Taken beside its middle, it keeps its distance from the pointer.
    robot.drag((begin[0] + 3.0, begin[1] - 2.0), (begin[0] + 43.0, begin[1] + 18.0))
    first = moved(robot)["8.3"]
    assert first == pytest.approx(pixel_at(robot, (begin[0] + 40.0, begin[1] + 20.0)), abs=1e-3)
    begin = at(robot, POINTS["9.3"])
    robot.drag(begin, (begin[0], begin[1] + 30.0))
    assert set(moved(robot)) == {"8.3", "9.3"}
    robot.key("Ctrl+Z")
    assert moved(robot) == {"8.3": first}
    robot.key("Ctrl+Z")
    assert not moved(robot)
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Shift+Z")
    assert moved(robot) == {"8.3": first}
    robot.click_widget("photo-head:redo")
    assert set(moved(robot)) == {"8.3", "9.3"}
    robot.click_widget("photo-head:undo")
    assert set(moved(robot)) == {"8.3"}
    # Nothing of the session behind the dialog was undone.
    assert not robot.app.session.can_redo


def test_a_click_and_a_drag_that_is_cancelled_move_nothing(robot: Robot) -> None:
    begin = at(robot, POINTS["8.4"])
    robot.click((begin[0] + 2.0, begin[1]))
    assert not moved(robot)
    assert state_of(robot).landmarks.selected == "8.4"
    robot.move(begin)
    robot.press()
    robot.move((begin[0] + 50.0, begin[1]), 4)
    assert set(moved(robot)) == {"8.4"}
    robot.key("Esc")
    robot.release()
    assert not moved(robot)
    assert state_of(robot).page == "landmarks"
    assert not state_of(robot).landmarks.steps.undo_label


def test_landmarks_are_reset_one_or_all(robot: Robot) -> None:
    for name in ("8.3", "9.3"):
        begin = at(robot, POINTS[name])
        robot.drag(begin, (begin[0] + 20.0, begin[1]))
    robot.key("Delete")
    assert set(moved(robot)) == {"8.3"}
    state_of(robot).landmarks.shown = 1
    robot.frames(2)
    begin = at(robot, POINTS["8.4"])
    robot.drag(begin, (begin[0] + 20.0, begin[1]))
    robot.click_widget("photo-head:reset-point")
    assert not moved(robot)
    state_of(robot).landmarks.undo()
    robot.frames(2)
    robot.click_widget("photo-head:reset-all")
    assert state_of(robot).landmarks.n_moved == 0
    robot.key("Ctrl+Z")
    assert state_of(robot).landmarks.n_moved == 2


def test_arrow_keys_move_the_selected_landmark(robot: Robot) -> None:
    robot.click(at(robot, POINTS["8.3"]))
    robot.key("Right")
    robot.key("Down")
    left, _, right, _ = robot.app.widget_rects["photo-head:picture"]
    step = 100.0 / (right - left)
    assert moved(robot)["8.3"] == pytest.approx((40.0 + step, 60.0 + step), abs=1e-3)
    robot.key("Ctrl+Z")
    assert moved(robot)["8.3"] == pytest.approx((40.0 + step, 60.0), abs=1e-3)


def test_the_picture_is_enlarged_around_the_pointer_moved_and_fitted(robot: Robot) -> None:
    whole = robot.app.widget_rects["photo-head:picture"]
    place = at(robot, (30.0, 20.0))
    robot.move(place)
    robot.wheel(6.0)
    robot.frames(2)
    assert pixel_at(robot, place) == pytest.approx((30.0, 20.0), abs=0.1)
    left, _, right, _ = robot.app.widget_rects["photo-head:picture"]
    assert right - left > 2.0 * (whole[2] - whole[0])
    before = at(robot, (50.0, 50.0))
    robot.drag(place, (place[0] + 30.0, place[1] + 20.0), button="middle")
    after = at(robot, (50.0, 50.0))
    assert (after[0] - before[0], after[1] - before[1]) == pytest.approx((30.0, 20.0), abs=0.6)
    # With Space held, the left button moves the picture even if it is pressed on a landmark.
    begin = at(robot, POINTS["9.3"])
    robot.key_down("Space")
    robot.drag(begin, (begin[0] - 25.0, begin[1]))
    robot.key_up("Space")
    assert at(robot, POINTS["9.3"])[0] == pytest.approx(begin[0] - 25.0, abs=0.6)
    assert not moved(robot)
    robot.key("F")
    robot.frames(2)
    assert robot.app.widget_rects["photo-head:picture"] == pytest.approx(whole)
    robot.move(place)
    robot.wheel(3.0)
    robot.click(place)
    robot.click(place)
    robot.frames(2)
    assert robot.app.widget_rects["photo-head:picture"] == pytest.approx(whole)


def test_moved_landmarks_are_not_lost_without_a_question(robot: Robot) -> None:
    begin = at(robot, POINTS["8.3"])
    robot.drag(begin, (begin[0] + 20.0, begin[1]))
    robot.key("Esc")
    robot.frames(3)
    assert robot.app.dialogs.waiting[0].title == "Discard and close?"
    robot.key("Esc")
    robot.frames(3)
    assert state_of(robot).open
    assert set(moved(robot)) == {"8.3"}
    robot.click_widget("photo-head:cancel")
    robot.frames(3)
    robot.click_widget("choice:0")
    robot.frames(3)
    assert not state_of(robot).open


def test_landmarks_of_files_that_stay_are_kept(
    open_window: OpenWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[str]] = []

    def find(files: list[str], _: Progress) -> list[Face]:
        asked.append([Path(path).name for path in files])
        return [Face(Path(path).name) for path in files]

    monkeypatch.setattr(marked_photo, "find_faces", find)
    robot = open_window("low", (1000, 800), pictures=False)
    state = state_of(robot)
    for name in ("one.png", "two.png", "three.png"):
        (tmp_path / name).write_bytes(b"")
    state.show()
    state.add(tmp_path / "one.png", tmp_path / "two.png")
    state.find()
    state.join()
    robot.frames(6)
    begin = at(robot, POINTS["8.3"])
    robot.drag(begin, (begin[0] + 20.0, begin[1]))
    robot.app.window.play_event(Drop((str(tmp_path / "three.png"), str(tmp_path / "a.txt"), str(tmp_path / "b.mp4"))))
    robot.frames(4)
    assert state.page == "form"
    assert [Path(path).name for path in state.files] == ["one.png", "two.png", "three.png"]
    assert state.error.startswith("'a.txt', 'b.mp4' are no photos; choose ")
    robot.click_widget("photo-head:1:remove")
    robot.click_widget("photo-head:find")
    state.join()
    robot.frames(6)
    assert asked == [["one.png", "two.png"], ["three.png"]]
    assert [face.name for face in state.landmarks.marked] == ["one.png", "three.png"]
    assert set(moved(robot)) == {"8.3"}


def test_a_fit_is_shown_cancelled_at_once_and_keeps_landmarks(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = threading.Event()

    def fit(
        marked: object, likelihood: float, title: str, painting: bool, show: Callable[[np.ndarray], None], _: Progress
    ) -> MadeHead:
        show(np.full((9, 10, 3), 77, dtype=np.uint8))
        ended.wait(20.0)
        show(np.full((9, 10, 3), 99, dtype=np.uint8))
        return made()

    monkeypatch.setattr(work, "fit_head", fit)
    state = state_of(robot)
    begin = at(robot, POINTS["8.3"])
    robot.drag(begin, (begin[0] + 20.0, begin[1]))
    robot.click_widget("photo-head:fit")
    while state.preview is None:
        robot.frames(1)
    robot.frames(2)
    assert state.page == "fitting"
    assert int(state.preview[0, 0, 0]) == 77
    assert "photo-head:progress" in robot.app.widget_rects
    # The work does not look whether it was cancelled; the window does not wait for it.
    robot.click_widget("photo-head:cancel")
    assert state.page == "landmarks"
    assert set(moved(robot)) == {"8.3"}
    ended.set()
    state.join()
    robot.frames(3)
    assert state.page == "landmarks"
    assert state.preview is None
    robot.click_widget("photo-head:fit")
    state.join()
    robot.frames(3)
    assert state.page == "result"
    robot.click_widget("photo-head:again")
    assert set(moved(robot)) == {"8.3"}
    robot.key("Ctrl+Z")
    assert not moved(robot)


@pytest.mark.parametrize(
    ("size", "scale"), [((1280, 720), 1.5), ((1920, 1080), 1.0), ((1920, 1080), 2.0), ((600, 420), 1.0)]
)
def test_pictures_get_the_room_and_buttons_stay_visible(
    open_window: OpenWindow, size: tuple[int, int], scale: float
) -> None:
    robot = shown(open_window, size, ui_scale=scale)
    state, rects = state_of(robot), robot.app.widget_rects
    state.error = "The face in 'one.png' is turned by more than 60 degrees (about 70); use a photo more from the front."
    robot.frames(3)
    seen = {"landmarks": ("fit", "back", "cancel"), "result": ("open", "again", "discard")}
    for page, buttons in seen.items():
        if page == "result":
            state.result = made()
            robot.frames(3)
        left, top, right, bottom = rects["photo-head:picture:canvas"]
        assert right - left > 0.45 * size[0]
        assert bottom - top > 0.5 * size[1]
        low = rects["photo-head:picture"]
        assert left <= low[0] <= low[2] <= right
        assert top <= low[1] <= low[3] <= bottom
        for name in buttons:
            box = rects[f"photo-head:{name}"]
            assert bottom < box[1] < box[3] <= size[1]
            assert 0.0 <= box[0] < box[2] <= size[0]
        if page == "result":
            middle = 0.5 * (low[1] + low[3])
            robot.drag((0.5 * (low[0] + low[2]), middle), (0.2 * low[2] + 0.8 * low[0], middle))
            assert state.dialog.compared.wiped == pytest.approx(0.2, abs=0.02)


def test_results_of_several_photos_are_compared_each_and_not_lost_by_esc(robot: Robot) -> None:
    state = state_of(robot)
    state.result = made()
    robot.frames(3)
    assert "photo-head:compared" in robot.app.widget_rects
    state.dialog.compared.shown = 1
    robot.frames(2)
    left, top, right, bottom = robot.app.widget_rects["photo-head:wipe"]
    robot.drag((0.5 * (left + right), 0.5 * (top + bottom)), (right + 20.0, 0.5 * (top + bottom)))
    assert state.dialog.compared.wiped == 1.0
    robot.key("Esc")
    robot.frames(3)
    assert state.result is not None
    assert robot.app.dialogs.open
    robot.key("Esc")
    robot.frames(2)
    robot.app.window.play_event(Drop(("other.png",)))
    robot.frames(3)
    assert state.page == "result"
    assert state.error == "Save or discard the head before you add files."


def test_scans_have_the_same_page(open_window: OpenWindow) -> None:
    robot = open_window("low", (1000, 800), pictures=False)
    state = robot.app.features[ScanFeature]
    state.show()
    state.files = ["a.obj"]
    state.landmarks.show([Face("a.obj")])  # type: ignore[list-item]
    robot.frames(5)
    left, top, right, bottom = robot.app.widget_rects["scan:picture"]
    begin = (left + 0.4 * (right - left), top + 60.0 / 90.0 * (bottom - top))
    robot.drag(begin, (begin[0] + 30.0, begin[1]))
    assert state.landmarks.n_moved == 1
    robot.key("Ctrl+Z")
    assert state.landmarks.n_moved == 0


def test_pictures_of_a_fit_take_a_fifth_of_its_time() -> None:
    now, drawn = [0.0], []

    def draw() -> np.ndarray:
        drawn.append(now[0])
        now[0] += 0.5
        return np.zeros((1, 1, 3), dtype=np.uint8)

    previews = Previews(lambda _: None, lambda: now[0])
    while now[0] < 20.0:
        previews.draw(draw)
        now[0] += 0.1
    assert 0.15 < 0.5 * len(drawn) / now[0] < 0.22
