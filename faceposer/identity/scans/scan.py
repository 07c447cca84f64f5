"""Scans as read from files, and their placing in our frame by landmarks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.registration import align
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.fitting import ScanData
from faceposer.identity.scans.surface import ScanSurface
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.on_meshes import MeshLandmarks, find_mesh_landmarks
from faceposer.progress import Progress

Array = NDArray[np.float64]

# Standard deviation of the networks' points for a spread of the views, in centimetres.
_PER_SPREAD = 1.0


@dataclass(frozen=True, eq=False)
class ScanLandmarks:
    """Known points of a scan, in its unit and axes.

    Attributes:
        points: The 468 landmarks, NaN where one is not known, shape (468, 3).
        spread: Their uncertainty, in the unit of the scan, shape (468,).
        features: Places of MPEG-4 feature points that somebody has placed, by their names.
    """

    points: Array
    spread: Array
    features: dict[str, Array]


def found_landmarks(found: MeshLandmarks) -> ScanLandmarks:
    """Return the landmarks that were found on a mesh."""
    return ScanLandmarks(found.points, found.spread, {})


def find_scan_landmarks(mesh: PaintedMesh, name: str, progress: Progress | None = None) -> ScanLandmarks:
    """Return the landmarks of the scan ``mesh``, called ``name``.

    Raises:
        FacePoserError: If no face is found.
        CancelledError: If the user has cancelled the work.
    """
    found = find_mesh_landmarks(mesh, progress=progress)
    if found is None:
        raise FacePoserError(
            f"No face was found on '{name}'; give a scan of a head with its face, or its landmarks in a file."
        )
    return found_landmarks(found)


@dataclass(frozen=True, eq=False)
class PlacedScan:
    """A scan with its known points, and where it lies.

    Attributes:
        frame: The similarity from the scan to upright centimetres, by the landmarks.
        data: The scan in that frame.
    """

    frame: Similarity
    data: ScanData


def placed_scan(basis: HeadBasis, mesh: PaintedMesh, landmarks: ScanLandmarks) -> PlacedScan:
    """Return the scan ``mesh`` in the frame of ``basis``.

    Raises:
        FacePoserError: If the landmarks do not determine a place, or the scan has no surface.
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
    surface = _outward(ScanSurface.of(TriangleMesh(frame.apply(mesh.vertices), mesh.triangles)), basis, rows, frame.apply(places))
    spreads = _PER_SPREAD * spread * float(frame.scale)
    return PlacedScan(frame, ScanData(surface, frame.apply(places), rows, shares, spreads, exact))


def _outward(surface: ScanSurface, basis: HeadBasis, rows: NDArray[np.int64], places: Array) -> ScanSurface:
    """Return ``surface`` with its triangles turned, if they face inwards at the landmarks ``places``."""
    facing = np.einsum("md,md->m", surface.closest(places).normals, basis.normals(basis.mean)[rows[:, 0]])
    if np.median(facing) >= 0.0:
        return surface
    return ScanSurface.of(TriangleMesh(surface.mesh.vertices, surface.mesh.triangles[:, ::-1]))
