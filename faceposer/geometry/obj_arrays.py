"""Parsing of blocks of OBJ files with NumPy."""

import re
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.obj_blocks import LONGEST_STATEMENT, MOST_CORNERS, WIDTHS, Block, Counts, Parsed, name_in

_Kind = TypeVar("_Kind", np.float64, np.int64)

_LINE, _SLASH, _COMMENT, _V, _T, _N, _F = b"\n/#vtnf"
# First letters of statements with a name.
_NAME_LETTERS = np.frombuffer(b"goum", dtype=np.uint8)
# Bytes that are space, and further ones that Python takes for space.
_IS_SPACE, _IS_ODD = np.zeros((2, 256), dtype=bool)
_IS_SPACE[[9, 10, 11, 12, 13, 32]] = True
_IS_ODD[[0x1C, 0x1D, 0x1E, 0x1F, 0x85, 0xA0]] = True


def parsed_at_once(block: Block, before: Counts) -> Parsed | None:
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
        found = name_in(data[starts[line] : ends[line]].tobytes(), block.decoded)
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
    return content if int((ends - starts).max()) < LONGEST_STATEMENT else None


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
    if int(sizes.min()) < 3 or int(sizes.max()) > MOST_CORNERS or (text[corners] == _SLASH).any():
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
