"""Reading meshes of any common format: OBJ, PLY and glTF by modules of their own, everything else through trimesh."""

from pathlib import Path
from typing import Any

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_io import GLTF_SUFFIXES, read_gltf
from faceposer.geometry.obj_io import read_obj
from faceposer.geometry.ply_io import read_ply
from faceposer.geometry.polygon_mesh import PolygonMesh

_MAX_BYTES = 1 << 30
MESH_SUFFIXES = (".obj", ".ply", ".stl", *GLTF_SUFFIXES, ".off")


def read_mesh(path: Path) -> PolygonMesh:
    """Return the mesh in ``path``: OBJ, PLY and glTF with their order, faces and groups kept, or what trimesh reads.

    Raises:
        FacePoserError: If the file cannot be read as a mesh, naming the place.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError(f"The mesh '{path}' is larger than {_MAX_BYTES >> 30} GB; give a smaller one.")
        mesh = _read(path)
    except OSError as error:
        raise FacePoserError(f"The mesh '{path}' cannot be read: {error.strerror}.") from error
    if len(mesh.vertices) == 0 or len(mesh.polygons) == 0:
        raise FacePoserError(f"The mesh '{path}' has no faces; give a file with a surface.")
    if not np.isfinite(mesh.vertices).all():
        vertex = int(np.argmin(np.isfinite(mesh.vertices).all(axis=1)))
        raise FacePoserError(f"The mesh '{path}' has a vertex that is not finite, number {vertex + 1}.")
    return mesh


def _read(path: Path) -> PolygonMesh:
    suffix = path.suffix.lower()
    if suffix in GLTF_SUFFIXES:
        return read_gltf(path).mesh
    return {".obj": read_obj, ".ply": read_ply}.get(suffix, _read_with_trimesh)(path)


def _read_with_trimesh(path: Path) -> PolygonMesh:
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise FacePoserError(f"'{path}' is not a mesh that can be read; give one of {', '.join(MESH_SUFFIXES)}.")
    path.open("rb").close()
    import trimesh  # it takes over a second to import, which only those who read such files should wait for

    try:
        mesh: Any = trimesh.load(path, force="mesh", process=False, maintain_order=True)
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
    except Exception as error:  # every reader of trimesh raises what it likes
        raise FacePoserError(f"The mesh '{path}' cannot be read: {str(error) or type(error).__name__}.") from error
    return PolygonMesh(vertices, faces.astype(np.int32))
