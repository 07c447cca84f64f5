"""Exact principal component analysis of the meshes of a rig, computed in the rig's weights.

Every example of a rig is x = neutral + D w with a few dozen weights w, so the covariance of the example meshes is
D cov(w) D^T and its eigenvectors lie in the span of D. In the metric M of the mesh only the small Gram matrix
G = D^T M D enters, and the PCA of thousands of meshes costs an eigendecomposition of a matrix as wide as w
(Lau et al. 2009, section 3.1 and eq. (1), in the rig's coordinates).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RigSubspace:
    """The principal subspace of a rig's meshes.

    Attributes:
        directions: Rig weights of each component, C of shape (S, r), with C^T G C = I.
        projection: C^T G of shape (r, S): coordinates p = projection @ w of rig weights w.
        variances: Variance of the examples along each component, descending, shape (r,).
    """

    directions: Array
    projection: Array
    variances: Array

    def truncated(self, n_components: int) -> "RigSubspace":
        """Return the subspace of the first ``n_components`` components."""
        return RigSubspace(
            self.directions[:, :n_components], self.projection[:n_components], self.variances[:n_components]
        )


def rig_pca(gram: Array, covariance: Array, tolerance: float = 1e-9) -> RigSubspace:
    """Return all principal components of a rig's meshes, orthonormal in the metric of the Gram matrix.

    Directions without any motion (empty or repeated shapes) are left out.

    Args:
        gram: G = D^T M D of the rig's shapes, shape (S, S).
        covariance: Covariance of the rig's weights over the examples, shape (S, S).
        tolerance: Eigenvalues of G below this share of the largest count as zero.
    """
    squared_lengths, axes = np.linalg.eigh(gram)
    moving = squared_lengths > tolerance * squared_lengths[-1]
    lengths, axes = np.sqrt(squared_lengths[moving]), axes[:, moving]
    half = lengths[:, None] * axes.T
    variances, components = np.linalg.eigh(half @ covariance @ half.T)
    variances, components = np.maximum(variances[::-1], 0.0), components[:, ::-1]
    directions = (axes / lengths) @ components
    # The sign of an eigenvector is arbitrary: make the largest entry positive for reproducible results.
    largest = np.argmax(np.abs(directions), axis=0)
    directions = directions * np.where(directions[largest, range(directions.shape[1])] < 0, -1.0, 1.0)
    return RigSubspace(directions, directions.T @ gram, variances)


def reconstruction_error(directions: Array, gram: Array) -> Array:
    """Return the relative reconstruction error of each shape in a subspace, shape (S,); 0 for empty shapes.

    Args:
        directions: Rig weights of each component of the subspace, shape (S, r).
        gram: Gram matrix of the shapes in the metric of the error, shape (S, S).
    """
    inner = directions.T @ gram
    fitted = np.einsum("rs,rs->s", inner, np.linalg.solve(directions.T @ gram @ directions, inner))
    total = np.diag(gram)
    share = np.maximum(total - fitted, 0.0) / np.where(total > 0, total, 1.0)
    return np.sqrt(np.where(total > 1e-12 * total.max(), share, 0.0))


def smallest_reaching(
    subspace: RigSubspace, gram: Array, shapes: NDArray[np.intp], leave_at_most: float
) -> RigSubspace:
    """Return the smallest leading subspace that loses at most ``leave_at_most`` of each shape's displacement.

    A threshold on the explained variance would drop a raised brow long before the last tenth of a percent of the jaw.

    Args:
        subspace: All principal components.
        gram: Gram matrix in the metric of displacements, shape (S, S).
        shapes: Indices of the shapes to which the limit applies.
        leave_at_most: Share of a shape's displacement that may be lost, 0 to 1.
    """
    for n_components in range(1, len(subspace.variances)):
        candidate = subspace.truncated(n_components)
        if reconstruction_error(candidate.directions, gram)[shapes].max() <= leave_at_most:
            return candidate
    return subspace
