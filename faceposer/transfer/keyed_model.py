"""Face models whose shapes are the key poses of a mesh, for characters without shapes, or keys beyond their shapes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh import first_unusable
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.model.character import Character, Part
from faceposer.model.errors import InconsistentError
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.origin import Origin

# Largest number of values of all keys together: 0.8 GB in single precision.
_MOST_VALUES = 200_000_000


def check_size(n_keys: int, n_vertices: int) -> None:
    """Check that ``n_keys`` meshes of ``n_vertices`` fit into memory.

    Raises:
        FacePoserError: If they do not.
    """
    if 3 * n_keys * n_vertices > _MOST_VALUES:
        raise FacePoserError(
            f"{n_keys} keys as meshes of {n_vertices:,} vertices are too many; use fewer keys, or poses."
        )


def keyed_model(character: Character, names: Sequence[str], displacements: Sequence[NDArray[np.floating]]) -> FaceModel:
    """Return the model of ``character`` with key poses in place of its shapes.

    Args:
        character: The face; its own shapes are left out.
        names: Names of the K keys.
        displacements: Displacements of the vertices in each key, each of shape (N, 3).
    """
    check_size(len(names), len(character.vertices))
    count = len(names)
    statistics = ExpressionStatistics(
        tuple(names),
        np.ones(1),
        np.zeros((1, count)),
        np.eye(count)[None],
        np.zeros(count),
        np.eye(count),
        "",
    )
    keyed = Character(
        name=character.name,
        title=character.title,
        vertices=character.vertices,
        polygons=character.polygons,
        uv=character.uv,
        polygon_uvs=character.polygon_uvs,
        parts=character.parts,
        shape_names=tuple(names),
        shapes=np.array(displacements, dtype=np.float32).reshape(count, -1, 3),
        regions=character.regions,
        feature_points=character.feature_points,
        feature_titles=character.feature_titles,
        textures=character.textures,
        credits=character.credits,
        statistics=statistics,
        origin=character.origin,
    )
    return build_face_model(keyed, n_components=count, metric="plain")


def character_of_mesh(mesh: PolygonMesh, name: str) -> Character:
    """Return the character, without shapes, of a ``mesh`` as it is in its file; ``name`` is for messages and exports.

    Raises:
        FacePoserError: If the mesh has no faces or no extent, or numbers that are not finite.
    """
    polygons = mesh.triangles()
    if not len(polygons) or not len(mesh.vertices):
        raise FacePoserError(f"The mesh '{name}' has no faces; give the neutral mesh of the character.")
    row = first_unusable(mesh.vertices)
    if row is not None:
        raise FacePoserError(f"The mesh '{name}' has a vertex {row + 1} that is not finite; export it again.")
    count = len(mesh.vertices)
    padded = np.pad(polygons, ((0, 0), (0, 1)), constant_values=-1).astype(np.int32)
    origin = Origin(
        np.eye(3),
        mesh.vertices,
        np.arange(count, dtype=np.int32),
        mesh.polygons,
        mesh.uv,
        mesh.polygon_uvs if len(mesh.uv) else np.zeros((0, 3), dtype=np.int32),
        mesh.groups,
    )
    try:
        return Character(
            name=name,
            title=name,
            vertices=np.ascontiguousarray(mesh.vertices, dtype=np.float32),
            polygons=padded,
            uv=np.zeros((1, 2), dtype=np.float32),
            polygon_uvs=np.where(padded < 0, -1, 0).astype(np.int32),
            parts=(Part("skin", "skin", (0, len(padded)), (0, count)),),
            shape_names=(),
            shapes=np.zeros((0, count, 3), dtype=np.float32),
            origin=origin,
        )
    except InconsistentError as error:
        raise FacePoserError(f"The mesh '{name}' cannot be used: {error}.") from error
