"""The rows as tables: gestures by characters."""

from collections.abc import Sequence

from faceposer.evaluation.gestures.rows import Row, missed


def summary(rows: Sequence[Row], most: int = 2) -> str:
    """Return a table of gestures by characters: "ok", or what is missed, the farthest first, ``most`` of each."""
    characters = list(dict.fromkeys(row["character"] for row in rows))
    cells = {(row["gesture"], row["character"]): _cell(row, most) for row in rows}
    lines = [["gesture", *characters]]
    for name in dict.fromkeys(row["gesture"] for row in rows):
        lines.append([name, *(cells.get((name, character), "-") for character in characters)])
    total = [
        f"{sum(r['holds'] for r in rows if r['character'] == c)}/{sum(r['character'] == c for r in rows)}"
        for c in characters
    ]
    lines.append(["hold", *total])
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines)


def _cell(row: Row, most: int) -> str:
    if row["holds"]:
        return "ok"
    found = missed(row)
    rest = f", +{len(found) - most}" if len(found) > most else ""
    return ", ".join(found[:most]) + rest
