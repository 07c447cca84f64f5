"""Sequences of meshes of the same topology, in folders or arrays, read in bounded memory."""

import lzma
import math
import re
import struct
import zipfile
import zlib
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.files.names import is_hidden
from faceposer.files.reading import open_file
from faceposer.geometry.mesh import first_unusable
from faceposer.geometry.mesh_io import MESH_SUFFIXES, read_mesh
from faceposer.geometry.obj_io import read_obj_positions_and_digest
from faceposer.geometry.polygon_mesh import PolygonMesh

Array = NDArray[np.float64]

ARRAY_SUFFIX = ".npz"
_VERTICES = "vertices.npy"
_NEUTRAL_WORDS = ("neutral", "rest", "base")
_MAX_FRAMES = 1_000_000
_MAX_FILE_BYTES = 1 << 30
_FACES = "faces.npy"
_WRONG_FACES = "The faces in '{}' must be vertex numbers from 0, shape (T, 3) or (T, 4)."
# Errors of zipfile and NumPy for damaged archives, of compression methods that they do not support included.
_DAMAGED = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, ValueError, RuntimeError)


@dataclass(frozen=True)
class _Source:
    """A file with the frames ``first`` to ``first + count - 1``; a compressed one can only be read in order."""

    path: Path
    first: int
    count: int
    compressed: bool = False


@dataclass(frozen=True, eq=False)
class MeshSequence:
    """A sequence of meshes of the same topology, which can be read repeatedly and pickled.

    Attributes:
        neutral: The neutral mesh, which defines the topology.
        neutral_name: Name of the neutral mesh in messages.
        sources: The files in order.
        face_digest: Digest of the faces in the neutral OBJ file; "" if there is none.
        neutral_path: File of the neutral mesh; None if it is not an OBJ file.
    """

    neutral: PolygonMesh
    neutral_name: str
    sources: tuple[_Source, ...]
    face_digest: str = ""
    neutral_path: Path | None = None

    def __len__(self) -> int:
        return self.sources[-1].first + self.sources[-1].count if self.sources else 0

    @property
    def compressed(self) -> bool:
        """True if random access is slow, since a file must be decompressed from its beginning."""
        return any(source.compressed for source in self.sources)

    def absolute(self) -> "MeshSequence":
        """Return the sequence with absolute paths."""
        return replace(self, sources=tuple(replace(source, path=source.path.absolute()) for source in self.sources))

    def read(self, first: int, stop: int) -> Iterator[Array]:
        """Yield the vertices, (N, 3), of the frames from ``first`` to ``stop - 1``.

        Raises:
            FacePoserError: If a file is damaged or its topology differs from the neutral mesh.
        """
        return self.pick(range(first, stop))

    def pick(self, frames: Sequence[int]) -> Iterator[Array]:
        """Yield the vertices, (N, 3), of ``frames``, given in ascending order.

        Raises:
            FacePoserError: If a file is damaged or its topology differs from the neutral mesh.
        """
        for source in self.sources_of(frames):
            selected = [frame - source.first for frame in _between(frames, source.first, source.first + source.count)]
            if source.path.suffix.lower() == ARRAY_SUFFIX:
                yield from self._read_arrays(source, selected)
            else:
                yield self._read_mesh(source.path)

    def sources_of(self, frames: Sequence[int]) -> list[_Source]:
        """Return the files that contain any of ``frames``, given in ascending order."""
        return [s for s in self.sources if _between(frames, s.first, s.first + s.count)]

    def name_of(self, frame: int) -> str:
        """Return the name of a frame for messages: its file, with its number in a file of several frames."""
        source = next(s for s in self.sources if s.first <= frame < s.first + s.count)
        return f"'{source.path}'" if source.count == 1 else f"frame {frame - source.first + 1} of '{source.path}'"

    def _read_mesh(self, path: Path) -> Array:
        if path.suffix.lower() == ".obj" and self.face_digest:
            vertices, digest = _obj_positions(path)
            if digest == self.face_digest:
                self._check_count(str(path), len(vertices))
                self._check_finite(f"'{path}'", vertices)
                return vertices
        mesh = read_mesh(path)
        self._check_count(str(path), len(mesh.vertices))
        self._check_finite(f"'{path}'", mesh.vertices)
        expected = self.neutral.polygons
        if mesh.polygons.shape != expected.shape or not np.array_equal(mesh.polygons, expected):
            n = min(len(mesh.polygons), len(expected))
            width = min(mesh.polygons.shape[1], expected.shape[1])
            differs = np.flatnonzero((mesh.polygons[:n, :width] != expected[:n, :width]).any(axis=1))
            counts = f"{counted(len(mesh.polygons), 'face')}, not {len(expected)}"
            difference = f"face {differs[0] + 1} differs" if len(differs) else counts
            raise FacePoserError(
                f"The topology of '{path}' differs from {self.neutral_name}: {difference}; export all meshes with the "
                "same vertices and faces in the same order."
            )
        return mesh.vertices

    def _check_count(self, name: str, count: int) -> None:
        if count != len(self.neutral.vertices):
            raise FacePoserError(
                f"'{name}' has {counted(count, 'vertex', 'vertices')}, but {self.neutral_name} has "
                f"{len(self.neutral.vertices)}; export all "
                "meshes with the same vertices in the same order."
            )

    def _check_finite(self, name: str, vertices: Array) -> None:
        if (vertex := first_unusable(vertices)) is not None:
            problem = "too far away" if np.isfinite(vertices[vertex]).all() else "not finite"
            raise FacePoserError(f"Vertex {vertex + 1} of {name} is {problem}; export it again.")

    def _read_arrays(self, source: _Source, frames: Iterable[int]) -> Iterator[Array]:
        try:
            with _open_vertices(source.path) as (stream, _):
                shape, dtype = _array_header(stream, source.path)
                count = shape[-2]
                self._check_count(str(source.path), count)
                size = count * 3 * dtype.itemsize
                start = stream.tell()
                for frame in frames:
                    stream.seek(start + frame * size)
                    data = stream.read(size)
                    if len(data) < size:
                        raise EOFError
                    vertices = np.frombuffer(data, dtype=dtype).reshape(count, 3).astype(np.float64)
                    self._check_finite(f"frame {frame + 1} of '{source.path}'", vertices)
                    yield vertices
        except (KeyError, *_DAMAGED) as error:
            raise FacePoserError(f"'{source.path}' is damaged or truncated; write it again.") from error


def open_sequence(path: Path, neutral: Path | None = None) -> MeshSequence:
    """Open the meshes in the folder ``path``, in the natural order of their names, or in the ``.npz`` file ``path``.

    A ``.npz`` file has ``vertices`` of shape (F, N, 3) or (N, 3), and optionally ``faces`` of shape (T, 3) or (T, 4).

    Args:
        path: Folder of OBJ, PLY, STL, GLB, OFF or NPZ files, or an NPZ file.
        neutral: File of the neutral mesh; if None, the file with neutral, rest or base in its name, else the first.

    Raises:
        FacePoserError: If there are no meshes, or the neutral cannot be read.
    """
    if paths.is_dir(path):
        allowed = (*MESH_SUFFIXES, ARRAY_SUFFIX)
        try:
            found = [f for f in path.iterdir() if f.suffix.lower() in allowed and not is_hidden(f) and paths.is_file(f)]
        except OSError as error:
            raise FacePoserError(f"The folder '{path}' cannot be read: {error.strerror}.") from error
        files = sorted(found, key=_natural_key)
    elif path.suffix.lower() == ARRAY_SUFFIX and paths.is_file(path):
        files = [path]
    else:
        raise FacePoserError(f"'{path}' is not a folder of meshes or an .npz file; choose one of these.")
    if not files:
        raise FacePoserError(f"The folder '{path}' contains no meshes; add OBJ, PLY, STL, GLB or NPZ files.")
    chosen = neutral or _neutral_among(files)
    sources: list[_Source] = []
    for file in files:
        first = sources[-1].first + sources[-1].count if sources else 0
        sources.append(_array_source(file, first) if file.suffix.lower() == ARRAY_SUFFIX else _Source(file, first, 1))
    total = sources[-1].first + sources[-1].count
    if total > _MAX_FRAMES:
        raise FacePoserError(f"'{path}' has {total} frames, more than {_MAX_FRAMES}; leave some out.")
    meshes = [s.path for s in sources if s.path.suffix.lower() != ARRAY_SUFFIX]
    base = _neutral_mesh(chosen, meshes)
    is_obj = chosen.suffix.lower() == ".obj"
    digest = _obj_positions(chosen)[1] if is_obj else ""
    return MeshSequence(base, f"the neutral '{chosen}'", tuple(sources), digest, chosen if is_obj else None)


def write_frames(path: Path, frames: Iterable[NDArray[np.floating]], count: int, n_vertices: int) -> None:
    """Write ``count`` frames of shape (N, 3) incrementally to the ``.npz`` file ``path``, in single precision.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the number of frames is not ``count``.
    """
    header = {"descr": "<f4", "fortran_order": False, "shape": (count, n_vertices, 3)}
    written = 0
    with zipfile.ZipFile(path, "w") as archive, archive.open(_VERTICES, "w", force_zip64=True) as stream:
        np.lib.format.write_array_header_1_0(stream, header)
        for frame in frames:
            stream.write(np.ascontiguousarray(frame, dtype="<f4").tobytes())
            written += 1
    if written != count:
        raise ValueError(f"{written} frames were given, not {count}")


def frames_of(path: Path, neutral: PolygonMesh, name: str) -> MeshSequence:
    """Open the frames in the ``.npz`` file ``path`` as a sequence of the mesh ``neutral``, named ``name``."""
    return MeshSequence(neutral, name, (_array_source(path, 0),))


def _neutral_among(files: list[Path]) -> Path:
    def is_neutral(file: Path) -> bool:
        words = re.split(r"[^a-z]+", file.stem.lower())
        return any(word in words for word in _NEUTRAL_WORDS)

    return next((file for file in files if is_neutral(file)), files[0])


def _neutral_mesh(path: Path, meshes: list[Path]) -> PolygonMesh:
    if path.suffix.lower() != ARRAY_SUFFIX:
        return read_mesh(path)
    vertices, faces = _first_frame(path)
    if faces is not None:
        return PolygonMesh(vertices, faces)
    if not meshes:
        raise FacePoserError(
            f"'{path}' has no 'faces' of shape (T, 3) or (T, 4); store them with 'vertices', or specify the neutral "
            "mesh with --neutral."
        )
    return read_mesh(meshes[0])


def _between(frames: Sequence[int], begin: int, end: int) -> Sequence[int]:
    return frames[bisect_left(frames, begin) : bisect_left(frames, end)]


@contextmanager
def _open_vertices(path: Path) -> Iterator[tuple[IO[bytes], zipfile.ZipInfo]]:
    """Yield the array of vertices as a stream, which is fast to seek unless it is compressed.

    Raises:
        KeyError: If there is no such array.
        zipfile.BadZipFile: If the file is damaged.
    """
    with open_file(path) as file, zipfile.ZipFile(file) as archive:
        info = archive.getinfo(_VERTICES)
        _refuse_encrypted(info, path)
        with archive.open(info) as stream:
            if info.compress_type != zipfile.ZIP_STORED:
                yield stream, info
                return
    # To seek, zipfile reads everything in between; stored members are read directly from the file instead.
    with open_file(path) as file:
        file.seek(info.header_offset)
        header = file.read(30)
        if len(header) < 30:
            raise zipfile.BadZipFile
        begin = info.header_offset + 30 + sum(struct.unpack("<HH", header[26:]))
        if begin + info.file_size > path.stat().st_size:
            raise zipfile.BadZipFile
        file.seek(begin)
        yield file, info


def _array_source(path: Path, first: int) -> _Source:
    try:
        with _open_vertices(path) as (stream, info):
            begin = stream.tell()
            shape, dtype = _array_header(stream, path)
            if stream.tell() - begin + math.prod(shape) * dtype.itemsize > info.file_size:
                raise EOFError
    except KeyError:
        raise FacePoserError(f"'{path}' has no array 'vertices'; store it with shape (frames, vertices, 3).") from None
    except _DAMAGED as error:
        raise FacePoserError(f"'{path}' is damaged or is not an .npz file; write it again.") from error
    return _Source(path, first, 1 if len(shape) == 2 else shape[0], info.compress_type != zipfile.ZIP_STORED)


def _first_frame(path: Path) -> tuple[Array, NDArray[np.int32] | None]:
    try:
        with open_file(path) as file, zipfile.ZipFile(file) as archive:
            with archive.open(_VERTICES) as stream:
                shape, dtype = _array_header(stream, path)
                size = shape[-2] * 3 * dtype.itemsize
                data = stream.read(size)
                if len(data) < size:
                    raise EOFError
                vertices = np.frombuffer(data, dtype=dtype).reshape(-1, 3).astype(np.float64)
            if _FACES not in archive.namelist():
                return vertices, None
            _refuse_encrypted(archive.getinfo(_FACES), path)
            with archive.open(_FACES) as stream:
                faces = _read_faces(stream, path)
    except _DAMAGED as error:
        raise FacePoserError(f"'{path}' is damaged or is not an .npz file; write it again.") from error
    if faces.max() >= len(vertices) or faces.min() < -1 or (faces[:, :3] < 0).any():
        raise FacePoserError(_WRONG_FACES.format(path))
    return vertices, faces.astype(np.int32)


def _read_faces(stream: IO[bytes], path: Path) -> NDArray[np.integer]:
    """Read the array of faces, (T, 3) or (T, 4), in memory no larger than its data."""
    shape, fortran, dtype = _header(stream, path, "faces")
    if dtype.kind not in "iu" or len(shape) != 2 or shape[1] not in (3, 4) or not shape[0]:
        raise FacePoserError(_WRONG_FACES.format(path))
    size = math.prod(shape) * dtype.itemsize
    if size > _MAX_FILE_BYTES:
        raise FacePoserError(f"'{path}' has too many faces; choose a smaller mesh.")
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return np.frombuffer(data, dtype=dtype).reshape(shape, order="F" if fortran else "C")


def _refuse_encrypted(info: zipfile.ZipInfo, path: Path) -> None:
    if info.flag_bits & 1:
        raise FacePoserError(f"'{path}' is encrypted; write it again without a password.")


def _header(stream: IO[bytes], path: Path, noun: str) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read the header of an array; return its shape, True for Fortran order, and its type."""
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(stream)
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError, TokenError) as error:
        raise FacePoserError(f"'{path}' is damaged: its {noun} have no readable header; write it again.") from error
    if any(not isinstance(length, int) or isinstance(length, bool) or length < 0 for length in shape):
        raise FacePoserError(f"'{path}' is damaged: its {noun} have the shape {shape}; write it again.")
    return shape, fortran, dtype


def _array_header(stream: IO[bytes], path: Path) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read the header of the array of vertices; return its shape and type."""
    shape, fortran, dtype = _header(stream, path, "vertices")
    if dtype.kind != "f" or len(shape) not in (2, 3) or shape[-1] != 3 or 0 in shape:
        raise FacePoserError(
            f"The vertices in '{path}' are {dtype} of shape {shape}; store them as floating-point numbers of shape "
            "(frames, vertices, 3)."
        )
    if fortran:
        raise FacePoserError(
            f"The vertices in '{path}' are in Fortran order; store them in C order (numpy.ascontiguousarray)."
        )
    if shape[-2] * 3 * dtype.itemsize > _MAX_FILE_BYTES:
        raise FacePoserError(f"'{path}' declares {shape[-2]} vertices; choose a smaller mesh.")
    return shape, dtype


def _obj_positions(path: Path) -> tuple[Array, str]:
    try:
        return read_obj_positions_and_digest(path)
    except OSError as error:
        raise FacePoserError(f"The mesh '{path}' cannot be read: {error.strerror}.") from error


def _natural_key(path: Path) -> list[Any]:
    """Return the key of the natural order of names, in which frame 10 follows frame 9."""
    return [(1, int(word), "") if word.isdecimal() else (0, 0, word) for word in re.split(r"(\d+)", path.name.lower())]
