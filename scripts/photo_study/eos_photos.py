"""A rival: heads and expressions from one photo by eos (Huber et al., VISAPP 2016), with the modes of our model.

eos gets the same landmarks without those of the oval, an affine camera, and people and expressions as one linear model,
whose coefficients of expressions have the density of the pose solver.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.face_places import OVAL, FacePlaces
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.landmarks.points import N_POINTS
from scripts.identity_study.eos_fit import LinearEos

Array = NDArray[np.float64]

#: Standard deviation of landmarks in centimetres, the best of several on other people than those of the study.
SIGMA = 1.2


@dataclass(frozen=True, eq=False)
class EosHead:
    """A head by eos.

    Attributes:
        rows: Its coefficients of people, shape (K,).
        pose: Its expression, shape (r,).
    """

    rows: Array
    pose: Array


class EosPhotos:
    """Fits by eos to photos."""

    def __init__(self, basis: HeadBasis, places: FacePlaces) -> None:
        """Prepare the model of eos, of the vertices that have landmarks only."""
        points = places.points
        inner = np.setdiff1d(np.arange(N_POINTS), OVAL)
        corners = points.corners(basis.model.triangles)[inner]
        landmarks = basis.landmarks(places)
        # Each landmark is a vertex of its own: eos has none inside triangles.
        self._inner, self._vertices = inner, np.arange(len(inner))
        factor = np.linalg.cholesky(np.linalg.inv(basis.prior.precision))
        expressions = np.tensordot(factor.T, landmarks.expression[:, inner], 1)
        modes = np.concatenate([landmarks.identity[:, inner], expressions])
        self._factor, self._n_identity = factor, len(landmarks.identity)
        self._eos = LinearEos(landmarks.mean[inner], modes, np.arange(3 * (len(corners) // 3)).reshape(-1, 3))
        self._extent = np.linalg.norm(np.ptp(landmarks.mean[inner, :2], axis=0))

    def fit(self, crop: FaceCrop, sigma: float = SIGMA) -> EosHead:
        """Return the head in a photo."""
        seen = crop.face.landmarks.points[self._inner, :2]
        # In centimetres, about.
        seen = seen * (self._extent / np.linalg.norm(np.ptp(seen, axis=0)))
        found = self._eos.coefficients(self._vertices, seen, sigma)
        return EosHead(found[: self._n_identity], self._factor @ found[self._n_identity :])
