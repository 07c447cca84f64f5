"""Content of OBJ files in blocks of whole statements, parsed by NumPy where they are plain, else line by line."""

import codecs
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.reading import open_file

_Kind = TypeVar("_Kind", np.float64, np.int64)

#: Byte order marks of UTF-16.
UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
#: Keywords of rows of numbers, and the number of values that are read.
WIDTHS = {"v": 3, "vt": 2, "vn": 3}
# Size of a block in bytes or characters.
_BLOCK = 1 << 22
# Limit on the length of a line, and of lines that continue each other.
_LONGEST_LINE = 1 << 25
# Limit on the corners of a face, since the array of polygons is as wide as the largest.
_MOST_CORNERS = 128
# Limit on the length of a statement with its continuation lines, in characters.
_LONGEST_STATEMENT = 1 << 16
_SPACE = " \t\r\n\f\v"
# Statements whose argument is a name, in which a "#" is a character like any other.
_NAMES = ("g", "o", "usemtl", "mtllib")
_NAME_LETTERS = np.frombuffer(b"goum", dtype=np.uint8)
_LINE, _SLASH, _COMMENT, _V, _T, _N, _F = b"\n/#vtnf"
# Bytes that are space, and further ones that Python takes for space.
_IS_SPACE, _IS_ODD = np.zeros((2, 256), dtype=bool)
_IS_SPACE[[9, 10, 11, 12, 13, 32]] = True
_IS_ODD[[0x1C, 0x1D, 0x1E, 0x1F, 0x85, 0xA0]] = True


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
    """

    rows: dict[str, NDArray[np.float64]]
    sizes: NDArray[np.int32]
    corners: NDArray[np.int32]
    textures: NDArray[np.int32] | None
    names: list[tuple[int, str, str]] = field(default_factory=list)


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
        if not text[begin:end].rstrip(_SPACE).endswith("\\"):
            break
        end = begin
    return end


def parse_block(block: Block, before: Counts, path: Path) -> Parsed:
    """Parse the ``block`` of the file ``path`` that follows the rows ``before``.

    Raises:
        FacePoserError: If a line is invalid.
    """
    return _parsed_at_once(block, before) or _parsed_by_line(block, before, path)


def _parsed_at_once(block: Block, before: Counts) -> Parsed | None:
    """Parse ``block`` with NumPy; None if a statement may be invalid or is not of a common form."""
    content = _joined(block.content)
    if content is None:
        return None
    data, starts, ends = _lines(content)
    if (_IS_SPACE[data[starts]] & (starts < ends)).any():
        data, starts, ends = _lines(re.sub(rb"(?m)^[ \t\f\v]+", b"", content))
    first, second, third = (data[np.minimum(starts + i, ends)] for i in range(3))
    is_known = (first == _V) | (first == _F)
    if _IS_ODD[first].any() or (is_known & (_IS_ODD[second] | _IS_ODD[third])).any():
        return None
    is_row = {
        "v": (first == _V) & _IS_SPACE[second],
        "vt": (first == _V) & (second == _T) & _IS_SPACE[third],
        "vn": (first == _V) & (second == _N) & _IS_SPACE[third],
    }
    rows = {}
    for keyword, mask in is_row.items():
        values = _rows(_text_of(data, starts, ends, mask, len(keyword)), WIDTHS[keyword])
        if values is None:
            return None
        rows[keyword] = values
    is_face = (first == _F) & _IS_SPACE[second]
    listed = [getattr(before, key) + np.cumsum(is_row[key])[is_face] for key in ("v", "vt")]
    faces = _faces(_text_of(data, starts, ends, is_face, 1), listed[0], listed[1])
    if faces is None:
        return None
    names = []
    number = np.cumsum(is_face)
    for line in np.flatnonzero(np.isin(first, _NAME_LETTERS)).tolist():
        found = _name(data[starts[line] : ends[line]].tobytes(), block.decoded)
        if found is not None:
            names.append((int(number[line]), *found))
    return Parsed(rows, *faces, names)


def _lines(content: bytes) -> tuple[NDArray[np.uint8], NDArray[np.intp], NDArray[np.intp]]:
    """Return ``content`` as an array, and the place of the first byte and of the line feed of each line."""
    data = np.frombuffer(content, dtype=np.uint8)
    ends = np.flatnonzero(data == _LINE)
    return data, np.concatenate([[0], ends[:-1] + 1]), ends


def _joined(content: bytes) -> bytes | None:
    """Return ``content`` with each statement on a line; None if that is not certain."""
    if b"\\" not in content:
        return content
    # Comments do not continue, but the line after a backslash is no comment.
    if re.search(rb"\\[ \t\f\v]*\n\s*[#\\]", content):
        return None
    content = re.sub(rb"(?m)^[ \t\f\v]*#[^\n]*", b"", content)
    content = re.sub(rb"\\[ \t\f\v]*\n", b" ", content)
    if not content.endswith(b"\n"):
        content += b"\n"
    _, starts, ends = _lines(content)
    return content if int((ends - starts).max()) < _LONGEST_STATEMENT else None


def _text_of(
    data: NDArray[np.uint8],
    starts: NDArray[np.intp],
    ends: NDArray[np.intp],
    mask: NDArray[np.bool_],
    keyword: int,
) -> NDArray[np.uint8]:
    """Return the lines of ``mask`` without comments, the first ``keyword`` bytes of each replaced by spaces."""
    chosen = np.flatnonzero(mask)
    if not len(chosen):
        return data[:0]
    begin, stop = int(starts[chosen[0]]), int(ends[chosen[-1]]) + 1
    lengths = ends - starts + 1
    text = data[begin:stop].copy()
    if chosen[-1] - chosen[0] + 1 > len(chosen):
        between = slice(int(chosen[0]), int(chosen[-1]) + 1)
        text = text[np.repeat(mask[between], lengths[between])]
    places = np.cumsum(lengths[chosen]) - lengths[chosen]
    for i in range(keyword):
        text[places + i] = 32
    if (text == _COMMENT).any():
        text = np.frombuffer(re.sub(rb"#[^\n]*", b"", text.tobytes()), dtype=np.uint8)
    return text


def _rows(text: NDArray[np.uint8], width: int) -> NDArray[np.float64] | None:
    """Return the first ``width`` numbers of each line, shape (n, ``width``); None if a line has fewer, or others."""
    is_space = _IS_SPACE[text]
    words = np.flatnonzero(~is_space & np.concatenate([[True], is_space[:-1]]))
    numbers = numbers_in(text.tobytes(), np.float64) if len(words) else np.zeros(0)
    if numbers is None or len(numbers) != len(words):
        return None
    counts = np.diff(np.searchsorted(words, np.flatnonzero(text == _LINE)), prepend=0)
    if int(counts.min(initial=width)) < width:
        return None
    first = np.cumsum(counts) - counts
    values: NDArray[np.float64] = numbers[first[:, None] + np.arange(width)]
    return values


def numbers_in(text: bytes, kind: type[_Kind]) -> NDArray[_Kind] | None:
    """Return the numbers in ``text``; None or too few if it contains anything else."""
    try:
        # Anything else causes a hidden DeprecationWarning and truncates the result, which callers detect by its length.
        # Turning the warning into an error temporarily would not be thread-safe.
        return np.fromstring(text.decode("ascii"), dtype=kind, sep=" ")
    except (DeprecationWarning, UnicodeDecodeError, ValueError):
        return None


def _faces(
    text: NDArray[np.uint8], vertices: NDArray[np.intp], textures: NDArray[np.intp]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32] | None] | None:
    """Return the numbers of corners, the vertices and the texture coordinates of faces, or None.

    Args:
        text: The lines of F faces.
        vertices: Number of vertices listed before each face, shape (F,).
        textures: Number of texture coordinates listed before each face, shape (F,).
    """
    none = np.zeros(0, dtype=np.int32)
    if not len(text):
        return none, none, none
    is_space, slashes = _IS_SPACE[text], np.flatnonzero(text == _SLASH)
    after_space = np.concatenate([[True], is_space[:-1]])
    corners = np.flatnonzero(~is_space & after_space)
    sizes = np.diff(np.searchsorted(corners, np.flatnonzero(text == _LINE)), prepend=0)
    if int(sizes.min()) < 3 or int(sizes.max()) > _MOST_CORNERS or (text[corners] == _SLASH).any():
        return None
    if not len(slashes):
        numbers = numbers_in(text.tobytes(), np.int64)
        if numbers is None or len(numbers) != len(corners):
            return None
        found = _indices(numbers, np.repeat(vertices, sizes))
        return None if found is None else (sizes.astype(np.int32), found, None)
    # Numbers begin after a space or a slash; the corners of a number, and the slashes before it in its corner.
    is_space[slashes] = True
    begins = np.flatnonzero(~is_space & np.concatenate([[True], is_space[:-1]]))
    text = text.copy()
    text[slashes] = 32
    numbers = numbers_in(text.tobytes(), np.int64)
    if numbers is None or len(numbers) != len(begins):
        return None
    owners, order = _places(corners, slashes, begins)
    found = _indices(numbers[order == 0], np.repeat(vertices, sizes))
    if found is None:
        return None
    # Only faces with a texture coordinate at each corner have any.
    is_texture = order == 1
    faces = np.repeat(np.arange(len(sizes)), sizes)[owners]
    whole = np.bincount(faces[is_texture], minlength=len(sizes)) == sizes
    used = is_texture & whole[faces]
    drawn = _indices(numbers[used], textures[faces[used]])
    if drawn is None:
        return None
    return sizes.astype(np.int32), found, drawn if whole.all() else None


def _places(
    corners: NDArray[np.intp], slashes: NDArray[np.intp], begins: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the corner of each number of faces, and the number of slashes before it in that corner.

    Args:
        corners: Places of the first bytes of the corners, in order.
        slashes: Places of the slashes.
        begins: Places of the first bytes of the numbers.
    """
    for orders in ((0, 1), (0, 2), (0, 1, 2)):
        # Where all corners are alike, nothing has to be searched.
        count = len(orders)
        if len(begins) != count * len(corners) or len(slashes) != orders[-1] * len(corners):
            continue
        is_double = count == 3 or orders[-1] == 1 or (np.diff(slashes.reshape(-1, 2), axis=1) == 1).all()
        if is_double and (begins[::count] == corners).all():
            return np.repeat(np.arange(len(corners)), count), np.tile(orders, len(corners))
    owners = np.searchsorted(corners, begins, side="right") - 1
    return owners, np.searchsorted(slashes, begins) - np.searchsorted(slashes, corners)[owners]


def _indices(values: NDArray[np.int64], counts: NDArray[np.intp]) -> NDArray[np.int32] | None:
    """Return zero-based indices of OBJ's ``values``, each below its count in ``counts``; None if one is not."""
    indices = np.where(values > 0, values - 1, counts + values)
    valid = (values != 0) & (indices >= 0) & (indices < counts)
    return indices.astype(np.int32) if valid.all() else None


def _name(line: bytes, decoded: bool) -> tuple[str, str] | None:
    """Return the keyword and the argument in ``line`` if it is a statement with a name."""
    keyword, *words = line.decode("utf-8" if decoded else "latin-1").split(None, 1) or [""]
    if keyword not in _NAMES:
        return None
    name = words[0] if words else ""
    return keyword, (name if decoded else decoded_name(name.encode("latin-1"))).strip(_SPACE)


def decoded_name(name: bytes) -> str:
    """Return a ``name`` from a file as text: UTF-8, or else Windows-1252 as older exporters write it."""
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("cp1252", errors="replace")


def _parsed_by_line(block: Block, before: Counts, path: Path) -> Parsed:
    """Parse ``block`` line by line.

    Raises:
        FacePoserError: If a line is invalid.
    """
    tables: dict[str, list[list[float]]] = {keyword: [] for keyword in WIDTHS}
    sizes: list[int] = []
    vertices: list[int] = []
    textures: list[int] = []
    names: list[tuple[int, str, str]] = []
    for number, text in _statements(block, path):
        keyword, *words = text.split(None, 1) or [""]
        rest = words[0].partition("#")[0] if words else ""
        try:
            if keyword in WIDTHS:
                width = WIDTHS[keyword]
                row = [_number(word) for word in rest.split(None, width)[:width]]
                if len(row) != width:
                    raise ValueError(f"'{keyword}' needs {width} numbers")
                tables[keyword].append(row)
            elif keyword == "f":
                corners = [corner.split("/", 2) for corner in rest.split(None, _MOST_CORNERS + 1)]
                if len(corners) < 3:
                    raise ValueError("a face needs at least 3 corners")
                if len(corners) > _MOST_CORNERS:
                    raise ValueError(f"a face of more than {_MOST_CORNERS} corners is too large; split it")
                sizes.append(len(corners))
                vertices += [_index(c[0], before.v + len(tables["v"])) for c in corners]
                if all(len(c) > 1 and c[1] for c in corners):
                    textures += [_index(c[1], before.vt + len(tables["vt"])) for c in corners]
        except ValueError as error:
            raise FacePoserError(f"The mesh '{path}' is broken at line {number}: {error}.") from error
        if keyword in _NAMES and (found := _name(text.encode(_encoding(block)), block.decoded)) is not None:
            names.append((len(sizes), *found))
    rows = {key: np.array(table, dtype=np.float64).reshape(-1, WIDTHS[key]) for key, table in tables.items()}
    return Parsed(
        rows,
        np.array(sizes, dtype=np.int32),
        np.array(vertices, dtype=np.int32),
        np.array(textures, dtype=np.int32) if len(textures) == len(vertices) else None,
        names,
    )


def _encoding(block: Block) -> str:
    return "utf-8" if block.decoded else "latin-1"


def _statements(block: Block, path: Path) -> Iterator[tuple[int, str]]:
    """Yield the line number and the text of each statement of ``block`` that is no comment.

    A backslash at the end of a line continues the statement on the next one, except in comments, which may end in a
    Windows path.
    """
    begun = ""
    number = block.line
    for number, line in enumerate(block.content.decode(_encoding(block)).split("\n"), block.line + 1):
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
        yield number, text
    yield number, begun


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
