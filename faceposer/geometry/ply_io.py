"""Reading of text and binary PLY and writing of binary PLY, preserving the order of vertices and face corners."""

import re
import warnings
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files.atomic import atomic_file
from faceposer.files.numbers import plain_float
from faceposer.files.reading import read_bytes
from faceposer.files.writing import check_finite
from faceposer.geometry.polygon_mesh import PolygonMesh, no_polygons, pad_polygons

_CODES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
_TYPES = {
    **dict(zip(("char", "uchar", "short", "ushort", "int", "uint", "float", "double"), _CODES, strict=True)),
    **dict(zip(("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"), _CODES, strict=True)),
}
_ENDIANS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER = 1 << 16
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_COLOUR_NAMES = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
_MAX_CORNERS = 255
#: Limit on the entries of a table of lists, which is as wide as the longest list.
_MAX_ENTRIES = 1 << 28


@dataclass(frozen=True)
class _Property:
    """A property of an element: a number of type ``dtype``, or a list of these with a length of type ``counter``."""

    name: str
    dtype: str
    counter: str = ""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def write_ply(
    path: Path, vertices: ArrayLike, polygons: NDArray[np.integer], normals: ArrayLike, comment: str = ""
) -> None:
    """Write a binary PLY atomically, little-endian and in single precision.

    Args:
        path: Path of the file.
        vertices: Positions, shape (N, 3).
        polygons: Vertex indices, shape (F, K); faces of fewer corners end in -1.
        normals: Vertex normals, shape (N, 3).
        comment: Comment in the header.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    check_finite(path, "mesh", vertices, normals)
    points = np.hstack([np.asarray(vertices, dtype="<f4"), np.asarray(normals, dtype="<f4")])
    header = ["ply", "format binary_little_endian 1.0", *([f"comment {comment}"] if comment else [])]
    header += [f"element vertex {len(points)}", *(f"property float {name}" for name in ("x", "y", "z"))]
    header += [*(f"property float {name}" for name in ("nx", "ny", "nz")), f"element face {len(polygons)}"]
    header += ["property list uchar int vertex_indices", "end_header", ""]
    inside = polygons >= 0
    rows = np.empty(len(polygons), dtype=[("count", "u1"), ("corners", "<i4", (polygons.shape[1],))])
    rows["count"] = inside.sum(axis=1)
    rows["corners"] = polygons
    written = np.hstack([np.ones((len(polygons), 1), dtype=bool), np.repeat(inside, 4, axis=1)])
    faces = rows.view(np.uint8).reshape(len(polygons), -1)[written]
    with atomic_file(path, "mesh") as temporary:
        temporary.write_bytes("\n".join(header).encode("utf-8") + points.tobytes() + faces.tobytes())


def read_ply(path: Path) -> PolygonMesh:
    """Read the mesh in the PLY file ``path``, with colours and texture coordinates of its vertices or face corners.

    Source: G. Turk, The PLY Polygon File Format (1994).

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If it is invalid or truncated.
    """
    data = read_bytes(path)
    try:
        text, endian, elements, body = _parse_header(data)
        columns = _read(memoryview(data)[body:], text, endian, elements)
        return _mesh(columns)
    except ValueError as error:
        raise FacePoserError(f"The mesh '{path}' is broken: {error}; export it again.") from error


def _parse_header(data: bytes) -> tuple[bool, str, list[_Element], int]:
    """Return True if the numbers are text, the byte order, the elements, and the offset of the first number."""
    head = re.match(rb"ply\r?\n(.*?\n)?end_header[ \t]*(\r\n|\n)", data[:_MAX_HEADER], re.DOTALL)
    if head is None:
        raise ValueError("it does not begin with a PLY header")
    form = ""
    elements: list[_Element] = []
    for number, line in enumerate(head[0].decode("latin-1").splitlines(), 1):
        words = line.split()
        keyword = words[0] if words else ""
        try:
            if keyword == "format":
                form = words[1]
            elif keyword == "element" and words[2].isdecimal():
                # Every element takes at least one byte.
                if len(words[2]) > 12 or int(words[2]) > len(data):
                    raise ValueError(f"the file is too short for {words[2][:20]} of '{words[1]}'")
                elements.append(_Element(words[1], int(words[2])))
            elif keyword == "element":
                raise IndexError
            elif keyword == "property" and words[1] == "list":
                elements[-1].properties.append(_Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif keyword == "property":
                elements[-1].properties.append(_Property(words[2], _TYPES[words[1]]))
        except (IndexError, KeyError) as error:
            raise ValueError(f"line {number} of its header is invalid") from error
    if form not in _ENDIANS:
        raise ValueError(f"its format is '{form[:30]}', not one of {', '.join(_ENDIANS)}")
    return form == "ascii", _ENDIANS[form], elements, head.end()


def _read(body: memoryview, text: bool, endian: str, elements: list[_Element]) -> dict[tuple[str, str], NDArray[Any]]:
    """Return the columns by (element, property); lists are padded with -1, with their lengths in another column."""
    if text:
        numbers = _numbers(bytes(body))
        # From here on, the numbers are treated like a binary file of doubles.
        body, endian = memoryview(numbers.tobytes()), "="
        double = [_Property(p.name, "f8", "f8" if p.counter else "") for e in elements for p in e.properties]
        kept = iter(double)
        elements = [_Element(e.name, e.count, [next(kept) for _ in e.properties]) for e in elements]
    columns: dict[tuple[str, str], NDArray[Any]] = {}
    at = 0
    for element in elements:
        if not element.count or not element.properties:
            continue
        at = _read_element(body, at, endian, element, columns)
    return columns


def _numbers(text: bytes) -> NDArray[np.float64]:
    """Return all numbers of ``text``."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            pass
    for number, line in enumerate(text.splitlines(), 1):
        try:
            [plain_float(word.decode("latin-1")) for word in line.split()]
        except ValueError as error:
            raise ValueError(f"line {number} after its header has a value that is not a number") from error
    return np.array(text.split(), dtype=np.float64)


def _read_element(
    body: memoryview, at: int, endian: str, element: _Element, columns: dict[tuple[str, str], NDArray[Any]]
) -> int:
    """Add the columns of ``element``, which begins at byte ``at``, and return the offset of its end."""
    lists = [i for i, p in enumerate(element.properties) if p.counter]
    starts = at
    kinds: list[tuple[int, ...]] = []
    rows: list[NDArray[np.void]] = []
    done = 0
    # Rows are read in runs with lists of equal lengths, of which there are usually few.
    while done < element.count:
        lengths = _lengths(body, starts, endian, element, done)
        dtype = _row_type(tuple(element.properties), endian, lengths)
        most = min(element.count - done, (len(body) - starts) // dtype.itemsize)
        if most < 1:
            raise ValueError(f"it is truncated in '{element.name}' {done + 1} of {element.count}")
        # The look-ahead grows with the length of runs, so that mixed faces are not read over and over.
        run = min(most, 2 * len(rows[-1]) + 16 if rows else most)
        table = np.frombuffer(body, dtype, run, starts)
        same = np.ones(run, dtype=bool)
        for i, length in zip(lists, lengths, strict=True):
            same &= table[f"n{i}"] == length
        run = run if same.all() else int(np.argmin(same))
        rows.append(table[:run])
        kinds.append(lengths)
        done += run
        starts += run * dtype.itemsize
    for i, column in enumerate(element.properties):
        if i not in lists:
            columns[element.name, column.name] = np.concatenate([table[f"p{i}"] for table in rows])
            continue
        wide = max(lengths[lists.index(i)] for lengths in kinds)
        if element.count * wide > _MAX_ENTRIES:
            raise ValueError(
                f"its {counted(element.count, 'list')} of up to {wide} entries in '{element.name}' are too large"
            )
        values = np.full((element.count, wide), -1.0)
        counts = np.zeros(element.count, dtype=np.intp)
        row = 0
        for table, lengths in zip(rows, kinds, strict=True):
            length = lengths[lists.index(i)]
            values[row : row + len(table), :length] = table[f"p{i}"].reshape(len(table), length)
            counts[row : row + len(table)] = length
            row += len(table)
        columns[element.name, column.name] = values
        columns[element.name, f"{column.name} lengths"] = counts
    return starts


@cache
def _row_type(properties: tuple[_Property, ...], endian: str, lengths: tuple[int, ...]) -> np.dtype[np.void]:
    """Return the type of a row with lists of the given ``lengths``, up to the first unknown length."""
    fields: list[Any] = []
    known = iter(lengths)
    for i, column in enumerate(properties):
        if not column.counter:
            fields.append((f"p{i}", endian + column.dtype))
            continue
        fields.append((f"n{i}", endian + column.counter))
        length = next(known, None)
        if length is None:
            break
        fields.append((f"p{i}", endian + column.dtype, (length,)))
    return np.dtype(fields)


def _lengths(body: memoryview, at: int, endian: str, element: _Element, row: int) -> tuple[int, ...]:
    """Return the lengths of the lists in the row that begins at byte ``at``."""
    lengths: list[int] = []
    for i, column in enumerate(element.properties):
        if not column.counter:
            continue
        dtype = _row_type(tuple(element.properties), endian, tuple(lengths))
        if at + dtype.itemsize > len(body):
            raise ValueError(f"it is truncated in '{element.name}' {row + 1} of {element.count}")
        length = np.frombuffer(body, dtype, 1, at)[f"n{i}"][0]
        if not 0 <= length <= 2 * _MAX_CORNERS or length != int(length):
            raise ValueError(f"'{element.name}' {row + 1} has a list of {length} entries")
        lengths.append(int(length))
    return tuple(lengths)


def _mesh(columns: dict[tuple[str, str], NDArray[Any]]) -> PolygonMesh:
    vertices = _table(columns, ("x", "y", "z"))
    if vertices is None:
        raise ValueError("it has no vertices with x, y and z")
    # A list has another column with its lengths.
    names = ("vertex_indices", "vertex_index")
    name = next((n for n in names if {("face", n), ("face", f"{n} lengths")} <= columns.keys()), None)
    if name is None:
        return PolygonMesh(vertices, no_polygons())
    polygons, lengths = columns["face", name], columns["face", f"{name} lengths"]
    if lengths.min() < 3:
        raise ValueError(f"face {int(np.argmin(lengths)) + 1} has fewer than 3 corners")
    inside = np.arange(polygons.shape[1]) < lengths[:, None]
    wrong = (inside & ((polygons < 0) | (polygons >= len(vertices)) | (polygons % 1 != 0))).any(axis=1)
    if wrong.any():
        raise ValueError(
            f"face {int(np.argmax(wrong)) + 1} has a corner outside the {counted(len(vertices), 'vertex', 'vertices')}"
        )
    faces = polygons.astype(np.int32)
    uv, polygon_uvs = np.zeros((0, 2)), no_polygons()
    for names in _UV_NAMES:
        of_vertices = _table(columns, names)
        if of_vertices is not None:
            uv, polygon_uvs = of_vertices, faces
            break
    corners = columns.get(("face", "texcoord"))
    if corners is not None and np.array_equal(columns.get(("face", "texcoord lengths"), ()), 2 * lengths):
        uv = corners.reshape(len(faces), -1, 2)[inside]
        ends = np.cumsum(lengths).tolist()
        polygon_uvs = pad_polygons([tuple(range(end - n, end)) for end, n in zip(ends, lengths.tolist(), strict=True)])
    normals = _table(columns, ("nx", "ny", "nz"))
    return PolygonMesh(
        vertices,
        faces,
        uv,
        polygon_uvs,
        np.zeros((0, 3)) if normals is None else normals,
        colours=_colours(columns),
    )


def _colours(columns: dict[tuple[str, str], NDArray[Any]]) -> NDArray[np.float64]:
    """Return the colours of the vertices, 0 to 255, shape (N, 3), or (0, 3) if there are none."""
    for names in _COLOUR_NAMES:
        found = _table(columns, names)
        if found is not None and np.isfinite(found).all():
            # Whole numbers are bytes; others, and those of text, are shares if none is larger than 1.
            shares = columns["vertex", names[0]].dtype.kind == "f" and found.max(initial=0.0) <= 1.0
            return np.clip(found * (255.0 if shares else 1.0), 0.0, 255.0)
    return np.zeros((0, 3))


def _table(columns: dict[tuple[str, str], NDArray[Any]], names: tuple[str, ...]) -> NDArray[np.float64] | None:
    """Return the columns ``names`` of the vertices as one array, (N, len(names)), or None if one is missing."""
    found = [columns.get(("vertex", name)) for name in names]
    if any(column is None or column.ndim != 1 for column in found):
        return None
    return np.stack([np.asarray(column, dtype=np.float64) for column in found], axis=1)
