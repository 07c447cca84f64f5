"""Reading of meshes in the OFF format (Geomview), in text, with colours, normals or texture coordinates ignored."""

import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError, counted
from faceposer.files.numbers import plain_float
from faceposer.files.reading import open_text
from faceposer.geometry.polygon_mesh import PolygonMesh, pad_polygons

_MAX_BYTES = 128 << 20
_MAX_CORNERS, _MAX_CELLS = 1_000, 50_000_000
# "ST", "C" and "N" are for texture coordinates, colours and normals; "4" and "n" for other dimensions than three.
_HEADER = re.compile(r"(ST)?C?N?OFF")
_OTHER = re.compile(r"(ST)?C?N?4?n?OFF( BINARY)?")
_INTEGER = re.compile(r"[+-]?[0-9]{1,12}")
_Lines = Iterator[tuple[int, list[str]]]


def read_off(path: Path) -> PolygonMesh:
    """Read the mesh in the OFF file ``path``.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If it is invalid or truncated.
    """
    with open_text(path, "utf-8-sig", "replace", max_bytes=_MAX_BYTES) as file:
        lines = ((number, words) for number, line in enumerate(file, 1) if (words := line.partition("#")[0].split()))
        n_vertices, n_faces = _counts(path, lines)
        vertices: list[list[float]] = []
        polygons: list[tuple[int, ...]] = []
        widest = 3
        for number, words in _rows(path, lines, n_vertices, "vertex", "vertices"):
            vertices.append([_number(path, number, word) for word in words[:3]])
            if len(vertices[-1]) < 3:
                raise _error(path, number, "a vertex has fewer than 3 coordinates")
        for number, words in _rows(path, lines, n_faces, "face", "faces"):
            count = _integer(path, number, words[0])
            if not 3 <= count <= _MAX_CORNERS:
                # Points and segments are not faces.
                if count in (1, 2):
                    continue
                raise _error(path, number, f"a face has {counted(count, 'corner')}, not 3 to {_MAX_CORNERS}")
            face = [_integer(path, number, word) for word in words[1 : 1 + count]]
            if len(face) < count:
                raise _error(path, number, f"a face of {count} corners has only {len(face)}")
            if min(face) < 0 or max(face) >= n_vertices:
                raise _error(path, number, f"a corner is not one of the {counted(n_vertices, 'vertex', 'vertices')}")
            polygons.append(tuple(face))
            widest = max(widest, count)
            if len(polygons) * widest > _MAX_CELLS:
                raise _error(path, number, "its faces have too many corners; export it with faces of 3 or 4 corners")
    return PolygonMesh(np.array(vertices, dtype=np.float64).reshape(-1, 3), pad_polygons(polygons))


def _counts(path: Path, lines: _Lines) -> tuple[int, int]:
    """Return the numbers of vertices and faces; the keyword before them may be on their line, or missing."""
    number, words = next(lines, (1, []))
    if words and _HEADER.fullmatch(words[0]) and words[1:2] != ["BINARY"]:
        words = words[1:]
        if not words:
            number, words = next(lines, (number, []))
    elif words and _OTHER.fullmatch(" ".join(words[:2])):
        raise _error(path, number, f"'{' '.join(words[:2])}' is not supported; export it as text, in three dimensions")
    counts = [_integer(path, number, word) for word in words[:2]]
    if len(counts) < 2 or min(counts) < 0:
        raise _error(path, number, "the numbers of vertices and faces are missing")
    return counts[0], counts[1]


def _rows(path: Path, lines: _Lines, count: int, one: str, many: str) -> _Lines:
    for done in range(count):
        row = next(lines, None)
        if row is None:
            raise FacePoserError(
                f"The mesh '{path}' is truncated: it declares {counted(count, one, many)}, but has {done}; copy or "
                "export it again."
            )
        yield row


def _integer(path: Path, number: int, word: str) -> int:
    # Some programs write indices as "1.0"; colours after the corners are not read.
    value = _number(path, number, word) if not _INTEGER.fullmatch(word) else int(word)
    return int(value) if math.isfinite(value) and abs(value) < 1e12 else -1


def _number(path: Path, number: int, word: str) -> float:
    try:
        return plain_float(word)
    except ValueError:
        raise _error(path, number, f"'{word[:40]}' is not a number") from None


def _error(path: Path, number: int, reason: str) -> FacePoserError:
    return FacePoserError(f"Line {number} of the mesh '{path}' is invalid: {reason}; export it again.")
