"""Tables of the rows: gestures by characters, and the generated part of docs/gestures.md."""

from collections.abc import Sequence

from faceposer.errors import FacePoserError
from faceposer.evaluation.gestures.expressions import EXPRESSIONS
from faceposer.evaluation.gestures.gesture import Gesture
from faceposer.evaluation.gestures.rows import Row, missed
from faceposer.evaluation.gestures.table import BY_NAME

BEGIN, END = "<!-- begin: written by scripts/study_gestures.py -->", "<!-- end -->"
# Text for gestures for which a character lacks the places.
_ABSENT = "n/a"
# Number of missed limits that a cell names.
_NAMED = 2


def grid(rows: Sequence[Row]) -> list[list[str]]:
    """Return the table of gestures by characters, with a head and a last line of totals: "ok", or the missed limits."""
    characters = _characters(rows)
    cells = {(row["gesture"], row["character"]): _cell(row) for row in rows}
    lines = [["", *characters]]
    for name in dict.fromkeys(row["gesture"] for row in rows):
        lines.append([name, *(cells.get((name, character), _ABSENT) for character in characters)])
    totals = []
    for character in characters:
        holds = [row["holds"] for row in rows if row["character"] == character]
        totals.append(f"{sum(holds)} of {len(holds)} hold")
    return [*lines, ["", *totals]]


def summary(rows: Sequence[Row]) -> str:
    """Return the table for a terminal."""
    lines = grid(rows)
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    padded = ("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines)
    return "\n".join(line.rstrip() for line in padded)


def markdown(rows: Sequence[Row], settings: str) -> str:
    """Return the generated part of the page: the ``settings``, the table, and the times of the expressions."""
    head, *body, totals = grid(rows)
    titled = [[_linked(BY_NAME[line[0]]), *line[1:]] for line in body]
    parts = [f"Settings: {settings}.", _table([head, *titled, ["", *(f"**{total}**" for total in totals[1:])]])]
    timed = _expression_times(rows)
    if timed:
        parts.append("Total time of the solves of an expression, in milliseconds:")
        parts.append(_table(timed))
    return "\n\n".join(parts) + "\n"


def spliced(page: str, written: str) -> str:
    """Return ``page`` with the text between the marks replaced by ``written``.

    Raises:
        FacePoserError: If the page has no marks.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise FacePoserError(f"The page has no marks '{BEGIN}' and '{END}' for the tables; add them.")
    return f"{before}{BEGIN}\n\n{written}\n{END}{after}"


def _expression_times(rows: Sequence[Row]) -> list[list[str]]:
    characters = _characters(rows)
    times = {(row["gesture"], row["character"]): row for row in rows}
    lines = [["expression", "gestures", *characters]]
    for gesture in EXPRESSIONS:
        of_gesture = [times.get((gesture.name, character)) for character in characters]
        if any(of_gesture):
            cells = [f"{row['solves_ms']:.0f}" if row else _ABSENT for row in of_gesture]
            lines.append([gesture.title, str(len(gesture.actions)), *cells])
    return lines if len(lines) > 1 else []


def _characters(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["character"] for row in rows))


def _linked(gesture: Gesture) -> str:
    return f"{gesture.title} (`{gesture.name}`)"


def _cell(row: Row) -> str:
    texts = missed(row)
    if not texts:
        return "ok"
    more = f", {len(texts) - _NAMED} more" if len(texts) > _NAMED else ""
    return ", ".join(texts[:_NAMED]) + more


def _table(lines: Sequence[Sequence[str]]) -> str:
    head, *body = ("| " + " | ".join(line) + " |" for line in lines)
    return "\n".join([head, "| --- " * len(lines[0]) + "|", *body])
