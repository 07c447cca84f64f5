"""What is drawn lies where the camera says, and picking by picture agrees with picking by ray."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import pytest

from faceposer.geometry.camera import OrbitView
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picking import pick
from faceposer.model.face_model import FaceModel
from faceposer.render.framebuffers import ColourTarget, IdTarget
from faceposer.render.images import drawn_pixels
from faceposer.render.offscreen import offscreen_context, plain_character, render_character, render_mesh
from faceposer.render.renderer import Renderer

pytestmark = pytest.mark.gl

VIEWS = [("front", (320, 240)), ("three-quarter", (240, 320)), ("left", (200, 200)), ("bottom", (200, 200))]


@pytest.fixture(scope="module")
def ctx() -> Iterator[moderngl.Context]:
    with offscreen_context() as context:
        yield context


def box(model: FaceModel) -> tuple[np.ndarray, np.ndarray]:
    return model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)


def test_vertices_appear_where_the_camera_projects_them() -> None:
    rng = np.random.default_rng(0)
    size = (321, 247)
    empty_character_camera = OrbitView((0, 0, 0), distance=60).camera(size)
    behind = np.array([[0.0, 0.0, 900.0], [1.0, 0.0, 900.0], [0.0, 1.0, 900.0]])
    backdrop = render_mesh(behind, [[0, 1, 2]], empty_character_camera, samples=0).astype(int)
    for _ in range(12):
        view = OrbitView((0, 0, 0), rng.uniform(-3, 3), rng.uniform(-1, 1), 60)
        camera = view.camera(size)
        center = rng.uniform(-3, 3, 3)
        axes = camera.rotation[:2] * 0.8
        # A small square that faces the camera.
        corners = center + np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]]) @ axes
        picture = render_mesh(corners, [[0, 1, 2], [0, 2, 3]], camera, samples=0).astype(int)
        rows, columns = np.nonzero(np.abs(picture - backdrop).sum(axis=2) > 12)
        seen = np.array([columns.mean() + 0.5, rows.mean() + 0.5])
        np.testing.assert_allclose(seen, camera.project(corners).mean(axis=0), atol=0.5)


@pytest.mark.slow
@pytest.mark.parametrize(("view", "size"), VIEWS)
def test_picking_by_picture_agrees_with_picking_by_ray(
    ctx: moderngl.Context, model: FaceModel, view: str, size: tuple[int, int]
) -> None:
    character = model.character
    vertices = model.instance(model.coefficients_of({"jawOpen": 0.6, "browInnerUp": 0.8}))
    renderer, ids = Renderer(ctx), IdTarget(ctx)
    renderer.set_character(character)
    renderer.update(vertices, VertexNormals(character.triangles, len(vertices))(vertices))
    camera = OrbitView.preset(*box(model), view).camera(size)
    solid = np.concatenate(
        [character.triangles[slice(*character.part_triangles(p))] for p in character.parts if p.material != "lashes"]
    )
    lookup = {tuple(triangle): i for i, triangle in enumerate(character.triangles.tolist())}
    same, hits = 0, 0
    for pixel in np.random.default_rng(1).uniform((0, 0), size, (150, 2)):
        centre = tuple((np.floor(pixel) + 0.5).tolist())
        by_picture = int(ids.at(renderer, camera, "pose", np.array([centre]))[0])
        point = pick(vertices, solid, camera, centre)
        by_ray = -1 if point is None else lookup[tuple(solid[point.face].tolist())]
        hits += by_ray >= 0
        same += by_picture == by_ray
    assert hits > 10
    # Where triangles are smaller than a pixel, rounding may choose the neighbour.
    assert same >= 146
    assert ids.at(renderer, camera, "pose", np.array([[-1.0, 5.0]]))[0] == -1
    ids.release()
    renderer.release()


def test_ids_are_redrawn_for_a_new_pose_or_camera(ctx: moderngl.Context, model: FaceModel) -> None:
    renderer, ids = Renderer(ctx), IdTarget(ctx)
    renderer.set_character(model.character)
    normals_of = VertexNormals(model.triangles, len(model.character.vertices))
    camera = OrbitView.preset(*box(model)).camera((200, 200))
    vertices = model.character.vertices
    renderer.update(vertices, normals_of(vertices), 1)
    before = ids.at(renderer, camera, 1, np.array([[100.0, 100.0]]))[0]
    assert before >= 0
    away = vertices + np.float32([40, 0, 0])
    renderer.update(away, normals_of(away), 2)
    assert ids.at(renderer, camera, 2, np.array([[100.0, 100.0]]))[0] == -1
    assert ids.at(renderer, camera.resized((400, 200)), 2, np.array([[399.0, 100.0]]))[0] >= 0
    ids.release()
    renderer.release()


def test_shading_modes_differ_and_leave_no_error(ctx: moderngl.Context, model: FaceModel) -> None:
    renderer = Renderer(ctx)
    renderer.set_character(model.character)
    vertices = model.character.vertices
    renderer.update(vertices, VertexNormals(model.triangles, len(vertices))(vertices))
    camera = OrbitView.preset(*box(model)).camera((160, 160))
    pictures = []
    for samples in (0, 4):
        target = ColourTarget(ctx, camera.size, samples)
        for shading in ("full", "clay"):
            for wireframe in (False, True):
                assert ctx.error  # reading the property clears what earlier reads of framebuffers left
                renderer.draw(target.framebuffer, camera, shading, wireframe)  # type: ignore[arg-type]
                assert ctx.error == "GL_NO_ERROR"
                target.resolve()
                pictures.append(target.read().astype(int))
        target.release()
    for i, a in enumerate(pictures):
        for b in pictures[i + 1 :]:
            assert np.abs(a - b).max() > 8
    renderer.release()


def test_the_head_fills_the_picture_and_fades_at_the_neck(model: FaceModel) -> None:
    camera = OrbitView.preset(*box(model)).camera((200, 200))
    picture = render_character(model.character, model.character.vertices, camera).astype(int)
    warmth = picture[..., 0] - picture[..., 2]
    rows = np.nonzero((warmth > 15).sum(axis=1) > 10)[0]
    assert rows.min() < 40
    assert rows.max() > 150
    assert warmth[rows.max() + 4 :].max() < 15, "no hard edge where the neck ends"


@pytest.mark.slow
@pytest.mark.parametrize("angles", [(0, 0), (180, 0), (90, 0), (0, -35), (150, -25)])
def test_the_cut_of_the_neck_is_an_edge_from_no_side(model: FaceModel, angles: tuple[int, int]) -> None:
    vertices = model.character.vertices
    yaw, pitch = (math.radians(angle) for angle in angles)
    camera = replace(OrbitView.preset(*box(model)), yaw=yaw, pitch=pitch).camera((300, 300))
    shown, empty = (render_character(model.character, v, camera, 0).astype(int) for v in (vertices, vertices + 1e4))
    differs = np.abs(shown - empty).max(axis=2)
    strong = differs > 50
    assert strong.mean() > 0.08
    columns = np.flatnonzero(strong.sum(axis=0) > 80)
    middle = columns[len(columns) // 4 : -len(columns) // 4]
    last = strong.shape[0] - 1 - strong[::-1, middle].argmax(axis=0)
    steps = np.abs(np.diff(differs, axis=0))
    found = [steps[row - 2 : row + 25, column].max() for row, column in zip(last, middle, strict=True)]
    assert np.median(found) < 40


def test_a_fold_of_the_lips_seen_from_below_is_opaque(model: FaceModel) -> None:
    character = model.character
    raised = {"mouthSmileLeft": 1.0, "mouthUpperUpLeft": 1.0, "mouthStretchLeft": 0.6, "jawOpen": 0.1}
    weights = np.array([raised.get(name, 0.0) for name in character.shape_names])
    vertices = model.contact.apply((character.vertices + np.tensordot(weights, character.shapes, 1)).astype(np.float32))
    lip = vertices[character.regions["mouth"]].mean(axis=0) + [1.2, 0.0, 0.0]
    camera = OrbitView(tuple(lip.tolist()), 0.4, -0.4, distance=12.0).camera((160, 120))
    assert (render_character(character, vertices, camera, transparent=True)[..., 3] == 255).all()


def test_missing_textures_are_replaced_by_plain_colours() -> None:
    vertices = np.array([[-5, -5, 0], [5, -5, 0], [0, 5, 0]])
    character = plain_character(vertices, [[0, 1, 2]])
    picture = render_character(character, character.vertices, OrbitView((0, 0, 0), distance=40).camera((64, 64)))
    assert picture[32, 32, 0] > picture[32, 32, 2] + 20


def test_a_head_that_ends_above_the_neck_does_not_fade(model: FaceModel) -> None:
    character = model.character
    regions = {name: ids for name, ids in character.regions.items() if name != "neck"}
    camera = OrbitView.preset(*box(model)).camera((200, 200))
    faded, whole = (
        render_character(shown, shown.vertices, camera).astype(int)
        for shown in (character, replace(character, regions=regions))
    )
    rows = np.flatnonzero(np.abs(whole - faded).max(axis=(1, 2)) > 20)
    assert len(rows) > 2
    assert rows.min() > 150, "only the lowest part is another"


def test_pictures_leave_nothing_on_the_gpu(ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    for name in ("texture", "renderbuffer", "depth_renderbuffer", "framebuffer", "simple_framebuffer"):
        create = getattr(moderngl.Context, name)
        monkeypatch.setattr(
            moderngl.Context,
            name,
            lambda *args, create=create, **options: made.append(create(*args, **options)) or made[-1],
        )
    picture = drawn_pixels(ctx, (30, 20), lambda: ctx.clear(1.0, 0.5, 0.0))
    assert picture.shape == (20, 30, 3)
    assert picture[0, 0].tolist() == [255, 128, 0]
    ColourTarget(ctx, (30, 20), 4).release()
    assert len(made) > 5
    assert all(isinstance(thing.mglo, moderngl.InvalidObject) for thing in made)
