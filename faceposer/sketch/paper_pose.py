"""The paper's way from matched feature points to a pose (Gunnarsson and Maddock 2010, sections 4.3 to 4.5).

Matched points of all strokes become places in space, by the conditional Gaussian of their view; a mixture of PPCA
completes them to all feature points; a statistical mapping gives the mesh.

Two departures, without which the errors of a hand are magnified: sigma of the mixture is at least the hand's error, and
of the completed pose W x + mu is mapped, the values without noise of the paper's own model (1), also at the drawn
points. The result is not limited to the natural range of the shapes, as in the paper.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.sketch.leave_out import Sizes, chosen_sizes, observed
from faceposer.sketch.mapping import MeshMapping
from faceposer.sketch.point_mixture import HAND_ERROR, PointMixture, Rays
from faceposer.sketch.ppca import PPCAMixture
from faceposer.sketch.training_poses import TrainingPoses

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PaperPose:
    """Completion and mapping of one character.

    Attributes:
        training: The training poses.
        places: Gaussians of the feature points, for depth.
        poses: Mixture of PPCA over all feature points, 3 F dimensions.
        mapping: Mapping to coefficients of the mesh.
        sizes: Sizes of the models.
    """

    training: TrainingPoses
    places: PointMixture
    poses: PPCAMixture
    mapping: MeshMapping
    sizes: Sizes

    @classmethod
    def fit(cls, training: TrainingPoses, height: float, sizes: Sizes | None = None, seed: int = 0) -> "PaperPose":
        """Fit to training poses.

        Args:
            training: The training poses.
            height: The head's height, in the character's unit.
            sizes: Sizes of the models; chosen by leaving poses out if None.
            seed: Seed of initial clusterings and of the choice of sizes.
        """
        error = HAND_ERROR * height
        sizes = sizes or chosen_sizes(training, error, seed)
        flat = training.points.reshape(len(training), -1)
        joint = (sizes.joint_dimensions, sizes.joint_dimensions)
        return cls(
            training,
            PointMixture.fit(training.points, training.names, error),
            PPCAMixture.fit(flat, sizes.components, sizes.dimensions, seed, error**2),
            MeshMapping.fit(training.points, training.coefficients, joint, sizes.joint_components, seed),
            sizes,
        )

    def places_of(self, matched: Iterable[tuple[Camera, str, tuple[float, float]]]) -> dict[str, Array]:
        """Return the place in space, shape (3,), of each matched feature point.

        A point of one view keeps its coordinates in the picture, and the conditional Gaussian gives its depth. A point
        of several views is where its Gaussian and all rays, with a hand's error, agree best.

        Args:
            matched: Cameras, names of feature points and pixels; names that the character lacks are left out.
        """
        pixels: dict[Camera, list[tuple[str, tuple[float, float]]]] = {}
        for camera, name, pixel in matched:
            if name in self.training.index:
                pixels.setdefault(camera, []).append((name, pixel))
        seen: dict[str, list[tuple[Array, Array, Array]]] = {}
        for camera, of_view in pixels.items():
            rays = Rays.through(camera, np.array([pixel for _, pixel in of_view], dtype=np.float64))
            ids = np.array([self.training.index[name] for name, _ in of_view], dtype=np.intp)
            placed = self.places.placed(rays, ids)
            for i, (name, _) in enumerate(of_view):
                seen.setdefault(name, []).append((placed[i], rays.axes[i, 2], rays.origin))
        return {name: self._agreed(name, views) for name, views in seen.items()}

    def _agreed(self, name: str, views: list[tuple[Array, Array, Array]]) -> Array:
        """Return the place of the point ``name`` from its place, direction and origin in each view, shape (3,)."""
        if len(views) == 1:
            return views[0][0]
        i, variance = self.training.index[name], self.places.hand_error**2
        precision = np.linalg.inv(self.places.covariances[i] + variance * np.eye(3))
        weighted = precision @ self.places.means[i]
        for _, along, origin in views:
            across = (np.eye(3) - np.outer(along, along)) / variance
            precision = precision + across
            weighted = weighted + across @ origin
        return np.asarray(np.linalg.solve(precision, weighted))

    def completed(self, places: dict[str, Array], keep: bool = False) -> Array:
        """Return the positions of all feature points, shape (F, 3), given the ``places`` of some.

        Args:
            places: Place of each known feature point, shape (3,).
            keep: True to keep these places, as in (6); False for their expected values too.
        """
        values = np.concatenate(list(places.values()))[None]
        pose = self.poses.completed(observed(self.training, tuple(places)), values, keep)
        return np.asarray(pose.reshape(-1, 3))

    def coefficients(self, places: dict[str, Array]) -> Array:
        """Return the coefficients, shape (r,), of the face given the ``places`` of one or more feature points."""
        return np.asarray(self.mapping.coefficients(self.completed(places)[None])[0])

    def face_of(self, points: Array) -> Array:
        """Return the coefficients, shape (r,), of the face with all feature ``points``, shape (F, 3)."""
        return np.asarray(self.mapping.coefficients(points[None])[0])
