"""The camera's projection, its derivative and its inverse agree with each other and with the orbit's conventions."""

import math

import numpy as np
import pytest

from faceposer.geometry.camera import VIEW_ANGLES, Camera, OrbitView


def random_view(rng: np.random.Generator) -> OrbitView:
    return OrbitView(tuple(rng.normal(0, 2, 3)), rng.uniform(-3, 3), rng.uniform(-1.4, 1.4), rng.uniform(40, 120))


def test_projection_is_the_documented_pinhole() -> None:
    camera = Camera(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 100.0]), 500.0, (640, 400))
    # 1 unit to the right of the axis and 2 up, 100 away.
    np.testing.assert_allclose(camera.project([[1.0, 2.0, 0.0]]), [[320 + 5.0, 200 - 10.0]])


def test_jacobian_agrees_with_finite_differences() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        camera = random_view(rng).camera((900, 700))
        points = rng.normal(0, 8, (5, 3))
        pixels, jacobian = camera.project_with_jacobian(points)
        np.testing.assert_allclose(pixels, camera.project(points), atol=1e-9)
        for axis in range(3):
            step = np.zeros(3)
            step[axis] = 1e-5
            numeric = (camera.project(points + step) - camera.project(points - step)) / 2e-5
            np.testing.assert_allclose(jacobian[:, :, axis], numeric, rtol=1e-5, atol=1e-5)


def test_ray_passes_through_the_point_it_was_made_from() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        camera = random_view(rng).camera((800, 600))
        point = rng.normal(0, 5, 3)
        origin, direction = camera.ray(camera.project([point])[0])
        along = origin + direction * ((point - origin) @ direction)
        np.testing.assert_allclose(along, point, atol=1e-8)


def test_views_show_the_side_they_are_named_after() -> None:
    left_cheek = [[6.0, 0.0, 0.0]]
    views = {name: OrbitView((0, 0, 0)).looking(name).camera((600, 600)) for name in VIEW_ANGLES}
    assert views["front"].project(left_cheek)[0, 0] > 300
    assert views["back"].project(left_cheek)[0, 0] < 300
    depth = {name: camera.to_camera(left_cheek)[0, 2] for name, camera in views.items()}
    assert depth["left"] < depth["three-quarter"] < depth["front"] < depth["right"]


def test_resized_keeps_the_vertical_framing() -> None:
    camera = OrbitView((0, 0, 0)).camera((800, 400))
    larger = camera.resized((500, 800))
    offset = camera.project([[0.0, 3.0, 0.0]])[0, 1] / 400
    assert larger.project([[0.0, 3.0, 0.0]])[0, 1] / 800 == pytest.approx(offset)


def test_orbit_turns_what_is_dragged_along_with_the_pointer() -> None:
    view, size = OrbitView((0, 0, 0)), (600, 600)
    nose = [[0.0, 0.0, 10.0]]
    assert view.orbited(30, 0, size).camera(size).project(nose)[0, 0] > 310
    assert view.orbited(0, 30, size).camera(size).project(nose)[0, 1] > 310
    assert view.orbited(0, 1e6, size).pitch <= math.radians(89.001)


def test_pan_moves_the_target_with_the_pointer() -> None:
    rng = np.random.default_rng(2)
    view, size = random_view(rng), (640, 480)
    moved = view.panned(25, -40, size).camera(size).project([view.target])
    np.testing.assert_allclose(moved, [[320 + 25, 240 - 40]], atol=1e-6)


def test_zoom_enlarges_within_limits() -> None:
    view = OrbitView((0, 0, 0), distance=100)
    assert view.zoomed(2).distance == 50
    assert view.zoomed(1e9).distance > 0


@pytest.mark.parametrize(
    ("rotation", "focal"), [(np.eye(3) * 2, 100.0), (np.diag([1.0, 1.0, -1.0]), 100.0), (np.eye(3), 0.0)]
)
def test_impossible_cameras_are_refused(rotation: np.ndarray, focal: float) -> None:
    with pytest.raises(ValueError, match=r"rotation|focal"):
        Camera(rotation, np.zeros(3), focal, (10, 10))


def test_a_view_is_found_again_from_its_camera() -> None:
    view = OrbitView((0.5, -1.0, 0.2), 0.7, -0.4, 80.0)
    camera = view.camera((900, 700))
    again = OrbitView.from_camera(camera, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(again.camera((900, 700)).project(np.eye(3)), camera.project(np.eye(3)), atol=1e-6)
    assert (again.yaw, again.pitch) == pytest.approx((0.7, -0.4))
    assert camera.transferred((10.0, 20.0), again.camera((900, 700))) == pytest.approx((10.0, 20.0))
    assert camera.transferred((10.0, 20.0), view.orbited(1, 0, (900, 700)).camera((900, 700))) is None
