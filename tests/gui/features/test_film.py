"""Films of faces in the window: the dialog, its work, the keys, and the film beside the face."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.animation.keyframes import FilmSource, Key, Keyframes
from faceposer.film.film import FILM_SUFFIXES
from faceposer.gui.events import Drop
from faceposer.gui.features.film.feature import FilmFeature
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.path_browser import PathBrowser
from faceposer.model.face_model import FaceModel
from faceposer.session.opening import open_session
from tests.film.films import speaking_face
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

JAW = (0.0, 0.1, 0.25, 0.4, 0.5)


@pytest.fixture(scope="module")
def film(woman: FaceModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A GIF of the woman, who opens her mouth: it is read without PyAV."""
    images = [Image.fromarray(pixels) for pixels in speaking_face(woman, JAW)]
    path = tmp_path_factory.mktemp("films") / "speaking.gif"
    images[0].save(path, save_all=True, append_images=images[1:], duration=40)
    return path


def finish(robot: Robot) -> FilmFeature:
    feature = robot.app.features[FilmFeature]
    if feature.job is not None:
        feature.job.join()
    robot.frames(3)
    return feature


def test_a_film_becomes_keys_and_is_shown_beside_the_face(open_window: OpenWindow, film: Path) -> None:
    robot = open_window("man", (1000, 800), pictures=False)
    feature = robot.app.features[FilmFeature]
    robot.app.window.play_event(Drop((str(film),)))
    robot.frames(2)
    assert feature.open
    assert feature.film is not None
    assert feature.film.rate == 25.0
    robot.click_widget("film:colours")
    robot.frames(1)
    assert not feature.colours
    robot.click_widget("film:follow")
    finish(robot)
    assert feature.error == ""
    assert feature.page == "result"
    robot.click_widget("film:all")
    robot.frames(3)
    assert not feature.open
    keyframes = robot.app.features[TimelineFeature].keyframes
    assert (len(keyframes.keys), keyframes.rate) == (len(JAW), 25.0)
    session = robot.app.session
    session.animation.go_to(4)
    robot.frames(2)
    names = session.model.character.shape_names
    assert session.model.weights_of(session.coefficients)[names.index("jawOpen")] > 0.1
    shown = robot.app.actions["film-shown"]
    assert shown.enabled()
    shown.run()
    robot.frames(2)
    assert not feature.visible
    robot.key("Ctrl+Z")
    robot.frames(2)
    assert not robot.app.features[TimelineFeature].keyframes.keys


def test_the_film_of_a_session_is_shown_again(open_window: OpenWindow, film: Path, tmp_path: Path) -> None:
    robot = open_window("man", (1000, 800), pictures=False)
    feature, session = robot.app.features[FilmFeature], robot.app.session
    moved = tmp_path / "moved.gif"
    moved.write_bytes(film.read_bytes())
    keys = [Key.of(frame, np.zeros(session.model.n_coefficients)) for frame in (0, 2)]
    source = FilmSource(str(moved), 1, 25.0)
    session.animation.load(Keyframes(tuple(keys), 25.0, 3, film=source), "Open a film")
    session.wait()
    session.save(tmp_path / "s.json")
    reopened = open_session(str(tmp_path / "s.json"))
    assert reopened.animation.keyframes.film == source
    finish_reading(robot)
    assert feature._pictures is not None
    shown = [feature._pictures.at(source.number(frame, 25.0)) for frame in (0, 2)]
    assert shown[0] is not None
    assert shown[1] is not None
    # The mouth is open wider in the later one.
    assert np.abs(shown[0].astype(int) - shown[1]).max() > 30
    assert robot.app.actions["film-shown"].enabled()
    moved.unlink()
    said: list[str] = []
    feature.context.notify = lambda text, *_: said.append(text)  # type: ignore[method-assign]
    session.animation.load(replace(session.animation.keyframes, film=replace(source, first=0)), "Open a film")
    finish_reading(robot)
    assert len(said) == 1
    assert "The film is not shown beside the face." in said[0]
    assert "moved.gif" in said[0]
    # Once it is back, it is shown by the action, which is off until then.
    shown = robot.app.actions["film-shown"]
    assert not shown.checked()
    moved.write_bytes(film.read_bytes())
    shown.run()
    finish_reading(robot)
    assert shown.checked()
    assert feature._pictures is not None
    assert feature._pictures.at(0) is not None


def test_the_form_comes_back_and_a_result_is_not_discarded_by_mistake(open_window: OpenWindow, film: Path) -> None:
    robot = open_window("man", (1000, 800), pictures=False)
    feature = robot.app.features[FilmFeature]
    feature.open_film(film)
    feature.start, feature.colours = "0.1", False
    robot.frames(2)
    robot.click_widget("film:follow")
    finish(robot)
    assert feature.page == "result"
    robot.key("Esc")
    robot.frames(2)
    assert robot.app.dialogs.waiting[0].title == "Discard the animation of the film?"
    robot.key("Esc")
    robot.frames(2)
    robot.click_widget("film:back")
    robot.frames(2)
    assert (feature.page, feature.start, feature.open) == ("form", "0.1", True)


def finish_reading(robot: Robot) -> None:
    feature = robot.app.features[FilmFeature]
    robot.frames(1)
    assert feature._reading is not None
    feature._reading.join()
    robot.frames(2)


def test_a_wrong_part_and_a_film_without_a_face_are_said_in_the_dialog(open_window: OpenWindow, tmp_path: Path) -> None:
    robot = open_window("low", (1000, 800), pictures=False)
    feature = robot.app.features[FilmFeature]
    grey = [Image.fromarray(np.full((120, 160, 3), value, dtype=np.uint8)) for value in (100, 110)]
    grey[0].save(tmp_path / "grey.gif", save_all=True, append_images=grey[1:], duration=500)
    feature.open_film(tmp_path / "grey.gif")
    robot.frames(2)
    for start, end, said in (
        ("x", "", "'x' is no time in seconds"),
        ("2", "1", "is not after its beginning"),
        ("5", "", "has 1.00 seconds"),
    ):
        feature.start, feature.end = start, end
        robot.click_widget("film:follow")
        robot.frames(1)
        assert said in feature.error
    feature.start = ""
    robot.click_widget("film:follow")
    finish(robot)
    assert "No face was found" in feature.error
    assert feature.page == "form"
    robot.key("Esc")
    robot.frames(2)
    assert not feature.open


def test_what_is_no_film_is_reported(open_window: OpenWindow, tmp_path: Path) -> None:
    robot = open_window("low", (1000, 800), pictures=False)
    (tmp_path / "a.gif").write_bytes(b"GIF89a" + bytes(20))
    robot.app.features[FilmFeature].open_film(tmp_path / "a.gif")
    robot.frames(2)
    assert robot.app.dialogs.open
    assert not robot.app.features[FilmFeature].open


def test_cancelled_work_changes_nothing(open_window: OpenWindow, film: Path) -> None:
    robot = open_window("man", (1000, 800), pictures=False)
    feature = robot.app.features[FilmFeature]
    feature.open_film(film)
    robot.frames(2)
    robot.click_widget("film:follow")
    assert feature.job is not None
    robot.frames(2)
    feature.stop()
    finish(robot)
    assert feature.page == "form"
    assert feature.error == ""
    assert not robot.app.features[TimelineFeature].keyframes.keys
    assert not robot.app.session.dirty


def test_the_first_of_many_endings_are_named(tmp_path: Path) -> None:
    films = PathBrowser(FileRequest("open", "Open film", "Films", FILM_SUFFIXES, tmp_path, print))
    assert films.advice() == ("Name or path (.mp4, .m4v, .mov, .mkv, .webm, .avi and others)", False)
    poses = PathBrowser(FileRequest("open", "Open pose", "Poses", (".json",), tmp_path, print))
    assert poses.advice() == ("Name or path (.json)", False)
