"""Content of OBJ files in blocks of whole statements."""

import codecs
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.reading import open_file

#: Byte order marks of UTF-16.
UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
#: Keywords of rows of numbers, and the number of values that are read.
WIDTHS = {"v": 3, "vt": 2, "vn": 3}
#: Statements whose argument is a name, in which a "#" is a character like any other.
NAMES = ("g", "o", "usemtl", "mtllib")
#: Limit on the corners of a face, since the array of polygons is as wide as the largest.
MOST_CORNERS = 128
#: Limit on the length of a statement with its continuation lines, in characters.
LONGEST_STATEMENT = 1 << 16
#: Characters that separate words.
SPACE = " \t\r\n\f\v"
# Size of a block, and limit on the length of a line and of lines that continue each other, in characters.
_BLOCK, _LONGEST_LINE = 1 << 20, 1 << 22


@dataclass(frozen=True)
class Block:
    """A part of a file that consists of whole statements.

    Attributes:
        content: The lines, each ending in a line feed; UTF-8 or bytes in an unknown encoding.
        line: Number of lines before the block.
        decoded: True if the content is known to be UTF-8.
    """

    content: bytes
    line: int
    decoded: bool


@dataclass(frozen=True)
class Counts:
    """Numbers of vertices and texture coordinates that are listed before a place in the file."""

    v: int = 0
    vt: int = 0

    def after(self, rows: Mapping[str, NDArray[np.float64]]) -> "Counts":
        """Return the counts after further ``rows`` by keyword."""
        return Counts(self.v + len(rows["v"]), self.vt + len(rows["vt"]))


@dataclass
class Parsed:
    """Statements of a block.

    Attributes:
        rows: Values by keyword, shape (n, width).
        sizes: Number of corners of the F faces, shape (F,).
        corners: Vertex indices of the corners of all faces, in order.
        textures: Indices of their texture coordinates; None if a corner has none.
        names: Number of faces before it, keyword and argument of each statement with a name.
        slow: Number of lines that were parsed one by one.
    """

    rows: dict[str, NDArray[np.float64]]
    sizes: NDArray[np.int32]
    corners: NDArray[np.int32]
    textures: NDArray[np.int32] | None
    names: list[tuple[int, str, str]] = field(default_factory=list)
    slow: int = 0


def read_blocks(path: Path) -> Iterator[Block]:
    """Yield the content of the OBJ file ``path``, with line feeds as line ends and without a byte order mark.

    Raises:
        OSError: If the file cannot be read.
        FacePoserError: If it is not valid UTF-16, or has an endless line.
    """
    with open_file(path) as raw:
        start = raw.read(3)
        decoded = start.startswith(UTF16)
        raw.seek(len(codecs.BOM_UTF8) if start == codecs.BOM_UTF8 else 0)
        # Latin-1 preserves all bytes, so that only names have to be decoded.
        file = io.TextIOWrapper(raw, "utf-16" if decoded else "latin-1")
        encoding = "utf-8" if decoded else "latin-1"
        line = 0
        rest = ""
        try:
            while text := file.read(_BLOCK):
                rest += text
                end = _last_statement(rest)
                if end:
                    block = Block(rest[:end].encode(encoding), line, decoded)
                    rest = rest[end:]
                    line += block.content.count(b"\n")
                    yield block
                elif len(rest) > _LONGEST_LINE:
                    raise FacePoserError(
                        f"The mesh '{path}' is broken after line {line}: a statement is longer than "
                        f"{_LONGEST_LINE >> 20} MB; export it again."
                    )
        except UnicodeError as error:
            raise FacePoserError(
                f"The mesh '{path}' is broken after line {line}: it is not valid UTF-16; export it again."
            ) from error
        if rest:
            yield Block((rest + "\n").encode(encoding), line, decoded)


def _last_statement(text: str) -> int:
    """Return the end of the last complete statement in ``text``, 0 if there is none."""
    end = text.rfind("\n") + 1
    while end:
        begin = text.rfind("\n", 0, end - 1) + 1
        if not text[begin:end].rstrip(SPACE).endswith("\\"):
            break
        end = begin
    return end


def name_in(line: bytes, decoded: bool) -> tuple[str, str] | None:
    """Return the keyword and the argument in ``line`` if it is a statement with a name."""
    keyword, *words = line.decode("utf-8" if decoded else "latin-1").split(None, 1) or [""]
    if keyword not in NAMES:
        return None
    name = words[0] if words else ""
    return keyword, (name if decoded else _decoded_name(name.encode("latin-1"))).strip(SPACE)


def _decoded_name(name: bytes) -> str:
    """Return a ``name`` from a file as text: UTF-8, or else Windows-1252 as older exporters write it."""
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("cp1252", errors="replace")
