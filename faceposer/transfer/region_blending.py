"""Blending of poses that were found separately for regions of a face."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel

Array = NDArray[np.float64]

# Share of a region: distance to its nearest feature point to the power of minus this, so that regions meet smoothly.
_STEEPNESS = 4
# Distances below this share of the height count as zero.
_NEAR = 1e-3


def region_shares(model: FaceModel, points: Mapping[str, Sequence[str]]) -> Array:
    """Return the share of each region in each vertex of the neutral face, shape (K, N); they sum to 1.

    Args:
        model: The face.
        points: Feature points of the K regions.

    Raises:
        FacePoserError: If the face lacks all points of a region.
    """
    from scipy.spatial import cKDTree

    character = model.character
    vertices = character.vertices.astype(np.float64)
    closeness = []
    for region, names in points.items():
        ids = [character.feature_points[name] for name in names if name in character.feature_points]
        if not ids:
            raise FacePoserError(
                f"The character {character.label} has no feature points of the {region}, so that its regions cannot "
                "be cloned separately; clone the face as a whole."
            )
        distances, _ = cKDTree(vertices[ids]).query(vertices)
        closeness.append(np.maximum(distances / character.height, _NEAR) ** -_STEEPNESS)
    shares = np.array(closeness)
    return shares / shares.sum(axis=0)


def region_projections(model: FaceModel, shares: Array) -> Array:
    """Return the matrices P_k, (K, r, r), that confine a pose to a region, in the least squares of its vertices.

    The coefficients P_k p are those whose displacements are nearest to those of p times the shares of region k. The
    matrices sum to the identity, so that equal poses of all regions blend to this pose.

    Args:
        model: The face.
        shares: Share of each region in each vertex, shape (K, N), with sum 1.
    """
    basis = model.basis
    inverse = np.linalg.pinv((basis @ basis.T).astype(np.float64), rcond=1e-10, hermitian=True)
    parts = [inverse @ ((basis * np.repeat(share, 3).astype(np.float32)) @ basis.T) for share in shares[1:]]
    return np.array([np.eye(model.n_coefficients) - sum(parts), *parts])
