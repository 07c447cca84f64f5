"""Scans as read from files, and their placing in our frame by landmarks."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.registration import align
from faceposer.identity.scan_surface import ScanSurface
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.fitting import ScanData
from faceposer.identity.scans.simplifying import simplified
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.on_meshes import YAWS, MeshLandmarks, View, find_mesh_landmarks
from faceposer.landmarks.reference import reference
from faceposer.progress import Progress

Array = NDArray[np.float64]

# Standard deviation of the networks' points for a spread of the views, in centimetres.
_PER_SPREAD = 1.0
# Difference of the logarithms of the odds of a face from which a texture is turned over.
_CLEARLY = 1.0
# Radius of the part of a scan that is used, in radii of the mean head.
_REACH = 1.4
# Most vertices for the fit, and for detail beyond it.
_MOST_FITTED, _MOST_DETAIL = 40_000, 150_000


@dataclass(frozen=True, eq=False)
class ScanLandmarks:
    """Known points of a scan, in its unit and axes.

    Attributes:
        points: The 468 landmarks, NaN where one is not known, shape (468, 3).
        spread: Their uncertainty, in the unit of the scan, shape (468,).
        features: Places of MPEG-4 feature points that somebody has placed, by their names.
        path: Path of their file; "" if they are of none.
    """

    points: Array
    spread: Array
    features: dict[str, Array]
    path: str = ""

    def of(self, scan: str) -> str:
        """Return what messages call the landmarks of the file ``scan``."""
        file = f"in '{self.path}' " if self.path else ""
        return f"The landmarks {file}of the scan '{scan}'"


def found_landmarks(found: MeshLandmarks) -> ScanLandmarks:
    """Return the landmarks that were found on a mesh."""
    return ScanLandmarks(found.points, found.spread, {})


def find_scan_landmarks(
    mesh: PaintedMesh, name: str, progress: Progress | None = None
) -> tuple[PaintedMesh, ScanLandmarks]:
    """Return the scan ``mesh``, called ``name``, with its texture the right way up, and its landmarks.

    Raises:
        FacePoserError: If no face is found.
        CancelledError: If the user has cancelled the work.
    """
    found = find_mesh_landmarks(mesh, progress=progress)
    if found is not None:
        upright = upright_texture(mesh, found_landmarks(found))
        if upright is not mesh:
            mesh, found = upright, find_mesh_landmarks(upright, progress=progress)
    if found is None:
        raise FacePoserError(
            f"No face was found on '{name}'; give a scan of a head with its face. 'faceposer identity fit --landmarks' "
            "takes landmarks that you give."
        )
    return mesh, found_landmarks(found)


def upright_texture(mesh: PaintedMesh, landmarks: ScanLandmarks) -> PaintedMesh:
    """Return ``mesh`` with the rows of its textures counted from the other end if the face then looks more like one.

    Some programs count them from the top and others from the bottom, and OBJ files do not tell.
    """
    known = np.isfinite(landmarks.points).all(axis=1)
    if not mesh.images or not known.any():
        return mesh
    frame = align(landmarks.points[known], reference().places[known])
    turned = replace(mesh, uv=mesh.uv * (1.0, -1.0) + (0.0, 1.0))
    return turned if _logit(turned, frame) > _logit(mesh, frame) + _CLEARLY else mesh


def _logit(mesh: PaintedMesh, frame: Similarity) -> float:
    """Return the sum of the logarithms of the odds that views of ``mesh`` show a face."""
    views = [View.of(mesh, frame, yaw) for yaw in YAWS[:3]]
    return sum(0.0 if view is None else float(view.landmarks.logit) for view in views)


@dataclass(frozen=True, eq=False)
class PlacedScan:
    """A scan with its known points, and where it lies.

    Attributes:
        frame: The similarity from the scan to upright centimetres, by the landmarks.
        mesh: The part around the head with its colours, in the scan's unit and axes; its triangles face outwards.
        data: What the fit needs, upright and in centimetres.
    """

    frame: Similarity
    mesh: PaintedMesh
    data: ScanData

    def moved(self, frame: Similarity) -> TriangleMesh:
        """Return the part around the head, moved by `frame` of the scan and then by ``frame``."""
        places = frame.apply(self.frame.apply(self.mesh.vertices))
        return simplified(TriangleMesh(places, self.mesh.triangles), _MOST_DETAIL)


def placed_scan(basis: HeadBasis, mesh: PaintedMesh, landmarks: ScanLandmarks, name: str = "scan") -> PlacedScan:
    """Return the scan ``mesh``, called ``name``, in the frame of ``basis``.

    Raises:
        FacePoserError: If the landmarks do not determine a place, or there is no surface around them.
    """
    known = np.flatnonzero(np.isfinite(landmarks.points).all(axis=1) & basis.on_skin)
    rows = basis.landmarks.corners(basis.triangles)[known]
    shares = basis.landmarks.barycentric[known]
    names = [name for name in landmarks.features if name in basis.feature_points]
    placed = np.array([landmarks.features[name] for name in names]).reshape(-1, 3)
    vertices = np.array([basis.feature_points[name] for name in names], dtype=np.int64)
    rows = np.concatenate([rows, np.repeat(vertices[:, None], 3, axis=1)])
    shares = np.concatenate([shares, np.tile([1.0, 0.0, 0.0], (len(names), 1))])
    places = np.concatenate([landmarks.points[known], placed])
    spread = np.concatenate([np.nan_to_num(landmarks.spread[known]), np.zeros(len(names))])
    exact = np.arange(len(places)) >= len(known)
    own = np.einsum("mcd,mc->md", basis.mean[rows], shares)
    frame = align(places, own)
    head = _cropped(mesh, frame, basis.mean, name)
    moved = frame.apply(head.vertices)
    if _faces_inwards(TriangleMesh(moved, head.triangles), basis, rows, frame.apply(places)):
        head = _turned(head)
    surface = ScanSurface.of(simplified(TriangleMesh(moved, head.triangles), _MOST_FITTED))
    spreads = _PER_SPREAD * spread * float(frame.scale)
    return PlacedScan(frame, head, ScanData(surface, frame.apply(places), rows, shares, spreads, exact))


def composed(outer: Similarity, inner: Similarity) -> Similarity:
    """Return the similarity that moves by ``inner`` and then by ``outer``."""
    rotation = outer.rotation @ inner.rotation
    return Similarity(rotation, outer.apply(inner.translation[None])[0], np.asarray(outer.scale * inner.scale))


def _cropped(mesh: PaintedMesh, frame: Similarity, mean: Array, name: str) -> PaintedMesh:
    """Return the triangles of ``mesh`` around the head, without other people and most of a body."""
    middle = (mean.min(axis=0) + mean.max(axis=0)) / 2
    reach = _REACH * float(np.linalg.norm(mean - middle, axis=1).max())
    near = np.linalg.norm(frame.apply(mesh.vertices) - middle, axis=1) < reach
    triangles = np.asarray(mesh.triangles)
    kept = np.flatnonzero(near[triangles].all(axis=1))
    if not kept.size:
        raise FacePoserError(f"There is no surface around the landmarks of '{name}'; move them to their places.")
    used, again = np.unique(triangles[kept], return_inverse=True)
    textured = bool(mesh.images)
    return PaintedMesh(
        mesh.vertices[used],
        again.reshape(-1, 3),
        mesh.colours[used] if mesh.colours.ndim == 2 else mesh.colours,
        mesh.uv[kept] if textured else mesh.uv,
        mesh.image_of[kept] if textured else mesh.image_of,
        mesh.images,
    )


def _faces_inwards(mesh: TriangleMesh, basis: HeadBasis, rows: NDArray[np.int64], places: Array) -> bool:
    facing = np.einsum("md,md->m", ScanSurface.of(mesh).closest(places).normals, basis.normals(basis.mean)[rows[:, 0]])
    return bool(np.median(facing) < 0.0)


def _turned(mesh: PaintedMesh) -> PaintedMesh:
    """Return ``mesh`` with its triangles turned over."""
    return replace(mesh, triangles=np.asarray(mesh.triangles)[:, ::-1], uv=mesh.uv[:, ::-1])
