"""Sliders for the settings of a constraint."""

from dataclasses import MISSING, fields, replace
from typing import Any

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.sliders import reset_button, row_label, slider, slider_room
from faceposer.gui.widgets.tooltips import tooltip
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
    """Draw a slider for ``attribute`` of constraint ``index``, which can be reset if the attribute has a default."""
    constraint: Any = context.session.document.constraints[index]
    default = next((f.default for f in fields(constraint) if f.name == attribute), MISSING)

    def changed_to(new: float) -> Constraint:
        changed: Constraint = replace(constraint, **{attribute: new})
        return changed

    value_slider(
        context,
        index,
        title,
        attribute,
        value,
        limits,
        form,
        changed_to,
        tip,
        logarithmic,
        None if default is MISSING else default,
    )


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
    default: float | None = None,
) -> None:
    """Draw a slider for a setting of constraint ``index``, which can be reset to the ``default``, if there is one.

    ``changed_to(value)`` returns the changed constraint.
    """
    row_label(title, tip)
    # The room of the button is kept where there is none, so that all sliders end at the same edge.
    imgui.set_next_item_width(slider_room())
    flags = imgui.SliderFlags_.clamp_on_input.value | (imgui.SliderFlags_.logarithmic.value if logarithmic else 0)
    changed, new = slider(f"##{key}", value, limits[0], limits[1], form, flags)
    context.widget_rects.record(f"detail:{key}")

    def apply() -> None:
        context.session.change_constraint(index, changed_to(new), f"Change {title.lower()}")

    context.slider_edit.update(context.session, f"{key}:{index}", f"Change the {title.lower()}", changed, apply)
    tooltip(tip)
    if default is None:
        return
    if reset_button(context.widget_rects, f"detail:{key}", value == default, f"Reset to {default:g}"):
        context.session.change_constraint(index, changed_to(default), f"Change the {title.lower()}")


def weight_slider(context: EditorContext, index: int, constraint: Constraint) -> None:
    """Draw the slider for the weight."""
    tip = "Weight relative to other constraints and to the prior."
    limits = (0.0, LARGEST_WEIGHT)
    attribute_slider(context, index, "Weight", "weight", constraint.weight, limits, "%.2f", tip, logarithmic=True)
