"""Characters of one's own, made in the window: by menu, by drop, with progress, cancel, errors and a summary."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pygltflib
import pytest
from imgui_bundle import imgui

from faceposer.geometry.mesh_io import read_mesh
from faceposer.gui.app import App
from faceposer.gui.events import CloseRequest, Drop
from faceposer.gui.features.import_character.feature import ImportCharacterFeature
from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.path_browser import PathBrowser
from faceposer.model.character_file import load_character
from faceposer.session.character_library import CharacterLibrary
from faceposer.session.opening import open_session
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

SHAPES = (
    "jawOpen",
    "mouthSmileLeft",
    "mouthSmileRight",
    "browDownLeft",
    "eyeBlinkLeft",
    "eyeBlinkRight",
    "mouthPucker",
)
PATIENCE = 60.0


def importer(app: App) -> ImportCharacterFeature:
    return app.features[ImportCharacterFeature]


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("man")


@pytest.fixture(scope="session")
def skin() -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """The front of the man's skin, thinned out, and some of its shapes."""
    man = load_character("man")
    part = man.part("skin")
    first, last = man.part_triangles(part)
    triangles = man.triangles[first:last]
    front = (man.vertices[triangles, 2] > 2.0).all(axis=1)
    used, faces = np.unique(triangles[front], return_inverse=True)
    shapes = {name: man.shapes[man.shape_names.index(name)][used] for name in SHAPES}
    return man.vertices[used], faces.reshape(-1, 3), shapes


@pytest.fixture
def glb(tmp_path: Path, skin: tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]) -> Path:
    """A small rig in metres."""
    vertices, faces, shapes = skin
    arrays = [faces.astype("<u4").ravel(), 0.01 * vertices, *(0.01 * offsets for offsets in shapes.values())]
    blob, views, accessors = b"", [], []
    for i, array in enumerate(arrays):
        data = array.astype("<u4" if i == 0 else "<f4")
        views.append(pygltflib.BufferView(buffer=0, byteOffset=len(blob), byteLength=data.nbytes))
        bounds = {} if i == 0 else {"min": data.min(axis=0).tolist(), "max": data.max(axis=0).tolist()}
        accessors.append(
            pygltflib.Accessor(
                bufferView=i,
                componentType=pygltflib.UNSIGNED_INT if i == 0 else pygltflib.FLOAT,
                count=len(data),
                type="SCALAR" if i == 0 else "VEC3",
                **bounds,
            )
        )
        blob += data.tobytes()
    targets = [pygltflib.Attributes(POSITION=i) for i in range(2, len(arrays))]
    primitive = pygltflib.Primitive(attributes=pygltflib.Attributes(POSITION=1), indices=0, targets=targets)
    mesh = pygltflib.Mesh(primitives=[primitive], name="head", extras={"targetNames": list(shapes)})
    file = pygltflib.GLTF2(
        scene=0,
        scenes=[pygltflib.Scene(nodes=[0])],
        nodes=[pygltflib.Node(mesh=0)],
        meshes=[mesh],
        accessors=accessors,
        bufferViews=views,
        buffers=[pygltflib.Buffer(byteLength=len(blob))],
    )
    file.set_binary_blob(blob)
    path = tmp_path / "My Head.glb"
    file.save_binary(str(path))
    return path


@pytest.fixture
def meshes(tmp_path: Path, skin: tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]) -> Path:
    """Eight example meshes."""
    vertices, faces, shapes = skin
    folder = tmp_path / "takes"
    folder.mkdir()
    corners = "".join(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())
    rng = np.random.default_rng(3)
    for i in range(8):
        weights = rng.uniform(0.0, 1.0, len(shapes)) if i else np.zeros(len(shapes))
        moved = vertices + np.einsum("s,snd->nd", weights, np.stack([*shapes.values()]))
        text = "".join(f"v {x:.5f} {y:.5f} {z:.5f}\n" for x, y, z in moved.tolist()) + corners
        (folder / ("neutral.obj" if not i else f"take{i}.obj")).write_text(text)
    return folder


def open_by_menu(robot: Robot) -> None:
    robot.click_widget("menu:File")
    robot.click_widget("menu:import")
    robot.frames(4)


def enter(robot: Robot, field: str, text: str) -> None:
    """Type ``text`` into a field of the dialog."""
    robot.frames(4)
    robot.click_widget(f"import:{field}")
    robot.type(text)
    robot.frames(4)


def press(robot: Robot, button: str) -> None:
    robot.frames(4)
    robot.click_widget(f"import:{button}")


def finish(robot: Robot) -> None:
    """Let frames pass until nothing is being learned."""
    deadline = time.monotonic() + PATIENCE
    while importer(robot.app).running:
        assert time.monotonic() < deadline
        robot.frames(1)
        # Most of the time is for what learns.
        time.sleep(0.05)
    robot.frames(6)


def left_over(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.suffix in (".npz", ".tmp"))


class Slow:
    """Stands in for learning: says that half is done, and waits until it may go on or is stopped."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.go_on, self.begun = threading.Event(), threading.Event()
        from faceposer.training import request

        self._train = request.train
        monkeypatch.setattr(request, "train", self)

    def __call__(self, request: object, progress: object) -> object:
        progress.at("Reading", 0.5)
        self.begun.set()
        while not self.go_on.wait(0.01):
            progress.at("Reading", 0.5)
        return self._train(request, progress)


def test_from_the_menu_to_a_posed_face(robot: Robot, glb: Path, tmp_path: Path) -> None:
    app = robot.app
    output = app.characters.folder / "my-head.npz"
    open_by_menu(robot)
    assert importer(app).open
    enter(robot, "source", str(glb))
    assert importer(app).form.title == "My head"
    assert importer(app).form.output == str(output)
    enter(robot, "title", "Somebody")
    press(robot, "start")
    finish(robot)
    assert importer(app).page == "summary"
    assert importer(app).about["path"] == str(output)
    assert importer(app).about["summary"]["shapes"] == len(SHAPES)
    assert left_over(tmp_path) == [], "nothing lies beside the source"
    assert left_over(output.parent) == ["my-head.npz"]
    press(robot, "open")
    robot.frames(2)
    assert not importer(app).open
    character = app.session.model.character
    assert (character.name, character.title) == ("my-head", "Somebody")
    assert app.settings.recent[0] == str(output)
    before = app.scene.vertices.copy()
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 8, y - 12))
    assert len(app.session.document.constraints) == 1
    assert np.abs(app.scene.vertices - before).max() > 0.1


def test_a_dropped_rig_a_dropped_folder_and_a_performance(robot: Robot, glb: Path, meshes: Path) -> None:
    app = robot.app
    app.window.play_event(Drop((str(glb),)))
    robot.frames(4)
    assert importer(app).open
    assert (importer(app).form.source, importer(app).form.kind) == (
        str(glb),
        "rig",
    )
    app.window.play_event(Drop(("/somewhere/take.csv",)))
    robot.frames(4)
    assert importer(app).form.captures == ["/somewhere/take.csv"]
    press(robot, "capture:0:remove")
    assert importer(app).form.captures == []
    app.window.play_event(Drop((str(meshes),)))
    robot.frames(4)
    assert importer(app).form.kind == "examples"
    assert importer(app).form.title == "Takes"
    robot.key("Esc")
    assert not importer(app).open


def test_other_drops_are_opened_as_ever(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    app.window.play_event(Drop((str(tmp_path / "none.npz"),)))
    robot.frames(4)
    assert not importer(app).open
    assert "none.npz" in app.dialogs.waiting[0].text


@pytest.mark.slow
def test_progress_is_shown_and_the_window_stays_alive(
    robot: Robot, glb: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = Slow(monkeypatch)
    app = robot.app
    importer(app).show(str(glb))
    press(robot, "start")
    assert slow.begun.wait(PATIENCE)
    robot.frames(2)
    assert importer(app).page == "running"
    assert (
        importer(app).training.stage,
        importer(app).training.share,
    ) == ("Reading", 0.5)
    assert "import:progress" in app.widget_rects
    robot.key("Esc")
    robot.key("R")
    assert importer(app).running, "a stray key stops nothing"
    app.window.play_event(Drop((str(tmp_path),)))
    robot.frames(2)
    assert importer(app).running
    app.window.play_event(CloseRequest())
    robot.frames(4)
    assert app.dialogs.waiting[0].title == "Cancel the import and quit?"
    robot.click_widget("choice:1")
    assert not app.closing
    slow.go_on.set()
    finish(robot)
    assert importer(app).page == "summary"


def test_cancel_leaves_nothing_and_keeps_the_form(
    robot: Robot, glb: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = Slow(monkeypatch)
    app = robot.app
    importer(app).show(str(glb))
    press(robot, "start")
    assert slow.begun.wait(PATIENCE)
    robot.frames(4)
    robot.click_widget("import:cancel")
    finish(robot)
    assert importer(app).page == "form"
    assert (importer(app).error, app.dialogs.waiting) == ("", [])
    assert importer(app).form.source == str(glb)
    assert left_over(tmp_path) == []


def test_closing_the_window_stops_it(robot: Robot, glb: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slow = Slow(monkeypatch)
    app = robot.app
    importer(app).show(str(glb))
    press(robot, "start")
    assert slow.begun.wait(PATIENCE)
    app.close()
    assert importer(app).training.done
    assert left_over(tmp_path) == []


@pytest.mark.slow
def test_errors_are_one_sentence_and_can_be_mended(robot: Robot, glb: Path, tmp_path: Path) -> None:
    app = robot.app
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF but not really")
    open_by_menu(robot)
    press(robot, "start")
    assert importer(app).page == "form"
    assert importer(app).form.missing == "Choose a source for the character."
    enter(robot, "source", str(broken))
    press(robot, "start")
    finish(robot)
    assert importer(app).page == "form"
    assert "broken.glb" in importer(app).error
    assert importer(app).error.count("\n") == 0
    assert importer(app).form.output == str(app.characters.folder / "broken.npz")
    enter(robot, "output", str(tmp_path / "nowhere" / "a.npz"))
    press(robot, "start")
    assert "nowhere" in importer(app).error
    enter(robot, "output", str(tmp_path / "a"))
    enter(robot, "source", str(glb))
    press(robot, "start")
    finish(robot)
    assert importer(app).page == "summary"
    assert left_over(tmp_path) == ["a.npz"]


def test_what_goes_wrong_inside_is_told(
    robot: Robot, glb: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    app = robot.app
    monkeypatch.setattr("faceposer.training.request.train", lambda request, progress: 1 / 0)
    importer(app).show(str(glb))
    press(robot, "start")
    finish(robot)
    assert "ZeroDivisionError" in app.dialogs.waiting[0].text
    assert "ZeroDivisionError" in capsys.readouterr().err
    robot.click_widget("choice:0")
    robot.frames(4)
    assert importer(app).page == "form"


@pytest.mark.slow
def test_a_file_that_is_there_is_replaced_only_if_wanted(robot: Robot, glb: Path, tmp_path: Path) -> None:
    app = robot.app
    there = tmp_path / "my-head.npz"
    there.write_bytes(b"precious")
    importer(app).show(str(glb))
    importer(app).form.output = str(there)
    press(robot, "start")
    robot.frames(4)
    assert app.dialogs.waiting[0].title == "Replace my-head.npz?"
    robot.key("Esc")
    assert importer(app).open, "Esc was meant for the question"
    assert there.read_bytes() == b"precious"
    press(robot, "start")
    robot.frames(4)
    robot.click_widget("choice:0")
    finish(robot)
    press(robot, "open")
    assert app.session.model.character.name == "my-head"
    first = app.session.model
    importer(app).show(str(glb))
    importer(app).form.output = str(there)
    enter(robot, "title", "Anew")
    press(robot, "start")
    robot.frames(4)
    robot.click_widget("choice:0")
    finish(robot)
    press(robot, "open")
    assert app.session.model is not first
    assert app.session.model.character.title == "Anew", "not the file from before"


@pytest.mark.slow
def test_unsaved_work_is_asked_about_before_the_new_face_opens(robot: Robot, glb: Path) -> None:
    app = robot.app
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 12, y - 14))
    importer(app).show(str(glb))
    press(robot, "start")
    finish(robot)
    press(robot, "open")
    robot.frames(4)
    assert app.dialogs.waiting[0].title == "Save the session?"
    robot.click_widget("choice:2")
    assert app.session.model.character.name == "man"


def test_sources_and_outputs_are_chosen_in_the_browser(robot: Robot, glb: Path, meshes: Path) -> None:
    app = robot.app
    open_by_menu(robot)
    robot.click_widget("import:source:file")
    robot.frames(4)
    assert "files:takes" in app.widget_rects
    robot.click_widget("files:My Head.glb")
    robot.click_widget("files:accept")
    assert importer(app).form.source == str(glb)
    robot.frames(4)
    robot.click_widget("import:source:folder")
    robot.frames(4)
    robot.click_widget("files:takes")
    robot.click_widget("files:accept")
    robot.frames(4)
    assert importer(app).form.source == str(meshes)
    assert importer(app).form.kind == "examples"
    robot.click_widget("import:kind:2")
    robot.frames(4)
    robot.click_widget("import:start")
    assert importer(app).page == "form"
    assert "map" in importer(app).form.missing
    robot.click_widget("import:marker_map:file")
    robot.frames(4)
    robot.key("Esc")
    robot.frames(4)
    assert importer(app).open, "Esc was meant for the browser"


def test_browsing_for_a_folder(meshes: Path) -> None:
    browser = PathBrowser(FileRequest("folder", "Folder", "Meshes", (".obj",), meshes.parent, lambda path: None))
    assert browser.accept() == meshes.parent
    browser.name = "takes"
    assert browser.accept() == meshes
    browser.name = str(meshes)
    assert browser.accept() == meshes
    browser.name = "nothing"
    assert browser.accept() is None
    assert "nothing" in browser.message


@pytest.mark.slow
@pytest.mark.parametrize("regions", [0, 2])
def test_a_character_from_examples_is_posed(robot: Robot, meshes: Path, tmp_path: Path, regions: int) -> None:
    app = robot.app
    importer(app).show(str(meshes))
    press(robot, f"regions:{regions}")
    press(robot, "start")
    finish(robot)
    assert importer(app).error == ""
    assert importer(app).about["summary"]["warnings"], "eight are few"
    press(robot, "open")
    session = app.session
    assert "tool-gaze" not in app.widget_rects
    assert not app.actions["tool-gaze"].enabled()
    robot.key("D")
    robot.frames(2)
    # Distances between feature points, if these were found on drawings of the face.
    assert any(mark.startswith("measure:") for mark in app.widget_rects) == bool(session.model.character.feature_points)
    robot.key("H")
    robot.frames(2)
    buttons = [mark for mark in app.widget_rects if mark.startswith("hold:")]
    assert buttons
    robot.click_widget(buttons[0])
    assert len(session.document.constraints) == 1
    assert session.document.constraints[0].kind == "fixed"
    robot.key("Ctrl+Z")
    robot.key("Q")
    neutral = app.scene.vertices.copy()
    # Where the shapes of the examples move most, of what looks at the viewer.
    character = session.model.character
    motion = np.sqrt(np.einsum("snd,snd->sn", character.shapes, character.shapes)).max(axis=0)
    moving = int(np.argmax(motion * (character.vertices[:, 2] > np.percentile(character.vertices[:, 2], 90))))
    left, top = app.viewport.origin
    u, v = app.viewport.camera.project(neutral[[moving]])[0].tolist()
    robot.drag((u + left, v + top), (u + left, v + top + 12))
    assert np.abs(app.scene.vertices - neutral).max() > 0.05
    robot.key("R")
    robot.click_widget("tab:Shapes")
    robot.frames(4)
    name = session.model.character.shape_names[0]
    x0, y0, _, y1 = app.widget_rects[f"shape:{name}"]
    middle = 0.5 * (y0 + y1)
    robot.drag((x0 + 40, middle), (x0 + 70, middle))
    lower, upper = session.model.character.shape_limits[0]
    weight = session.model.weights_of(session.coefficients)[0]
    assert lower <= weight <= upper
    assert np.abs(app.scene.vertices - neutral).max() > 0.01
    pose = session.coefficients.copy()
    obj, saved = tmp_path / "posed.obj", tmp_path / "elsewhere" / "pose.json"
    saved.parent.mkdir()
    app.files._export(obj)
    assert len(read_mesh(obj).vertices) == len(read_mesh(meshes / "neutral.obj").vertices)
    app.files._save(saved)
    again = open_session(str(saved))
    np.testing.assert_allclose(again.coefficients, pose, atol=1e-9)


@pytest.mark.parametrize("size", [(480, 360), (640, 480), (1360, 860)])
def test_it_fits_the_window(robot: Robot, glb: Path, size: tuple[int, int]) -> None:
    app = robot.app
    app.window.set_size(size)
    importer(app).show(str(glb))
    app.features[
        ImportCharacterFeature
    ].error = "Something is wrong with one of the many files, which is called so that it takes two lines."
    robot.frames(6)

    def fits() -> bool:
        window = next(w for w in imgui.get_current_context().windows if w.name == "##import" and w.active)
        low, high = window.pos, window.pos + window.size
        names = [n for n in app.widget_rects if n in ("import:start", "import:cancel", "import:open", "import:close")]
        assert len(names) == 2
        return all(
            low.x >= 0 <= low.y and high.x <= size[0] and high.y <= size[1] and app.widget_rects[n][3] < high.y
            for n in names
        )

    assert fits()
    press(robot, "start")
    finish(robot)
    assert fits()


def test_readings_of_a_rig_are_under_advanced(robot: Robot, glb: Path, tmp_path: Path) -> None:
    avatar = tmp_path / "avatar.vrm"
    avatar.write_bytes(glb.read_bytes())
    open_by_menu(robot)
    enter(robot, "source", str(avatar))
    robot.click_widget("import:advanced")
    robot.frames(4)
    form = importer(robot.app).form
    request = form.request(tmp_path / "a.npz")
    assert (request.sides, request.align_shapes, request.weights_range) == ("auto", True, None)
    for widget in ("import:sides:1", "import:align:1", "import:range:2"):
        robot.click_widget(widget)
        robot.frames(2)
    request = form.request(tmp_path / "a.npz")
    assert (request.sides, request.align_shapes, request.weights_range) == ("as-named", False, 100.0)


def test_the_form_keeps_what_the_user_has_entered(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.glb").touch()
    library = CharacterLibrary(tmp_path)
    form = ImportForm(source=str(tmp_path / "one.glb"))
    form.follow_source(library)
    assert (form.title, Path(form.output).name) == ("One", "one.npz")
    form.title = "My own"
    form.source = f'"{tmp_path / "two.glb"}"'
    form.follow_source(library)
    assert (form.title, Path(form.output).name) == ("My own", "two.npz")
    (tmp_path / "take.npz").touch()
    form.source = str(tmp_path / "take.npz")
    form.follow_source(library)
    assert form.kind == "examples"
    assert Path(form.output).name == "take-2.npz", "not the examples themselves"


def test_processes_can_be_started_from_the_program(tmp_path: Path) -> None:
    """Learning from many files starts processes, which import the program's main module again."""
    code = "import multiprocessing as m\nwith m.get_context('spawn').Pool(1) as p: print(p.map(abs, [-3]))\n"
    hook = tmp_path / "sitecustomize.py"
    hook.write_text(
        "from faceposer.cli import characters as command\n"
        "def characters(_options):\n" + "".join(f"    {line}\n" for line in code.splitlines()) + "    return 0\n"
        "command.run = characters\n"
    )
    script = tmp_path / "faceposer-script"
    script.write_text("import sys\nfrom faceposer.cli import main\nif __name__ == '__main__':\n    sys.exit(main())\n")
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    for command in (["-m", "faceposer"], [str(script)]):
        result = subprocess.run(
            [sys.executable, *command, "characters"],
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE,
            env=os.environ | {"PYTHONPATH": paths},
        )
        assert (result.returncode, result.stdout) == (0, "[3]\n"), result.stderr
