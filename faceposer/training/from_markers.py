"""Characters from the motion of markers on a performer's face (Lau et al. 2009, section 3.1)."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.marker_io import read_markers
from faceposer.geometry.marker_map import read_marker_map
from faceposer.geometry.marker_meshes import MarkerMeshes, meshes_from_markers
from faceposer.geometry.mesh_io import MESH_SUFFIXES, read_mesh
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.progress import Progress
from faceposer.training.examples import ExampleOptions
from faceposer.training.known_face import character_from_frames, mesh_of


def character_from_markers(
    motion: Path, marker_map: Path, scan: str, options: ExampleOptions, progress: Progress | None = None
) -> Character:
    """Train a character from the frames of marker motion, transferred to a scan.

    Args:
        motion: C3D or CSV file.
        marker_map: JSON file with the place of each marker on the scan.
        scan: A mesh file, or the name or path of a character, to whose feature points the map may refer.
        options: Options for training from the resulting examples.
        progress: Progress to update.

    Raises:
        FacePoserError: If a file cannot be used.
    """
    progress = progress or Progress()
    progress.at("Reading the markers")
    known: Character | None = None
    if Path(scan).suffix.lower() in MESH_SUFFIXES:
        mesh = read_mesh(Path(scan))
    else:
        known = load_character(scan)
        mesh = mesh_of(known)
    points = dict(known.feature_points) if known else None
    markers = read_markers(motion)
    moved = meshes_from_markers(markers, read_marker_map(marker_map), mesh.vertices, mesh.triangles(), points)
    character = character_from_frames(
        _with_progress(moved, progress), len(moved), mesh, known, motion.name, options, progress
    )
    report = moved.report
    summary = {
        **character.summary,
        "kind": "markers",
        "scan": scan,
        "markers": {
            "frames": report.n_frames,
            "frames_left_out": report.left_out,
            "gaps_filled": report.gaps_filled,
            "completed": report.completed,
            "unused": list(report.unused),
            "held": list(report.held),
            "misfit": round(report.misfit, 4),
        },
        "warnings": [*character.summary.get("warnings", []), *markers.notes],
    }
    return replace(character, summary=summary)


def _with_progress(moved: MarkerMeshes, progress: Progress) -> Iterator[NDArray[np.float64]]:
    for i, vertices in enumerate(moved):
        progress.at("Deforming the scan by the markers", (i + 1) / len(moved))
        yield vertices
