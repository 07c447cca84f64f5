"""The list of characters in the window, New, and where things are saved at first."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from faceposer.gui.app import App
from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.features.import_character.summary import facts_of, sentence_of
from faceposer.gui.settings import Settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character, save_character
from faceposer.training.summary import arkit_shapes_of
from tests.windows import OpenWindow

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("small_textures")]


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    app = App("low", hidden=True, threaded=False, settings=Settings(window_size=(1000, 760), folder=str(tmp_path)))
    draw_few_pixels(app)
    yield Robot(app)
    if app._window is not None:
        app.close()


def make_character(path: Path, title: str) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    save_character(path, replace(load_character("low"), name=path.stem, title=title))
    return str(path)


def smile(robot: Robot) -> None:
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 10, y - 12))


def open_list(robot: Robot) -> None:
    robot.frames(2)
    robot.click_widget("character")
    robot.frames(2)


def test_an_imported_character_is_listed_opened_renamed_and_removed(robot: Robot) -> None:
    app = robot.app
    own = make_character(app.characters.folder / "head.npz", "My head")
    open_list(robot)
    robot.click_widget(f"character:{own}")
    robot.frames(2)
    assert app.session.document.character == own
    assert app.session.model.character.title == "My head"
    assert app.settings.characters == [], "what the library holds is known anyway"
    open_list(robot)
    robot.click_widget(f"character:{own}:remove")
    robot.frames(2)
    assert not app.dialogs.open, "the open one stays"
    robot.key("Esc")
    robot.frames(2)
    open_list(robot)
    robot.click_widget(f"character:{own}:rename")
    robot.frames(3)
    robot.key("Ctrl+A")
    robot.type("Somebody")
    robot.click_widget("text:accept")
    robot.frames(2)
    assert not app.dialogs.open
    assert [one.title for one in app.characters.all() if one.home == "library"] == ["Somebody"]
    open_list(robot)
    robot.click_widget("character:low")
    robot.frames(2)
    open_list(robot)
    robot.click_widget(f"character:{own}:remove")
    robot.frames(3)
    robot.click_widget("choice:1")
    robot.frames(2)
    assert Path(own).exists(), "cancelled"
    open_list(robot)
    robot.click_widget(f"character:{own}:remove")
    robot.frames(3)
    robot.click_widget("choice:0")
    robot.frames(2)
    assert not Path(own).exists()


def test_an_empty_name_is_refused_in_the_dialog(robot: Robot) -> None:
    app = robot.app
    own = make_character(app.characters.folder / "head.npz", "My head")
    open_list(robot)
    robot.click_widget(f"character:{own}:rename")
    robot.frames(3)
    question = app.dialogs.waiting[0]
    robot.key("Ctrl+A")
    robot.type(" ")
    robot.click_widget("text:accept")
    robot.frames(2)
    assert app.dialogs.open
    assert "name" in question.problem  # type: ignore[union-attr]
    robot.key("Esc")
    robot.frames(2)
    assert not app.dialogs.open
    assert app.characters.title(Path(own)) == "My head"


def test_files_elsewhere_are_remembered_and_can_be_forgotten(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    other = make_character(tmp_path / "elsewhere" / "face.npz", "Face")
    app.files.open(other)
    robot.frames(2)
    assert app.settings.characters == [other]
    app.files.open("low")
    open_list(robot)
    assert f"character:{other}" in app.widget_rects
    robot.click_widget(f"character:{other}:remove")
    robot.frames(2)
    assert app.settings.characters == []
    assert Path(other).exists()


def test_new_begins_with_the_character_and_asks_about_changes(robot: Robot) -> None:
    app = robot.app
    smile(robot)
    session = app.session
    robot.key("Ctrl+N")
    robot.frames(3)
    robot.click_widget("choice:2")
    robot.frames(2)
    assert app.session is session
    robot.key("Ctrl+N")
    robot.frames(3)
    robot.click_widget("choice:1")
    robot.frames(2)
    assert app.session is not session
    assert app.session.document.character == "low"
    assert app.session.document.constraints == ()
    assert app.session.path is None
    entries = app.files.new_with()
    assert [entry.label for entry in entries] == [one.title for one in app.characters.all()]
    next(entry for entry in entries if entry.name == "new:woman").run()
    robot.frames(2)
    assert app.session.document.character == "woman"


def test_saving_begins_in_the_users_documents(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    documents = tmp_path / "documents"
    documents.mkdir()
    monkeypatch.setattr("faceposer.gui.settings.documents_folder", lambda: documents)
    app.settings.folder = ""
    other = make_character(tmp_path / "rigs" / "face.npz", "Face")
    app.files.open(other)
    robot.frames(2)
    asked = []
    monkeypatch.setattr(app, "ask_for_file", asked.append)
    app.files.save_as()
    assert asked[-1].start == documents / "face.json"
    app.files.export_as()
    assert asked[-1].start == documents / "face.obj"


def test_an_import_goes_to_the_library_and_never_beside_its_source(robot: Robot, tmp_path: Path) -> None:
    source = tmp_path / "rigs" / "My Head.glb"
    source.parent.mkdir()
    source.write_bytes(b"")
    form = ImportForm(source=str(source))
    form.follow_source(robot.app.characters)
    assert form.output == str(robot.app.characters.folder / "my-head.npz")
    make_character(Path(form.output), "My head")
    again = ImportForm(source=str(source))
    again.follow_source(robot.app.characters)
    assert again.output == str(robot.app.characters.folder / "my-head-2.npz")


def summary_of(**changed: object) -> dict[str, object]:
    summary: dict[str, object] = {
        "kind": "rig",
        "shapes": 52,
        "dimensions": 40,
        "missing": [],
        "empty": [],
        "not_arkit": [],
        "eyes_turned": [],
        "kept_energy": 0.987,
        "worst": {"shape": "jawOpen", "unreached": 0.1},
        "prior": {"from": "the shipped statistics"},
    }
    return summary | changed


@pytest.mark.parametrize(
    ("changed", "count"),
    [
        ({}, 52),
        ({"shapes": 51, "missing": ["tongueOut"]}, 51),
        ({"empty": ["tongueOut"]}, 52),
        # Two shapes in halves, and one that is missing.
        ({"shapes": 53, "missing": ["tongueOut"]}, 51),
        ({"shapes": 54}, 52),
    ],
)
def test_the_count_of_shapes_agrees_with_what_is_missing(changed: dict[str, object], count: int) -> None:
    summary = summary_of(**changed)
    text = arkit_shapes_of(summary)
    assert text.startswith(f"{count} of ARKit's {len(ARKIT_SHAPES)} shapes")
    assert ("1 of them empty" in text) == bool(summary["empty"])
    assert ("sliders" in text) == (summary["shapes"] != count)
    about = {"path": "/x/head.npz", "file_vertices": 4, "polygons": 2, "parts": [{"name": "head"}], "summary": summary}
    assert dict(facts_of(about))["Shapes"] == text
    assert sentence_of(about) == "The character reproduces 98.7 % of the motion of the rig's shapes."


def test_memory_goes_back_soon_after_another_character_is_opened(
    open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = open_window("low")
    robot.frames(20)
    trims: list[int] = []
    monkeypatch.setattr("faceposer.gui.app.return_free_memory", lambda: trims.append(robot.app.frames_drawn))
    robot.frames(20)
    assert trims == []
    opened = robot.app.frames_drawn
    robot.app.files.open("creature")
    robot.frames(20)
    assert [frame - opened for frame in trims] == [9]
