"""The dialog that makes a character of scans, driven by pointer and keys; the fit itself is tested elsewhere."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.obj_io import write_obj
from faceposer.gui.features.head_making.contents import MadeHead
from faceposer.gui.features.scan import marked_scan, work
from faceposer.gui.features.scan.feature import ScanFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.character_file import load_character
from faceposer.progress import Progress
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    robot = open_window("low", (1000, 800), pictures=False)
    robot.app.actions["scan"].run()
    robot.frames(3)
    return robot


def feature(robot: Robot) -> ScanFeature:
    return robot.app.features[ScanFeature]


def page(robot: Robot) -> str:
    return feature(robot).page


def finish(robot: Robot) -> None:
    job = feature(robot).job
    if job is not None:
        job.join()
    robot.frames(3)


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A head as a scan: in millimetres, lying on its back."""
    man = load_character("man")
    path = tmp_path_factory.mktemp("scans") / "ann_other.obj"
    vertices = 10.0 * man.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    write_obj(path, vertices, man.polygons)
    return path


def test_landmarks_are_found_moved_and_fitted(robot: Robot, scan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state = feature(robot)
    state.add(scan)
    robot.frames(2)
    assert state.title == "Ann Other"
    robot.click_widget("scan:find")
    finish(robot)
    assert page(robot) == "landmarks"
    assert state.error == ""

    # The picture shows the face upright, and its points lie on it.
    marked = state.landmarks.marked[0]
    eyes = 0.5 * (marked.places["3.7"] + marked.places["3.8"])
    assert eyes[1] > marked.places["8.1"][1] > marked.places["2.1"][1]

    left, top, right, _ = robot.app.widget_rects["scan:picture"]
    factor = (right - left) / marked.drawing.image.shape[1]
    pixel = marked.camera.project(marked.places["8.3"][None])[0]
    begin = (left + factor * float(pixel[0]), top + factor * float(pixel[1]))
    robot.drag(begin, (begin[0] + 12.0, begin[1] + 6.0))
    robot.frames(2)
    moved = state.landmarks.marked[0]
    assert moved.moved == {"8.3"}
    assert np.linalg.norm(moved.places["8.3"] - marked.places["8.3"]) > 0.1
    # It is on the surface exactly under the place where it was dropped.
    assert moved.pixels["8.3"] == pytest.approx(pixel + np.array([12.0, 6.0]) / factor, abs=1e-3)
    given = moved.with_landmarks().landmarks
    assert given is not None
    assert list(given.features) == ["8.3"]
    # In millimetres, as in the file.
    nearest = np.linalg.norm(moved.scan.mesh.vertices - given.features["8.3"], axis=1).min()
    assert nearest < 5.0

    asked: list[tuple[bool, bool, str]] = []

    def fit(
        scans: list[marked_scan.MarkedScan],
        detail: bool,
        texture: bool,
        title: str,
        show: Callable[[np.ndarray], None],
        _: Progress,
    ) -> MadeHead:
        asked.append((detail, texture, title))
        return MadeHead(load_character("man"), "It fits.", np.zeros((20, 60, 3), dtype=np.uint8))

    monkeypatch.setattr(work, "fit_head", fit)
    robot.click_widget("scan:fit")
    finish(robot)
    assert asked == [(True, True, "Ann Other")]
    assert page(robot) == "result"
    # A question about unsaved changes that is cancelled leaves the result.
    robot.app.session.mark_unsaved()
    robot.click_widget("scan:open")
    robot.frames(3)
    assert robot.app.dialogs.waiting[0].title == "Save the session?"
    robot.key("Esc")
    robot.frames(3)
    assert page(robot) == "result"
    assert not list(robot.app.characters.folder.glob("*.npz"))
    robot.click_widget("scan:open")
    robot.frames(3)
    robot.click_widget("choice:1")
    robot.frames(3)
    assert not robot.app.dialogs.open
    assert not state.open
    assert robot.app.session.model.character.title == "Man"
    assert "/characters/" in robot.app.session.document.character


def test_what_is_wrong_is_said_in_the_dialog(robot: Robot, tmp_path: Path) -> None:
    state = feature(robot)
    state.add(tmp_path / "photo.png")
    robot.frames(2)
    assert "is no scan" in state.error
    cube = tmp_path / "cube.obj"
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    write_obj(cube, corners, np.array([[0, 1, 3, 2], [4, 6, 7, 5]], dtype=np.int32))
    state.add(cube)
    robot.frames(2)
    robot.click_widget("scan:find")
    finish(robot)
    assert page(robot) == "form"
    assert "No face was found" in state.error
    robot.key("Esc")
    robot.frames(2)
    assert not state.open
    assert state.files == []


def test_the_fit_can_be_cancelled(robot: Robot, scan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def wait(files: list[str], progress: Progress) -> list[marked_scan.MarkedScan]:
        while True:
            progress.at("Waiting")

    monkeypatch.setattr(marked_scan, "find_landmarks", wait)
    state = feature(robot)
    state.add(scan)
    robot.frames(2)
    robot.click_widget("scan:find")
    robot.frames(2)
    robot.click_widget("scan:cancel")
    finish(robot)
    assert page(robot) == "form"
    assert state.error == ""


def test_errors_of_files_name_them(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=r"missing\.obj"):
        marked_scan.find_landmarks([str(tmp_path / "missing.obj")], Progress())
