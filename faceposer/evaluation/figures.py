"""Figures of a study as PNG and SVG, modelled on Figures 14 and 16 and Table II of the paper."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError
from faceposer.evaluation.rows import Row
from faceposer.evaluation.tables import TIMED, targets, timed_rows

_KINDS = {"point": "points", "distance": "distances", "stroke": "pixels of a stroke"}
# Paul Tol's "muted" scheme, distinct for all common kinds of colour vision; markers distinguish methods in greyscale.
_STYLES: dict[str, tuple[str, str, str]] = {
    "mfa": ("#000000", "o", "-"),
    "mfa-whole": ("#666666", "o", "--"),
    "mfa-undamped": ("#999999", "o", ":"),
    "mfa-plain": ("#882255", "s", "-"),
    "ppca": ("#332288", "^", "-"),
    "pca": ("#88CCEE", "v", "--"),
    "lwr": ("#CC6677", "D", "-"),
    "opt-blend": ("#117733", "P", "-"),
    "interp-all": ("#999933", "X", "-"),
    "bounded-weights": ("#DDAA33", "<", "-"),
    "eos": ("#AA4499", ">", "--"),
    "arap": ("#44AA99", "p", "--"),
}
_OTHER_STYLE = ("#555555", "*", ":")
# Upper limits of the axes: larger errors only show that a method is useless.
_MAX_ERROR, _MAX_ERROR_PX = 1.5, 6.0
_FONT: dict[Any, Any] = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.labelsize": 10,
    "legend.fontsize": 10,
    "svg.hashsalt": "faceposer",
}


def require_matplotlib() -> None:
    """Check that matplotlib is installed.

    Raises:
        FacePoserError: If it is not.
    """
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise FacePoserError(
            "The figures need matplotlib: pip install 'faceposer[plots]', or omit them with --no-figures."
        ) from None


def write_figures(folder: Path, rows: Sequence[Row]) -> list[Path]:
    """Draw the figures for ``rows`` into ``folder``, and return their paths.

    Raises:
        FacePoserError: If matplotlib is not installed or a file cannot be written.
    """
    require_matplotlib()
    import matplotlib

    written: list[Path] = []
    with matplotlib.rc_context(_FONT):
        for noise in dict.fromkeys(row["noise_px"] for row in rows):
            of_noise = [row for row in rows if row["noise_px"] == noise]
            suffix = f"{noise:g}px" if noise else "exact"
            anywhere = [row for row in of_noise if "region" not in row]
            regional = [row for row in of_noise if "region" in row]
            if anywhere:
                written += _write(folder / f"errors-{suffix}", _errors(anywhere, noise))
            if regional:
                written += _write(folder / f"regions-{suffix}", _regions(regional, noise))
        first = [row for row in rows if row["noise_px"] == rows[0]["noise_px"] and "region" not in row]
        if first:
            written += _write(folder / "times", _times(first))
        if timed_rows(rows):
            written += _write(folder / "time-table", _time_table(timed_rows(rows)))
    return written


def _figure(width: float, height: float) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _write(path: Path, figure: Any) -> list[Path]:
    written = []
    for suffix in (".png", ".svg"):
        target = path.with_name(path.name + suffix)
        temporary = target.with_name(f".{target.name}.tmp")
        try:
            # Without a date, the same rows give the same bytes.
            metadata = {"Date": None} if suffix == ".svg" else {"Software": None}
            figure.savefig(temporary, format=suffix[1:], dpi=150, metadata=metadata)
            temporary.replace(target)
        except OSError as error:
            temporary.unlink(missing_ok=True)
            raise FacePoserError(f"The figure '{target}' cannot be written: {error.strerror}.") from error
        written.append(target)
    return written


def _style(method: str) -> tuple[str, str, str]:
    return _STYLES.get(method, _OTHER_STYLE)


def _kinds(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["constraint"] for row in rows))


def _methods(rows: Sequence[Row]) -> list[str]:
    """Return the methods of ``rows``, with ours last, so that it is drawn over the others."""
    return sorted(dict.fromkeys(row["method"] for row in rows), key=lambda name: name == "mfa")


def _curves(axes: Any, rows: Sequence[Row], value: str, band: str) -> None:
    """Plot ``value`` over the counts, as a line with a 95 % ``band`` for each method."""
    for method in _methods(rows):
        of = sorted((row for row in rows if row["method"] == method), key=lambda row: row["count"])
        colour, marker, dashes = _style(method)
        counts = [row["count"] for row in of]
        ours = method == "mfa"
        low, high = zip(*(row[band] for row in of), strict=True)
        if len(of) > 1:
            axes.fill_between(counts, low, high, color=colour, alpha=0.18 if ours else 0.10, lw=0)
        else:
            axes.vlines(counts, low, high, color=colour, linewidth=1.0)
        axes.plot(
            counts,
            [row[value] for row in of],
            color=colour,
            marker=marker,
            linestyle=dashes,
            linewidth=2.6 if ours else 1.4,
            markersize=6 if ours else 5,
            label=method,
        )
    counts = sorted({row["count"] for row in rows})
    axes.set_xscale("log", base=2)
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.minorticks_off()
    axes.grid(alpha=0.25)


def _limit(axes: Any, rows: Sequence[Row], value: str, least: float, most: float) -> None:
    """Limit ``axes`` to the range of ``value``, between ``least`` and ``most``, and name the methods beyond it."""
    axes.set_ylim(0.0, min(max(least, 1.05 * max(row[value] for row in rows)), most))
    beyond = list(dict.fromkeys(row["method"] for row in rows if row[value] > most))
    if beyond:
        remark = f"beyond {most:g}: {', '.join(beyond)}"
        axes.text(0.98, 0.98, remark, transform=axes.transAxes, ha="right", va="top", fontsize=8)


def _legend(figure: Any, axes: Sequence[Any]) -> None:
    labels: dict[str, Any] = {}
    for panel in axes:
        handles, names = panel.get_legend_handles_labels()
        labels |= dict(zip(names, handles, strict=True))
    order = [name for name in _STYLES if name in labels] + [name for name in labels if name not in _STYLES]
    figure.legend([labels[name] for name in order], order, loc="outside right center", frameon=False)


def _errors(rows: Sequence[Row], noise: float) -> Any:
    """Draw Figure 16: 3D and 2D errors by the number of constraints."""
    kinds = _kinds(rows)
    figure = _figure(3.6 * len(kinds) + 2.0, 6.6)
    panels = figure.subplots(2, len(kinds), squeeze=False)
    for column, kind in enumerate(kinds):
        of = [row for row in rows if row["constraint"] == kind]
        above, below = panels[0, column], panels[1, column]
        _curves(above, of, "error_3d_relative", "ci95")
        above.axhline(1.0, color="#444444", linewidth=1.0, linestyle=(0, (1, 2)))
        _limit(above, of, "error_3d_relative", 1.1, _MAX_ERROR)
        _curves(below, of, "error_2d_px", "error_2d_ci95")
        _limit(below, of, "error_2d_px", 1.0, _MAX_ERROR_PX)
        above.set_title({"point": "Points", "distance": "Distances", "stroke": "Strokes"}[kind])
        below.set_xlabel(f"{'number of ' if kind != 'stroke' else ''}{_KINDS[kind]}")
    panels[0, 0].set_ylabel("3D error, neutral face = 1")
    panels[1, 0].set_ylabel("2D error, px")
    figure.suptitle(f"Errors by the number of constraints, {targets(noise)}; bands: 95 %")
    _legend(figure, list(panels[0]))
    return figure


def _times(rows: Sequence[Row]) -> Any:
    """Draw Figure 14 for all methods: time of a solve by the number of constraints."""
    kinds = _kinds(rows)
    figure = _figure(3.6 * len(kinds) + 2.0, 3.8)
    panels = figure.subplots(1, len(kinds), squeeze=False, sharey=True)[0]
    for axes, kind in zip(panels, kinds, strict=True):
        _curves(axes, [row for row in rows if row["constraint"] == kind], "ms", "ms_ci95")
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(lambda y, _: f"{y:g}")
        axes.set_xlabel(f"{'number of ' if kind != 'stroke' else ''}{_KINDS[kind]}")
    panels[0].set_ylabel("median time of a solve, ms")
    figure.suptitle("Time of a solve from the neutral face; bands: 95 %")
    _legend(figure, list(panels))
    return figure


def _regions(rows: Sequence[Row], noise: float) -> Any:
    """Draw the errors with constraints in one region only: a panel for each region, a line for each method."""
    regions = list(dict.fromkeys(row["region"] for row in rows))
    methods = [name for name in _STYLES if any(row["method"] == name for row in rows)]
    methods += [name for name in _methods(rows) if name not in methods]
    cells = list(dict.fromkeys((row["constraint"], row["count"]) for row in rows))
    figure = _figure(2.6 * len(regions) + 1.6, 0.34 * len(methods) + 1.9)
    panels = figure.subplots(1, len(regions), squeeze=False, sharey=True, sharex=True)[0]
    markers = "osD^vPX"
    for axes, region in zip(panels, regions, strict=True):
        for i, (kind, count) in enumerate(cells):
            offset = 0.5 * ((i + 0.5) / len(cells) - 0.5)
            label = f"{count} {_KINDS[kind] if kind == 'stroke' or count > 1 else kind}"
            for j, method in enumerate(methods):
                for row in rows:
                    if (row["method"], row["region"], row["constraint"], row["count"]) == (method, region, kind, count):
                        colour = _style(method)[0]
                        axes.plot(row["ci95"], [j + offset] * 2, color=colour, linewidth=1.4)
                        beyond = row["error_3d_relative"] > _MAX_ERROR
                        axes.plot(
                            [min(row["error_3d_relative"], _MAX_ERROR)],
                            [j + offset],
                            color=colour,
                            marker=">" if beyond else markers[i % len(markers)],
                            clip_on=not beyond,
                            markersize=5,
                            linestyle="none",
                            markerfacecolor=colour if i % 2 else "white",
                        )
            # An empty entry for the legend: markers distinguish cells, colours repeat the methods.
            axes.plot(
                [],
                [],
                color="#444444",
                marker=markers[i % len(markers)],
                linestyle="none",
                markerfacecolor="#444444" if i % 2 else "white",
                label=label,
            )
        axes.axvline(1.0, color="#444444", linewidth=1.0, linestyle=(0, (1, 2)))
        axes.set_title(region)
        axes.grid(alpha=0.25, axis="x")
    panels[0].set_yticks(range(len(methods)), methods)
    panels[0].invert_yaxis()
    panels[0].set_xlim(0.0, min(max(1.1, 1.05 * max(row["error_3d_relative"] for row in rows)), _MAX_ERROR))
    figure.supxlabel("3D error of the face, neutral face = 1; lines: 95 %; >: beyond", fontsize=10)
    figure.suptitle(f"Constraints in one region only, {targets(noise)}")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center", frameon=False)
    return figure


def _time_table(rows: Sequence[Row]) -> Any:
    """Draw Table II: time of a solve with 4 points, 4 distances and a stroke of 450 pixels."""
    columns = [cell for cell in TIMED if any((row["constraint"], row["count"]) == cell[:2] for row in rows)]
    methods = [name for name in _STYLES if any(row["method"] == name for row in rows)]
    methods += [name for name in _methods(rows) if name not in methods]
    cells = {(row["method"], row["constraint"], row["count"]): f"{row['ms']:.1f}" for row in rows}
    text = [[cells.get((method, kind, count), "-") for kind, count, _ in columns] for method in methods]
    figure = _figure(1.5 + 1.3 * len(columns), 0.28 * (len(methods) + 1) + 0.6)
    axes = figure.subplots()
    axes.axis("off")
    table = axes.table(
        cellText=text,
        rowLabels=methods,
        colLabels=[title for _, _, title in columns],
        cellLoc="right",
        rowLoc="left",
        bbox=(0.28, 0.0, 0.72, 1.0),
        edges="horizontal",
    )
    table.auto_set_font_size(False)
    table.set_fontsize(10)
    for (line, column), cell in table.get_celld().items():
        cell.set_edgecolor("#bbbbbb")
        if line == 0 or (column == -1 and methods[line - 1] == "mfa"):
            cell.get_text().set_fontweight("bold")
    axes.set_title("Median time of a solve, ms")
    return figure
