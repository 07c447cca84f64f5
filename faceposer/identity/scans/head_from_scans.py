"""A head from scans of one person: landmarks, fit, detail and texture, one after the other."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.mesh_io import MESH_SUFFIXES
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.scan_surface import ScanSurface
from faceposer.identity.scans.baking import Layer, baked_layer, blended, has_colours
from faceposer.identity.scans.basis import HeadBasis, basis_of
from faceposer.identity.scans.detail import Detail, find_detail
from faceposer.identity.scans.fitting import HeadFit, fit_head
from faceposer.identity.scans.residuals import UnmatchedError
from faceposer.identity.scans.scan import (
    PlacedScan,
    ScanLandmarks,
    composed,
    find_scan_landmarks,
    placed_scan,
    upright_texture,
)
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.reading import read_painted
from faceposer.model.character_file import load_character
from faceposer.progress import Progress

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Most vertices of a scan.
_MOST_VERTICES = 2_000_000
# Trust from which vertices count in the report.
_REPORTED = 0.5
# Weight of an expression from which it is reported.
_SHOWN_WEIGHT = 0.02
# Farthest that a vertex lies from the scan that it is said to lie on, in centimetres.
_ON_SCAN = 0.4
# Least share of the face on a scan that matches its landmarks, and that from which nobody need look for a mistake.
_LEAST_SHARE, _USUAL_SHARE = 0.3, 0.7
# Weight of the displacement of a vertex that does not lie on a scan, beside those that do.
_UNKNOWN = 1e-3
# Shares of the work at which its stages begin and end.
_STAGES = {
    "prepare": (0.02, 0.1),
    "landmarks": (0.1, 0.2),
    "model": (0.2, 0.5),
    "detail": (0.5, 0.8),
    "texture": (0.8, 1.0),
}


@dataclass(frozen=True, eq=False)
class Scan:
    """A scan of a head.

    Attributes:
        name: Name for messages.
        mesh: The surface with its colours, in any unit and axes.
        landmarks: Its known points; they are looked for if None.
        path: Path of its file; "" if it is of none.
    """

    name: str
    mesh: PaintedMesh
    landmarks: ScanLandmarks | None = None
    path: str = ""

    @property
    def label(self) -> str:
        """What messages call the scan, so that its file is found."""
        return self.path or self.name


@dataclass(frozen=True, eq=False)
class FittedScan:
    """A scan with the head on it.

    Attributes:
        scan: The scan, with its landmarks.
        frame: The similarity from the scan to the head's frame.
        placed: The part of the scan around the head.
        mesh: That part in the head's frame, coarser if it has many vertices.
        posed: The head with the scan's expression and detail, shape (N, 3).
        distances: Distances of its vertices from the scan in centimetres, shape (N,).
        used: Mask of the vertices on the scan, shape (N,).
        report: What was measured, as JSON.
    """

    scan: Scan
    frame: Similarity
    placed: PlacedScan
    mesh: TriangleMesh
    posed: Array
    distances: Array
    used: Mask
    report: dict[str, Any]


@dataclass(frozen=True, eq=False)
class HeadFromScans:
    """A head from scans.

    Attributes:
        skin: The neutral head, shape (N, 3), in centimetres.
        textures: Encoded images by material.
        fit: The fit of the model.
        scans: The scans.
        report: What was measured, as JSON.
    """

    skin: Array
    textures: dict[str, bytes]
    fit: HeadFit
    scans: tuple[FittedScan, ...]
    report: dict[str, Any]


@dataclass(frozen=True, eq=False)
class ScanFitSoFar:
    """A fit in progress, for pictures of it.

    Attributes:
        fit: The fit of the model.
        placed: The parts of the scans around the head.
        details: Displacements of the scans beyond the model that are known.
    """

    fit: HeadFit
    placed: Sequence[PlacedScan]
    details: Sequence[Detail] = ()

    def vertices(self, number: int) -> Array:
        """Return the head with the expression of scan ``number``, shape (N, 3)."""
        posed = self.fit.posed(number)
        return posed + self.details[number].offsets if number < len(self.details) else posed

    def frame(self, number: int) -> Similarity:
        """Return the similarity from scan ``number`` to the head's frame."""
        return composed(self.fit.scans[number].frame, self.placed[number].frame)


def read_scan(path: str, landmarks: ScanLandmarks | None = None) -> Scan:
    """Read a scan from a mesh file.

    Raises:
        FacePoserError: If it cannot be read, has no surface or too many vertices.
    """
    if Path(path).suffix.lower() not in MESH_SUFFIXES:
        raise FacePoserError(f"'{path}' is not a mesh; choose a scan of type {', '.join(MESH_SUFFIXES)}.")
    mesh = read_painted(path)
    if len(mesh.vertices) > _MOST_VERTICES:
        raise FacePoserError(
            f"The scan '{path}' has {len(mesh.vertices)} vertices; reduce it to at most {_MOST_VERTICES}, or cut out "
            "the head."
        )
    return Scan(Path(path).name, mesh, landmarks, path)


@lru_cache(maxsize=1)
def shipped_basis() -> HeadBasis:
    """Return the basis of the shipped model.

    Raises:
        FacePoserError: If its file is missing or damaged.
    """
    return basis_of(load_identity_model())


def head_from_scans(
    scans: Sequence[Scan],
    detail: bool = True,
    texture: bool = True,
    progress: Progress | None = None,
    basis: HeadBasis | None = None,
    model: IdentityModel | None = None,
    watch: Callable[[ScanFitSoFar], None] = lambda _: None,
) -> HeadFromScans:
    """Return the head of the person in ``scans``.

    Args:
        scans: Scans of one person, with the same or different expressions.
        detail: False for the head of the model, without what the scans have beyond it.
        texture: False to leave the colours of the scans.
        progress: Progress to update.
        basis: What is fitted; that of the shipped model if None.
        model: The model of ``basis``; the shipped one if None.
        watch: Called with the fit after each step.

    Raises:
        FacePoserError: If no face is found on a scan, or it does not match its landmarks.
        CancelledError: If the user has cancelled the work.
    """
    began = time.perf_counter()
    progress = progress or Progress()
    progress.at("Preparing the model", _STAGES["prepare"][0])
    basis, model = basis or shipped_basis(), model or load_identity_model()
    finding = progress.part(*_STAGES["landmarks"])
    scans = [
        marked_scan(scan, finding.part(number / len(scans), (number + 1) / len(scans)))
        for number, scan in enumerate(scans)
    ]
    placed = [placed_scan(basis, scan.mesh, known_landmarks(scan), scan.label) for scan in scans]
    try:
        fit = fit_head(
            basis,
            [scan.data for scan in placed],
            progress=progress.part(*_STAGES["model"]),
            watch=lambda fit: watch(ScanFitSoFar(fit, placed)),
        )
    except UnmatchedError as error:
        of = " or ".join(known_landmarks(scan).of(scan.label) for scan in scans)
        raise FacePoserError(f"{of} do not match it: move them to their places, or scan more of the face.") from error
    fitted, details = [], []
    registering = progress.part(*_STAGES["detail"])
    for number, (scan, place) in enumerate(zip(scans, placed, strict=True)):
        mesh = place.moved(fit.scans[number].frame)
        found = None
        if detail:
            offsets = basis.offsets(fit.scans[number].weights)
            part = registering.part(number / len(scans), (number + 1) / len(scans))
            found = find_detail(basis, fit.posed(number), offsets, mesh, part)
            details.append(found)
            watch(ScanFitSoFar(fit, placed, details))
        fitted.append(_fitted(basis, fit, number, scan, place, mesh, found))
    skin = fit.neutral + mean_detail(details, len(basis.mean))
    textures = {}
    if texture and any(has_colours(scan.mesh) for scan in scans):
        textures = _textures(basis, fitted, progress.part(*_STAGES["texture"]))
    report = _report(fitted, model.commonness(fit.shape), detail, time.perf_counter() - began)
    return HeadFromScans(skin, textures, fit, tuple(fitted), report)


def doubts(made: HeadFromScans) -> str:
    """Return a sentence on scans that few vertices of the face lie on, so that somebody checks landmarks; or ""."""
    doubtful = [scan for scan in made.scans if scan.report["used"] < _USUAL_SHARE]
    if not doubtful:
        return ""
    shares = ", ".join(f"{scan.report['used']:.0%} on '{scan.scan.name}'" for scan in doubtful)
    return f"Little of the face lies on the scan: {shares}. Check the landmarks, if the scan shows all of the face."


def marked_scan(scan: Scan, progress: Progress) -> Scan:
    """Return ``scan`` with its landmarks and its texture the right way up.

    Raises:
        FacePoserError: If no face is found.
        CancelledError: If the user has cancelled the work.
    """
    if scan.landmarks is not None:
        return replace(scan, mesh=upright_texture(scan.mesh, scan.landmarks))
    mesh, landmarks = find_scan_landmarks(scan.mesh, scan.label, progress)
    return replace(scan, mesh=mesh, landmarks=landmarks)


def known_landmarks(scan: Scan) -> ScanLandmarks:
    """Return the landmarks of a scan that has them."""
    assert scan.landmarks is not None
    return scan.landmarks


def mean_detail(details: Sequence[Detail], n_vertices: int) -> Array:
    """Return the mean of the displacements of several scans, (N, 3): of each vertex of those that know it."""
    total, count = np.zeros((n_vertices, 3)), np.zeros((n_vertices, 1))
    for detail in details:
        weight = np.where(detail.known, 1.0, _UNKNOWN)[:, None]
        total += weight * detail.offsets
        count += weight
    return total / np.maximum(count, 1e-12)


def _fitted(
    basis: HeadBasis,
    fit: HeadFit,
    number: int,
    scan: Scan,
    placed: PlacedScan,
    mesh: TriangleMesh,
    detail: Detail | None,
) -> FittedScan:
    state, data = fit.scans[number], placed.data
    posed = fit.posed(number) if detail is None else fit.posed(number) + detail.offsets
    closest = ScanSurface.of(mesh).closest(posed)
    facing = np.einsum("nd,nd->n", closest.normals, basis.normals(posed)) > 0.5
    counted = basis.trust >= _REPORTED
    used = (closest.distances < _ON_SCAN) & ~closest.at_border & facing & (basis.trust > 0.0)
    share = float((used & counted).sum() / counted.sum())
    if share < _LEAST_SHARE:
        raise FacePoserError(
            f"{known_landmarks(scan).of(scan.label)} do not match it: {share:.0%} of the face would lie on the scan; "
            "move them to their places."
        )
    apart = np.linalg.norm(
        state.frame.apply(data.places) - np.einsum("mcd,mc->md", posed[data.rows], data.shares), axis=1
    )
    distances = 10.0 * closest.distances[used & counted]
    frame = composed(state.frame, placed.frame)
    shown = zip(basis.expression_names, state.weights.tolist(), strict=True)
    report = {
        "name": scan.name,
        "landmark_mm": round(10.0 * float(np.median(apart)), 4),
        "surface_mm_median": round(float(np.median(distances)), 4),
        "surface_mm_mean": round(float(distances.mean()), 4),
        "used": round(share, 4),
        "unit_cm": float(f"{float(frame.scale):.5g}"),
        "expression": {name: round(weight, 3) for name, weight in shown if weight >= _SHOWN_WEIGHT},
    }
    return FittedScan(scan, frame, placed, mesh, posed, closest.distances, used, report)


def _textures(basis: HeadBasis, fitted: Sequence[FittedScan], progress: Progress) -> dict[str, bytes]:
    man = load_character("man")
    layers: list[Layer] = []
    for number, scan in enumerate(fitted):
        progress.at("Painting the texture", number / (len(fitted) + 1))
        if has_colours(scan.placed.mesh):
            places = scan.frame.apply(scan.placed.mesh.vertices)
            mesh = TriangleMesh(places, scan.placed.mesh.triangles)
            layers.append(baked_layer(basis, man, scan.posed, scan.used, mesh, scan.placed.mesh))
    progress.at("Painting the texture", len(fitted) / (len(fitted) + 1))
    return {"skin": blended(layers, man.textures["skin"])}


def _report(fitted: Sequence[FittedScan], likelihood: float, detail: bool, seconds: float) -> dict[str, Any]:
    """Return the report: means over the scans, and each of them."""
    names = ("landmark_mm", "surface_mm_median", "surface_mm_mean", "used")
    means = {name: round(float(np.mean([scan.report[name] for scan in fitted])), 4) for name in names}
    return {
        "format": "faceposer.scan-report",
        "version": 1,
        **means,
        "likelihood": round(likelihood, 4),
        "detail": detail,
        "seconds": round(seconds, 2),
        "scans": [scan.report for scan in fitted],
    }
