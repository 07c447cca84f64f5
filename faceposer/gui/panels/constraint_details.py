"""What can be set on the selected constraint: its weight, and what its kind has beside that."""

from dataclasses import replace
from typing import Any

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import caption, choice, tooltip
from faceposer.gui.widgets.theme import WARNING, em
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.gaze import MOST_PITCH, MOST_YAW, GazeConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.stroke import STROKE_ENERGIES, StrokeConstraint

LARGEST_WEIGHT, LARGEST_HOLD = 100.0, 1000.0


def draw_details(context: EditorContext, index: int) -> None:
    """Draw what can be set on constraint ``index``."""
    imgui.push_id(f"constraint {index}")
    _draw_details(context, index)
    imgui.pop_id()


def _draw_details(context: EditorContext, index: int) -> None:
    constraint = context.session.document.constraints[index]
    conflict = context.drawn_constraints.conflicts.get(index)
    if conflict is not None:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*WARNING))
        imgui.text_wrapped(conflict)
        imgui.pop_style_color()
    imgui.begin_disabled(constraint.locked or context.toolbox.active)
    if isinstance(constraint, DistanceConstraint):
        _distance(context, index, constraint)
    elif isinstance(constraint, StrokeConstraint):
        _stroke(context, index, constraint)
    elif isinstance(constraint, GazeConstraint):
        _gaze(context, index, constraint)
    if isinstance(constraint, FixedConstraint):
        caption(f"{len(constraint.points)} vertices, held where they were")
        tip = "From free, at 0, to immovable."
        _slider(context, index, "Hold", "weight", constraint.weight, (0.0, LARGEST_HOLD), "%.2f", tip, logarithmic=True)
    elif not isinstance(constraint, GazeConstraint):
        tip = "How much this one counts against the others and against what is natural."
        _slider(
            context, index, "Weight", "weight", constraint.weight, (0.0, LARGEST_WEIGHT), "%.2f", tip, logarithmic=True
        )
    imgui.end_disabled()
    if constraint.camera is not None and constraint.camera.transferred((0.0, 0.0), context.viewport.camera) is None:
        if imgui.button("Look from where it was drawn", (-1.0, 0.0)):
            context.viewport.look_through(constraint.camera)
        context.widget_rects.record("its-view")
        tooltip("Turn to the view that it was drawn in, where its target can be seen and changed")


def _distance(context: EditorContext, index: int, constraint: DistanceConstraint) -> None:
    low, high = constraint.reach(context.session.model)
    limits = (min(low, constraint.target), max(high, constraint.target))
    tip = "Pixels between the two points, as far as this face can do. Ctrl+click to type a value."
    _slider(context, index, "Distance", "target", constraint.target, limits, "%.1f px", tip)
    caption(f"now {constraint.measured(context.session.model, context.session.coefficients):.1f} px")


def _stroke(context: EditorContext, index: int, constraint: StrokeConstraint) -> None:
    if imgui.button("Redraw the target", (-1.0, 0.0)) and not context.busy:
        context.toolbox.choose("stroke")
        context.toolbox.stroke_tool.redraw(constraint)
    context.widget_rects.record("redraw")
    tooltip("The next stroke becomes its target; the source stays")
    tips = ("Distances both ways between the strokes.", "The difference of two images, as in the paper of 2009.")
    before = STROKE_ENERGIES.index(constraint.energy)
    chosen = choice(context.widget_rects, "stroke-energy", ("Distance", "Image"), before, tips)
    if chosen != before and not context.busy:
        changed = replace(constraint, energy=STROKE_ENERGIES[chosen])
        context.session.change_constraint(index, changed, "Compare strokes differently")


def _gaze(context: EditorContext, index: int, constraint: GazeConstraint) -> None:
    for axis, (title, most) in enumerate((("Left", MOST_YAW), ("Up", MOST_PITCH))):
        key = f"gaze:{axis}"

        def changed_to(value: float, axis: int = axis) -> GazeConstraint:
            yaw, pitch = constraint.direction
            return replace(constraint, direction=(yaw, value) if axis else (value, pitch))

        _value(context, index, title, key, constraint.direction[axis], (-most, most), "%.0f deg", changed_to)


def _slider(
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

    _value(context, index, title, attribute, value, limits, form, changed_to, tip, logarithmic)


def _value(
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
    imgui.align_text_to_frame_padding()
    imgui.text(title)
    imgui.same_line(em(6.6))
    imgui.set_next_item_width(-1.0)
    flags = imgui.SliderFlags_.clamp_on_input | (imgui.SliderFlags_.logarithmic if logarithmic else 0)
    changed, new = imgui.slider_float(f"##{key}", value, limits[0], limits[1], form, flags)
    context.widget_rects.record(f"detail:{key}")

    def apply() -> None:
        context.session.change_constraint(index, changed_to(new), f"Change {title.lower()}")

    context.slider_edit.follow(context.session, f"{key}:{index}", f"Change the {title.lower()}", changed, apply)
    if tip:
        tooltip(tip)
