"""Sliders for the settings of a constraint."""

from dataclasses import replace
from typing import Any

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import tooltip
from faceposer.gui.widgets.theme import em
from faceposer.solve.constraints.registry import Constraint

LARGEST_WEIGHT = 100.0


def attribute_slider(
    context: EditorContext,
    index: int,
    title: str,
    attribute: str,
    value: float,
    limits: tuple[float, float],
    form: str,
    tip: str,
    logarithmic: bool = False,
) -> None:
    """Draw a slider for ``attribute`` of constraint ``index``."""
    constraint: Any = context.session.document.constraints[index]

    def changed_to(new: float) -> Constraint:
        changed: Constraint = replace(constraint, **{attribute: new})
        return changed

    value_slider(context, index, title, attribute, value, limits, form, changed_to, tip, logarithmic)


def value_slider(
    context: EditorContext,
    index: int,
    title: str,
    key: str,
    value: float,
    limits: tuple[float, float],
    form: str,
    changed_to: Any,
    tip: str = "",
    logarithmic: bool = False,
) -> None:
    """Draw a slider for a setting of constraint ``index``; ``changed_to(value)`` returns the changed constraint."""
    imgui.align_text_to_frame_padding()
    imgui.text(title)
    imgui.same_line(em(6.6))
    imgui.set_next_item_width(-1.0)
    flags = imgui.SliderFlags_.clamp_on_input | (imgui.SliderFlags_.logarithmic if logarithmic else 0)
    changed, new = imgui.slider_float(f"##{key}", value, limits[0], limits[1], form, flags)
    context.widget_rects.record(f"detail:{key}")

    def apply() -> None:
        context.session.change_constraint(index, changed_to(new), f"Change {title.lower()}")

    context.slider_edit.update(context.session, f"{key}:{index}", f"Change the {title.lower()}", changed, apply)
    if tip:
        tooltip(tip)


def weight_slider(context: EditorContext, index: int, constraint: Constraint) -> None:
    """Draw the slider for the weight."""
    tip = "Weight relative to other constraints and to the prior."
    limits = (0.0, LARGEST_WEIGHT)
    attribute_slider(context, index, "Weight", "weight", constraint.weight, limits, "%.2f", tip, logarithmic=True)
