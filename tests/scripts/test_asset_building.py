from dataclasses import replace

import numpy as np
import pytest

from faceposer.model.subject import Subject
from faceposer.model.subject_file import load_subject
from scripts.asset_building.piece import grid_quads
from scripts.asset_building.raster import map_texels, smoothstep
from scripts.asset_building.subdivision import catmull_clark, linear_split
from scripts.asset_building.symmetry import even, even_units
from scripts.asset_building.unwrap import Layout, unwrap_skin
from scripts.build_assets import differences

CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
CUBE_QUADS = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], dtype=np.int32
)


def test_a_cube_is_subdivided_as_catmull_and_clark_say() -> None:
    fine = catmull_clark(CUBE_QUADS, 8)
    points = fine.matrix @ CUBE
    assert points.shape == (26, 3)
    assert fine.quads.shape == (24, 4)
    np.testing.assert_allclose(np.abs(points[:8]), 5 / 9)
    np.testing.assert_allclose(np.sort(np.abs(points[8 : fine.n_edge_points])), np.tile([0, 0.75, 0.75], (12, 1)))
    np.testing.assert_allclose(np.sort(np.abs(points[fine.n_edge_points :])), np.tile([0, 0, 1], (6, 1)))
    np.testing.assert_allclose(fine.matrix.sum(axis=1), 1.0)
    np.testing.assert_array_equal(fine.quads[:, 0], CUBE_QUADS.ravel(), "the quads follow the old corners")


def test_an_open_border_follows_its_own_curve() -> None:
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    grid = np.stack([x.ravel(), y.ravel(), (x**2).ravel()], axis=1)
    quads = np.array([[r * 4 + c, r * 4 + c + 1, r * 4 + c + 5, r * 4 + c + 4] for r in range(2) for c in range(3)])
    points = catmull_clark(quads.astype(np.int32), 12).matrix @ grid
    np.testing.assert_allclose(points[0], grid[0], err_msg="corners stay")
    np.testing.assert_allclose(points[1], (grid[0] + 6 * grid[1] + grid[2]) / 8)
    split = linear_split(quads.astype(np.int32), 12)
    np.testing.assert_allclose((split.matrix @ grid)[:12], grid)


def test_halves_are_evened_out() -> None:
    mirror = np.array([1, 0, 2], dtype=np.int32)
    vertices = np.array([[1.0, 2.0, 0.0], [-3.0, 2.0, 0.0], [0.5, 1.0, 1.0]])
    np.testing.assert_allclose(even(vertices, mirror), [[2, 2, 0], [-2, 2, 0], [0, 1, 1]])
    left = np.array([[0.0, 1.0, 0.0], [0, 0, 0], [0, 0, 0]])
    units = even_units({"aLeft": left, "aRight": np.zeros((3, 3))}, mirror)
    np.testing.assert_allclose(units[0][0], [0, 0.5, 0])
    np.testing.assert_allclose(units[1][1], [0, 0.5, 0])


def test_texels_get_what_lies_under_them() -> None:
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    corners = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    positions = np.concatenate([2.0 * uv, np.zeros((4, 1))], axis=1)[corners]
    texels = map_texels(uv, corners, positions, uv[corners], 8)
    assert texels.covered.all()
    image = texels.image(texels.values)
    np.testing.assert_allclose(image[0, 0], [0.5 / 8, 7.5 / 8], atol=1e-6)
    np.testing.assert_allclose(image[7, 7], [7.5 / 8, 0.5 / 8], atol=1e-6)
    np.testing.assert_allclose(texels.along[0], [[4, 0, 0], [0, -4, 0]], atol=1e-5)
    np.testing.assert_allclose(texels.pixels_per_area, 16, rtol=1e-5)


def test_smoothstep_runs_either_way() -> None:
    x = np.array([0.0, 1.0, 2.0], dtype=np.float32)
    np.testing.assert_allclose(smoothstep(0.0, 2.0, x), [0, 0.5, 1])
    np.testing.assert_allclose(smoothstep(2.0, 0.0, x), [1, 0.5, 0])


@pytest.fixture(scope="module")
def man() -> Subject:
    return load_subject("man")


def test_the_check_sees_every_kind_of_difference(man: Subject) -> None:
    assert differences(man, man) == []
    moved = man.vertices.copy()
    moved[100, 1] += 0.01
    assert differences(replace(man, vertices=moved), man) == ["vertices"]
    assert differences(replace(man, credits="mine"), man) == ["credits"]
    assert differences(replace(man, regions={**man.regions, "nose": man.regions["nose"][1:]}), man) == ["regions: nose"]
    other = {**man.textures, "tongue": man.textures["gums"]}
    assert differences(replace(man, textures=other), man) == ["textures: tongue"]


def test_the_outside_is_laid_out_without_folds() -> None:
    """A sphere that is open below, with a small chart of its own in front, as the mouth's inside has."""
    rows, columns = 13, 24
    theta = np.linspace(0.35, 2.5, rows)[:, None]
    phi = np.arange(columns)[None, :] * (2 * np.pi / columns)
    ring = np.stack(np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), -1)
    points = 10.0 * ring.reshape(-1, 3)
    points[np.abs(points[:, 0]) < 1e-9, 0] = 0.0
    quads = grid_quads(rows, columns, closed=True)[:, [0, 3, 2, 1]]
    # The crown is closed by a fan of quads around a vertex on top.
    top = len(points)
    points = np.concatenate([points, [[0.0, 10.5, 0.0]]])
    cap = [[top, c, c + 1, (c + 2) % columns] for c in range(0, columns, 2)]
    quads = np.concatenate([quads, cap]).astype(np.int32)
    layout = unwrap_skin(points, quads, Layout(points[:, :2], quads), np.ones(len(points)))
    corners = layout.uv[layout.quad_uvs]
    assert corners.min() >= 0
    assert corners.max() <= 1
    one, other = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    assert (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0] > 0).all()
