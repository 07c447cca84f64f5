"""Examples of a face whose mesh is a subject already: it keeps its parts, looks, regions and feature points."""

import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_sequence import frames_of, write_frames
from faceposer.geometry.polygon_mesh import Group, PolygonMesh
from faceposer.model.origin import Origin
from faceposer.model.subject import Subject
from faceposer.progress import Progress
from faceposer.training.assemble import UprightMesh
from faceposer.training.examples import ExampleOptions, subject_from_sequence


def mesh_of(subject: Subject) -> PolygonMesh:
    """Return the mesh of a subject, with its parts as groups."""
    groups = tuple(Group(part.name, part.polygons, part.material) for part in subject.parts)
    return PolygonMesh(
        subject.vertices.astype(np.float64),
        subject.polygons,
        subject.uv.astype(np.float64),
        subject.polygon_uvs,
        groups=groups,
    )


def subject_from_frames(
    frames: Iterable[NDArray[np.floating]],
    count: int,
    mesh: PolygonMesh,
    known: Subject | None,
    source: str,
    options: ExampleOptions,
    progress: Progress,
) -> Subject:
    """Return the character that ``frames`` are examples of.

    Args:
        frames: ``count`` arrays of shape (M, 3), read once.
        count: How many there are.
        mesh: The neutral face, M vertices.
        known: The subject that ``mesh`` is of, if it is one.
        source: Where the frames come from, for the summary.
        options: What to make of them.
        progress: Told how far it is.

    Raises:
        FacePoserError: If the frames cannot be used, or there is no room for them.
    """
    with tempfile.TemporaryDirectory(prefix="faceposer-") as folder:
        path = Path(folder) / "frames.npz"
        try:
            write_frames(path, frames, count, len(mesh.vertices))
        except OSError as error:
            raise FacePoserError(
                f"The meshes of '{source}' cannot be copied to '{tempfile.gettempdir()}' ({error.strerror}); make "
                f"{12e-9 * count * len(mesh.vertices):.1f} GB free there, or set TMPDIR to another folder."
            ) from error
        sequence = frames_of(path, mesh, f"the mesh of '{known.name if known else source}'")
        if known is None:
            return subject_from_sequence(sequence, source, options, progress)
        learned = subject_from_sequence(sequence, source, options, progress, _as_upright(known))
    return replace(
        learned,
        regions=known.regions,
        feature_points=known.feature_points,
        feature_titles=known.feature_titles,
        origin=known.origin,
    )


def _as_upright(known: Subject) -> UprightMesh:
    ids = np.arange(len(known.vertices), dtype=np.int32)
    mesh = mesh_of(known)
    origin = Origin(np.eye(3), mesh.vertices, ids, mesh.polygons, mesh.uv, mesh.polygon_uvs, mesh.groups)
    return UprightMesh(
        known.vertices,
        known.polygons,
        known.uv,
        known.polygon_uvs,
        known.parts,
        known.textures,
        origin,
        ids,
        known.regions or None,
    )
