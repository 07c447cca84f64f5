"""Rows and columns of a take that are no frames and no weights of its face."""

import difflib
import itertools
import re
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import counted, short_name
from faceposer.files.tables import decimal_number
from faceposer.files.time_columns import is_frame_number, is_time, times_of
from faceposer.model.character import ARKIT_SHAPES

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Rows at the end that may lack a time, such as means, and the share of rows at the time of the one before that repeat
# it if the file has rows twice.
_MOST_FOOTERS, _MOST_REPEAT = 10, 0.95
_FACE = re.compile(r"(face|person|people|subject|actor|performer|user)s?(id|index|idx|no|nr|num|number|name)?")
# Columns of known programs beside weights and times.
_OTHERS = re.compile(
    r"(blendshapecount|count|confidence|score|success|valid|tracked|tracking|visible|detected|neutral|subject|device|name"
    r"|(head|lefteye|righteye|eye|pose|gaze|rotation|position|translation|r|t)?(yaw|pitch|roll|[xyzw])"
    r"|(fps|rate|framerate)(hz)?|date|day|)"
)
_TURN = re.compile(r"(head|eye|gaze)(left|right)?(yaw|pitch|roll|rotation|position)")
_LONGEST_NAME, _MOST_GUESSED, _LIKE = 40, 200, 0.8


def face_column(header: Sequence[str]) -> int | None:
    """Return the column that tells faces of several people apart, by the ``header``."""
    return next((i for i, name in enumerate(header) if _FACE.fullmatch(_letters(name))), None)


def is_comment(cells: Sequence[str]) -> bool:
    """Return True if a row is a comment."""
    return cells[0].lstrip().startswith(("#", "//"))


def kept_rows(
    heading: str, times: Sequence[str], faces: Sequence[str], weights: Sequence[Array | None]
) -> tuple[Mask, str]:
    """Return the rows that are frames of the first face, shape (N,), and sentences about the others.

    Args:
        heading: Heading of the column of times or numbers of frames.
        times: Its N cells, or none.
        faces: The N cells of the column that tells faces apart, or none.
        weights: Weights of the rows, shape (S,) each, or None without a face.
    """
    kept = np.ones(len(weights), dtype=bool)
    notes = []
    names = Counter(face.strip() for face, row in zip(faces, weights, strict=False) if row is not None)
    if len(names) > 1:
        first = next(iter(names))
        kept &= np.array([face.strip() == first for face in faces])
        listed = ", ".join(f"'{short_name(name)}'" for name in list(names)[:3]) + (" etc." if len(names) > 3 else "")
        notes.append(f"It has {len(names)} faces ({listed}); that of '{short_name(first)}' was read.")
    if not times:
        return kept, " ".join(notes)
    cells = [cell.strip() for cell in times]
    known = _known(heading, cells)
    if known.any():
        last = int(np.flatnonzero(known)[-1]) + 1
        missing = np.flatnonzero(~known[:last] & np.array([bool(cell) for cell in cells[:last]]))
        # A line between rows, such as a remark, has neither a time nor weights.
        kept[[i for i in missing.tolist() if weights[i] is None]] = False
        if 0 < len(cells) - last <= min(_MOST_FOOTERS, last):
            kept[last:] = False
            shown = cells[last]
            what = f"'{short_name(shown)}' in place of a time" if shown else "no time"
            count = len(cells) - last
            rows, were = ("row has", "it was") if count == 1 else (f"{count} rows have", "they were")
            notes.append(f"Its last {rows} {what}; {were} left out.")
    same = np.array([False, *(bool(one) and one == two for one, two in itertools.pairwise(cells))]) & kept
    repeats = np.flatnonzero(same)
    equal = [i for i in repeats.tolist() if weights[i] is not None and _same(weights[i], weights[i - 1])]
    # Times that are all the same tell nothing.
    if equal and len(set(cells)) > 1 and len(equal) >= _MOST_REPEAT * len(repeats):
        kept[equal] = False
        does = "1 of its rows repeats" if len(equal) == 1 else f"{len(equal)} of its rows repeat"
        notes.append(f"{does} the row before and {'was' if len(equal) == 1 else 'were'} left out.")
    return kept, " ".join(notes)


def _same(one: Array | None, other: Array | None) -> bool:
    return one is not None and other is not None and np.array_equal(one, other)


def _known(heading: str, cells: Sequence[str]) -> Mask:
    """Return which of the ``cells`` have a time or the number of a frame."""
    found = None if is_frame_number(heading) else times_of(heading, cells)
    if found is None:
        return np.array([decimal_number(cell) is not None for cell in cells])
    return np.isfinite(found.seconds)


def unread_note(names: Sequence[str]) -> str:
    """Return the sentence about columns with ``names`` that are none of ARKit's shapes, with guesses, or "".

    Times, numbers of frames, rotations and other columns of known programs are left out.
    """
    unread = [name.strip() for name in names if not _is_other(name)]
    if not unread:
        return ""
    guesses = {name: guess for name in unread[:_MOST_GUESSED] if (guess := guessed(name))}
    shown = [*guesses, *(name for name in unread if name not in guesses)][:3]
    listed = ", ".join(
        f"'{short_name(name[:_LONGEST_NAME])}'" + (f" ({guesses[name]}?)" if name in guesses else "") for name in shown
    )
    rest = len(unread) - len(shown)
    what = counted(len(unread), "column")
    return f"{what} {'was' if len(unread) == 1 else 'were'} not read: {listed}{f' and {rest} more' if rest else ''}."


def guessed(name: str) -> str | None:
    """Return the one of ARKit's shapes that ``name`` misspells, or None."""
    letters = _letters(name)
    if not 4 <= len(letters) <= _LONGEST_NAME:
        return None
    by_letters = {shape.lower(): shape for shape in ARKIT_SHAPES}
    close = difflib.get_close_matches(letters, list(by_letters), 1, _LIKE)
    return by_letters[close[0]] if close else None


def _is_other(name: str) -> bool:
    letters = _letters(name)
    return (
        is_time(name)
        or is_frame_number(name)
        or _OTHERS.fullmatch(letters) is not None
        or _TURN.search(letters) is not None
        or _FACE.fullmatch(letters) is not None
    )


def _letters(name: str) -> str:
    return re.sub(r"[^a-z]", "", name[:80].lower())
