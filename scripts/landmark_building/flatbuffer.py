"""A reader of FlatBuffers, as far as TensorFlow Lite's model files need one.

The layout is that of the FlatBuffers internals page: little-endian; a table starts with the signed distance back to its
vtable, which lists the offset of each field within the table, or 0 for a field with its default value.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Table:
    """A table at the position ``at`` of the bytes ``data``; fields are numbered as in the schema."""

    data: bytes
    at: int

    @classmethod
    def root(cls, data: bytes) -> "Table":
        """Return the root table of a buffer."""
        return cls(data, _number(data, 0, "I"))

    def number(self, field: int, kind: str = "i", default: int = 0) -> int:
        """Return the scalar ``field`` of the ``struct`` format ``kind``."""
        place = self._place(field)
        return default if place is None else _number(self.data, place, kind)

    def table(self, field: int) -> "Table | None":
        """Return the table in ``field``, or None if it is missing."""
        place = self._place(field)
        return None if place is None else Table(self.data, place + _number(self.data, place, "I"))

    def tables(self, field: int) -> "list[Table]":
        """Return the tables of the vector ``field``."""
        begin, count = self._vector(field)
        places = [begin + 4 * i for i in range(count)]
        return [Table(self.data, place + _number(self.data, place, "I")) for place in places]

    def numbers(self, field: int) -> list[int]:
        """Return the 32-bit integers of the vector ``field``."""
        begin, count = self._vector(field)
        return list(struct.unpack_from(f"<{count}i", self.data, begin))

    def bytes_of(self, field: int) -> NDArray[np.uint8]:
        """Return the bytes of the vector ``field``, shape (n,)."""
        begin, count = self._vector(field)
        return np.frombuffer(self.data, dtype=np.uint8, count=count, offset=begin)

    def _place(self, field: int) -> int | None:
        vtable = self.at - _number(self.data, self.at, "i")
        entry = 4 + 2 * field
        offset = _number(self.data, vtable + entry, "H") if entry < _number(self.data, vtable, "H") else 0
        return self.at + offset if offset else None

    def _vector(self, field: int) -> tuple[int, int]:
        place = self._place(field)
        if place is None:
            return 0, 0
        begin = place + _number(self.data, place, "I")
        return begin + 4, _number(self.data, begin, "I")


def _number(data: bytes, at: int, kind: str) -> int:
    return int(struct.unpack_from("<" + kind, data, at)[0])
