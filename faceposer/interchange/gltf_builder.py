"""Builder for binary glTF 2.0: one binary chunk, its buffer views and accessors, and the JSON that describes them.

Section numbers refer to the Khronos glTF 2.0 specification, revision 2.0.1.
"""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError

#: Targets of a buffer view (5.11.5).
VERTICES, INDICES = 34962, 34963
_JSON_CHUNK, _BINARY_CHUNK = b"JSON", b"BIN\0"
_COMPONENTS = {"<u2": 5123, "<u4": 5125, "<f4": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}
_MAX_BYTES = (1 << 32) - 1


class GltfBuilder:
    """Builder of a GLB file.

    Attributes:
        root: JSON of the file; its lists grow as parts are added.
    """

    def __init__(self, asset: dict[str, str]) -> None:
        """Create an empty file with the JSON ``asset``, to which the version is added."""
        self.root: dict[str, Any] = {"asset": {"version": "2.0", **asset}}
        self._chunks: list[bytes] = []
        self._length = 0
        self._finite = True

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Add ``entry`` to the list ``kind``, such as "meshes", and return its index."""
        entries: list[dict[str, Any]] = self.root.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def view(self, data: bytes, target: int | None = None, stride: int | None = None) -> int:
        """Add ``data``, aligned to four bytes (3.6.2.4), and return the index of its view."""
        entry: dict[str, Any] = {"buffer": 0, "byteOffset": self._length, "byteLength": len(data)}
        if target is not None:
            entry["target"] = target
        if stride is not None:
            entry["byteStride"] = stride
        padded = data + bytes(-len(data) % 4)
        self._chunks.append(padded)
        self._length += len(padded)
        return self.add("bufferViews", entry)

    def accessor(self, values: NDArray[Any], dtype: str, target: int | None = None, bounds: bool = False) -> int:
        """Add ``values``, shape (n,) or (n, columns), and return the index of their accessor.

        Args:
            values: At least one value.
            dtype: Component type: "<u2", "<u4" or "<f4".
            target: Target of the view, for vertices and indices.
            bounds: Include minimum and maximum, which positions and key frame times require (3.6.2.5).
        """
        with np.errstate(over="ignore"):
            stored = np.ascontiguousarray(values, dtype=dtype)
        self._finite &= bool(np.isfinite(stored).all())
        return self.accessor_of_view(self.view(stored.tobytes(), target), stored, bounds)

    def accessor_of_view(self, view: int, stored: NDArray[Any], bounds: bool = False) -> int:
        """Add an accessor of the start of ``view``, which contains ``stored``, and return its index."""
        columns = stored.reshape(len(stored), -1)
        entry: dict[str, Any] = {
            "bufferView": view,
            "componentType": _COMPONENTS[stored.dtype.str],
            "count": len(stored),
            "type": _TYPES[columns.shape[1]],
        }
        if bounds:
            entry |= {"min": columns.min(axis=0).tolist(), "max": columns.max(axis=0).tolist()}
        return self.add("accessors", entry)

    def to_bytes(self) -> bytes:
        """Return the content of the file (4.4).

        Raises:
            ValueError: If a number is not finite.
            FacePoserError: If it would exceed 4 GB, the limit of GLB.
        """
        if not self._finite:
            raise ValueError("a value of an accessor is not finite")
        root = dict(self.root)
        if self._length:
            root["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(root, separators=(",", ":"), allow_nan=False).encode("ascii")
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + (8 + self._length if self._length else 0)
        if total > _MAX_BYTES:
            raise FacePoserError("The face has too many vertices and shapes for a GLB file, which is limited to 4 GB.")
        parts = [struct.pack("<4sII", b"glTF", 2, total), struct.pack("<I4s", len(text), _JSON_CHUNK), text]
        if self._length:
            parts += [struct.pack("<I4s", self._length, _BINARY_CHUNK), *self._chunks]
        return b"".join(parts)
