"""Parsing of blocks of OBJ files line by line, which finds the place of what is invalid."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError, counted
from faceposer.files.numbers import plain_float, plain_int
from faceposer.geometry.obj_blocks import (
    LONGEST_STATEMENT,
    MOST_CORNERS,
    NAMES,
    SPACE,
    WIDTHS,
    Block,
    Counts,
    Parsed,
    name_in,
)


def parsed_by_line(block: Block, before: Counts, path: Path) -> Parsed:
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
                corners = [corner.split("/", 2) for corner in rest.split(None, MOST_CORNERS + 1)]
                if len(corners) < 3:
                    raise ValueError("a face needs at least 3 corners")
                if len(corners) > MOST_CORNERS:
                    raise ValueError(f"a face of more than {MOST_CORNERS} corners is too large; split it")
                sizes.append(len(corners))
                vertices += [_index(c[0], before.v + len(tables["v"])) for c in corners]
                if all(len(c) > 1 and c[1] for c in corners):
                    textures += [_index(c[1], before.vt + len(tables["vt"])) for c in corners]
        except ValueError as error:
            raise FacePoserError(f"The mesh '{path}' is broken at line {number}: {error}.") from error
        if keyword in NAMES and (found := name_in(text.encode(_encoding(block)), block.decoded)) is not None:
            names.append((len(sizes), *found))
    rows = {key: np.array(table, dtype=np.float64).reshape(-1, WIDTHS[key]) for key, table in tables.items()}
    return Parsed(
        rows,
        np.array(sizes, dtype=np.int32),
        np.array(vertices, dtype=np.int32),
        np.array(textures, dtype=np.int32) if len(textures) == len(vertices) else None,
        names,
        block.content.count(b"\n"),
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
        if "#" in text and text.lstrip(SPACE).startswith("#"):
            continue
        if "\\" in text and (plain := text.rstrip(SPACE)).endswith("\\"):
            begun = plain[:-1] + " "
            if len(begun) > LONGEST_STATEMENT:
                raise FacePoserError(
                    f"The mesh '{path}' is broken at line {number}: a continued statement is longer than "
                    f"{LONGEST_STATEMENT} characters; export it again."
                )
            continue
        yield number, text
    yield number, begun


def _legible(word: str) -> str:
    """Return ``word`` for a message, decoded as UTF-8 if it was read as single bytes."""
    with suppress(UnicodeError):
        word = word.encode("latin-1").decode("utf-8")
    return word[:20]


def _number(word: str) -> float:
    try:
        return plain_float(word)
    except ValueError:
        raise ValueError(f"'{_legible(word)}' is not a number") from None


def _index(word: str, count: int) -> int:
    """Return the zero-based index of OBJ's index ``word``, which counts from 1, or from the end if negative."""
    try:
        value = plain_int(word)
    except ValueError:
        raise ValueError(f"'{_legible(word)}' is not the index of a vertex") from None
    index = value - 1 if value > 0 else count + value
    if value == 0 or not 0 <= index < count:
        raise ValueError(f"index {value} is out of range for the {counted(count, 'entry', 'entries')} listed before")
    return index
