"""Reading and writing meshes.

OBJ is read and written here, because its order of vertices, faces and texture coordinates must come through untouched;
everything else goes through trimesh.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError

_MAX_BYTES = 1 << 30
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".gltf", ".off")


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """A mesh as a file has it.

    Attributes:
        vertices: Shape (N, 3).
        polygons: Vertex indices per face, in the file's order.
        uv: Texture coordinates, shape (U, 2); empty if the file has none.
        polygon_uvs: Indices into ``uv`` per face, or empty.
        normals: As the file lists them, shape (M, 3); empty if it has none.
    """

    vertices: NDArray[np.float64]
    polygons: tuple[tuple[int, ...], ...]
    uv: NDArray[np.float64]
    polygon_uvs: tuple[tuple[int, ...], ...]
    normals: NDArray[np.float64]

    def triangles(self) -> NDArray[np.int32]:
        """Return the faces as triangles about their first corner, shape (T, 3)."""
        fans = [(face[0], face[i], face[i + 1]) for face in self.polygons for i in range(1, len(face) - 1)]
        return np.array(fans, dtype=np.int32).reshape(-1, 3)


@dataclass(frozen=True)
class Group:
    """A named range of faces.

    Attributes:
        name: Without spaces.
        polygons: First face and the one after the last.
        material: Name of the material, if any.
    """

    name: str
    polygons: tuple[int, int]
    material: str = ""


def write_obj(
    path: Path,
    vertices: ArrayLike,
    polygons: NDArray[np.integer],
    uv: ArrayLike | None = None,
    polygon_uvs: NDArray[np.integer] | None = None,
    normals: ArrayLike | None = None,
    groups: Sequence[Group] = (),
    comment: str = "",
) -> None:
    """Write a Wavefront OBJ with vertices and faces in the order given, all or nothing.

    Args:
        path: The file.
        vertices: Shape (N, 3); written so that single precision comes back exactly.
        polygons: Vertex indices, shape (F, 3) or (F, 4); a triangle among quads has -1 last.
        uv: Texture coordinates, shape (U, 2).
        polygon_uvs: Indices into ``uv``, of the shape of ``polygons``.
        normals: One per vertex, shape (N, 3).
        groups: Named ranges of faces.
        comment: First line of the file.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    lines = [f"# {comment}"] if comment else []
    lines += _rows("v", np.asarray(vertices), "%.9g")
    if uv is not None:
        lines += _rows("vt", np.asarray(uv), "%.7g")
    if normals is not None:
        lines += _rows("vn", np.asarray(normals), "%.5f")
    textures = polygon_uvs if uv is not None else None
    faces = [
        _face(face, None if textures is None else textures[i], normals is not None) for i, face in enumerate(polygons)
    ]
    done = 0
    for group in groups:
        lines += faces[done : group.polygons[0]]
        lines.append(f"g {group.name}")
        if group.material:
            lines.append(f"usemtl {group.material}")
        lines += faces[group.polygons[0] : group.polygons[1]]
        done = group.polygons[1]
    lines += faces[done:]
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise FacePoserError(f"The mesh '{path}' cannot be written: {error.strerror}.") from error


def _rows(keyword: str, values: NDArray[np.floating], form: str) -> list[str]:
    template = " ".join([keyword, *[form] * values.shape[1]])
    return [template % tuple(row) for row in values.tolist()]


def _face(face: NDArray[np.integer], texture: NDArray[np.integer] | None, with_normals: bool) -> str:
    corners = []
    for k, vertex in enumerate(face.tolist()):
        if vertex < 0:
            continue
        corner = str(vertex + 1)
        if texture is not None:
            corner += f"/{int(texture[k]) + 1}"
        elif with_normals:
            corner += "/"
        corners.append(corner + (f"/{vertex + 1}" if with_normals else ""))
    return "f " + " ".join(corners)


def read_mesh(path: Path) -> PolygonMesh:
    """Return the mesh in ``path``: OBJ with its order kept, or what trimesh reads.

    Raises:
        FacePoserError: If the file cannot be read as a mesh, naming the place.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError(f"The mesh '{path}' is larger than {_MAX_BYTES >> 30} GB; give a smaller one.")
        mesh = _read_obj(path) if path.suffix.lower() == ".obj" else _read_with_trimesh(path)
    except OSError as error:
        raise FacePoserError(f"The mesh '{path}' cannot be read: {error.strerror}.") from error
    if len(mesh.vertices) == 0 or len(mesh.polygons) == 0:
        raise FacePoserError(f"The mesh '{path}' has no faces; give a file with a surface.")
    if not np.isfinite(mesh.vertices).all():
        vertex = int(np.argmin(np.isfinite(mesh.vertices).all(axis=1)))
        raise FacePoserError(f"The mesh '{path}' has a vertex that is not finite, number {vertex + 1}.")
    return mesh


def _read_obj(path: Path) -> PolygonMesh:
    tables: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    polygons: list[tuple[int, ...]] = []
    polygon_uvs: list[tuple[int, ...]] = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            keyword, _, rest = line.partition("#")[0].strip().partition(" ")
            try:
                if keyword in tables:
                    width = 2 if keyword == "vt" else 3
                    row = [float(word) for word in rest.split()[:width]]
                    if len(row) != width:
                        raise ValueError(f"'{keyword}' needs {width} numbers")
                    tables[keyword].append(row)
                elif keyword == "f":
                    corners = [corner.split("/") for corner in rest.split()]
                    if len(corners) < 3:
                        raise ValueError("a face needs at least 3 corners")
                    polygons.append(tuple(_index(c[0], len(tables["v"])) for c in corners))
                    if all(len(c) > 1 and c[1] for c in corners):
                        polygon_uvs.append(tuple(_index(c[1], len(tables["vt"])) for c in corners))
            except ValueError as error:
                raise FacePoserError(f"The mesh '{path}' is broken at line {number}: {error}.") from error
    whole = len(polygon_uvs) == len(polygons)
    return PolygonMesh(
        np.array(tables["v"], dtype=np.float64).reshape(-1, 3),
        tuple(polygons),
        np.array(tables["vt"] if whole else [], dtype=np.float64).reshape(-1, 2),
        tuple(polygon_uvs) if whole else (),
        np.array(tables["vn"], dtype=np.float64).reshape(-1, 3),
    )


def _index(word: str, count: int) -> int:
    """Return the index from 0 that OBJ's index ``word`` (from 1, or from the end if negative) means."""
    value = int(word)
    index = value - 1 if value > 0 else count + value
    if value == 0 or not 0 <= index < count:
        raise ValueError(f"index {value} names none of the {count} listed before")
    return index


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
    empty = np.zeros((0, 2))
    return PolygonMesh(vertices, tuple(map(tuple, faces.tolist())), empty, (), np.zeros((0, 3)))
