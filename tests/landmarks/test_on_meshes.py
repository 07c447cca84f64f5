"""Landmarks and feature points of meshes, in any axes and unit, and of imported characters."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.landmarks.drawing import PaintedMesh, draw
from faceposer.landmarks.feature_points import EXTRAPOLATED, feature_pixels, feature_places
from faceposer.landmarks.on_meshes import MeshLandmarks, find_mesh_landmarks
from faceposer.landmarks.painting import painted_character
from faceposer.landmarks.reference import reference
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.progress import Progress
from faceposer.training.examples import ExampleOptions
from faceposer.training.known_face import character_from_frames, mesh_of

UPRIGHT = Similarity(np.eye(3), np.zeros(3), np.array(1.0))
# Mean and largest distance of the feature points from those that ship, in percent of the head's height: of those on the
# face, and of those beyond, which are extrapolated. A creature's ears are where no human's are.
ALLOWED = {
    "man": (0.3, 1.0, 2.0, 3.5),
    "woman": (1.2, 3.5, 3.5, 6.0),
    "low": (1.5, 4.0, 3.8, 7.0),
    "creature": (2.8, 11.0, 20.0, 45.0),
}


@cache
def landmarks_of(name: str) -> tuple[Character, MeshLandmarks]:
    """Return a character and its landmarks."""
    character = load_character(name)
    found = find_mesh_landmarks(painted_character(character), UPRIGHT)
    assert found is not None
    return character, found


def misses(character: Character, places: dict[str, NDArray[np.float64]]) -> tuple[float, float, float, float]:
    """Return the mean and largest miss on the face, and beyond it, in percent of the head's height."""
    apart = {
        name: 100.0 * np.linalg.norm(place - character.vertices[character.feature_points[name]]) / character.height
        for name, place in places.items()
    }
    inside = [miss for name, miss in apart.items() if name not in EXTRAPOLATED]
    beyond = [miss for name, miss in apart.items() if name in EXTRAPOLATED]
    return float(np.mean(inside)), float(np.max(inside)), float(np.mean(beyond)), float(np.max(beyond))


@pytest.mark.parametrize("name", list(ALLOWED))
def test_feature_points_are_where_they_ship(name: str) -> None:
    character, found = landmarks_of(name)
    features = feature_places(found, _skin(character, found.mesh))
    assert features.keys() == character.feature_points.keys()
    assert {n: feature.title for n, feature in features.items()} == dict(character.feature_titles)
    got = misses(character, {n: np.array(feature.place) for n, feature in features.items()})
    assert all(one <= most for one, most in zip(got, ALLOWED[name], strict=True)), got
    assert (found.seen > 0).sum() > 460
    assert np.isfinite(found.pupils).all()
    for feature in features.values():
        corners = found.mesh.vertices[found.mesh.triangles[feature.surface.face]]
        np.testing.assert_allclose(np.array(feature.surface.barycentric) @ corners, feature.place, atol=1e-9)


def test_points_are_symmetric_on_symmetric_heads() -> None:
    known = reference()
    for name in ALLOWED:
        _, found = landmarks_of(name)
        apart = np.linalg.norm(found.points - found.points[known.mirror] * (-1.0, 1.0, 1.0), axis=1)
        assert np.nanmean(apart) < 0.2


@pytest.mark.parametrize("textured", [True, False])
def test_any_axes_and_unit(textured: bool) -> None:
    character, found = landmarks_of("low")
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh = found.mesh
    moved = 0.01 * mesh.vertices @ turn.T + (5.0, -2.0, 1.0)
    other = PaintedMesh(moved, mesh.triangles)
    if textured:
        other = PaintedMesh(moved, mesh.triangles, mesh.colours, mesh.uv, mesh.image_of, mesh.images)
    again = find_mesh_landmarks(other)
    assert again is not None
    assert abs(float(again.frame.scale) - 100.0) < 8.0
    back = (again.points - (5.0, -2.0, 1.0)) @ turn / 0.01
    apart = np.linalg.norm(back - found.points, axis=1)
    assert np.nanmedian(apart) < (0.15 if textured else 0.4)
    features = {n: np.array(f.place) for n, f in feature_places(again).items()}
    inside, largest, _, _ = misses(character, {n: (p - (5.0, -2.0, 1.0)) @ turn / 0.01 for n, p in features.items()})
    assert inside < 2.0
    assert largest < 6.0


def test_meshes_without_a_face() -> None:
    rng = np.random.default_rng(0)
    columns, rows = (values.ravel() for values in np.meshgrid(np.arange(30), np.arange(30)))
    places = np.stack([columns, rows, rng.random(900)], axis=1).astype(np.float64)
    first = np.flatnonzero((columns < 29) & (rows < 29))
    sheet = np.concatenate(
        [np.stack([first, first + 1, first + 30], 1), np.stack([first + 1, first + 31, first + 30], 1)]
    )
    assert find_mesh_landmarks(PaintedMesh(places, sheet)) is None
    assert find_mesh_landmarks(PaintedMesh(np.zeros((4, 3)), sheet[:0])) is None
    assert find_mesh_landmarks(PaintedMesh(np.zeros((900, 3)), sheet)) is None


def test_drawing_shows_the_nearest_surface_and_its_places() -> None:
    # Two triangles, the nearer smaller, seen from +z.
    vertices = np.array([[-2, -2, 0], [2, -2, 0], [0, 2, 0], [-0.5, -0.5, 1], [0.5, -0.5, 1], [0, 0.5, 1]], dtype=float)
    mesh = PaintedMesh(vertices, np.array([[0, 1, 2], [3, 5, 4]]), np.array([[250.0, 0, 0]] * 3 + [[0, 250.0, 0]] * 3))
    camera = Camera(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 10.0]), 200.0, (100, 80))
    drawing = draw(mesh, camera)
    assert set(np.unique(drawing.faces)) == {-1, 0, 1}
    assert drawing.faces[40, 50] == 1
    rows, columns = np.nonzero(drawing.faces >= 0)
    seen = camera.project(drawing.places[rows, columns])
    np.testing.assert_allclose(seen, np.stack([columns + 0.5, rows + 0.5], axis=1), atol=1e-6)
    np.testing.assert_allclose(drawing.places[drawing.faces == 1][:, 2], 1.0, atol=1e-9)
    assert (drawing.image[drawing.faces == 1].argmax(axis=1) == 1).all()
    assert np.isnan(drawing.places[drawing.faces < 0]).all()
    # The nearer one faces away, and is drawn all the same.
    assert (drawing.facing[drawing.faces >= 0] > 0.9).all()


def test_feature_points_in_an_image() -> None:
    character, found = landmarks_of("woman")
    view = found.views[0]
    pixels = feature_pixels(view.landmarks)
    assert not set(pixels) & set(EXTRAPOLATED)
    expected = view.camera.project(character.vertices[[character.feature_points[name] for name in pixels]])
    # The depth is the network's here, not that of the mesh.
    height = character.height / 27.0 * 400.0 / float(found.frame.inverse().scale)
    apart = np.linalg.norm(np.array(list(pixels.values())) - expected, axis=1) / height
    assert np.mean(apart) < 0.02


def test_characters_from_examples_get_feature_points() -> None:
    low = load_character("low")
    rng = np.random.default_rng(0)
    frames = [low.vertices + np.tensordot(rng.random(len(low.shapes)) * 0.5, low.shapes, 1) for _ in range(6)]
    mesh = mesh_of(low)
    learned = character_from_frames(
        [low.vertices, *frames], 7, mesh, None, "low", ExampleOptions("low2", "Low"), Progress()
    )
    assert learned.summary["points_from_pictures"] == len(learned.feature_points) >= 50
    apart = {
        name: np.linalg.norm(learned.vertices[vertex] - low.vertices[low.feature_points[name]]) / low.height
        for name, vertex in learned.feature_points.items()
        if name not in EXTRAPOLATED
    }
    assert np.mean(list(apart.values())) < 0.03
    assert set(learned.feature_titles) == set(learned.feature_points)


def _skin(character: Character, mesh: PaintedMesh) -> NDArray[np.intp]:
    on_skin = np.zeros(len(character.vertices), dtype=bool)
    on_skin[slice(*character.part("skin").vertices)] = True
    return np.flatnonzero(on_skin[mesh.triangles].all(axis=1))
