"""The approximate place of the face under a pixel, from samples of the skin around the feature points.

Picking tests all triangles, which takes tens of milliseconds for a stroke. Samples about a hundredth of the head's
height apart suffice where depth is uncertain by more than that.
"""

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.sketch.training_poses import TrainingPoses

Array = NDArray[np.float64]

# Number of samples, their greatest distance from a feature point, and the distance from a pixel within which a sample
# counts, both as shares of the head's height.
_SAMPLES, _NEAR, _RADIUS = 4000, 0.15, 0.035


class VisibleSurface:
    """Samples of the skin that move with the pose."""

    def __init__(self, model: FaceModel, training: TrainingPoses, seed: int = 0) -> None:
        """Sample the skin of ``model`` near the drawable feature points, with a seeded choice."""
        # Imported late to shorten the start of the window.
        from scipy.spatial import cKDTree

        vertices, triangles = model.character.vertices.astype(np.float64), model.triangles
        solid = model.character.solid_triangles
        corners = vertices[triangles[solid]]
        height = model.character.height
        knots = training.neutral[[training.index[name] for name in training.drawable]]
        centers = (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0
        apart = cKDTree(knots).query(centers)[0] if len(knots) else np.full(len(solid), np.inf)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.maximum(np.linalg.norm(cross, axis=1), 1e-12)
        chances = np.where(apart < _NEAR * height, areas, 0.0)
        self._rows, self._neutral = np.zeros((0, 3, model.n_coefficients)), np.zeros((0, 3))
        self._normals = np.zeros((0, 3))
        self._radius = _RADIUS * height
        if chances.sum() > 0.0:
            rng = np.random.default_rng(seed)
            chosen = rng.choice(len(solid), size=_SAMPLES, p=chances / chances.sum())
            barycentric = rng.dirichlet(np.ones(3), size=_SAMPLES)
            self._rows, self._neutral = model.rows_of(SurfacePoints(solid[chosen], barycentric))
            self._normals = cross[chosen] / areas[chosen, None]

    def under(self, camera: Camera, pixels: Array, pose: Array) -> Array:
        """Return the frontmost place of the face ``pose``, (r,), on the rays through ``pixels``, (n, 2), shape (n, 3).

        It is NaN where no part of the face that looks to the camera is near.
        """
        places = self._neutral + self._rows @ pose
        local = camera.to_camera(places)
        facing = ((places - camera.center) * self._normals).sum(axis=1) < 0.0
        seen = np.flatnonzero(facing & (local[:, 2] > 1e-6))
        offsets = (pixels - camera.principal_point) / camera.focal
        depth = local[seen, 2]
        # Distances at the depth of the sample.
        x = offsets[:, :1] * depth - local[seen, 0]
        y = offsets[:, 1:] * depth - local[seen, 1]
        front = np.where(x * x + y * y < self._radius**2, depth, np.inf).min(axis=1, initial=np.inf)
        front = np.where(np.isfinite(front), front, np.nan)
        found = np.column_stack([offsets, np.ones(len(offsets))]) * front[:, None]
        return np.asarray((found - camera.translation) @ camera.rotation)
