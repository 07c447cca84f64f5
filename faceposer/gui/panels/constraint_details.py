"""What can be set on the selected constraint: its weight, and what its kind has beside that."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from imgui_bundle import imgui

from faceposer.gui.widgets.basic import caption, choice, tooltip
from faceposer.gui.widgets.theme import WARNING, em
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.gaze import MOST_PITCH, MOST_YAW, GazeConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.stroke import STROKE_ENERGIES, StrokeConstraint

if TYPE_CHECKING:
    from faceposer.gui.app import App

LARGEST_WEIGHT, LARGEST_HOLD = 100.0, 1000.0


def draw_details(app: "App", index: int) -> None:
    """Draw what can be set on constraint ``index``."""
    constraint = app.session.document.constraints[index]
    conflict = app.drawn_constraints.conflicts.get(index)
    if conflict is not None:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*WARNING))
        imgui.text_wrapped(conflict)
        imgui.pop_style_color()
    imgui.begin_disabled(constraint.locked or app.toolbox.active)
    if isinstance(constraint, DistanceConstraint):
        _distance(app, index, constraint)
    elif isinstance(constraint, StrokeConstraint):
        _stroke(app, index, constraint)
    elif isinstance(constraint, GazeConstraint):
        _gaze(app, index, constraint)
    if isinstance(constraint, FixedConstraint):
        caption(f"{len(constraint.points)} vertices, held where they were")
        tip = "From free, at 0, to immovable."
        _slider(app, index, "Hold", "weight", constraint.weight, (0.0, LARGEST_HOLD), "%.2f", tip, logarithmic=True)
    elif not isinstance(constraint, GazeConstraint):
        tip = "How much this one counts against the others and against what is natural."
        _slider(app, index, "Weight", "weight", constraint.weight, (0.0, LARGEST_WEIGHT), "%.2f", tip, logarithmic=True)
    imgui.end_disabled()
    if constraint.camera is not None and constraint.camera.transferred((0.0, 0.0), app.viewport.camera) is None:
        if imgui.button("Look from where it was drawn", (-1.0, 0.0)):
            app.viewport.look_through(constraint.camera)
        app.marks.note("its-view")
        tooltip("Turn to the view that it was drawn in, where its target can be seen and changed")


def _distance(app: "App", index: int, constraint: DistanceConstraint) -> None:
    low, high = constraint.reach(app.session.model)
    limits = (min(low, constraint.target), max(high, constraint.target))
    tip = "Pixels between the two points, as far as this face can do. Ctrl+click to type a value."
    _slider(app, index, "Distance", "target", constraint.target, limits, "%.1f px", tip)
    caption(f"now {constraint.measured(app.session.model, app.session.coefficients):.1f} px")


def _stroke(app: "App", index: int, constraint: StrokeConstraint) -> None:
    if imgui.button("Redraw the target", (-1.0, 0.0)) and not app.busy:
        app.toolbox.choose("stroke")
        app.toolbox.stroke_tool.redraw(constraint)
    app.marks.note("redraw")
    tooltip("The next stroke becomes its target; the source stays")
    tips = ("Distances both ways between the strokes.", "The difference of two images, as in the paper of 2009.")
    before = STROKE_ENERGIES.index(constraint.energy)
    chosen = choice(app.marks, "stroke-energy", ("Distance", "Image"), before, tips)
    if chosen != before and not app.busy:
        changed = replace(constraint, energy=STROKE_ENERGIES[chosen])
        app.session.change_constraint(index, changed, "Compare strokes differently")


def _gaze(app: "App", index: int, constraint: GazeConstraint) -> None:
    for axis, (title, most) in enumerate((("Left", MOST_YAW), ("Up", MOST_PITCH))):
        key = f"gaze:{axis}"

        def changed_to(value: float, axis: int = axis) -> GazeConstraint:
            yaw, pitch = constraint.direction
            return replace(constraint, direction=(yaw, value) if axis else (value, pitch))

        _value(app, index, title, key, constraint.direction[axis], (-most, most), "%.0f deg", changed_to)


def _slider(
    app: "App",
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
    constraint: Any = app.session.document.constraints[index]

    def changed_to(new: float) -> Constraint:
        changed: Constraint = replace(constraint, **{attribute: new})
        return changed

    _value(app, index, title, attribute, value, limits, form, changed_to, tip, logarithmic)


def _value(
    app: "App",
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
    app.marks.note(f"detail:{key}")

    def apply() -> None:
        app.session.change_constraint(index, changed_to(new), f"Change {title.lower()}")

    app.slider_edit.follow(app.session, f"{key}:{index}", f"Change the {title.lower()}", changed, apply)
    if tip:
        tooltip(tip)
