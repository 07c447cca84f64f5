"""Correspondence of a template with any surface, by landmarks and then by closest points.

1. A similarity brings the target's landmarks, and with them the target, into the template's frame.
2. The space around the template is bent so that its landmarks lie on the target's
   (`faceposer.geometry.space_bending`).
3. Coarse to fine, the vertices are drawn to the closest points of the target. With the positions X of the template,
   their closest points C, 0-1 weights W and the landmarks' rows S and places T, each round adds the displacement D that
   minimises

       Σ w_i ‖x_i + d_i - c_i‖² + μ ‖S (X + D) - T‖² + λ ‖L D‖²,

   with the graph Laplacian L, whose rows are a vertex less the mean of its neighbours. λ falls from round to round, and
   μ with it. This is the displacement form of non-rigid ICP (Amberg, Romdhani and Vetter, "Optimal step nonrigid ICP
   algorithms for surface registration", CVPR 2007, has an affine map per vertex, twelve unknowns for our three, and did
   not end in a minute on 17,000 vertices).

A vertex has no say (w = 0) whose closest point is too far away, on a surface that faces another way, or on a border of
the target, behind which there may be more that the scanner did not see. It follows its neighbours.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity, determines_rotation, rigid_alignment
from faceposer.geometry.mesh import Ints, TriangleMesh, VertexNormals
from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.space_bending import bend
from faceposer.identity.scan_surface import ScanSurface, counted_edges
from faceposer.progress import Progress

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Residual of landmarks after the similarity, in medians of all, from which they lose weight; and rounds of it.
_OUTLYING, _ROBUST_ROUNDS = 2.5, 5
# Keeps vertices that nothing else holds where they are.
_HELD = 1e-7
# Least share of the vertices that must find the target.
_LEAST_USED = 0.02


@dataclass(frozen=True)
class RegistrationSettings:
    """Settings of `register`; lengths are in the template's unit, centimetres.

    Attributes:
        stiffness: λ of each stage.
        rounds: Rounds in each stage.
        landmark_weight: μ of the first stage; it falls in proportion to λ.
        farthest: Distances of closest points that still count in the first and in the last stage.
        least_cosine: Least cosine between the normals of a vertex and of its closest point.
        ridge: How little landmarks are trusted by the first bend: 0 is met exactly.
    """

    stiffness: tuple[float, ...] = (1000.0, 300.0, 100.0, 30.0, 10.0, 3.0, 1.0)
    rounds: int = 2
    landmark_weight: float = 30.0
    farthest: tuple[float, float] = (2.0, 0.7)
    least_cosine: float = 0.5
    ridge: float = 0.2


@dataclass(frozen=True, eq=False)
class LandmarkPairs:
    """Points of the template and the same points of the target.

    Attributes:
        on_template: Points on the template's surface.
        on_target: Their places, in the target's unit and axes, shape (m, 3).
        weights: Nonnegative trust in each, shape (m,), 1 for a usual one.
    """

    on_template: SurfacePoints
    on_target: Array
    weights: Array

    def __post_init__(self) -> None:
        m = len(self.on_template)
        if self.on_target.shape != (m, 3) or self.weights.shape != (m,):
            raise ValueError(f"{m} points, but {self.on_target.shape} places and {self.weights.shape} weights")


@dataclass(frozen=True, eq=False)
class Registration:
    """A template laid on a target.

    Attributes:
        vertices: The template's vertices on the target, in the template's frame and unit, shape (N, 3).
        frame: The similarity from the target's frame to the template's.
        points: The closest points of the target's triangles.
        distances: Distances of the vertices from them, shape (N,).
        used: Mask of the vertices whose closest point had a say in the last round, shape (N,).
    """

    vertices: Array
    frame: Similarity
    points: SurfacePoints
    distances: Array
    used: Mask

    def in_target(self) -> Array:
        """Return the vertices in the target's unit and axes, shape (N, 3)."""
        return self.frame.inverse().apply(self.vertices)


def align(source: Array, target: Array, weights: Array | None = None) -> Similarity:
    """Return the similarity from ``source`` to ``target``, (m, 3) each, that most of the points agree on.

    Iterated least squares: beyond some medians of the residuals, the weight of a point falls with their square.

    Raises:
        FacePoserError: If the points do not determine it.
    """
    given = np.ones(len(source)) if weights is None else np.asarray(weights, dtype=np.float64)
    current, found = given, None
    for _ in range(_ROBUST_ROUNDS):
        if not (determines_rotation(source, current) and determines_rotation(target, current)):
            break
        found = rigid_alignment(source, target, current, scale=True)
        misses = np.linalg.norm(found.apply(source) - target, axis=1)
        usual = _OUTLYING * max(float(np.median(misses[given > 0.0])), 1e-12)
        current = given / np.maximum(1.0, misses / usual) ** 2
    if found is None:
        raise FacePoserError("The landmarks do not determine a place: give at least three that are not on a line.")
    return found


def register(
    template: TriangleMesh,
    target: TriangleMesh,
    landmarks: LandmarkPairs,
    settings: RegistrationSettings | None = None,
    progress: Progress | None = None,
    searching: Mask | None = None,
    frame: Similarity | None = None,
    bent: bool = True,
) -> Registration:
    """Lay ``template`` on ``target``.

    Args:
        template: The mesh that is moved, in centimetres.
        target: Any surface, in any unit and axes; its vertices need not be shared between triangles.
        landmarks: Corresponding points.
        settings: Settings; those of `RegistrationSettings` if None.
        progress: Progress to update.
        searching: Mask of the template's vertices that look for a closest point, shape (N,); all if None. The others
            follow, as the inside of the mouth, which scans do not have.
        frame: The similarity from the target's frame to the template's; by the landmarks if None.
        bent: False if the template already lies about on the target, and only step 3 is wanted.

    Raises:
        FacePoserError: If the landmarks do not determine a place, or the surfaces do not meet.
        CancelledError: If the user has cancelled the work.
    """
    settings, progress = settings or RegistrationSettings(), progress or Progress()
    progress.at("Aligning")
    vertices = np.asarray(template.vertices, dtype=np.float64)
    own = landmarks.on_template.positions(vertices, template.triangles)
    frame = frame or align(landmarks.on_target, own, landmarks.weights)
    wanted = frame.apply(landmarks.on_target)
    surface = ScanSurface.of(TriangleMesh(frame.apply(target.vertices), target.triangles))
    known = landmarks.weights > 0.0
    if bent:
        ridge = settings.ridge / landmarks.weights[known]
        vertices = bend(vertices, own[known], wanted[known], ridge)
    solver = _Solver.of(template.triangles, landmarks, wanted, len(vertices))
    searching = np.ones(len(vertices), dtype=bool) if searching is None else searching
    normals = VertexNormals(template.triangles, len(vertices))
    n_rounds = len(settings.stiffness) * settings.rounds
    farthest = np.geomspace(*settings.farthest, n_rounds)
    used = searching
    for number in range(n_rounds):
        progress.at("Registering", number / n_rounds)
        stiffness = settings.stiffness[number // settings.rounds]
        points, distances = surface.nearest.points(vertices)
        used = searching & (distances < farthest[number]) & _facing(surface, points, normals(vertices), settings)
        if used.mean() < _LEAST_USED:
            raise FacePoserError("The surfaces do not meet: check the landmarks, or move them to their places.")
        closest = points.positions(surface.mesh.vertices, surface.mesh.triangles)
        pull = settings.landmark_weight * stiffness / settings.stiffness[0]
        vertices = vertices + solver.displacements(vertices, closest, used, pull, stiffness)
    points, distances = surface.nearest.points(vertices)
    return Registration(vertices, frame, points, distances, used)


def _facing(
    surface: ScanSurface, points: SurfacePoints, normals: NDArray[np.float32], settings: RegistrationSettings
) -> Mask:
    """Return the mask of the closest ``points`` whose surface faces as the ``normals``, away from borders."""
    theirs = points.positions(surface.normals, surface.mesh.triangles)
    theirs /= np.maximum(np.linalg.norm(theirs, axis=1, keepdims=True), 1e-12)
    cosines = np.einsum("nd,nd->n", theirs, normals)
    return (cosines > settings.least_cosine) & ~surface.at_border[points.faces]


@dataclass(frozen=True, eq=False)
class _Solver:
    """The linear system of a round: bending LᵀL, landmarks S and their places T."""

    bending: sparse.csc_array
    rows: sparse.csr_array
    weights: Array
    wanted: Array
    attraction: sparse.csc_array = field(repr=False)

    @classmethod
    def of(cls, triangles: Ints, landmarks: LandmarkPairs, wanted: Array, n: int) -> "_Solver":
        laplacian = graph_laplacian(triangles, n)
        corners = landmarks.on_template.corners(triangles)
        rows = sparse.csr_array(
            (landmarks.on_template.barycentric.ravel(), (np.repeat(np.arange(len(corners)), 3), corners.ravel())),
            shape=(len(corners), n),
        )
        attraction = (rows.T @ sparse.diags_array(landmarks.weights) @ rows).tocsc()
        bending = (laplacian.T @ laplacian + _HELD * sparse.eye_array(n)).tocsc()
        return cls(bending, rows, landmarks.weights, wanted, attraction)

    def displacements(self, vertices: Array, closest: Array, used: Mask, pull: float, stiffness: float) -> Array:
        """Return D of the module's equation, shape (N, 3)."""
        weights = used.astype(np.float64)
        system = stiffness * self.bending + sparse.diags_array(weights + _HELD) + pull * self.attraction
        right = weights[:, None] * (closest - vertices)
        right += pull * (self.rows.T @ (self.weights[:, None] * (self.wanted - self.rows @ vertices)))
        factors = linalg.splu(
            system.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        return factors.solve(right)


def graph_laplacian(triangles: Ints, n_vertices: int) -> sparse.csr_array:
    """Return L of shape (N, N): rows of a vertex less the mean of its neighbours; 0 for vertices without any."""
    edges = _edges(triangles)
    links = sparse.csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n_vertices, n_vertices))
    links = links + links.T
    counts = np.asarray(links.sum(axis=1)).ravel()
    mean = sparse.diags_array(1.0 / np.maximum(counts, 1.0)) @ links
    return sparse.csr_array(sparse.diags_array((counts > 0.0).astype(float)) - mean)


def _edges(triangles: Ints) -> NDArray[np.int64]:
    return counted_edges(triangles)[0]
