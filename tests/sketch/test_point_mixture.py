"""Gaussians of feature points seen from any camera."""

import numpy as np
import pytest

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera, OrbitView
from faceposer.sketch.point_mixture import PointMixture, Rays

_MEANS = np.array([[0.0, 0.0, 10.0], [3.0, 1.0, 9.0]])


def _mixture(error: float = 0.05) -> PointMixture:
    rng = np.random.default_rng(0)
    factors = rng.normal(size=(2, 3, 3))
    return PointMixture(("a", "b"), np.array([0.5, 0.5]), _MEANS, factors @ factors.transpose(0, 2, 1), error)


def _camera(yaw: float = 0.6, pitch: float = 0.3) -> Camera:
    # So near that the perspective matters.
    return OrbitView((0.0, 0.0, 9.0), yaw, pitch, 25.0).camera((800, 600))


def test_rays_pass_through_their_pixels() -> None:
    camera, pixels = _camera(), np.array([[10.0, 20.0], [400.0, 300.0], [790.0, 400.0]])
    rays = Rays.through(camera, pixels)
    assert camera.project(rays.origin + 7.0 * rays.axes[:, 2]) == pytest.approx(pixels)
    assert rays.axes @ rays.axes.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (3, 1, 1)))


def test_depth_is_the_conditional_mean_on_the_ray() -> None:
    camera, mixture = _camera(), _mixture()
    pixel = camera.project(_MEANS[:1] + [[0.5, -0.4, 0.8]])
    rays = Rays.through(camera, pixel)
    placed = mixture.placed(rays, np.array([0]))[0]
    assert camera.project(placed[None]) == pytest.approx(pixel)
    # Monte Carlo: the mean of those draws that lie by the ray.
    covariance = mixture.covariances[0] + mixture.hand_error**2 * np.eye(3)
    draws = np.random.default_rng(1).multivariate_normal(_MEANS[0], covariance, 2_000_000)
    local = (draws - rays.origin) @ rays.axes[0].T
    near = local[np.hypot(local[:, 0], local[:, 1]) < 0.08, 2]
    depth = (placed - rays.origin) @ rays.axes[0, 2]
    assert len(near) > 1000
    assert depth == pytest.approx(near.mean(), abs=4.0 * near.std() / np.sqrt(len(near)))


def test_density_with_a_known_depth_is_that_of_the_place() -> None:
    camera, mixture = _camera(), _mixture()
    places = _MEANS + [[0.2, 0.1, -0.5], [-0.4, 0.3, 0.2]]
    joint = mixture.log_joint(Rays.through(camera, camera.project(places)), places, 0.0)
    for i in range(2):
        covariance = mixture.covariances[i] + mixture.hand_error**2 * np.eye(3)
        deviations = places - _MEANS[i]
        distance = np.einsum("nd,de,ne->n", deviations, np.linalg.inv(covariance), deviations)
        direct = np.log(0.5) - 0.5 * (distance + np.linalg.slogdet(2 * np.pi * covariance)[1])
        assert joint[:, i] == pytest.approx(direct)


def test_unknown_depth_is_integrated_out() -> None:
    camera, mixture = _camera(), _mixture()
    pixel = camera.project(_MEANS[:1] + [[0.5, -0.4, 0.8]])
    rays = Rays.through(camera, pixel)
    steps = np.arange(5.0, 45.0, 0.01)
    on_ray = rays.origin + steps[:, None] * rays.axes[0, 2]
    repeated = Rays(rays.origin, np.repeat(rays.axes, len(steps), axis=0))
    total = np.exp(mixture.log_joint(repeated, on_ray, 0.0)).sum(axis=0) * 0.01
    marginal = mixture.log_joint(rays, np.full((1, 3), np.nan), 1.0)[0]
    assert np.exp(marginal) == pytest.approx(total, rel=1e-3)


def test_a_turned_world_gives_the_same() -> None:
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    camera, mixture = _camera(), _mixture()
    turned = PointMixture(
        mixture.names, mixture.weights, _MEANS @ turn.T, turn @ mixture.covariances @ turn.T, mixture.hand_error
    )
    other = camera.following(Similarity(turn, np.zeros(3), np.array(1.0)))
    places = _MEANS + [[0.2, 0.1, -0.5], [-0.4, 0.3, 0.2]]
    pixels = camera.project(places)
    assert other.project(places @ turn.T) == pytest.approx(pixels)
    rays, turned_rays = Rays.through(camera, pixels), Rays.through(other, pixels)
    ids = np.array([0, 1])
    assert turned.placed(turned_rays, ids) == pytest.approx(mixture.placed(rays, ids) @ turn.T)
    assert turned.log_joint(turned_rays, places @ turn.T, 0.3) == pytest.approx(mixture.log_joint(rays, places, 0.3))


def test_gaussians_are_those_of_their_named_places() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]) + 0.5 * np.random.default_rng(0).normal(size=(200, 2, 3))
    fitted = PointMixture.fit(points, ("a", "b"), 0.1)
    assert fitted.means == pytest.approx(points.mean(axis=0))
    assert fitted.covariances[1] == pytest.approx(np.cov(points[:, 1].T, bias=True))
