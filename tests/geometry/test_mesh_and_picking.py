"""Normals and picking against shapes whose answers are known."""

import numpy as np
import pytest

from faceposer.geometry.camera import OrbitView
from faceposer.geometry.mesh import TriangleMesh, VertexNormals
from faceposer.geometry.picking import SurfacePoint, barycentric_on_triangle, pick, surface_positions


def sphere(n: int = 24, radius: float = 5.0) -> TriangleMesh:
    """A latitude-longitude sphere with outward, counter-clockwise triangles."""
    theta = np.linspace(0, np.pi, n)[:, None]
    phi = np.linspace(0, 2 * np.pi, 2 * n, endpoint=False)[None, :]
    grid = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi, np.sin(theta) * np.cos(phi)], axis=-1)
    index = np.arange(n * 2 * n).reshape(n, 2 * n)
    a, b = index[:-1], np.roll(index, -1, axis=1)[:-1]
    c, d = np.roll(index, -1, axis=1)[1:], index[1:]
    triangles = np.concatenate([np.stack([a, d, c], -1).reshape(-1, 3), np.stack([a, c, b], -1).reshape(-1, 3)])
    return TriangleMesh(radius * grid.reshape(-1, 3), triangles)


def test_sphere_normals_point_outwards() -> None:
    mesh = sphere(60)
    normals = VertexNormals(mesh.triangles, len(mesh.vertices))(mesh.vertices)
    inner = np.abs(mesh.vertices[:, 1]) < 4.9
    np.testing.assert_allclose(normals[inner], mesh.vertices[inner] / 5.0, atol=0.03)


def test_normals_are_area_weighted() -> None:
    # Two triangles share vertex 0: a large one facing +z and a small one facing +x.
    vertices = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 1, 0], [0, 0, 1.0]])
    normals = VertexNormals(np.array([[0, 1, 2], [0, 3, 4]]), 5)(vertices)
    np.testing.assert_allclose(normals[0], np.array([1, 0, 16]) / np.hypot(1, 16), atol=1e-6)


def test_lonely_vertices_have_no_normal() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9.0]])
    normals = VertexNormals(np.array([[0, 1, 2]]), 4)(vertices)
    np.testing.assert_array_equal(normals[3], 0)


def test_picked_point_projects_back_onto_the_pixel() -> None:
    mesh = sphere()
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(60):
        camera = OrbitView((0, 0, 0), rng.uniform(-3, 3), rng.uniform(-1.2, 1.2), 40).camera((400, 300))
        pixel = rng.uniform((100, 50), (300, 250))
        point = pick(mesh.vertices, mesh.triangles, camera, pixel)
        if point is None:
            continue
        found += 1
        position = surface_positions(mesh.vertices, mesh.triangles, [point])
        np.testing.assert_allclose(camera.project(position)[0], pixel, atol=1e-6)
        assert np.linalg.norm(position[0] - camera.center) < 40, "the near side is picked, not the far one"
        again = barycentric_on_triangle(mesh.vertices, mesh.triangles, point.face, camera, pixel)
        np.testing.assert_allclose(again.barycentric, point.barycentric, atol=1e-9)
    assert found > 20


def test_nothing_is_picked_beside_the_mesh() -> None:
    mesh = sphere()
    assert pick(mesh.vertices, mesh.triangles, OrbitView((0, 0, 0)).camera((400, 300)), (1, 1)) is None


def test_back_faces_are_not_picked() -> None:
    mesh = sphere()
    inside_out = mesh.triangles[:, ::-1]
    camera = OrbitView((0, 0, 0), distance=40).camera((400, 300))
    point = pick(mesh.vertices, inside_out, camera, (200, 150))
    assert point is not None
    assert np.linalg.norm(surface_positions(mesh.vertices, inside_out, [point])[0] - camera.center) > 40


def test_a_pixel_beside_the_triangle_gives_its_edge() -> None:
    vertices, triangles = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]])
    point = barycentric_on_triangle(vertices, triangles, 0, OrbitView((0, 0, 0)).camera((400, 300)), (0, 0))
    assert min(point.barycentric) == 0
    assert sum(point.barycentric) == pytest.approx(1)


def test_surface_point_at_vertex() -> None:
    mesh = sphere()
    point = SurfacePoint.at_vertex(mesh.triangles, 77)
    np.testing.assert_allclose(surface_positions(mesh.vertices, mesh.triangles, [point])[0], mesh.vertices[77])
    with pytest.raises(ValueError, match="belongs to no triangle"):
        SurfacePoint.at_vertex(mesh.triangles, 10**6)


def test_meshes_must_be_consistent() -> None:
    with pytest.raises(ValueError, match="do not exist"):
        TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 3]]))
