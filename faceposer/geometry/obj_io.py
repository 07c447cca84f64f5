"""Reading and writing of Wavefront OBJ, preserving the order of vertices, faces and texture coordinates."""

import codecs
import hashlib
import re
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files.atomic import write_text
from faceposer.files.reading import read_bytes
from faceposer.files.writing import check_finite
from faceposer.geometry.mtl_io import writable_name
from faceposer.geometry.obj_arrays import numbers_in, parsed_at_once
from faceposer.geometry.obj_blocks import UTF16, WIDTHS, Counts, read_blocks
from faceposer.geometry.obj_lines import parsed_by_line
from faceposer.geometry.polygon_mesh import Group, PolygonMesh, no_polygons, padded

# Limits on groups, on lines that are parsed one by one, and on the cells of the array of polygons, which is as wide as
# the largest face.
_MOST_GROUPS, _MOST_SLOW, _MOST_CELLS = 100_000, 500_000, 40_000_000


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
        check_finite(path, "mesh", vertices, () if normals is None else normals)
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

    Names are kept to the letter. Text is UTF-8, with or without a byte order mark, or UTF-16 with one; a name that is
    not valid UTF-8 is read as Windows-1252.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If a line is invalid, or there are far too many groups, or corners of faces.
    """
    rows: dict[str, list[NDArray[np.float64]]] = {keyword: [] for keyword in WIDTHS}
    sizes: list[NDArray[np.int32]] = []
    corners: list[NDArray[np.int32]] = []
    textures: list[NDArray[np.int32]] = []
    has_textures = True
    count = began = slow = 0
    groups: list[Group] = []
    libraries: dict[str, None] = {}
    name = material = ""

    def close_group(end: int) -> None:
        if end > began and (name or material):
            groups.append(Group(name, (began, end), material))
            if len(groups) > _MOST_GROUPS:
                raise FacePoserError(
                    f"The mesh '{path}' has more than {_MOST_GROUPS:,} groups of faces; export it without groups."
                )

    before = Counts()
    for block in read_blocks(path):
        parsed = parsed_at_once(block, before) or parsed_by_line(block, before, path)
        for keyword, values in parsed.rows.items():
            rows[keyword].append(values)
        before = before.after(parsed.rows)
        slow += parsed.slow + len(parsed.names)
        if slow > _MOST_SLOW:
            raise FacePoserError(
                f"The mesh '{path}' has more than {_MOST_SLOW:,} lines of names, or of an unusual form; export the "
                "face only, without groups."
            )
        sizes.append(parsed.sizes)
        corners.append(parsed.corners)
        if parsed.textures is None:
            has_textures = False
        elif has_textures:
            textures.append(parsed.textures)
        for first, keyword, rest in parsed.names:
            if keyword == "mtllib":
                libraries[rest] = None
                continue
            close_group(count + first)
            began = count + first
            if keyword == "usemtl":
                material = rest
            else:
                name = rest
        count += len(parsed.sizes)
    close_group(count)
    lengths = np.concatenate([*sizes, np.zeros(0, np.int32)])
    columns = int(lengths.max(initial=3))
    if len(lengths) * columns > _MOST_CELLS:
        raise FacePoserError(
            f"The mesh '{path}' has {counted(len(lengths), 'face')} of up to {columns} corners, which is too "
            "many; export it with faces of 3 or 4 corners."
        )
    return PolygonMesh(
        np.concatenate([*rows["v"], np.zeros((0, 3))]),
        padded(corners, lengths),
        np.concatenate([*(rows["vt"] if has_textures else []), np.zeros((0, 2))]),
        padded(textures, lengths) if has_textures else no_polygons(),
        np.concatenate([*rows["vn"], np.zeros((0, 3))]),
        tuple(groups),
        tuple(libraries),
    )


def _content(path: Path) -> bytes:
    """Return the content of the OBJ file ``path`` as UTF-8 with each statement on a single line.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If it is not valid UTF-16.
    """
    data = read_bytes(path)
    if data.startswith(UTF16):
        try:
            data = data.decode("utf-16").encode("utf-8")
        except UnicodeError as error:
            raise FacePoserError(f"The mesh '{path}' is not valid UTF-16; export it again.") from error
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\\" in data:
        data = re.sub(rb"(?m)^[ \t]*#[^\r\n]*", b"", data)
        data = re.sub(rb"\\[ \t]*(?:\r\n?|\n)", b" ", data)
    return data


def read_obj_positions_and_digest(path: Path) -> tuple[NDArray[np.float64], str]:
    """Read the vertices of the OBJ file ``path``, shape (N, 3), and a digest of the vertex indices of its faces, fast.

    Files with equal digests have the same faces. The digest is "" if indices count from the end, as their meaning
    depends on their position.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If the line of a vertex is invalid.
    """
    data = _content(path)
    vertices, faces = _run_of(data, b"v "), _run_of(data, b"f ")
    if vertices is not None and faces is not None:
        numbers = numbers_in(vertices.replace(b"\nv ", b"\n")[2:], np.float64)
        # Rows of six numbers have colours; all other files are read line by line.
        rows = vertices.count(b"\n") + 1
        if numbers is not None and len(numbers) in (3 * rows, 6 * rows):
            return np.ascontiguousarray(numbers.reshape(rows, -1)[:, :3]), _digest(faces)
    lines = data.splitlines()
    return _positions(path, lines), _digest(b"\n".join(line for line in lines if line.startswith((b"f ", b"f\t"))))


def read_obj_colours(path: Path, n_vertices: int) -> NDArray[np.float64]:
    """Return the colours of the vertices of the OBJ file ``path``, 0 to 255, shape (N, 3), or (0, 3).

    They are the fourth to sixth number of each vertex, which many programs write, from 0 to 1 or to 255. Only files are
    read that have them at all vertices, in consecutive lines.

    Raises:
        OSError: If the file cannot be read.
    """
    vertices = _run_of(_content(path), b"v ")
    numbers = None if vertices is None else numbers_in(vertices.replace(b"\nv ", b"\n")[2:], np.float64)
    if numbers is None or len(numbers) != 6 * n_vertices:
        return np.zeros((0, 3))
    colours = numbers.reshape(-1, 6)[:, 3:]
    if not np.isfinite(colours).all():
        return np.zeros((0, 3))
    scale = 255.0 if colours.max(initial=0.0) <= 1.0 else 1.0
    return np.clip(colours * scale, 0.0, 255.0)


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
    numbers = numbers_in(b" ".join(rows), np.float64)
    # Rows of six numbers have colours; all other files are read line by line.
    for columns in (3, 6):
        if numbers is not None and len(numbers) == columns * len(rows):
            return np.ascontiguousarray(numbers.reshape(-1, columns)[:, :3])
    return read_obj(path).vertices
