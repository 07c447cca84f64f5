"""Expression lines in pictures: none at rest, where they belong in a pose, and off where nobody wants them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import faceposer
from faceposer.cli import main
from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.gui.app import App
from faceposer.gui.settings import Settings, load_settings, save_settings
from faceposer.gui.testing.scripted_user import Robot
from faceposer.interchange.formats import write
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel
from faceposer.poses.portrait import portrait_view
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.offscreen import offscreen_context, render_character
from faceposer.render.options import OutputOptions
from faceposer.render.renderer import Renderer
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

SIZE = (400, 400)
BROWS = {"browInnerUp": 1.0, "browOuterUpLeft": 1.0, "browOuterUpRight": 1.0}
SMILE = {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8, "cheekSquintLeft": 0.6, "cheekSquintRight": 0.6}


def posed(character: Character, weights: dict[str, float]) -> np.ndarray:
    """Return the vertices; a shape that has been split into halves counts as both."""
    vertices = character.vertices.copy()
    for i, name in enumerate(character.shape_names):
        weight = weights.get(name, weights.get(name.removesuffix("Left").removesuffix("Right"), 0.0))
        vertices += np.float32(weight) * character.shapes[i]
    return vertices


def change(character: Character, vertices: np.ndarray, camera: Camera) -> np.ndarray:
    """Return how much the lines change each pixel, shape (height, width)."""
    with_lines, without = (
        render_character(character, vertices, camera, expression_lines=shown).astype(int) for shown in (True, False)
    )
    return np.abs(with_lines - without).max(axis=2)


@pytest.fixture(scope="module")
def camera(model: FaceModel) -> Camera:
    """A view of the man from the hairline to the chin."""
    view = portrait_view(model.character).zoomed(0.75)
    x, y, z = view.target
    return replace(view, target=(x, y + 2.0, z)).camera(SIZE)


@pytest.mark.parametrize("name", ["man", "woman", "low", "creature"])
def test_the_neutral_face_has_none(name: str) -> None:
    character = load_character(name)
    assert not np.any(change(character, character.vertices, portrait_view(character).camera((120, 120))))


@pytest.mark.parametrize(
    ("weights", "points", "elsewhere"),
    [
        (BROWS, ("11.1", "4.1", "4.2"), ("8.1", "9.3", "3.7", "2.1")),
        ({"browDownLeft": 1.0, "browDownRight": 1.0}, ("4.1", "4.2"), ("8.3", "9.3", "11.1", "2.1")),
        ({"noseSneerLeft": 1.0, "noseSneerRight": 1.0}, ("3.8", "3.11"), ("8.1", "11.1", "2.1")),
        (SMILE, ("9.1", "8.3"), ("11.1", "4.3", "2.1")),
        (SMILE, ("5.3", "4.5"), ("11.1", "4.3", "9.3")),
    ],
)
def test_lines_lie_among_the_points_of_their_muscle(
    model: FaceModel, camera: Camera, weights: dict[str, float], points: tuple[str, ...], elsewhere: tuple[str, ...]
) -> None:
    character = model.character
    vertices = posed(character, weights)
    changed = change(character, vertices, camera)

    def near(places: np.ndarray, reach: int) -> float:
        u, v = camera.project(places.mean(axis=0, keepdims=True).astype(np.float64))[0].astype(int)
        return float(changed[max(v - reach, 0) : v + reach + 1, max(u - reach, 0) : u + reach + 1].max())

    ids = [character.feature_points[name] for name in points]
    assert near(vertices[ids], 18) > 10
    for name in elsewhere:
        assert near(vertices[[character.feature_points[name]]], 4) <= 3, name


def test_one_side_alone(model: FaceModel, camera: Camera) -> None:
    changed = change(model.character, posed(model.character, {"mouthSmileLeft": 1.0, "cheekSquintLeft": 1.0}), camera)
    # Seen a little from the left, the nose lies left of the middle of the picture.
    nose = camera.project(model.character.vertices[[model.character.feature_points["9.3"]]].astype(np.float64))[0, 0]
    assert changed[:, int(nose) :].max() > 15
    assert changed[:, : int(nose) - 10].max() <= 6


def test_clay_and_unknown_faces_have_none(model: FaceModel, camera: Camera) -> None:
    vertices = posed(model.character, BROWS)
    clay = [render_character(model.character, vertices, camera, 0, "clay", expression_lines=on) for on in (True, False)]
    assert np.array_equal(*clay)
    unknown = replace(model.character, feature_points={}, feature_titles={})
    assert not np.any(change(unknown, vertices, camera))


def test_a_face_without_texture_coordinates_has_them(camera: Camera) -> None:
    character = load_character("man")
    polygon_uvs = np.where(character.polygons < 0, -1, 0).astype(np.int32)
    bare = replace(character, uv=np.zeros((1, 2), dtype=np.float32), polygon_uvs=polygon_uvs, textures={})
    assert change(bare, posed(bare, BROWS), camera).max() > 12


def test_python_interface_and_films(tmp_path: Path) -> None:
    face = faceposer.load("low")
    face.set_weights(BROWS)
    pictures = [face.render(view="front", size=(320, 320), expression_lines=on).astype(int) for on in (True, False)]
    assert np.abs(pictures[0] - pictures[1]).max() > 6
    assert np.array_equal(face.render(view="front", size=(320, 320)), pictures[0])
    for suffix in ("png", "gif"):
        frames = []
        for name, on in (("with", True), ("without", False)):
            path = tmp_path / f"{name}.{suffix}"
            write(
                path, face.model, face.coefficients, OutputOptions((320, 320), turn=0.2, rate=10.0, expression_lines=on)
            )
            with Image.open(path) as image:
                frames.append(np.asarray(image.convert("RGB")).astype(int))
        assert np.abs(frames[0] - frames[1]).max() > 6
    exported = face.export(tmp_path / "off.png", expression_lines=False)
    assert exported.read_bytes() != face.export(tmp_path / "on.png").read_bytes()


@pytest.mark.parametrize("command", ["render", "export"])
def test_commands(command: str, tmp_path: Path) -> None:
    face = faceposer.load("low")
    face.set_weights(BROWS)
    face.save(tmp_path / "brows.json")
    pictures = []
    for extra in ([], ["--no-expression-lines"]):
        with pytest.raises(SystemExit) as ended:
            main([command, str(tmp_path / "brows.json"), "-o", str(tmp_path / "a.png"), "--size", "320x320", *extra])
        assert not ended.value.code
        pictures.append(np.asarray(Image.open(tmp_path / "a.png").convert("RGB")).astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() > 6


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window(pictures=True)


def test_the_window_switches_them(robot: Robot) -> None:
    app = robot.app
    app.session.set_start(app.session.model.coefficients_of(BROWS))
    robot.frames(3)

    def shown() -> np.ndarray:
        robot.frames(3)
        left, top, right, bottom = (int(edge) for edge in app.widget_rects["view"])
        return app.screenshot()[top:bottom, left : right - 20].astype(int)

    with_lines = shown()
    portrait = app.scene.portrait(app.session.coefficients, portrait_view(app.session.model.character).camera(SIZE), 0)
    action = app.actions["expression-lines"]
    assert action.menu == "View"
    assert action.checked is not None
    assert action.checked()
    action.run()
    assert not action.checked()
    assert not app.settings.expression_lines
    without = shown()
    assert np.abs(with_lines - without).max() > 6
    other = app.scene.portrait(app.session.coefficients, portrait_view(app.session.model.character).camera(SIZE), 0)
    assert np.abs(portrait.astype(int) - other.astype(int)).max() > 6
    action.run()
    assert np.array_equal(shown(), with_lines)
    robot.click_widget("tab:View")
    robot.click_widget("expression-lines")
    assert not app.scene.expression_lines


def test_the_choice_is_remembered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert load_settings().expression_lines
    save_settings(Settings(expression_lines=False))
    assert not load_settings().expression_lines
    app = App("low", hidden=True, threaded=False, settings=load_settings(), journal=False)
    assert not app.scene.expression_lines
    app.close()


def test_the_first_picture_of_a_renderer_is_like_the_next(model: FaceModel, camera: Camera) -> None:
    smile = model.instance(model.coefficients_of({"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0}))
    with offscreen_context() as ctx:
        renderer = Renderer(ctx)
        renderer.set_character(model.character)
        renderer.update(smile, VertexNormals(model.triangles, len(smile))(smile))
        target = ColourTarget(ctx, camera.size, 0)
        pictures = []
        for _ in range(2):
            renderer.draw(target.framebuffer, camera)
            target.resolve()
            pictures.append(target.read().astype(int))
        target.release()
        renderer.release()
    assert pictures[0].mean() > 40
    np.testing.assert_array_equal(*pictures)
