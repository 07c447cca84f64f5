"""Motion of markers on a performer's face, carried over to a scan, becomes a subject (Lau et al. 2009, section 3.1)."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.marker_io import read_markers
from faceposer.geometry.marker_map import read_marker_map
from faceposer.geometry.marker_meshes import MarkerMeshes, meshes_from_markers
from faceposer.geometry.mesh_io import MESH_SUFFIXES, read_mesh
from faceposer.geometry.mesh_sequence import frames_of, write_frames
from faceposer.geometry.polygon_mesh import Group, PolygonMesh
from faceposer.model.subject import Subject
from faceposer.model.subject_file import load_subject
from faceposer.training.examples import ExampleOptions, subject_from_sequence
from faceposer.training.progress import Progress


def subject_from_markers(
    motion: Path, marker_map: Path, scan: str, options: ExampleOptions, progress: Progress | None = None
) -> Subject:
    """Return the character whose examples are the frames of a motion of markers, carried over to a scan.

    Args:
        motion: C3D or CSV file.
        marker_map: JSON file that says where on the scan each marker is.
        scan: A mesh file, or the name or path of a subject, whose feature points the map may name.
        options: What to make of the examples.
        progress: Told how far it is.

    Raises:
        FacePoserError: If a file cannot be used, naming it, the place and the remedy.
    """
    progress = progress or Progress()
    progress.at("Reading the markers")
    known: Subject | None = None
    if Path(scan).suffix.lower() in MESH_SUFFIXES:
        mesh = read_mesh(Path(scan))
    else:
        known = load_subject(scan)
        mesh = _mesh_of(known)
    points = dict(known.feature_points) if known else None
    moved = meshes_from_markers(
        read_markers(motion), read_marker_map(marker_map), mesh.vertices, mesh.triangles(), points
    )
    with tempfile.TemporaryDirectory(prefix="faceposer-") as folder:
        frames = Path(folder) / "frames.npz"
        try:
            write_frames(frames, _counted(moved, progress), len(moved), len(mesh.vertices))
        except OSError as error:
            raise FacePoserError(
                f"The meshes of '{motion}' cannot be copied to '{tempfile.gettempdir()}' ({error.strerror}); make "
                f"{12 * len(moved) * len(mesh.vertices) / 1e9:.1f} GB free there, or set TMPDIR to another folder."
            ) from error
        sequence = frames_of(frames, mesh, f"the scan '{scan}'")
        upright = Similarity(np.eye(3), np.zeros(3), np.array(1.0)) if known else None
        subject = subject_from_sequence(sequence, motion.name, options, progress, upright)
    report = moved.report
    summary = {
        **subject.summary,
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
    }
    subject = replace(subject, summary=summary)
    return _with_landmarks_of(subject, known) if known else subject


def _counted(moved: MarkerMeshes, progress: Progress):  # type: ignore[no-untyped-def]
    for i, vertices in enumerate(moved):
        progress.at("Moving the scan by the markers", (i + 1) / len(moved))
        yield vertices


def _mesh_of(subject: Subject) -> PolygonMesh:
    """Return the mesh of a subject, with its parts as groups."""
    groups = tuple(Group(part.name, part.polygons, part.material) for part in subject.parts)
    return PolygonMesh(
        subject.vertices.astype(np.float64),
        subject.polygons,
        subject.uv.astype(np.float64),
        subject.polygon_uvs,
        groups=groups,
    )


def _with_landmarks_of(subject: Subject, known: Subject) -> Subject:
    """Return ``subject`` with regions, feature points and looks of the ``known`` one that is its scan."""
    assert subject.origin is not None
    ids = subject.origin.vertex_ids
    return replace(
        subject,
        regions={name: np.unique(ids[vertices]) for name, vertices in known.regions.items()},
        feature_points={name: int(ids[vertex]) for name, vertex in known.feature_points.items()},
        feature_titles=known.feature_titles,
        textures=known.textures,
    )
