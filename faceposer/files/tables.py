"""Text tables in their dialects: encodings, separators and decimal signs."""

import codecs
import csv
import itertools
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from faceposer.errors import FacePoserError
from faceposer.files.numbers import is_plain, plain_float
from faceposer.files.reading import open_file, open_text

Row = tuple[int, list[str]]

_SEPARATORS = ("\t", ";", ",", "|")
# Lines from which the separator is determined.
_HEAD = 40
_LONGEST_LINE = 2**20
_MOST_CELLS = 20_000
_MOST_LINES = 1_100_000
_LONGEST_CELL = 2**16
_CHUNK = 2**20
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
# Spreadsheets of Western Windows write this where they do not write UTF-8.
_FALLBACK = "cp1252"
_NUMBER = re.compile(r"[+-]?(\d+(,\d*)?|,\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)


@contextmanager
def open_table(path: Path, kind: str, most_bytes: int, blank: bool = False) -> Iterator[Iterator[Row]]:
    """Open the text table ``path`` for reading; yields its rows as pairs of line number and cells.

    The encoding (UTF-8, UTF-16 and UTF-32 with or without byte order mark, else Windows-1252) and the separator (tab,
    semicolon, comma, bar or spaces) are inferred. A first line ``sep=;`` states the separator and is no row.

    Args:
        path: A regular file.
        kind: Noun for messages, such as "capture".
        most_bytes: Maximum size of the file.
        blank: True to yield rows without content, too.

    Raises:
        FacePoserError: If the file cannot be read, is no text or too large, or a line or cell is too long.
    """
    try:
        encoding = _encoding(path, most_bytes)
        if encoding is None:
            raise FacePoserError(f"The {kind} '{path}' cannot be read: it is not a text file; export it again.")
        with open_text(path, encoding, "replace", "") as file:
            yield _rows(file, path, blank)
    except OSError as error:
        raise FacePoserError(f"The {kind} '{path}' cannot be read: {error.strerror or error}.") from error


def decimal_numbers(cells: Sequence[str]) -> list[float] | None:
    """Return the finite numbers in all ``cells``, which have decimal points, or None: the fast case of most rows."""
    try:
        values = list(map(float, cells))
    except ValueError:
        return None
    return values if all(map(math.isfinite, values)) and is_plain("".join(cells)) else None


def decimal_number(text: str) -> float | None:
    """Return the finite number in ``text``, with a decimal point or a decimal comma, or None."""
    text = text.strip()
    try:
        value = plain_float(text)
    except ValueError:
        if not _NUMBER.fullmatch(text):
            return None
        value = float(text.replace(",", "."))
    return value if math.isfinite(value) else None


def _encoding(path: Path, max_bytes: int) -> str | None:
    """Return the encoding of the text in ``path``, or None if it is no text."""
    with open_file(path, max_bytes) as file:
        head = file.read(_CHUNK)
        for mark, name in _MARKS:
            if head.startswith(mark):
                return name if _decodes(path, name) else None
        if b"\0" in head:
            # Of Latin letters in UTF-16, every other byte is 0.
            name = "utf-16-le" if head[1:2] == b"\0" else "utf-16-be"
            return name if _decodes(path, name) else None
    if _decodes(path, "utf-8"):
        return "utf-8"
    return _FALLBACK if _decodes(path, _FALLBACK) else None


def _decodes(path: Path, encoding: str) -> bool:
    """Return True if all of the file is text in ``encoding``, without control characters other than white space."""
    # Windows-1252 leaves some bytes undefined.
    decoder = codecs.getincrementaldecoder(encoding)("replace" if encoding == _FALLBACK else "strict")
    wide = encoding.startswith(("utf-16", "utf-32"))
    with open_file(path) as file:
        try:
            while chunk := file.read(_CHUNK):
                text = decoder.decode(chunk)
                if _CONTROL.search(text) if wide else len(chunk.translate(None, _CONTROL_BYTES)) < len(chunk):
                    return False
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            return False
    return True


# All but tabs, line ends, and the end mark of old files.
_CONTROL = re.compile(r"[\0-\x08\x0e-\x19\x1b-\x1f]")
_CONTROL_BYTES = bytes(code for code in range(32) if _CONTROL.match(chr(code)))


def _rows(file: TextIO, path: Path, blank: bool) -> Iterator[Row]:
    lines = _lines(file, path)
    head = list(itertools.islice(lines, _HEAD))
    stated = re.fullmatch(r'\s*"?sep=(.)"?\s*', head[0], re.IGNORECASE) if head else None
    skipped = 0 if stated is None else 1
    separator = _separator(head[skipped:]) if stated is None else stated[1]
    everything = itertools.chain(head[skipped:], lines)
    reader = csv.reader(everything, delimiter=separator, skipinitialspace=separator == " ")
    while True:
        try:
            cells = next(reader, None)
        except csv.Error as error:
            number = skipped + reader.line_num
            raise FacePoserError(
                f"Line {number} of '{path}' cannot be read as a row of a table; check its quotation marks."
            ) from error
        if cells is None:
            return
        if blank or any(cell and not cell.isspace() for cell in cells):
            if len(cells) > _MOST_CELLS:
                raise FacePoserError(
                    f"Line {skipped + reader.line_num} of '{path}' has {len(cells):,} cells, more than "
                    f"{_MOST_CELLS:,}; check the file."
                )
            if max(map(len, cells), default=0) > _LONGEST_CELL:
                raise FacePoserError(
                    f"Line {skipped + reader.line_num} of '{path}' has a cell of more than {_LONGEST_CELL} characters; "
                    "check its quotation marks."
                )
            yield skipped + reader.line_num, cells


def _lines(file: TextIO, path: Path) -> Iterator[str]:
    number = 0
    while line := file.readline(_LONGEST_LINE):
        number += 1
        if number > _MOST_LINES:
            raise FacePoserError(f"'{path}' has more than {_MOST_LINES:,} lines; split it into shorter takes.")
        if len(line) == _LONGEST_LINE:
            raise FacePoserError(
                f"Line {number} of '{path}' has more than {_LONGEST_LINE - 1:,} characters; check the file."
            )
        # Line ends other than the system's would end up in the last cell.
        yield line.rstrip("\r\n") + "\n"


def _separator(lines: list[str]) -> str:
    """Return the separator that divides most of ``lines`` into the same, large number of cells."""

    def size(separator: str) -> int:
        counts: dict[int, int] = {}
        try:
            for cells in csv.reader(lines, delimiter=separator, skipinitialspace=separator == " "):
                if len(cells) > 1:
                    counts[len(cells)] = counts.get(len(cells), 0) + len(cells)
        except csv.Error:
            return 0
        return max(counts.values(), default=0)

    # Timecodes may have semicolons of their own, headers do not.
    first = next((line for line in lines if line.strip()), "")
    best = max([separator for separator in _SEPARATORS if separator in first] or [*_SEPARATORS, " "], key=size)
    return best if size(best) else ","
