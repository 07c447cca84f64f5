"""Reading and writing of Wavefront OBJ, preserving the order of vertices, faces and texture coordinates."""

import codecs
import hashlib
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.reading import open_file, open_text, read_bytes
from faceposer.files.writing import check_finite
from faceposer.geometry.mtl_io import writable_name
from faceposer.geometry.polygon_mesh import Group, PolygonMesh, no_polygons, pad_polygons

# Limit on the corners of a face, since the array of polygons is as wide as the largest.
_MOST_CORNERS = 128
# Limit on the length of a statement with its continuation lines, in characters.
_LONGEST_STATEMENT = 1 << 16
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_SPACE = " \t\r\n\f\v"
# Statements whose argument is a name, in which a "#" is a character like any other.
_NAMES = ("g", "o", "usemtl", "mtllib")


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
        FacePoserError: If a line is invalid.
    """
    tables: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    polygons: list[tuple[int, ...]] = []
    polygon_uvs: list[tuple[int, ...]] = []
    groups: list[Group] = []
    libraries: list[str] = []
    name = material = ""
    began = 0

    def close_group() -> None:
        if len(polygons) > began and (name or material):
            groups.append(Group(name, (began, len(polygons)), material))

    for number, keyword, rest in _statements(path):
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
            elif keyword == "mtllib":
                libraries.append(rest)
            elif keyword in _NAMES:
                close_group()
                began = len(polygons)
                if keyword == "usemtl":
                    material = rest
                else:
                    name = rest
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
        tuple(libraries),
    )


def _statements(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield the line number, the keyword and the argument of each statement, without comments.

    A backslash at the end of a line continues the statement on the next one, except in comments, which may end in a
    Windows path.
    """
    with open_file(path) as file:
        start = file.read(3)
    is_utf16 = start.startswith(_UTF16)
    # Latin-1 preserves all bytes, so that only names have to be decoded.
    with open_text(path, "utf-16" if is_utf16 else "latin-1") as file:
        if start == codecs.BOM_UTF8:
            file.read(3)
        begun = ""
        number = 0
        try:
            for number, line in enumerate(file, 1):
                text = begun + line
                begun = ""
                if "#" in text and text.lstrip(_SPACE).startswith("#"):
                    continue
                if "\\" in text and (plain := text.rstrip(_SPACE)).endswith("\\"):
                    begun = plain[:-1] + " "
                    if len(begun) > _LONGEST_STATEMENT:
                        raise FacePoserError(
                            f"The mesh '{path}' is broken at line {number}: a continued statement is longer than "
                            f"{_LONGEST_STATEMENT} characters; export it again."
                        )
                    continue
                if (found := _statement(text, is_utf16)) is not None:
                    yield number, *found
            if (found := _statement(begun, is_utf16)) is not None:
                yield number, *found
        except UnicodeError as error:
            raise FacePoserError(
                f"The mesh '{path}' is broken after line {number}: it is not valid UTF-16; export it again."
            ) from error


def _statement(text: str, decoded: bool) -> tuple[str, str] | None:
    """Return the keyword and the argument in ``text``; None if it is empty."""
    keyword, *words = text.split(None, 1) or [""]
    if not keyword:
        return None
    rest = words[0] if words else ""
    if keyword not in _NAMES:
        return keyword, rest.partition("#")[0] if "#" in rest else rest
    return keyword, (rest if decoded else decoded_name(rest.encode("latin-1"))).strip(_SPACE)


def decoded_name(name: bytes) -> str:
    """Return a ``name`` from a file as text: UTF-8, or else Windows-1252 as older exporters write it."""
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("cp1252", errors="replace")


def obj_content(path: Path) -> bytes:
    """Return the content of the OBJ file ``path`` as UTF-8 with each statement on a single line.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If it is not valid UTF-16.
    """
    data = read_bytes(path)
    if data.startswith(_UTF16):
        try:
            data = data.decode("utf-16").encode("utf-8")
        except UnicodeError as error:
            raise FacePoserError(f"The mesh '{path}' is not valid UTF-16; export it again.") from error
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\\" in data:
        data = re.sub(rb"(?m)^[ \t]*#[^\r\n]*", b"", data)
        data = re.sub(rb"\\[ \t]*(?:\r\n?|\n)", b" ", data)
    return data


def read_obj_positions(path: Path) -> NDArray[np.float64]:
    """Read only the vertices of the OBJ file ``path``, shape (N, 3), many times faster than ``read_obj``.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If the line of a vertex is invalid.
    """
    return _positions(path, obj_content(path).splitlines())


def read_obj_positions_and_digest(path: Path) -> tuple[NDArray[np.float64], str]:
    """Read the vertices of the OBJ file ``path``, shape (N, 3), and a digest of the vertex indices of its faces.

    Files with equal digests have the same faces. The digest is "" if indices count from the end, as their meaning
    depends on their position.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If the line of a vertex is invalid.
    """
    data = obj_content(path)
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
        raise ValueError(f"'{word[:20]}' is not the index of a vertex") from None
    index = value - 1 if value > 0 else count + value
    if value == 0 or not 0 <= index < count:
        raise ValueError(f"index {value} is out of range for the {count} entries listed before")
    return index
