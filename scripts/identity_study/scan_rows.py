"""Rows of heads from scans: of sampled identities, whose truth is known, and of a real one."""

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import rigid_alignment
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.scans.fitting import STAGES, fit_head
from faceposer.identity.scans.head_from_scans import (
    Scan,
    head_from_scans,
    known_landmarks,
    marked_scan,
    read_scan,
    shipped_basis,
)
from faceposer.identity.scans.learning import learning_rounds
from faceposer.identity.scans.scan import composed, placed_scan
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.model.character_file import load_character
from faceposer.progress import Progress
from scripts.identity_study.eos_fit import EosFit, has_eos
from scripts.identity_study.rows import row
from scripts.identity_study.sampling import SampledScans, vertex_errors

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: First seed of scans; identities the model was learned from have others.
_SEED, _COUNT = 50_000, 10_000
#: Trust from which a vertex belongs to the face.
_FACE = 0.9
#: Vertices of the scans from which a model is learned.
_COUNT_LEARNING = 6000


def scan_rows(sampled: SampledScans, n: int, damaged: bool = False, hair: bool = False) -> Iterator[dict[str, Any]]:
    """Yield the rows of fits to scans of ``n`` unseen identities: vertex errors of the face.

    Scans with hair also have the distance of the scalp from the true one, along its normals.
    """
    basis = shipped_basis()
    face = sampled.known & (basis.trust >= _FACE)
    mean, whole, segmented, detailed = [], [], [], []
    scalps: list[float] = []
    seconds = np.zeros(3)
    for seed in range(_SEED, _SEED + n):
        made = sampled.scan(seed, _COUNT, damaged, hair)
        began = time.perf_counter()
        scan = marked_scan(Scan(f"identity {seed}", PaintedMesh(made.mesh.vertices, made.mesh.triangles)), Progress())
        placed = placed_scan(basis, scan.mesh, scan.landmarks, scan.name)
        marked = time.perf_counter()
        fit = fit_head(basis, [placed.data], STAGES[:-1])
        seconds[:2] += marked - began, time.perf_counter() - began
        frame = composed(fit.scans[0].frame, placed.frame).inverse()
        whole.append(vertex_errors(made.in_centimetres(frame.apply(fit.posed(0))), made.truth, face))
        mean.append(vertex_errors(basis.mean, made.truth, face))
        began = time.perf_counter()
        result = head_from_scans([scan], texture=False)
        seconds[2] += marked - began + time.perf_counter() - began
        frame = result.scans[0].frame.inverse()
        segmented.append(vertex_errors(made.in_centimetres(frame.apply(result.fit.posed(0))), made.truth, face))
        posed = made.in_centimetres(frame.apply(result.scans[0].posed))
        detailed.append(vertex_errors(posed, made.truth, face))
        scalps.append(_scalp_error(posed, made.truth, face, sampled.known))
    name, modes = "scan with holes" if damaged else "scan with hair" if hair else "scan", len(basis.modes)
    yield row(name, "mean", 0, mean, 0.0)
    yield row(name, "model", modes, whole, seconds[1] / n)
    yield row(name, "model, segments", modes, segmented, seconds[2] / n)
    more = {"scalp_mm_mean": round(float(np.mean(scalps)), 4)} if hair else {}
    yield row(name, "model, segments, detail", modes, detailed, seconds[2] / n, **more)


def eos_rows(sampled: SampledScans, n: int) -> Iterator[dict[str, Any]]:
    """Yield the row of fits by eos to the landmarks of the scans of `scan_rows`, if it is installed."""
    if not has_eos():
        print("eos is not installed (pip install eos-py): its row is left out.", file=sys.stderr)
        return
    basis = shipped_basis()
    face = sampled.known & (basis.trust >= _FACE)
    rival = EosFit(basis)
    errors, seconds = [], 0.0
    for seed in range(_SEED, _SEED + n):
        made = sampled.scan(seed, _COUNT)
        scan = marked_scan(Scan(f"identity {seed}", PaintedMesh(made.mesh.vertices, made.mesh.triangles)), Progress())
        placed = placed_scan(basis, scan.mesh, known_landmarks(scan), scan.name)
        began = time.perf_counter()
        head = rival.head(placed)
        seconds += time.perf_counter() - began
        errors.append(vertex_errors(head, made.truth, face))
    yield row("scan", "eos-py, landmarks", len(basis.modes), errors, seconds / n)


def _scalp_error(head: Array, truth: Array, face: Mask, known: Mask) -> float:
    """Return the mean distance of the scalp of ``head`` from the true one along its normals, laid on it by the face."""
    scalp = load_character("man").regions["scalp"]
    scalp = scalp[scalp < len(known)]
    scalp = scalp[known[scalp]]
    moved = rigid_alignment(head[face], truth[face], scale=True).apply(head[scalp])
    normals = shipped_basis().normals(truth)[scalp]
    return 10.0 * float(np.abs(np.einsum("nd,nd->n", moved - truth[scalp], normals)).mean())


def real_scan_rows(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of the fit to the scan of Lee Perry-Smith (Infinite-Realities, CC BY 3.0): surface distances."""
    modes = len(shipped_basis().modes)
    for method, detail in (("model, segments", False), ("model, segments, detail", True)):
        began = time.perf_counter()
        result = head_from_scans([read_scan(str(folder / "perry_smith.obj"))], detail)
        fitted = result.scans[0]
        chosen = fitted.used & (shipped_basis().trust >= _FACE)
        yield row("real-scan", method, modes, [10.0 * fitted.distances[chosen]], time.perf_counter() - began)


def correspondence_rows(sampled: SampledScans, n: int, rounds: int) -> Iterator[dict[str, Any]]:
    """Yield the correspondence errors of ``n`` damaged scans after each round of bootstrapping from the mean alone."""
    basis = shipped_basis()
    face = sampled.known & (basis.trust >= _FACE)
    made = [sampled.scan(seed, _COUNT_LEARNING, damaged=True) for seed in range(_SEED + 1000, _SEED + 1000 + n)]
    meshes = [PaintedMesh(each.mesh.vertices, each.mesh.triangles) for each in made]
    scans = [marked_scan(Scan(f"identity {k}", mesh), Progress()) for k, mesh in enumerate(meshes)]
    for method, from_mean, count in (("from the mean", True, rounds), ("from the model", False, 1)):
        began = time.perf_counter()
        for number, learned in enumerate(learning_rounds(scans, load_identity_model(), count, from_mean=from_mean)):
            pairs = zip(learned.heads, made, strict=True)
            errors = [vertex_errors(head, each.truth, face) for head, each in pairs]
            seconds = (time.perf_counter() - began) / n
            yield row("correspondence", method, learned.model.n_coefficients, errors, seconds, rounds=number + 1)
