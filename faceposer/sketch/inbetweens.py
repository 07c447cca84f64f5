"""In-betweens through splines of feature points (Gunnarsson and Maddock 2010, section 5).

The feature points of the keys are joined by a cardinal spline, and the statistical mapping from feature points to
meshes gives the face of each frame. As every frame has all feature points, there is nothing to complete.

Two departures. The mapping is blended over the components of its mixture, where the paper takes the likeliest, so that
the motion has no jumps. And a key is shown as it is: the mapping alone changes it, because it knows only what its
training poses have; the difference at the keys is interpolated by the caller and added.

With one component the mapping is affine and commutes with the spline: what the mapping represents of a pose follows
the spline, and the rest, which feature points do not determine or training poses do not have, the caller's curve.
"""

import threading
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.sketch.mapping import MeshMapping
from faceposer.sketch.training_poses import TrainingPoses

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

Array = NDArray[np.float64]

#: Ways to the poses between keys: curves of rig weights, or splines of feature points.
Inbetweens = Literal["poses", "feature points"]

#: Tension of the cardinal spline, from 0 (Catmull-Rom) to 1 (the motion rests at every key).
TENSION = 0.0
#: Dimensions q_P and q_V of the mapping, and components of its mixture (scripts/study_inbetweens.py --tune).
DIMENSIONS, COMPONENTS = 20, 1
# Frames that are mapped together, which limits memory.
_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class PointFaces:
    """Faces of one character by the positions of its feature points.

    Attributes:
        training: Poses that the mapping is learned from, with the derivatives of the feature points.
        mapping: Mapping to coefficients, or None if the character has no feature point that moves.
    """

    training: TrainingPoses
    mapping: MeshMapping | None

    @classmethod
    def fit(
        cls, training: TrainingPoses, dimensions: int = DIMENSIONS, components: int = COMPONENTS, seed: int = 0
    ) -> "PointFaces":
        """Fit the mapping to ``training`` poses; fewer dimensions are used where the poses have fewer.

        Args:
            training: Training poses.
            dimensions: q_P and q_V.
            components: Components of the joint mixture.
            seed: Seed of its initial clustering.
        """
        moves = training.points.size > 0 and float(np.ptp(training.points, axis=0).max(initial=0.0)) > 0.0
        if len(training) < 2 or not moves:
            return cls(training, None)
        sizes = (dimensions, dimensions)
        return cls(training, MeshMapping.fit(training.points, training.coefficients, sizes, components, seed))

    def points_of(self, poses: Array) -> Array:
        """Return the positions of all feature points, shape (n, F, 3), in ``poses``, shape (n, r)."""
        neutral, rows = self.training.neutral, self.training.rows
        offsets = poses @ rows.reshape(-1, rows.shape[2]).T
        return np.asarray(neutral + offsets.reshape(len(poses), *neutral.shape))

    def poses_of(self, points: Array) -> Array:
        """Return the poses, shape (n, r), of the faces with feature ``points``, shape (n, F, 3)."""
        if self.mapping is None:
            return np.zeros((len(points), self.training.coefficients.shape[1]))
        return self.mapping.coefficients(points, blended=True)


@dataclass(frozen=True, eq=False)
class PointSpline:
    """A cardinal spline through the feature points of keys, and the faces along it.

    Attributes:
        faces: Faces by their feature points.
        knots: Increasing times of the keys, shape (n,), n ≥ 2.
        poses: Poses of the keys, shape (n, r).
        tension: From 0, a Catmull-Rom spline, to 1, a motion that rests at every key.
    """

    faces: PointFaces
    knots: Array
    poses: Array
    tension: float = TENSION

    @cached_property
    def _curve(self) -> "CubicHermiteSpline":
        # Imported late: it takes a good part of a second to load.
        from scipy.interpolate import CubicHermiteSpline

        points = self.faces.points_of(self.poses)
        velocities = np.zeros_like(points)
        spans = self.knots[2:] - self.knots[:-2]
        # The motion rests at the first and the last knot; a loop has knots beyond the frames that it shows.
        velocities[1:-1] = (1.0 - self.tension) * (points[2:] - points[:-2]) / spans[:, None, None]
        return CubicHermiteSpline(self.knots, points, velocities, axis=0)

    @cached_property
    def residuals(self) -> Array:
        """Poses of the keys minus those by their feature points, shape (n, r)."""
        return self.poses - self.faces.poses_of(self.faces.points_of(self.poses))

    def poses_at(self, times: Array) -> Array:
        """Return the poses by the feature points at ``times``, shape (m,) to (m, r), without ``residuals``."""
        result = np.empty((len(times), self.poses.shape[1]))
        for begin in range(0, len(times), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            result[part] = self.faces.poses_of(self._curve(times[part]))
        return result


_faces: "WeakKeyDictionary[FaceModel, PointFaces]" = WeakKeyDictionary()
_lock = threading.Lock()


def point_faces(model: FaceModel) -> PointFaces:
    """Return the faces of ``model`` by their feature points, fitted when first needed.

    Training poses are the neutral face, shapes and draws from the prior, but no pose library, so that an animation
    depends on its character alone.
    """
    with _lock:
        found = _faces.get(model)
        if found is None:
            found = _faces[model] = PointFaces.fit(TrainingPoses.of(model))
        return found
