"""Summary of an imported character: a table of facts and three curves that measure its quality."""

from typing import Any

import numpy as np
from imgui_bundle import imgui, implot

from faceposer.errors import counted
from faceposer.gui.recent_files import shown_path
from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import ACCENT, FAINT, TARGET, WARNING, Fonts, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects
from faceposer.training.summary import arkit_shapes_of

_LABEL = 8.4
# Facts that are collapsed at first.
_DETAILS = ("Parts", "Dimensions", "Retained", "Prior", "Held-out faces", "Neutral")
_PLOTS = (
    ("compactness", "Compactness", 1.0, "Share of the energy that a number of components retains"),
    (
        "generalization_cm",
        "Generalization, mm",
        10.0,
        "Error of held-out expressions for a number of components",
    ),
    (
        "specificity_cm",
        "Specificity, mm",
        10.0,
        "Distance of random samples from the nearest example",
    ),
)
# Largest number of names in a list; the others are counted.
_MANY = 8


def draw_summary(fonts: Fonts, rects: WidgetRects, about: dict[str, Any]) -> None:
    """Draw the summary of ``about``, the description of a character (``description_of``) with its file as "path"."""
    imgui.text_colored(TARGET, Icon.CHECK)
    imgui.same_line()
    imgui.push_font(fonts.bold, 0.0)
    imgui.text_unformatted(displayed(f"{about['title']} is ready"))
    imgui.pop_font()
    imgui.dummy((0.0, em(0.1)))
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(displayed(sentence_of(about)))
    imgui.pop_text_wrap_pos()
    imgui.dummy((0.0, em(0.1)))
    facts = facts_of(about)
    for label, text in facts:
        if label not in _DETAILS:
            _row(label, text)
    for warning in about["summary"].get("warnings", []):
        _row("Note", warning, WARNING)
    opened = imgui.tree_node_ex("Details", imgui.TreeNodeFlags_.span_avail_width.value)
    rects.record("import:details")
    if not opened:
        return
    for label, text in facts:
        if label in _DETAILS:
            _row(label, text)
    curves = about["summary"].get("curves")
    if curves:
        _draw_curves(curves)
    imgui.tree_pop()


def sentence_of(about: dict[str, Any]) -> str:
    """Return a sentence about the quality of the character."""
    summary = about["summary"]
    source = "the rig's shapes" if summary["kind"] == "rig" else "the examples"
    ignored = len(summary.get("not_arkit", ()))
    if ignored:
        source = f"the {counted(summary['shapes'], 'shape', 'shapes')} in use"
    text = f"The character reproduces {_percent(summary['kept_energy'])} of the motion of {source}"
    curves = summary.get("curves", {})
    if curves.get("generalization_cm"):
        text += f", and held-out expressions with an error of {10.0 * curves['generalization_cm'][-1]:.2f} mm"
    if ignored:
        verb = "is" if ignored == 1 else "are"
        text += f"; {counted(ignored, 'other shape', 'other shapes')} of the rig {verb} ignored"
    return f"{text}."


def facts_of(about: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the rows of the table as pairs of label and text."""
    summary = about["summary"]
    rows = [
        ("Saved as", shown_path(about["path"])),
        ("Mesh", f"{about['file_vertices']:,} vertices, {about['polygons']:,} faces"),
        ("Parts", _listed([part["name"] for part in about["parts"]])),
    ]
    if summary["kind"] == "rig":
        rows.append(("Shapes", arkit_shapes_of(summary)))
        for key, label in (("missing", "Missing"), ("empty", "Empty"), ("not_arkit", "Ignored")):
            if summary[key]:
                rows.append((label, _listed(summary[key])))
        if summary["eyes_turned"]:
            rows.append(("Eyes", f"{_listed(summary['eyes_turned'])}: no shape rotated them, now they follow the gaze"))
        retained = f"{_percent(summary['kept_energy'])} of the motion"
        if summary["worst"]["shape"]:
            retained += f"; least for {summary['worst']['shape']}, {_percent(1.0 - summary['worst']['unreached'])}"
        rows.append(("Retained", retained))
    else:
        rows.append(("Examples", f"{summary['examples']}"))
        if "markers" in summary:
            marked = summary["markers"]
            frames, gaps = counted(marked["frames"], "frame"), counted(marked["gaps_filled"], "gap")
            text = f"{frames}, {marked['frames_left_out']} left out, {gaps} filled"
            rows.append(("Markers", text))
        rows.append(("Neutral", shown_path(summary["neutral"])))
        worst_region = summary["worst"]
        rows.append(
            (
                "Retained",
                f"{_percent(summary['kept_energy'])} of the motion; least for {worst_region['region']}, "
                f"{_percent(worst_region['kept_energy'])}",
            )
        )
    rows.append(("Dimensions", str(summary["dimensions"])))
    rows.append(("Prior", _prior(summary["prior"])))
    curves = summary.get("curves", {})
    if curves.get("generalization_cm"):
        error, baseline = 10.0 * curves["generalization_cm"][-1], 10.0 * curves["neutral_cm"]
        rows.append(("Held-out faces", f"error {error:.2f} mm; {baseline:.2f} mm for the neutral face"))
    return rows


def _prior(prior: dict[str, Any]) -> str:
    if "components" not in prior:
        return f"{prior['from']}"
    count, factors = prior["components"], prior["factors"]
    text = f"{counted(count, 'factor analyzer', 'factor analyzers')} of {counted(factors, 'factor', 'factors')}"
    text += ", set by the user" if prior.get("fixed_by_user") else ", chosen from held-out data"
    if prior.get("takes"):
        text += "; from " + _listed([f"{take['file']} ({counted(take['frames'], 'frame')})" for take in prior["takes"]])
    return text


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _listed(names: list[str]) -> str:
    rest = len(names) - _MANY
    return ", ".join(names[:_MANY]) + (f" and {rest} more" if rest > 0 else "")


def _row(label: str, text: str, colour: tuple[float, float, float, float] | None = None) -> None:
    left = imgui.get_cursor_pos_x()
    imgui.text_colored(colour or FAINT, label)
    imgui.same_line(left + em(_LABEL))
    imgui.push_text_wrap_pos(0.0)
    # A file name may contain format specifiers.
    imgui.text_unformatted(displayed(text))
    imgui.pop_text_wrap_pos()


def _draw_curves(curves: dict[str, Any]) -> None:
    """Draw the curves side by side, against the number of components."""
    imgui.dummy((0.0, em(0.3)))
    shown = [plot for plot in _PLOTS if len(curves.get(plot[0], ())) > 1]
    if not shown:
        return
    gap = imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap * (len(shown) - 1)) / len(shown)
    components = np.asarray(curves["components"], dtype=np.float64)
    flags = implot.Flags_.no_inputs | implot.Flags_.no_legend | implot.Flags_.no_menus | implot.Flags_.no_mouse_text
    axis = implot.AxisFlags_.no_highlight | implot.AxisFlags_.no_menus
    for i, (key, title, factor, tip) in enumerate(shown):
        if i:
            imgui.same_line(0.0, gap)
        imgui.begin_group()
        imgui.text_colored(FAINT, title)
        values = factor * np.asarray(curves[key], dtype=np.float64)
        if implot.begin_plot(f"##{key}", (width, em(9)), flags):
            implot.setup_axes("components", "", axis, axis)
            top = 1.05 * max(float(values.max()), 1e-6)
            implot.setup_axes_limits(0.0, float(components[-1]) + 1.0, 0.0, top, implot.Cond_.always)
            spec = implot.Spec()
            spec.line_color = imgui.ImVec4(*ACCENT)
            spec.line_weight = em(0.12)
            implot.plot_line(f"##{key}line", components[: len(values)], values, spec=spec)
            implot.end_plot()
        imgui.end_group()
        tooltip(tip)
