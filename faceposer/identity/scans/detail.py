"""Detail of a scan beyond the model: non-rigid registration where the scan is skin, blended into the model elsewhere.

The fitted head is laid on the scan by displacement-form non-rigid ICP (`faceposer.identity.registration`). Before, a
coarse scan is rounded (`faceposer.identity.scans.rounding`), so that the head does not follow its flat triangles. What
is found is kept where the scan has data, faces the same way and lies close. From there the displacement D fades into
the model:

    min Σ_v known ω ‖d_v - D_v‖² + λ ‖L d‖² + ε ‖d‖²,

with the graph Laplacian L, so that it continues smoothly and dies out within (λ / ε)^¼ edges.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg
from scipy.spatial import cKDTree

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.registration import LandmarkPairs, RegistrationSettings, graph_laplacian, register
from faceposer.identity.scan_surface import ScanSurface
from faceposer.identity.scans.basis import HeadBasis, region_mask
from faceposer.identity.scans.rounding import rounded
from faceposer.model.character_file import load_character
from faceposer.progress import Progress

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SETTINGS = RegistrationSettings(
    stiffness=(100.0, 30.0, 10.0, 3.0, 1.0), rounds=2, landmark_weight=0.0, farthest=(0.6, 0.25), least_cosine=0.75
)
# Number of vertices from which a scan is fine enough.
_FINE = 40_000
# Least trust at which a vertex looks for the scan, and the one from which it is not questioned.
_SEARCHING, _SKIN = 0.02, 0.2
# Where hair may be, the scan is only followed if most of it lies within this distance of the fit, in centimetres.
_BALD_DISTANCE, _BALD_SHARE = 0.3, 0.75
# Width of the strip along the scalp in which hair may begin, and the distance of the scan from which it is hair there:
# in centimetres, and in standard deviations of the distances of the skin.
_HAIRLINE, _CLOSE, _USUAL = 3.0, 0.03, 4.0
# Motion by an expression, in centimetres, above which the form of the surface is not carried to the neutral face.
_MOVED = 0.35
# Weight of known displacements, and number of edges within which they fade.
_KNOWN, _FADE = 30.0, 12.0
#: The similarity that moves nothing.
IDENTITY = Similarity(np.eye(3), np.zeros(3), np.array(1.0))


@dataclass(frozen=True, eq=False)
class Detail:
    """Displacements from a fitted head to its scan.

    Attributes:
        offsets: Shape (N, 3), in centimetres.
        known: Mask of the vertices that lie on the scan, shape (N,).
    """

    offsets: Array
    known: Mask


def find_detail(
    basis: HeadBasis, posed: Array, expression: Array, scan: TriangleMesh, progress: Progress | None = None
) -> Detail:
    """Return the displacements from the head ``posed``, (N, 3), to ``scan``, both in the model's frame.

    Args:
        basis: The model.
        posed: The fitted head with the expression of the scan.
        expression: Offsets of that expression, shape (N, 3); what they move far is left to the model.
        scan: The scan.
        progress: Progress to update.

    Raises:
        CancelledError: If the user has cancelled the work.
    """
    nobody = LandmarkPairs(SurfacePoints.at_vertices([]), np.zeros((0, 3)), np.zeros(0))
    searching = _searching(basis, posed, scan)
    if len(scan.vertices) < _FINE:
        scan = rounded(scan)
    found = register(
        TriangleMesh(posed, basis.triangles),
        scan,
        nobody,
        SETTINGS,
        progress,
        searching=searching,
        frame=IDENTITY,
        bent=False,
    )
    links = _neighbours(basis)
    known = found.used & (np.linalg.norm(expression, axis=1) < _MOVED)
    known &= links @ (~known).astype(np.float64) < 0.5
    return Detail(faded(basis, found.vertices - posed, known), known)


def _searching(basis: HeadBasis, posed: Array, scan: TriangleMesh) -> Mask:
    """Return the mask of the vertices that look for the scan: where it is skin, and all of it if the head is bald.

    With hair, vertices near the scalp look for it only if it lies about as close as elsewhere: where hair begins, it
    rises from the skin without an edge.
    """
    hairy = (basis.trust > _SEARCHING) & (basis.trust < _SKIN)
    result = basis.trust >= _SKIN
    if not hairy.any():
        return result
    closest = ScanSurface.of(scan).closest(posed)
    near = (closest.distances < _BALD_DISTANCE) & ~closest.at_border
    if near[hairy].mean() > _BALD_SHARE:
        return result | hairy
    man = load_character("man")
    scalp = np.flatnonzero(region_mask(man, ["scalp"], len(posed)))
    apart, _ = cKDTree(basis.mean[scalp]).query(basis.mean)
    usual = 1.4826 * float(np.median(closest.distances[result & near]))
    return result & ((apart > _HAIRLINE) | (closest.distances < max(_CLOSE, _USUAL * usual)))


def _neighbours(basis: HeadBasis) -> sparse.csr_array:
    return sparse.csr_array(abs(graph_laplacian(basis.triangles, len(basis.mean))) > 0.0).astype(np.float64)


def faded(basis: HeadBasis, offsets: Array, known: Mask) -> Array:
    """Return D of the module's equation: ``offsets``, (N, 3), where they are ``known``, faded out elsewhere."""
    n = len(basis.mean)
    laplacian = graph_laplacian(basis.triangles, n)
    smooth = laplacian.T @ laplacian + _FADE**-4.0 * sparse.eye_array(n)
    weights = _KNOWN * known
    factors = linalg.splu(
        (smooth + sparse.diags_array(weights)).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    result: Array = factors.solve(weights[:, None] * offsets)
    return result
