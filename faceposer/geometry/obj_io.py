"""Reading and writing of Wavefront OBJ, preserving the order of vertices, faces and texture coordinates."""

import hashlib
import re
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.reading import open_text, read_bytes
from faceposer.geometry.mtl_io import writable_name
from faceposer.geometry.polygon_mesh import Group, PolygonMesh, no_polygons, pad_polygons

# Limit on the corners of a face, since the array of polygons is as wide as the largest.
_MOST_CORNERS = 128


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
    """Write a Wavefront OBJ atomically, with vertices and faces in the given order.

    Args:
        path: Path of the file.
        vertices: Positions, shape (N, 3), written exactly in single precision.
        polygons: Vertex indices, shape (F, 3) or (F, 4); triangles among quads end in -1.
        uv: Texture coordinates, shape (U, 2).
        polygon_uvs: Indices into ``uv``, of the same shape as ``polygons``.
        normals: Vertex normals, shape (N, 3).
        groups: Named ranges of faces.
        comment: First line of the file.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    writer = ObjWriter(polygons, uv, polygon_uvs, normals is not None, groups, comment)
    writer.write(path, vertices, normals)


class ObjWriter:
    """Writer of a surface in many poses, which formats everything except positions and normals only once."""

    def __init__(
        self,
        polygons: NDArray[np.integer],
        uv: ArrayLike | None = None,
        polygon_uvs: NDArray[np.integer] | None = None,
        with_normals: bool = False,
        groups: Sequence[Group] = (),
        comment: str = "",
        library: str = "",
    ) -> None:
        """Format the parts that do not depend on the pose.

        Args:
            polygons: Vertex indices, as in ``write_obj``.
            uv: Texture coordinates, as in ``write_obj``.
            polygon_uvs: Indices into ``uv``, as in ``write_obj``.
            with_normals: True if normals are written.
            groups: Named ranges of faces.
            comment: First line of the file.
            library: Name of the material library in the same folder; "" for none.
        """
        self._head = [f"# {comment}"] if comment else []
        self._head += [f"mtllib {library}"] if library else []
        self._uv = _rows("vt", np.asarray(uv), "%.7g") if uv is not None else []
        textures = polygon_uvs if uv is not None else None
        faces = [
            _face(face, None if textures is None else textures[i], with_normals) for i, face in enumerate(polygons)
        ]
        self._faces: list[str] = []
        done = 0
        for group in groups:
            self._faces += faces[done : group.polygons[0]]
            if group.name:
                self._faces.append(f"g {writable_name(group.name)}")
            if group.material:
                self._faces.append(f"usemtl {writable_name(group.material)}")
            self._faces += faces[group.polygons[0] : group.polygons[1]]
            done = group.polygons[1]
        self._faces += faces[done:]

    def write(self, path: Path, vertices: ArrayLike, normals: ArrayLike | None = None) -> None:
        """Write the surface with ``vertices`` and ``normals``, each (N, 3), atomically to ``path``.

        Raises:
            FacePoserError: If the file cannot be written.
        """
        write_text(path, self.text(vertices, normals), "mesh")

    def text(self, vertices: ArrayLike, normals: ArrayLike | None = None) -> str:
        """Return the content of the file for ``vertices`` and ``normals``, each (N, 3)."""
        lines = [*self._head, *_rows("v", np.asarray(vertices), "%.9g"), *self._uv]
        if normals is not None:
            lines += _rows("vn", np.asarray(normals), "%.5f")
        return "\n".join([*lines, *self._faces]) + "\n"


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


def read_obj(path: Path) -> PolygonMesh:
    """Read the mesh in the OBJ file ``path``; ``g``, ``o`` and ``usemtl`` begin groups.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If a line is invalid.
    """
    tables: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    polygons: list[tuple[int, ...]] = []
    polygon_uvs: list[tuple[int, ...]] = []
    groups: list[Group] = []
    name = material = ""
    began = 0

    def close_group() -> None:
        if len(polygons) > began and (name or material):
            groups.append(Group(name, (began, len(polygons)), material))

    with open_text(path, errors="replace") as file:
        for number, line in enumerate(file, 1):
            keyword, *words = line.partition("#")[0].split(None, 1) or [""]
            rest = words[0] if words else ""
            try:
                if keyword in tables:
                    width = 2 if keyword == "vt" else 3
                    row = [_number(word) for word in rest.split()[:width]]
                    if len(row) != width:
                        raise ValueError(f"'{keyword}' needs {width} numbers")
                    tables[keyword].append(row)
                elif keyword == "f":
                    corners = [corner.split("/") for corner in rest.split()]
                    if len(corners) < 3:
                        raise ValueError("a face needs at least 3 corners")
                    if len(corners) > _MOST_CORNERS:
                        raise ValueError(f"a face of {len(corners)} corners is too large; split it into smaller ones")
                    polygons.append(tuple(_index(c[0], len(tables["v"])) for c in corners))
                    if all(len(c) > 1 and c[1] for c in corners):
                        polygon_uvs.append(tuple(_index(c[1], len(tables["vt"])) for c in corners))
                elif keyword in ("g", "o", "usemtl"):
                    close_group()
                    began = len(polygons)
                    if keyword == "usemtl":
                        material = rest.strip()
                    else:
                        name = rest.strip()
            except ValueError as error:
                raise FacePoserError(f"The mesh '{path}' is broken at line {number}: {error}.") from error
    close_group()
    whole = len(polygon_uvs) == len(polygons)
    return PolygonMesh(
        np.array(tables["v"], dtype=np.float64).reshape(-1, 3),
        pad_polygons(polygons),
        np.array(tables["vt"] if whole else [], dtype=np.float64).reshape(-1, 2),
        pad_polygons(polygon_uvs) if whole else no_polygons(),
        np.array(tables["vn"], dtype=np.float64).reshape(-1, 3),
        tuple(groups),
    )


def read_obj_positions(path: Path) -> NDArray[np.float64]:
    """Read only the vertices of the OBJ file ``path``, shape (N, 3), many times faster than ``read_obj``.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If the line of a vertex is invalid.
    """
    return _positions(path, read_bytes(path).splitlines())


def read_obj_positions_and_digest(path: Path) -> tuple[NDArray[np.float64], str]:
    """Read the vertices of the OBJ file ``path``, shape (N, 3), and a digest of the vertex indices of its faces.

    Files with equal digests have the same faces. The digest is "" if indices count from the end, as their meaning
    depends on their position.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If the line of a vertex is invalid.
    """
    data = read_bytes(path)
    vertices, faces = _run_of(data, b"v "), _run_of(data, b"f ")
    if vertices is not None and faces is not None:
        numbers = _numbers(vertices.replace(b"\nv ", b"\n")[2:])
        # Rows of six numbers have colours; all other files are read line by line.
        rows = vertices.count(b"\n") + 1
        if numbers is not None and len(numbers) in (3 * rows, 6 * rows):
            return np.ascontiguousarray(numbers.reshape(rows, -1)[:, :3]), _digest(faces)
    lines = data.splitlines()
    return _positions(path, lines), _digest(b"\n".join(line for line in lines if line.startswith((b"f ", b"f\t"))))


def _run_of(data: bytes, keyword: bytes) -> bytes | None:
    """Return the lines that begin with ``keyword`` if they are consecutive and plain, else None."""
    start = 0 if data.startswith(keyword) else data.find(b"\n" + keyword) + 1
    last = data.rfind(b"\n" + keyword) + 1
    end = data.find(b"\n", max(last, start))
    run = data[start : len(data) if end < 0 else end]
    if not run.startswith(keyword) or b"\r" in run or run.count(b"\n" + keyword) != run.count(b"\n"):
        return None
    # Other lines may have a tab after the keyword.
    return None if b"\n" + keyword[:1] + b"\t" in data else run


@lru_cache(maxsize=4)
def _digest(faces: bytes) -> str:
    """Return a digest of the lines of faces; cached, since files of a sequence have the same faces."""
    # Indices of texture coordinates and normals are ignored, as exporters number them differently in each file.
    plain = re.sub(rb"/\S*", b"", faces)
    return "" if b"-" in plain else hashlib.blake2b(plain).hexdigest()


def _positions(path: Path, lines: list[bytes]) -> NDArray[np.float64]:
    rows = [line[2:] for line in lines if line.startswith((b"v ", b"v\t"))]
    numbers = _numbers(b" ".join(rows))
    # Rows of six numbers have colours; all other files are read line by line.
    for columns in (3, 6):
        if numbers is not None and len(numbers) == columns * len(rows):
            return np.ascontiguousarray(numbers.reshape(-1, columns)[:, :3])
    return read_obj(path).vertices


def _numbers(text: bytes) -> NDArray[np.float64] | None:
    """Return the numbers in ``text``; None or too few if it contains anything else."""
    try:
        # Anything else causes a hidden DeprecationWarning and truncates the result, which callers detect by its length.
        # Turning the warning into an error temporarily would not be thread-safe.
        return np.fromstring(text.decode("ascii"), dtype=np.float64, sep=" ")
    except (DeprecationWarning, UnicodeDecodeError, ValueError):
        return None


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise ValueError(f"'{word[:20]}' is not a number") from None


def _index(word: str, count: int) -> int:
    """Return the zero-based index of OBJ's index ``word``, which counts from 1, or from the end if negative."""
    try:
        value = int(word)
    except ValueError:
        raise ValueError(f"'{word[:20]}' is not an index") from None
    index = value - 1 if value > 0 else count + value
    if value == 0 or not 0 <= index < count:
        raise ValueError(f"index {value} is out of range for the {count} entries listed before")
    return index
