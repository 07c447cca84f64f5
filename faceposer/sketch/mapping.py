"""The statistical mapping from the feature points of a pose to its mesh (Gunnarsson and Maddock 2010, section 4.5).

Poses of feature points, P, and of the mesh, V, each have their latent variables by dual PPCA (Lawrence 2005): the
eigenvectors come from the matrix of inner products of the n samples, since there are more dimensions than samples. A
mixture of Gaussians over the joint latent variables maps those of P to those of V by completion (6), and (9) turns
these into a mesh. Meshes of the subspace are neutral + B p with rows of B that are orthonormal in its metric, so that
PPCA of the coefficients p is that of the meshes.

Slips of the paper: M = sigma^2 I + W^T W is printed as its inverse in (8). (9) writes the reconstruction
W (W^T W)^-1 M x + mu correctly for that M: it inverts (8) and gives the orthogonal projection of t on the subspace.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.ppca import PPCAMixture

Array = NDArray[np.float64]

# Directions in which the standard deviation is less than this share of the largest are left out.
_RANK = 1e-5


@dataclass(frozen=True, eq=False)
class DualPPCA:
    """A single PPCA by the eigenvectors of the samples' inner products.

    Attributes:
        mean: mu, shape (d,).
        factors: W with orthogonal columns, shape (d, q).
        variance: sigma^2.
    """

    mean: Array
    factors: Array
    variance: float

    @classmethod
    def fit(cls, data: Array, dimensions: int) -> "DualPPCA":
        """Fit to samples ``data``, shape (n, d), with q = ``dimensions``, or the rank of the samples if it is less."""
        n, d = data.shape
        mean = data.mean(axis=0)
        deviations = data - mean
        spreads, axes = np.linalg.eigh(deviations @ deviations.T / n)
        spreads, axes = spreads[::-1].clip(0.0), axes[:, ::-1]
        q = min(dimensions, int((spreads > _RANK**2 * max(float(spreads[0]), 1e-300)).sum()))
        variance = float(spreads[q:].sum()) / (d - q) if d > q else 0.0
        used = spreads[:q]
        directions = deviations.T @ axes[:, :q] / np.sqrt(n * used)
        return cls(mean, directions * np.sqrt((used - variance).clip(1e-12 * used)), variance)

    @property
    def n_dimensions(self) -> int:
        """The number q of latent variables."""
        return self.factors.shape[1]

    def latents(self, data: Array) -> Array:
        """Return x = M^-1 W^T (t - mu) of samples ``data``, shape (n, d), shape (n, q) (equation (8))."""
        inner = self.factors.T @ self.factors + self.variance * np.eye(self.n_dimensions)
        return np.asarray(np.linalg.solve(inner, self.factors.T @ (data - self.mean).T).T)

    def reconstructed(self, latents: Array) -> Array:
        """Return W (W^T W)^-1 M x + mu of ``latents``, shape (n, q), shape (n, d) (equation (9))."""
        squared = self.factors.T @ self.factors
        inner = squared + self.variance * np.eye(self.n_dimensions)
        return np.asarray(np.linalg.solve(squared, inner @ latents.T).T @ self.factors.T + self.mean)


@dataclass(frozen=True, eq=False)
class MeshMapping:
    """The mapping from feature points to coefficients of the mesh.

    Attributes:
        points: PPCA of the feature points, of d_P = 3 F dimensions.
        meshes: PPCA of the coefficients, of r dimensions.
        joint: Mixture over the joint latent variables, of q_P + q_V dimensions.
    """

    points: DualPPCA
    meshes: DualPPCA
    joint: PPCAMixture

    @classmethod
    def fit(
        cls, points: Array, coefficients: Array, dimensions: tuple[int, int], components: int = 1, seed: int = 0
    ) -> "MeshMapping":
        """Fit the mapping to training poses.

        Args:
            points: Positions of feature points in each pose, shape (n, F, 3).
            coefficients: Coefficients of each pose, shape (n, r).
            dimensions: q_P and q_V.
            components: Components of the joint mixture.
            seed: Seed of its initial clustering.
        """
        flat = points.reshape(len(points), -1)
        of_points, of_meshes = DualPPCA.fit(flat, dimensions[0]), DualPPCA.fit(coefficients, dimensions[1])
        latents = np.concatenate([of_points.latents(flat), of_meshes.latents(coefficients)], axis=1)
        rank = min(len(points) - 1, latents.shape[1] - 1)
        return cls(of_points, of_meshes, PPCAMixture.fit(latents, components, rank, seed))

    def coefficients(self, points: Array, blended: bool = False) -> Array:
        """Return the coefficients, shape (n, r), of complete poses of feature points, shape (n, F, 3).

        Args:
            points: Positions of all feature points in each pose.
            blended: True for the expectation over all components of the mixture, which is continuous in ``points``;
                False for the likeliest component, as in the paper.
        """
        given = self.points.latents(points.reshape(len(points), -1))
        q = self.points.n_dimensions
        seen = np.arange(q)
        if blended:
            return self.meshes.reconstructed(self.joint.expected(seen, given))
        return self.meshes.reconstructed(self.joint.completed(seen, given)[:, q:])
