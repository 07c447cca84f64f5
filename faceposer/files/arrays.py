"""Reading of NumPy archives without pickle, with all sizes checked before memory is allocated."""

import lzma
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from faceposer.files.reading import open_file


class DamagedError(Exception):
    """An archive or an array in it cannot be read; the message is the reason, or empty if it is no archive."""


class TooLargeError(DamagedError):
    """The archive has too many arrays, or too large ones."""


def read_arrays(path: Path, max_bytes: int, max_members: int, named: set[str] | None = None) -> dict[str, NDArray[Any]]:
    """Return the arrays of the archive ``path`` by name, or those ``named``.

    Args:
        path: The file.
        max_bytes: Limit on the size of all arrays together.
        max_members: Limit on their number.
        named: Names of the arrays to read; all if None.

    Raises:
        DamagedError: If it is damaged, is no archive, or contains pickled objects.
        TooLargeError: If a limit is exceeded.
        OSError: If it is not a regular file, or cannot be opened.
    """
    try:
        with open_file(path) as file, zipfile.ZipFile(file) as archive:
            entries = archive.infolist()
            if len(entries) > max_members or sum(entry.file_size for entry in entries) > max_bytes:
                raise TooLargeError
            members = {}
            for entry in entries:
                name = entry.filename.removesuffix(".npy")
                if named is None or name in named:
                    with archive.open(entry) as stream:
                        members[name] = _read_array(stream, entry.file_size)
            return members
    except (zipfile.BadZipFile, EOFError, zlib.error, lzma.LZMAError, NotImplementedError, RuntimeError, ValueError):
        raise DamagedError from None


def _read_array(stream: IO[bytes], size: int) -> NDArray[Any]:
    try:
        version = np.lib.format.read_magic(stream)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        if version not in read_header:
            raise DamagedError(f"an array has the unknown format version {version}")
        shape, fortran_order, dtype = read_header[version](stream)
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError, TokenError) as error:
        raise DamagedError("an array has no readable header") from error
    if any(not isinstance(length, int) or isinstance(length, bool) or length < 0 for length in shape):
        raise DamagedError(f"an array has the shape {shape}")
    if dtype.hasobject:
        raise DamagedError("it contains pickled objects, which are never loaded")
    count = int(np.prod(shape, dtype=object)) if shape else 1
    if count * dtype.itemsize > size:
        raise DamagedError("the declared size of an array exceeds its data")
    data = stream.read(count * dtype.itemsize)
    if len(data) != count * dtype.itemsize:
        raise DamagedError("an array is truncated")
    return np.frombuffer(data, dtype=dtype).reshape(shape, order="F" if fortran_order else "C")
