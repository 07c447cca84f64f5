"""Training from examples of an existing character, which keeps its parts, textures, regions and feature points."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.temporary import scratch_folder, scratch_parent
from faceposer.geometry.mesh_sequence import frames_of, write_frames
from faceposer.geometry.polygon_mesh import Group, PolygonMesh
from faceposer.model.character import Character
from faceposer.model.origin import Origin
from faceposer.progress import Progress
from faceposer.training.assemble import CanonicalMesh
from faceposer.training.examples import ExampleOptions, character_from_sequence


def mesh_of(character: Character) -> PolygonMesh:
    """Return the mesh of a character, with a group for each part."""
    groups = tuple(Group(part.name, part.polygons, part.material) for part in character.parts)
    return PolygonMesh(
        character.vertices.astype(np.float64),
        character.polygons,
        character.uv.astype(np.float64),
        character.polygon_uvs,
        groups=groups,
    )


def character_from_frames(
    frames: Iterable[NDArray[np.floating]],
    count: int,
    mesh: PolygonMesh,
    known: Character | None,
    source: str,
    options: ExampleOptions,
    progress: Progress,
) -> Character:
    """Train a character from the examples ``frames``.

    Args:
        frames: ``count`` arrays of shape (M, 3), iterated once.
        count: Number of frames.
        mesh: The neutral face, M vertices.
        known: The character of ``mesh``, if it belongs to one.
        source: Name of the source, for the summary.
        options: Options for training.
        progress: Progress to update.

    Raises:
        FacePoserError: If the frames cannot be used, or the disk is full.
    """
    with scratch_folder() as folder:
        path = folder / "frames.npz"
        try:
            write_frames(path, frames, count, len(mesh.vertices))
        except OSError as error:
            raise FacePoserError(
                f"The meshes of '{source}' cannot be copied to '{scratch_parent()}' ({error.strerror}); make "
                f"{12e-9 * count * len(mesh.vertices):.1f} GB free there, or set TMPDIR to another folder."
            ) from error
        sequence = frames_of(path, mesh, f"the mesh of '{known.name if known else source}'")
        if known is None:
            return character_from_sequence(sequence, source, options, progress)
        learned = character_from_sequence(sequence, source, options, progress, _canonical_mesh(known))
    return replace(
        learned,
        regions=known.regions,
        feature_points=known.feature_points,
        feature_titles=known.feature_titles,
        origin=known.origin,
    )


def _canonical_mesh(known: Character) -> CanonicalMesh:
    ids = np.arange(len(known.vertices), dtype=np.int32)
    mesh = mesh_of(known)
    origin = Origin(np.eye(3), mesh.vertices, ids, mesh.polygons, mesh.uv, mesh.polygon_uvs, mesh.groups)
    return CanonicalMesh(
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
