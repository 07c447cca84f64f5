"""Rows of the equations of a fit to a scan: distances between surfaces as linear functions of the unknowns.

There are two ways to measure them. `from_head` looks for the closest points of the scan to the head's control vertices,
which works from afar. `from_scan` looks for the closest points of the head to the scan's vertices. Those lie on the
skin, while the scan's triangles cut through it where it is curved; by a tenth of a millimetre if there are 10,000
vertices. Only what lies across the surface counts there: along it, the surfaces may slide.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.identity.scan_surface import ScanSurface
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.equations import pose_columns

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Share of tangential distances, κ: surfaces slide along each other.
_ALONG = 0.005
# Share of independent errors among those of vertices.
INDEPENDENT = 0.15
# Least cosine between the normals of model and scan.
_LEAST_COSINE = 0.7
# Least share of the trusted vertices that must find the scan.
_LEAST_USED = 0.05
# Deviations τ of the coefficients of segments from those of the whole head, in standard deviations.
_LOCAL = 0.4
# Standard deviation of a normal distribution in terms of the median of the magnitudes.
_NORMAL = 1.4826
# Most vertices of the scan, and the area in square centimetres from which one counts fully.
_MOST, _AREA = 12_000, 0.1


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The columns of the unknowns of the shape and of the expressions.

    Attributes:
        modes: Offsets of the chosen vertices per unknown of the shape, shape (P, n, 3).
        n_modes: Number of modes that are free.
        precision: Precision of the prior of these unknowns, shape (P,).
        expressions: Offsets of the chosen vertices per expression, shape (E, n, 3).
        segments: True if the segments have coefficients of their own.
    """

    modes: Array
    n_modes: int
    precision: Array
    expressions: Array
    segments: bool

    @classmethod
    def of(cls, basis: HeadBasis, n_modes: int, segments: bool, chosen: NDArray[np.int64]) -> "Unknowns":
        """Return the columns at the vertices ``chosen``, (n,), of the first ``n_modes`` modes."""
        modes = basis.modes[:n_modes, chosen]
        precision = np.ones(n_modes)
        if segments:
            local = [weights[chosen][:, None] * modes for weights in basis.segments]
            modes = np.concatenate([modes, *local])
            precision = np.concatenate([precision, np.full(len(modes) - n_modes, 1.0 / _LOCAL**2)])
        return cls(modes, n_modes, precision, basis.expressions[:, chosen], segments)

    def at(self, basis: HeadBasis, rows: NDArray[np.int64], shares: Array) -> tuple[Array, Array]:
        """Return the columns of surface points: of the shape, (P, m, 3), and of the expressions, (E, m, 3)."""
        modes = np.einsum("kmcd,mc->kmd", basis.modes[: self.n_modes][:, rows], shares)
        expressions = np.einsum("kmcd,mc->kmd", basis.expressions[:, rows], shares)
        if self.segments:
            weights = np.einsum("smc,mc->sm", basis.segments[:, rows], shares)
            modes = np.concatenate([modes, *(w[:, None] * modes for w in weights)])
        return modes, expressions

    def across(self, basis: HeadBasis, rows: NDArray[np.int64], shares: Array, normals: Array) -> Array:
        """Return the components along ``normals``, (m, 3), of the columns of surface points, shape (m, P + E)."""
        m, n = len(rows), len(basis.mean)
        picked = (shares[:, :, None] * normals[:, None]).reshape(-1)
        places = (3 * rows[:, :, None] + np.arange(3)).reshape(-1)
        matrix = sparse.csr_array((picked, places, 9 * np.arange(m + 1)), shape=(m, 3 * n))
        modes = matrix @ basis.modes[: self.n_modes].reshape(self.n_modes, -1).T
        if self.segments:
            weights = np.einsum("smc,mc->sm", basis.segments[:, rows], shares)
            modes = np.concatenate([modes, *(w[:, None] * modes for w in weights)], axis=1)
        return np.concatenate([modes, matrix @ basis.expressions.reshape(len(basis.expressions), -1).T], axis=1)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of the equations of one scan.

    Attributes:
        columns: Weighted rows, shape (r, P + E + 7).
        values: Weighted distances, shape (r,).
        used: Mask of the head's vertices with a say, shape (N,).
        spread: Standard deviation of the distances, as of their median, in centimetres.
    """

    columns: Array
    values: Array
    used: Mask
    spread: float


def from_head(
    basis: HeadBasis,
    head: Array,
    surface: ScanSurface,
    frame: Similarity,
    unknowns: Unknowns,
    chosen: NDArray[np.int64],
    sigma: float,
    farthest: float,
) -> Rows:
    """Return the rows of the closest points of a scan to the vertices ``chosen`` of ``head``, (N, 3).

    Args:
        basis: The model.
        head: The present head.
        surface: The scan.
        frame: The similarity from the scan to the head's frame.
        unknowns: The columns at these vertices.
        chosen: Vertices, shape (n,).
        sigma: Standard deviation of the distances in centimetres.
        farthest: Largest distance that counts.

    Raises:
        FacePoserError: If hardly anything of the scan is near.
    """
    closest = surface.closest(frame.inverse().apply(head[chosen]))
    places = frame.apply(closest.places)
    normals = closest.normals @ frame.rotation.T
    own_normals = basis.normals(head)[chosen]
    distances = closest.distances * float(frame.scale)
    facing = np.einsum("nd,nd->n", normals, own_normals) > _LEAST_COSINE
    kept = np.flatnonzero(facing & (distances < farthest) & ~closest.at_border)
    used = _used(basis, chosen[kept])
    apart = places[kept] - head[chosen[kept]]
    across = np.einsum("nd,nd->n", apart, normals[kept])
    spread = _spread(across)
    root = np.sqrt(INDEPENDENT * basis.trust[chosen[kept]] * _robust(across, sigma, spread)) / sigma
    jacobian = np.concatenate([unknowns.modes[:, kept], unknowns.expressions[:, kept], -pose_columns(places[kept])])
    rows = np.einsum("pnd,nd->np", jacobian, normals[kept]) * root[:, None]
    along = np.sqrt(_ALONG) * root
    flat = (jacobian * along[:, None]).reshape(len(jacobian), -1).T
    values = np.concatenate([across * root, (apart * along[:, None]).ravel()])
    return Rows(np.concatenate([rows, flat]), values, used, spread)


def from_scan(
    basis: HeadBasis,
    head: Array,
    surface: ScanSurface,
    frame: Similarity,
    unknowns: Unknowns,
    least_sigma: float,
    farthest: float,
) -> Rows:
    """Return the rows of the closest points of ``head``, (N, 3), to the vertices of a scan.

    The standard deviation of the distances is estimated from them, and is ``least_sigma`` at least. Other arguments are
    those of `from_head`.

    Raises:
        FacePoserError: If hardly anything of the scan is near.
    """
    mesh = surface.mesh
    corners = np.asarray(basis.triangles)
    proper = np.flatnonzero((basis.trust[corners] > 0.0).any(axis=1))
    inner, areas = _inner_vertices(surface)
    places = frame.apply(np.asarray(mesh.vertices)[inner])
    points, distances = NearestSurface(head, corners, proper).points(places)
    rows, shares = points.corners(corners), points.barycentric
    normals = np.einsum("mcd,mc->md", basis.normals(head).astype(np.float64)[rows], shares)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    facing = np.einsum("md,md->m", normals, surface.normals[inner] @ frame.rotation.T)
    trust = np.einsum("mc,mc->m", basis.trust[rows], shares)
    kept = np.flatnonzero((facing > _LEAST_COSINE) & (distances < farthest) & (trust > 0.0))
    used = _used(basis, rows[kept].ravel())
    rows, shares, normals, trust, places = rows[kept], shares[kept], normals[kept], trust[kept], places[kept]
    across = np.einsum("md,md->m", places - np.einsum("mcd,mc->md", head[rows], shares), normals)
    spread = _spread(across[trust >= np.median(trust)])
    sigma = max(spread, least_sigma) / np.sqrt(INDEPENDENT)
    area = np.minimum(1.0, areas[kept] * float(frame.scale) ** 2 / _AREA)
    root = np.sqrt(area * trust * _robust(across, least_sigma, spread)) / sigma
    columns = unknowns.across(basis, rows, shares, normals)
    columns = np.concatenate([columns, -np.einsum("pmd,md->mp", pose_columns(places), normals)], axis=1)
    return Rows(columns * root[:, None], across * root, used, spread)


def _inner_vertices(surface: ScanSurface) -> tuple[NDArray[np.int64], Array]:
    """Return vertices of a scan off its borders, at most `_MOST`, and the area that each stands for."""
    mesh: TriangleMesh = surface.mesh
    vertices, triangles = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.triangles)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    sizes = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
    areas = np.bincount(triangles.ravel(), np.repeat(sizes, 3), len(vertices))
    areas[triangles[surface.at_border].ravel()] = 0.0
    inner = np.flatnonzero(areas > 0.0).astype(np.int64)
    if len(inner) > _MOST:
        chosen = np.sort(np.random.default_rng(0).choice(inner, _MOST, replace=False))
        return chosen, np.asarray(areas[chosen] * (len(inner) / _MOST))
    return inner, np.asarray(areas[inner])


class UnmatchedError(FacePoserError):
    """Raised if too little of a scan lies where its landmarks are."""


def _used(basis: HeadBasis, vertices: NDArray[np.int64]) -> Mask:
    """Return the mask of ``vertices``, (N,); if they are too few, the scan lies elsewhere."""
    used = np.zeros(len(basis.mean), dtype=bool)
    used[vertices] = True
    control = slice(basis.n_control)
    if basis.trust[control][used[control]].sum() < _LEAST_USED * basis.trust[control].sum():
        raise UnmatchedError(
            "The scan does not match its landmarks: move them to their places, or scan more of the face."
        )
    return used


def _spread(across: Array) -> float:
    return _NORMAL * float(np.median(np.abs(across))) if len(across) else 0.0


def _robust(across: Array, sigma: float, spread: float) -> Array:
    """Return the weights of Geman and McClure of distances ``across``, shape (m,)."""
    weights: Array = 1.0 / (1.0 + (across / max(3.0 * sigma, 2.0 * spread)) ** 2) ** 2
    return weights
