"""A mixture with one Gaussian per drawable feature point, over places in space, seen from any camera.

Gunnarsson and Maddock (2010, section 4.3): the positions of a feature point in all training poses form a cluster with a
Gaussian, and responsibilities (4) tell which feature point a place belongs to. A drawn point is a ray. Its depth is
that of the surface below it, uncertain by ``DEPTH_ERROR``, when it is classified; afterwards it is replaced by that of
the cluster's conditional Gaussian on the ray. The paper takes two axes of the front view for this; here every ray has
its own frame, so that it holds for every view and for a perspective camera.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

#: Standard deviation of a hand's error, as a share of the head's height: about 6 pixels where the head fills a window.
HAND_ERROR = 0.01
#: Standard deviation of the depth of the surface of another pose below a drawn point, as a share of the head's height.
DEPTH_ERROR = 0.04


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays through pixels of a camera.

    Attributes:
        origin: The camera's position, shape (3,).
        axes: Two unit vectors across each ray and its direction, shape (n, 3, 3).
    """

    origin: Array
    axes: Array

    @classmethod
    def through(cls, camera: Camera, pixels: Array) -> "Rays":
        """Return the rays through ``pixels``, shape (n, 2)."""
        offsets = (pixels - camera.principal_point) / camera.focal
        local = np.column_stack([offsets, np.ones(len(offsets))])
        forward = local / np.linalg.norm(local, axis=1, keepdims=True)
        # The camera's x axis made orthogonal to each ray, and a third axis across both.
        right = np.array([1.0, 0.0, 0.0]) - forward[:, :1] * forward
        right /= np.linalg.norm(right, axis=1, keepdims=True)
        axes = np.stack([right, np.cross(forward, right), forward], axis=1)
        return cls(camera.center, axes @ camera.rotation)


@dataclass(frozen=True, eq=False)
class PointMixture:
    """The density sum over i of weight_i N(t; mean_i, C_i) with one component per feature point (equation (2)).

    Attributes:
        names: Names of the feature points, F in number.
        weights: Mixing coefficients, shape (F,).
        means: Shape (F, 3).
        covariances: Shape (F, 3, 3), without the hand's error.
        hand_error: Standard deviation of a hand's error, in the character's unit; its square is added to all variances.
    """

    names: tuple[str, ...]
    weights: Array
    means: Array
    covariances: Array
    hand_error: float

    @classmethod
    def fit(cls, points: Array, names: tuple[str, ...], hand_error: float) -> "PointMixture":
        """Return the maximum likelihood Gaussians of the named places of feature points in training poses.

        The paper refines them by EM over places without their names, which lets clusters that overlap, such as those of
        lips that touch, exchange places, so that they lose their meaning.

        Args:
            points: Shape (n, F, 3).
            names: Names of the feature points.
            hand_error: Standard deviation of a hand's error, more than 0.
        """
        n, count = points.shape[:2]
        means = points.mean(axis=0)
        deviations = points - means
        covariances = np.einsum("nfi,nfj->fij", deviations, deviations) / n
        return cls(names, np.full(count, 1.0 / max(count, 1)), means, covariances, hand_error)

    def log_parts(self, rays: Rays, surface: Array, depth_error: float) -> tuple[Array, Array]:
        """Return ln p(x | i) of drawn points across their rays and ln p(d | x, i) of their depth, each of shape (n, F).

        Args:
            rays: Rays of the drawn points.
            surface: Places of the surface on the rays, shape (n, 3). Where it is NaN, depth does not count: its part is
                0.
            depth_error: Standard deviation of its depth, in the character's unit.
        """
        on_ray: NDArray[np.bool_] = np.isfinite(surface[:, 2])
        deviations = np.where(on_ray[:, None], surface, rays.origin)[:, None] - self.means
        axes = rays.axes[:, None]
        rotated = axes @ (self.covariances + self.hand_error**2 * np.eye(3)) @ axes.transpose(0, 1, 3, 2)
        local = deviations @ rays.axes.transpose(0, 2, 1)
        plane = _log_gaussian_of(local[..., :2], rotated[..., :2, :2])
        # Depth given the position across the ray.
        pull = np.linalg.solve(rotated[..., :2, :2], rotated[..., :2, 2:])[..., 0]
        depth = local[..., 2] - (pull * local[..., :2]).sum(axis=-1)
        variance = rotated[..., 2, 2] - (pull * rotated[..., :2, 2]).sum(axis=-1) + depth_error**2
        deep = -0.5 * (depth**2 / variance + np.log(2.0 * np.pi * variance))
        return plane, np.where(on_ray[:, None], deep, 0.0)

    def log_joint(self, rays: Rays, surface: Array, depth_error: float) -> Array:
        """Return ln(weight_i p(t | i)) of drawn points, shape (n, F); see ``log_parts``."""
        across, along = self.log_parts(rays, surface, depth_error)
        return np.asarray(np.log(self.weights) + across + along)

    def placed(self, rays: Rays, components: Ids) -> Array:
        """Return the place on each ray that its component's conditional Gaussian gives, shape (n, 3).

        Coordinates across the ray are kept; depth is mu_d + C_dx C_xx^-1 (x - mu_x), with x across and d along.

        Args:
            rays: n rays.
            components: Index of the component of each ray, shape (n,).
        """
        axes = rays.axes
        covariances = self.covariances[components] + self.hand_error**2 * np.eye(3)
        rotated = axes @ covariances @ axes.transpose(0, 2, 1)
        local = np.einsum("nij,nj->ni", axes, rays.origin - self.means[components])
        pull = np.linalg.solve(rotated[:, :2, :2], rotated[:, :2, 2:])[..., 0]
        depth = (pull * local[:, :2]).sum(axis=1) - local[:, 2]
        return np.asarray(rays.origin + depth[:, None] * axes[:, 2])


def _log_gaussian_of(deviations: Array, covariances: Array) -> Array:
    """Return ln N of ``deviations``, shape (..., 2), with ``covariances``, shape (..., 2, 2), shape (...)."""
    a, b, c = covariances[..., 0, 0], covariances[..., 0, 1], covariances[..., 1, 1]
    determinant = a * c - b * b
    x, y = deviations[..., 0], deviations[..., 1]
    distance = (c * x * x - 2.0 * b * x * y + a * y * y) / determinant
    return np.asarray(-0.5 * (distance + np.log(determinant)) - np.log(2.0 * np.pi))
