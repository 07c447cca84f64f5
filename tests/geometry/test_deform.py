"""Handles are met exactly, turned input gives turned output, lips part, and what no handle reaches stays."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from faceposer.geometry.deform import MarkerDeformer
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import Character
from faceposer.model.character_file import load_character


def grid(n: int = 21, size: float = 10.0, slit: bool = False) -> TriangleMesh:
    """A square in the plane z = 0; with a slit along the middle row, whose two lips are at the same height."""
    u = np.linspace(-size / 2, size / 2, n)
    x, y = np.meshgrid(u, u)
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    triangles = np.concatenate([np.stack([a, a + 1, a + n + 1], 1), np.stack([a, a + n + 1, a + n], 1)])
    if slit:
        middle = n // 2
        inside = np.arange(n // 4, n - n // 4)
        below = middle * n + inside
        above = len(vertices) + np.arange(len(inside))
        vertices = np.concatenate([vertices, vertices[below] + [0.0, 1e-3, 0.0]])
        twin = dict(zip(below.tolist(), above.tolist(), strict=True))
        is_above = vertices[triangles][:, :, 1].mean(axis=1) > 0.0
        triangles[is_above] = np.vectorize(lambda v: twin.get(v, v))(triangles[is_above])
    return TriangleMesh(vertices, triangles)


def spread(mesh: TriangleMesh, n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).permutation(len(mesh.vertices))[:n]


def test_handles_are_met_exactly_whatever_they_sit_on() -> None:
    mesh = grid()
    faces = np.array([5, 100, -1 - 220, 390])
    points = SurfacePoints(faces, np.array([[0.2, 0.3, 0.5], [0.6, 0.4, 0.0], [1.0, 0.0, 0.0], [1 / 3, 1 / 3, 1 / 3]]))
    deformer = MarkerDeformer(mesh.vertices, mesh.triangles, points, reach=np.inf)
    np.testing.assert_allclose(deformer.places, points.positions(mesh.vertices, mesh.triangles))
    targets = deformer.places + np.random.default_rng(0).normal(size=(6, 4, 3))
    moved = deformer(targets)
    assert moved.shape == (6, len(mesh.vertices), 3)
    for frame, target in zip(moved, targets, strict=True):
        np.testing.assert_allclose(points.positions(frame, mesh.triangles), target, atol=1e-9)
        np.testing.assert_allclose(deformer(target), frame, atol=1e-12)
    np.testing.assert_allclose(deformer(deformer.places), mesh.vertices, atol=1e-12)


def test_a_shift_of_all_handles_shifts_everything_within_reach_of_them() -> None:
    mesh = grid()
    handles = spread(mesh, 12)
    everywhere = MarkerDeformer(mesh.vertices, mesh.triangles, handles, reach=np.inf)
    np.testing.assert_allclose(everywhere.weights.sum(axis=1), 1.0, atol=1e-9)
    near = MarkerDeformer(mesh.vertices, mesh.triangles, handles[:1], reach=2.0)
    moved = near(near.places + 1.0) - mesh.vertices
    distances = np.linalg.norm(mesh.vertices - mesh.vertices[handles[0]], axis=1)
    assert not moved[distances > 2.0 + 1e-9].any()
    assert moved[distances < 0.8].min() > 0.2


def test_turned_input_gives_turned_output() -> None:
    mesh = grid(15)
    rng = np.random.default_rng(1)
    vertices = mesh.vertices + rng.normal(scale=0.1, size=mesh.vertices.shape)
    handles = spread(mesh, 9)
    targets = vertices[handles] + rng.normal(size=(9, 3))
    turn, shift = Rotation.random(random_state=rng).as_matrix(), np.array([3.0, -2.0, 7.0])
    plain = MarkerDeformer(vertices, mesh.triangles, handles)(targets)
    turned = MarkerDeformer(vertices @ turn.T + shift, mesh.triangles, handles)(targets @ turn.T + shift)
    np.testing.assert_allclose(turned, plain @ turn.T + shift, atol=1e-8)
    larger = MarkerDeformer(10.0 * vertices, mesh.triangles, handles)(10.0 * targets)
    np.testing.assert_allclose(larger, 10.0 * plain, atol=1e-7)


def test_lips_part() -> None:
    mesh = grid(41, slit=True)
    middle = np.flatnonzero((np.abs(mesh.vertices[:, 0]) < 1e-9) & (np.abs(mesh.vertices[:, 1]) < 1e-2))
    lower, upper = middle[np.argsort(mesh.vertices[middle, 1])]
    rim = np.flatnonzero(np.abs(mesh.vertices[:, :2]).max(axis=1) > 4.99)
    deformer = MarkerDeformer(mesh.vertices, mesh.triangles, np.array([lower, upper, *rim[::10]]))
    moves = np.zeros((deformer.n_handles, 3))
    moves[0, 1] = -1.0
    lips = (np.abs(mesh.vertices[:, 0]) < 0.6) & (np.abs(mesh.vertices[:, 1]) < 1e-2)
    dropped = deformer.displaced(moves)[:, 1] - mesh.vertices[:, 1]
    assert dropped[lips & (mesh.vertices[:, 1] < 5e-4)].max() < -0.5
    assert np.abs(dropped[lips & (mesh.vertices[:, 1] > 5e-4)]).max() < 0.15


def test_seams_hold_and_other_pieces_stay() -> None:
    mesh = grid(11)
    # The right half has vertices of its own along the seam, and a triangle floats in front of it all.
    right = mesh.vertices[mesh.triangles][:, :, 0].mean(axis=1) > 0.0
    seam = np.flatnonzero(np.abs(mesh.vertices[:, 0]) < 1e-9)
    n = len(mesh.vertices)
    twin = dict(zip(seam.tolist(), range(n, n + len(seam)), strict=True))
    triangles = mesh.triangles.copy()
    triangles[right] = np.vectorize(lambda v: twin.get(v, v))(triangles[right])
    vertices = np.concatenate([mesh.vertices, mesh.vertices[seam], [[0, 0, 1], [1, 0, 1], [0, 1, 1]]])
    triangles = np.concatenate([triangles, [[n + len(seam), n + len(seam) + 1, n + len(seam) + 2]], [[0, 0, 1]]])
    handles = np.array([0, 10, 60, 110, 120])
    deformer = MarkerDeformer(vertices, triangles, handles, reach=np.inf)
    moved = deformer.displaced(np.random.default_rng(0).normal(size=(5, 3)))
    np.testing.assert_array_equal(moved[seam], moved[n : n + len(seam)])
    np.testing.assert_array_equal(moved[-3:], vertices[-3:])
    whole = MarkerDeformer(mesh.vertices, mesh.triangles, handles, reach=np.inf)
    np.testing.assert_allclose(deformer.weights[:n], whole.weights, atol=1e-9)


def test_a_missing_handle_goes_where_the_others_take_it() -> None:
    mesh = grid(15)
    handles = spread(mesh, 10)
    deformer = MarkerDeformer(mesh.vertices, mesh.triangles, handles, reach=np.inf)
    moves = np.random.default_rng(3).normal(size=(4, 10, 3))
    moves[1, 2] = np.nan
    moves[2, [2, 5]] = np.nan
    moves[3, 5, 1] = np.nan
    moved = deformer.displaced(moves)
    assert np.isfinite(moved).all()
    for frame, missing in ((1, [2]), (2, [2, 5]), (3, [5])):
        kept = np.setdiff1d(np.arange(10), missing)
        fewer = MarkerDeformer(mesh.vertices, mesh.triangles, handles[kept], reach=np.inf)
        np.testing.assert_allclose(moved[frame], fewer.displaced(moves[frame, kept]), atol=1e-8)
    with pytest.raises(ValueError, match="without any handle"):
        deformer.complete(np.full((10, 3), np.nan))
    with pytest.raises(ValueError, match=r"\(\.\.\., 10, 3\)"):
        deformer.complete(np.zeros((9, 3)))


def test_slivers_and_odd_handles() -> None:
    mesh = grid(9)
    vertices = mesh.vertices.copy()
    # One row is pressed almost flat, so that its triangles are slivers.
    vertices[36:45, 1] = vertices[27:36, 1] + 1e-7
    moved = MarkerDeformer(vertices, mesh.triangles, np.array([0, 8, 40, 72, 80]), reach=np.inf).displaced(
        np.random.default_rng(0).uniform(-1.0, 1.0, (5, 3))
    )
    assert np.abs(moved - vertices).max() < 3.0
    for handles in ([], [3, 3], [81], SurfacePoints(np.array([200]), np.array([[1.0, 0.0, 0.0]]))):
        with pytest.raises(ValueError, match="handle"):
            MarkerDeformer(mesh.vertices, mesh.triangles, handles if handles else np.zeros(0, dtype=int))


def markers_on(character: Character) -> np.ndarray:
    """Return 55 vertices: the feature points that a marker can be put on, and places between them, far from others."""
    numbers = {
        2: (1, 10, 11, 12, 13, 14),
        3: (9, 10, 13, 14),
        4: (1, 2, 3, 4, 5, 6),
        5: (1, 2, 3, 4),
        8: (1, 2, 3, 4, 5, 6, 7, 8),
        9: (1, 2, 3, 12),
        10: (5, 6),
        11: (1, 2, 3),
    }
    names = [f"{group}.{number}" for group, members in numbers.items() for number in members]
    chosen = [character.feature_points[name] for name in names]
    regions = ("cheek_left", "cheek_right", "mouth", "jaw", "forehead", "nose", "lids_left", "lids_right")
    face = np.unique(np.concatenate([character.regions[name] for name in regions]))
    # Not inside the mouth, nor under the lids.
    face = face[character.vertices[face, 2] > 0.5 * character.vertices[:, 2].max()]
    while len(chosen) < 55:
        between = np.linalg.norm(character.vertices[face, None] - character.vertices[chosen], axis=2).min(axis=1)
        chosen.append(int(face[np.argmax(between)]))
    return np.array(chosen)


def test_expressions_come_back_from_55_markers_on_a_head() -> None:
    character = load_character("man")
    vertices = character.vertices.astype(np.float64)
    markers = markers_on(character)
    deformer = MarkerDeformer(vertices, character.triangles, markers)
    first, last = character.part("skin").vertices
    wanted = [
        i for i, name in enumerate(character.shape_names) if not name.startswith("eyeLook") and name != "tongueOut"
    ]
    expressions = character.shapes[wanted].astype(np.float64)
    found = deformer.displaced(expressions[:, markers]) - vertices
    errors = np.linalg.norm(found - expressions, axis=2)[:, first:last]
    sizes = np.linalg.norm(expressions, axis=2)[:, first:last]
    assert errors.mean() < 0.45 * sizes.mean()
    lips = np.concatenate([character.regions["lip_upper"], character.regions["lip_lower"]])
    assert errors[:, lips].mean() < 0.2 * sizes[:, lips].mean()
    # The back of the head, the neck's rim and the eyes stay.
    back = [character.feature_points["11.6"]]
    rim = np.flatnonzero(vertices[:, 1] < vertices[:, 1].min() + 0.5)
    assert not found[:, np.concatenate([back, rim, character.regions["eye_left"]])].any()
