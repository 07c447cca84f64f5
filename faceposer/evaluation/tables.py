"""Markdown tables of rows: methods by numbers of constraints."""

from collections.abc import Callable, Sequence

from faceposer.evaluation.rows import Row

#: Cells of the paper's Table II.
TIMED: tuple[tuple[str, int, str], ...] = (
    ("point", 4, "4 points"),
    ("distance", 4, "4 distances"),
    ("stroke", 450, "450 pixels"),
)
_PLURALS = {"point": "points", "distance": "distances", "stroke": "strokes (pixels)"}

_WORSE = "Share of trials that end worse than the neutral face"

LEGEND = (
    "3D error, summed over the trials and divided by that of the neutral face; **lowest** of the column; † not "
    "significantly above the lowest: the 95 % interval of the difference between the two relative errors over the same "
    "trials (bootstrap, 2000 resamples) is not above 0."
)


def error_tables(rows: Sequence[Row], legend: bool = True) -> str:
    """Return the tables of relative 3D errors for each noise level, with those of regions below, after the legend."""
    parts = [LEGEND] if legend else []
    for noise in _noises(rows):
        of_noise = [row for row in rows if row["noise_px"] == noise]
        parts.append(f"### 3D error, {targets(noise)}")
        parts.append(_table([row for row in of_noise if "region" not in row], _error))
        regional = [row for row in of_noise if "region" in row]
        if regional:
            parts += [
                f"### 3D error of the face, constraints in one region only, {targets(noise)}",
                _table(regional, _error),
            ]
    return "\n\n".join(parts) + "\n"


def time_table(rows: Sequence[Row]) -> str:
    """Return the table of median times, in ms, as in the paper's Table II, at the first noise level, or ""."""
    timed = timed_rows(rows)
    if not timed:
        return ""
    return "### Time of a solve from the neutral face, median ms (as Table II)\n\n" + _table(timed, _ms, "count") + "\n"


def timed_rows(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of the paper's Table II for the first noise level."""
    cells = {(kind, count) for kind, count, _ in TIMED}
    noises = _noises(rows)
    return [
        row
        for row in rows
        if (row["constraint"], row["count"]) in cells and "region" not in row and row["noise_px"] == noises[0]
    ]


def share_tables(rows: Sequence[Row]) -> str:
    """Return the tables of the share of trials that end worse than the neutral face, one for each noise level."""
    parts = []
    for noise in _noises(rows):
        of_noise = [row for row in rows if row["noise_px"] == noise and "region" not in row]
        if of_noise:
            parts += [f"### {_WORSE}, {targets(noise)}", _table(of_noise, _share)]
    return "\n\n".join(parts) + "\n" if parts else ""


def other_tables(rows: Sequence[Row]) -> str:
    """Return the tables of the other measures for each noise level."""
    parts = []
    measures: tuple[tuple[str, Callable[[Row], str]], ...] = (
        (_WORSE, _share),
        ("2D error, px", lambda row: f"{row['error_2d_px']:.2f}"),
        ("Distance to the nearest real frame, in the mesh's unit", lambda row: f"{row['to_real']:.3f}"),
        ("Held-out log-likelihood per component", lambda row: f"{row['log_likelihood']:.2f}"),
        ("Time of a solve, median ms", _ms),
    )
    for noise in _noises(rows):
        of_noise = [row for row in rows if row["noise_px"] == noise]
        anywhere, regional = ([row for row in of_noise if ("region" in row) is inside] for inside in (False, True))
        for title, text in measures:
            parts += [f"### {title}, {targets(noise)}", _table(anywhere, text)]
        if regional:
            title, text = measures[0]
            parts += [f"### {title}, constraints in one region only, {targets(noise)}", _table(regional, text)]
    return "\n\n".join(parts) + "\n"


def targets(noise_px: float) -> str:
    """Describe targets with the noise ``noise_px``, a standard deviation in pixels."""
    return f"target noise {noise_px:g} px" if noise_px else "exact targets"


def _noises(rows: Sequence[Row]) -> list[float]:
    return list(dict.fromkeys(row["noise_px"] for row in rows))


def _error(row: Row) -> str:
    value = (
        f"{row['error_3d_relative']:.3f}".replace("0.", ".", 1)
        if row["error_3d_relative"] < 1
        else f"{row['error_3d_relative']:.2f}"
    )
    if row["lowest"]:
        return f"**{value}**"
    return f"{value}†" if row["within"] else value


def _share(row: Row) -> str:
    return f"{row['worse_than_neutral']:.2f}"


def _ms(row: Row) -> str:
    return f"{row['ms']:.3g}" if row["ms"] < 1000 else f"{row['ms']:.0f}"


def _table(rows: Sequence[Row], text: Callable[[Row], str], heads: str = "kind") -> str:
    """Return ``rows`` as a table with a line for each method and a column for each cell.

    Args:
        rows: The rows.
        text: Returns the text of a row's table cell.
        heads: "count" to name the kind in the head of every column, "kind" only where it changes.
    """
    columns = list(dict.fromkeys((row["constraint"], row["count"], row.get("region")) for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    cells = {(row["method"], row["constraint"], row["count"], row.get("region")): text(row) for row in rows}
    titles, last = [], None
    for kind, count, region in columns:
        title = str(count)
        if (kind, region) != last or heads == "count":
            title = " ".join(word for word in (region, _PLURALS[kind], str(count)) if word)
        last = (kind, region)
        titles.append(title)
    lines = [f"| | {' | '.join(titles)} |", "| --- " * (len(columns) + 1) + "|"]
    lines += [
        f"| `{method}` | {' | '.join(cells.get((method, *column), '') for column in columns)} |" for method in methods
    ]
    return "\n".join(lines)
