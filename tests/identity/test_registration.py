"""A template is laid on other meshes of heads whose correspondence is known."""

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh import TriangleMesh, VertexNormals
from faceposer.geometry.nearest_surface import NearestSurface, closest_on_triangles
from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.space_bending import bend
from faceposer.identity.registration import LandmarkPairs, Registration, align, register
from faceposer.progress import CancelledError, Progress
from tests.identity.meshes import ELSEWHERE, coarse, feature_vertices, remeshed, skin


@pytest.fixture(scope="module")
def landmarks() -> LandmarkPairs:
    """Return the feature points of man and woman, those of her with an error of a millimetre, in another frame."""
    (_, quads), (woman, _) = skin("man"), skin("woman")
    n_coarse = coarse(woman, quads).vertices.shape[0]
    ids = np.array([v for v in feature_vertices() if v < n_coarse])
    places = woman[ids] + np.random.default_rng(0).normal(scale=0.06, size=(len(ids), 3))
    return LandmarkPairs(SurfacePoints.at_vertices(ids), ELSEWHERE.apply(places), np.ones(len(ids)))


@pytest.fixture(scope="module")
def woman_of_man(landmarks: LandmarkPairs) -> Registration:
    """Return the man's coarse mesh laid on the woman's dual mesh with a hole in the cheek, in another frame."""
    (man, quads), (woman, _) = skin("man"), skin("woman")
    target = remeshed(woman, quads)
    kept = np.linalg.norm(target.vertices[target.triangles].mean(axis=1) - HOLE, axis=1) > HOLE_RADIUS
    holed = TriangleMesh(ELSEWHERE.apply(target.vertices), target.triangles[kept])
    return register(coarse(man, quads), holed, landmarks)


HOLE, HOLE_RADIUS = np.array([4.6, -2.0, 7.0]), 1.2


def test_the_man_becomes_the_woman(woman_of_man: Registration) -> None:
    man, woman = (coarse(*skin(name)).vertices for name in ("man", "woman"))
    found = ELSEWHERE.inverse().apply(woman_of_man.in_target())
    face = woman[:, 2] > 3.0
    before = 10.0 * np.linalg.norm(man - woman, axis=1)[face].mean()
    after = 10.0 * np.linalg.norm(found - woman, axis=1)[face].mean()
    assert after < 2.0 < before
    used = woman_of_man.used
    assert used[face].mean() > 0.9
    assert np.median(10.0 * woman_of_man.distances[used & face]) < 0.05


def test_a_hole_is_filled_by_the_neighbourhood(woman_of_man: Registration) -> None:
    woman = coarse(*skin("woman")).vertices
    inside = np.linalg.norm(woman - HOLE, axis=1) < HOLE_RADIUS
    found = ELSEWHERE.inverse().apply(woman_of_man.in_target())
    assert inside.sum() > 3
    assert not woman_of_man.used[inside].all()
    assert (10.0 * np.linalg.norm(found - woman, axis=1)[inside]).max() < 4.0


def test_it_keeps_to_the_sheet_that_faces_as_it_does() -> None:
    rows = np.linspace(0.0, 4.0, 21)
    flat = np.stack(np.meshgrid(rows, rows, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    near = np.arange(20)[:, None] * 21 + np.arange(20)
    square = np.stack([near, near + 21, near + 22, near + 1], axis=-1).reshape(-1, 4)
    triangles = square[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    assert VertexNormals(triangles, len(flat))(flat)[0, 2] > 0.99
    # The nearer sheet is seen from behind, and the farther one from the front.
    both = TriangleMesh(
        np.concatenate([flat + [0.0, 0.0, 0.2], flat + [0.0, 0.0, -0.4]]),
        np.concatenate([triangles[:, ::-1], triangles + len(flat)]),
    )
    corners = np.array([0, 20, 420, 440])
    pairs = LandmarkPairs(SurfacePoints.at_vertices(corners), flat[corners], np.ones(4))
    template = TriangleMesh(flat, triangles)
    # The nearest sheet is the wrong one everywhere.
    with pytest.raises(FacePoserError, match="do not meet"):
        register(template, both, pairs)
    only = register(template, TriangleMesh(both.vertices, both.triangles[len(triangles) :]), pairs)
    middle = np.abs(flat[:, :2] - 2.0).max(axis=1) < 1.5
    assert np.abs(only.vertices[middle, 2] + 0.4).max() < 0.02


def test_outlying_landmarks_lose_weight() -> None:
    places = np.random.default_rng(1).normal(size=(30, 3))
    wrong = ELSEWHERE.apply(places)
    wrong[:3] += 100.0
    found = align(places, wrong)
    # Least squares would be off by about ten.
    assert np.abs(found.apply(places[3:]) - wrong[3:]).max() < 2.0
    with pytest.raises(FacePoserError, match="at least three"):
        align(places[:2], wrong[:2])


def test_bending_meets_points_and_reproduces_similarities() -> None:
    rng = np.random.default_rng(2)
    source, places = rng.normal(size=(2, 20, 3))
    target = ELSEWHERE.apply(source)
    assert np.allclose(bend(places, source, target, np.zeros(20)), ELSEWHERE.apply(places))
    target += rng.normal(size=(20, 3))
    assert np.allclose(bend(source, source, target, np.zeros(20)), target)


def test_closest_points_of_triangles_are_those_of_a_fine_grid() -> None:
    rng = np.random.default_rng(3)
    corners, places = rng.normal(size=(300, 3, 3)), 2.0 * rng.normal(size=(300, 3))
    weights, distances = closest_on_triangles(corners, places)
    grid = np.array([(i, j, 60 - i - j) for i in range(61) for j in range(61 - i)]) / 60.0
    nearest = np.linalg.norm(grid @ corners - places[:, None], axis=2).min(axis=1)
    assert (weights >= -1e-12).all()
    assert np.allclose(weights.sum(axis=1), 1.0)
    assert (distances <= nearest + 1e-12).all()
    assert (distances > nearest - 0.1).all()


def test_large_triangles_next_to_small_ones_are_found() -> None:
    # Two triangles of a large floor, and a small heap of tiny ones high above one corner.
    rng = np.random.default_rng(5)
    floor = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [100.0, 100.0, 0.0], [0.0, 100.0, 0.0]])
    heap = [0.0, 0.0, 30.0] + rng.normal(scale=0.5, size=(3000, 3))
    triangles = np.concatenate([[[0, 1, 2], [0, 2, 3]], 4 + np.arange(3000).reshape(-1, 3)])
    surface = NearestSurface(np.concatenate([floor, heap]), triangles, np.arange(len(triangles)))
    places = rng.uniform([0.0, 0.0, 1.0], [100.0, 100.0, 5.0], size=(200, 3))
    points, distances = surface.points(places)
    assert np.allclose(distances, places[:, 2])
    assert (points.faces < 2).all()
    assert np.allclose(points.positions(np.concatenate([floor, heap]), triangles)[:, :2], places[:, :2])


def test_work_can_be_cancelled(landmarks: LandmarkPairs) -> None:
    template = coarse(*skin("man"))
    woman = TriangleMesh(ELSEWHERE.apply(template.vertices), template.triangles)
    stages: list[float] = []

    def show(_: str, share: float) -> None:
        stages.append(share)

    with pytest.raises(CancelledError):
        register(template, woman, landmarks, progress=Progress(show, lambda: len(stages) > 1))
    assert stages == [0.0, 0.0]


def test_a_target_without_area_is_refused(landmarks: LandmarkPairs) -> None:
    nothing = TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 1]]))
    with pytest.raises(FacePoserError, match="no surface"):
        register(coarse(*skin("man")), nothing, landmarks)


def test_seams_are_no_borders(landmarks: LandmarkPairs) -> None:
    woman = remeshed(*skin("woman"))
    split = TriangleMesh(
        woman.vertices[woman.triangles].reshape(-1, 3), np.arange(3 * len(woman.triangles)).reshape(-1, 3)
    )
    places = NearestSurface(woman.vertices, woman.triangles, np.arange(len(woman.triangles)))
    found = register(
        coarse(*skin("man")),
        TriangleMesh(ELSEWHERE.apply(split.vertices), split.triangles),
        landmarks,
    )
    assert found.used.mean() > 0.9
    _, distances = places.points(ELSEWHERE.inverse().apply(found.in_target()))
    assert np.median(distances) < 0.005
