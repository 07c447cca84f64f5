"""Eyes look alive from every view: parallel, between their lids, with a catchlight; lashes are dark."""

import io
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.render.eye_shading import Eye, EyeShading
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.offscreen import offscreen_context, plain_character, render_character
from faceposer.render.renderer import Renderer

pytestmark = pytest.mark.gl

PEOPLE = ("man", "woman", "low")
ALL = (*PEOPLE, "creature")
SIZE = (400, 400)
# Yaw and pitch in degrees; the left eye is the near one for positive yaws.
VIEWS = {
    "front": (0, 0),
    "near": (35, 4),
    "far": (-30, 0),
    "side": (60, 0),
    "profile": (88, 0),
    "above": (0, 30),
    "below": (0, -30),
}


def clear() -> bytes:
    file = io.BytesIO()
    Image.new("RGBA", (4, 4)).save(file, "PNG")
    return file.getvalue()


CLEAR = clear()


def both(name: str, weight: float) -> dict[str, float]:
    return {name + "Left": weight, name + "Right": weight}


def gaze(across: float, up: float) -> dict[str, float]:
    """Return weights that turn both eyes to the character's left by ``across`` and up by ``up``, each -1 to 1."""
    left, right = max(across, 0.0), max(-across, 0.0)
    sideways = {"eyeLookOutLeft": left, "eyeLookInRight": left, "eyeLookInLeft": right, "eyeLookOutRight": right}
    return sideways | both("eyeLookUp", max(up, 0.0)) | both("eyeLookDown", max(-up, 0.0))


def posed(character: Character, weights: dict[str, float]) -> NDArray[np.float32]:
    vertices = character.vertices.copy()
    for name, weight in weights.items():
        vertices += np.float32(weight) * character.shapes[character.shape_names.index(name)]
    return vertices


def without_lashes(character: Character) -> Character:
    return replace(character, textures={**character.textures, "lashes": CLEAR})


def axes(character: Character, vertices: NDArray[np.float32]) -> list[NDArray[np.float64]]:
    """Return where the pupils of the eyeballs lie from their centres, unit vectors, by the built eyeballs' poles."""
    found = []
    for part in character.parts:
        if part.material == "eye":
            ball = vertices[slice(*part.vertices)].astype(np.float64)
            away = ball[0] - ball[1:].mean(axis=0)
            found.append(away / np.linalg.norm(away))
    return found


def angle(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    return float(np.degrees(np.arccos(np.clip(one @ other, -1.0, 1.0))))


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    with offscreen_context() as ctx:
        yield Renderer(ctx)


def picture(renderer: Renderer, vertices: NDArray[np.float32], camera: Camera) -> NDArray[np.float64]:
    """Return the picture, shape (height, width, 3), of the character that the renderer has."""
    buffers = renderer.buffers
    assert buffers is not None
    normals = VertexNormals(buffers.character.triangles, len(vertices))(vertices)
    renderer.update(vertices, normals)
    target = ColourTarget(renderer.ctx, camera.size, min(4, renderer.ctx.max_samples))
    renderer.draw(target.framebuffer, camera)
    target.resolve()
    pixels = target.read()
    target.release()
    return pixels.astype(np.float64)


def at_eye(eye: Eye, view: str) -> Camera:
    yaw, pitch = (math.radians(degrees) for degrees in VIEWS[view])
    x, y, z = (eye.centre + [0.0, 0.0, 0.8 * eye.radius]).tolist()
    return OrbitView((x, y, z), yaw, pitch, 22.0, math.radians(16)).camera(SIZE)


# Parallel


@pytest.mark.parametrize("name", PEOPLE)
def test_the_eyes_are_parallel_under_every_gaze(name: str) -> None:
    character = load_character(name)
    shading = EyeShading(character)
    rng = np.random.default_rng(5)
    for across, up in [(0.0, 0.0), (1, 0), (-1, 0), (0, 1), (0, -1), *rng.uniform(-1, 1, (20, 2))]:
        vertices = posed(character, gaze(across, up))
        shading.update(vertices)
        left, right = axes(character, vertices)
        assert angle(left, right) < 0.3
        one, other = (eye.gaze for eye in shading.eyes.values())
        assert angle(one, other) < 0.3
        assert angle(one, left) < 2.5, "the shader follows the ball"
        assert np.sign(one[0]) == np.sign(round(across, 6)) or abs(across) < 0.05


def test_the_goblin_looks_straight_ahead() -> None:
    character = load_character("creature")
    left, right = axes(character, character.vertices)
    assert angle(left, right) < 0.05
    assert angle(left, np.array([0.0, 0.0, 1.0])) < 0.1


# Lids


@pytest.mark.parametrize("name", ALL)
def test_the_opening_lies_between_lids_and_round_the_gaze(name: str) -> None:
    shading = EyeShading(load_character(name))
    assert len(shading.eyes) == 2
    left, right = shading.eyes["eye_left"], shading.eyes["eye_right"]
    for eye in (left, right):
        assert eye.own_picture
        upper, lower = np.degrees(eye.opening(0.0))
        assert 6 < upper < 25
        assert -25 < lower < -6
        assert (eye.lids[1:-1, 0] > eye.lids[1:-1, 1]).all()
        assert -70 < np.degrees(eye.corners[0]) < -25
        assert 25 < np.degrees(eye.corners[1]) < 70
    assert left.corners == pytest.approx((-right.corners[1], -right.corners[0]), abs=0.03)


@pytest.mark.parametrize("name", PEOPLE)
def test_the_opening_follows_the_lids(name: str) -> None:
    character = load_character(name)
    shading = EyeShading(character)

    def height(weights: dict[str, float]) -> float:
        shading.update(posed(character, weights))
        upper, lower = np.degrees(shading.eyes["eye_left"].opening(0.0))
        return float(upper - lower)

    rest, half, closed, wide = (height(w) for w in ({}, both("eyeBlink", 0.5), both("eyeBlink", 1), both("eyeWide", 1)))
    assert closed < 0.15 * rest < half < 0.75 * rest < rest < wide


@pytest.mark.gl
def test_a_ball_without_lids_is_not_shaded() -> None:
    man = load_character("man")
    part = man.part("eye_left")
    triangles = man.triangles[slice(*man.part_triangles(part))] - part.vertices[0]
    ball = plain_character(man.vertices[slice(*part.vertices)], triangles)
    eye = replace(ball, parts=(replace(ball.parts[0], material="eye"),))
    (found,) = EyeShading(eye).eyes.values()
    assert found.opening(0.0) == (1.5, -1.5)
    shown = render_character(eye, eye.vertices, at_eye(found, "front"))
    assert shown[200, 200].max() > 90


def test_lids_shade_the_ball_and_the_shadow_goes_with_them(renderer: Renderer) -> None:
    man = load_character("man")
    renderer.set_character(replace(without_lashes(man), textures={"lashes": CLEAR}))
    shading = EyeShading(man)

    def brightness(weights: dict[str, float], below_lid: float) -> float:
        vertices = posed(man, weights)
        shading.update(vertices)
        eye = shading.eyes["eye_left"]
        camera = at_eye(eye, "front")
        azimuth = math.radians(30)
        elevation = eye.opening(azimuth)[0] - math.radians(below_lid)
        d = [math.sin(azimuth) * math.cos(elevation), math.sin(elevation), math.cos(azimuth) * math.cos(elevation)]
        u, v = camera.project([eye.centre + eye.radius * np.array(d)])[0].astype(int)
        return float(picture(renderer, vertices, camera)[v, u].mean())

    assert brightness({}, 3.0) < 0.80 * brightness({}, 12.0)
    lowered = both("eyeBlink", 0.25)
    assert brightness(lowered, 3.0) < 0.85 * brightness(lowered, 10.0)


# Catchlight


def brightest_in_iris(pixels: NDArray[np.float64], eye: Eye, camera: Camera) -> float:
    """Return the darkest channel of the brightest pixel where the iris is."""
    around = np.linspace(0.0, 2.0 * np.pi, 60)
    best = 0.0
    u, w = np.eye(3)[0] - eye.gaze[0] * eye.gaze, np.eye(3)[1] - eye.gaze[1] * eye.gaze
    for degrees in np.arange(0.0, 24.0, 1.0):
        tilt = math.radians(degrees)
        ring = math.cos(tilt) * eye.gaze + math.sin(tilt) * (np.cos(around)[:, None] * u + np.sin(around)[:, None] * w)
        column, row = camera.project(eye.centre + 1.01 * eye.radius * ring).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < SIZE[0]) & (row < SIZE[1])
        best = max(best, float(pixels[row[inside], column[inside]].min(axis=1).max(initial=0.0)))
    return best


@pytest.mark.parametrize("name", ALL)
def test_a_catchlight_is_seen_from_every_view(name: str, renderer: Renderer) -> None:
    character = load_character(name)
    renderer.set_character(character)
    eye = EyeShading(character).eyes["eye_left"]
    for view in VIEWS:
        camera = at_eye(eye, view)
        assert brightest_in_iris(picture(renderer, character.vertices, camera), eye, camera) > 195, view


@pytest.mark.parametrize("name", PEOPLE)
def test_a_catchlight_stays_whatever_eyes_and_lids_do(name: str, renderer: Renderer) -> None:
    character = load_character(name)
    renderer.set_character(character)
    shading = EyeShading(character)
    poses = {
        "left": gaze(1, 0),
        "right": gaze(-0.8, 0),
        "up": gaze(0, 1),
        "down": gaze(0, -0.8),
        "wide": both("eyeWide", 1),
        "squint": both("eyeSquint", 1),
        "half": both("eyeBlink", 0.5),
    }
    for pose, weights in poses.items():
        vertices = posed(character, weights)
        shading.update(vertices)
        eye = shading.eyes["eye_left"]
        for view in ("front", "near"):
            camera = at_eye(eye, view)
            assert brightest_in_iris(picture(renderer, vertices, camera), eye, camera) > 190, (pose, view)


def test_the_catchlight_lies_on_the_side_of_the_light_and_is_small(renderer: Renderer) -> None:
    man = load_character("man")
    renderer.set_character(man)
    eye = EyeShading(man).eyes["eye_left"]
    camera = at_eye(eye, "front")
    pixels = picture(renderer, man.vertices, camera)
    middle = camera.project([eye.centre + eye.radius * eye.gaze])[0]
    across = np.abs(np.stack(np.meshgrid(*(np.arange(side) for side in SIZE)), -1) - middle).max(axis=2)
    iris = 0.4 * eye.radius * camera.focal / 22.0
    bright = np.argwhere((pixels.min(axis=2) > 215) & (across < iris))[:, ::-1]
    assert 0.002 < len(bright) / (math.pi * iris**2) < 0.10, "a catchlight, not a marble"
    assert (bright.mean(axis=0) < middle).all(), "above, at the left of the picture, as the key light"


# Lashes


@pytest.mark.parametrize("name", ["man", "woman"])
def test_lashes_are_dark_from_every_view(name: str, renderer: Renderer) -> None:
    character = load_character(name)
    bare = without_lashes(character)
    eye = EyeShading(character).eyes["eye_left"]
    for view in ("front", "near", "side", "profile", "below", "far"):
        camera = at_eye(eye, view)
        renderer.set_character(character)
        lashed = picture(renderer, character.vertices, camera).mean(axis=2)
        renderer.set_character(bare)
        without = picture(renderer, character.vertices, camera).mean(axis=2)
        changed = np.abs(lashed - without) > 12
        assert changed.sum() > 40, view
        assert (lashed - without).max() < 4, "nothing gets lighter"
        assert np.percentile(lashed[changed], 10) < 55, view


def test_closed_eyes_and_blinks_keep_their_lashes_dark(renderer: Renderer) -> None:
    man = load_character("man")
    vertices = posed(man, both("eyeBlink", 1))
    eye = EyeShading(man).eyes["eye_left"]
    camera = at_eye(eye, "above")
    renderer.set_character(man)
    assert np.sort(picture(renderer, vertices, camera).mean(axis=2).ravel())[200] < 50


def test_lashes_of_an_eye_behind_the_nose_are_not_seen() -> None:
    for name in ("man", "woman"):
        character = load_character(name)
        shading = EyeShading(character)
        left = character.part("lashes_left")
        for view, seen in (("front", 1.0), ("profile", 1.0), ("near", 1.0), ("far", 1.0)):
            assert shading.lashes_seen(left, at_eye(shading.eyes["eye_left"], view)) == seen, view
        for yaw in (-80, -90, -110):
            camera = OrbitView((0.0, 0.0, 0.0), math.radians(yaw), 0.0, 60.0).camera(SIZE)
            assert shading.lashes_seen(left, camera) == 0.0
