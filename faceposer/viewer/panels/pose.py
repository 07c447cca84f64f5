"""The panel's first part: which face, how it follows, and back to neutral."""

from dataclasses import replace
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.model.subject_file import available_subjects
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.priors import PRIORS
from faceposer.viewer.panels.constraint_details import LARGEST_HOLD
from faceposer.viewer.panels.widgets import action_button, button_width, choice, tooltip
from faceposer.viewer.theme import Icon, em

if TYPE_CHECKING:
    from faceposer.viewer.app import App

_MODES = ("live", "apply")
_LARGEST_WEIGHT = 10.0
_USUAL_WEIGHT = 1.0


class PosePanel:
    """Subject, mode, prior weight, neutral."""

    def __init__(self) -> None:
        self._subjects: list[tuple[str, str]] | None = None

    def draw(self, app: "App") -> None:
        """Draw the part."""
        tips = (
            "The face follows while you drag.",
            f"The points wait until you press Apply  ({app.actions['apply'].shortcut})",
        )
        session = app.session
        mode = _MODES.index(session.mode)
        chosen = choice(app.marks, "mode", ("Live", "On apply"), mode, tips)
        if chosen != mode:
            app.set_mode("live" if chosen == 0 else "apply")
        if session.mode == "apply":
            action_button(app.marks, app.actions["apply"], -1.0, strong=session.pending)
        imgui.spacing()
        self._draw_weight(app)
        self._draw_prior(app)
        self._draw_hold(app)
        imgui.spacing()
        width = button_width(3)
        action_button(app.marks, app.actions["reset"], width, "Reset")
        imgui.same_line()
        action_button(app.marks, app.actions["compare"], width, "Compare")
        imgui.same_line()
        action_button(app.marks, app.actions["accept-pose"], width, "Accept")

    def draw_subjects(self, app: "App") -> None:
        """Draw the list of faces to choose from."""
        subject = app.session.model.subject
        imgui.set_next_item_width(-1.0)
        opened = imgui.begin_combo("##subject", subject.title)
        app.marks.note("subject")
        if not opened:
            tooltip(f"Whose face to pose; {app.actions['open'].shortcut} opens others from files")
            return
        if self._subjects is None:
            self._subjects = available_subjects()
        for name, title in self._subjects:
            pressed, _ = imgui.selectable(f"{title}##{name}", name == app.session.document.subject)
            app.marks.note(f"subject:{name}")
            if pressed and name != app.session.document.subject:
                app.files.open(name)
        imgui.end_combo()

    def _draw_weight(self, app: "App") -> None:
        session = app.session
        weight = session.document.prior_weight
        imgui.align_text_to_frame_padding()
        imgui.text("Prior weight")
        imgui.same_line(em(6.6))
        reset = weight != _USUAL_WEIGHT and not app.slider_edit.active
        imgui.set_next_item_width(-em(2.3) if reset else -1.0)
        flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.clamp_on_input
        changed, value = imgui.slider_float("##weight", weight, 0.0, _LARGEST_WEIGHT, "%.2f", flags)
        app.marks.note("weight")
        app.slider_edit.follow(
            session, "weight", "Change the prior weight", changed, lambda: session.set_prior_weight(value)
        )
        tooltip(
            "How strongly the face keeps to natural expressions. At 0 only the points count. "
            "Ctrl+click to type a value, Esc to take a drag back."
        )
        if reset:
            imgui.same_line()
            if imgui.button(f"{Icon.UNDO}##weight", (em(1.8), 0.0)) and not session.editing:
                session.set_prior_weight(_USUAL_WEIGHT)
            app.marks.note("weight:reset")
            tooltip("Back to 1")

    def _draw_prior(self, app: "App") -> None:
        session = app.session
        tips = (
            "Each region of the face is kept natural by itself: a brow can be raised and the mouth stays.",
            "The face is kept natural as a whole: what one region does tells of all others.",
            "The mixture as it was learned, as in the paper: the face goes to its usual expressions by itself.",
        )
        chosen = choice(
            app.marks, "prior", ("By region", "Whole face", "As learned"), PRIORS.index(session.document.prior), tips
        )
        if PRIORS[chosen] != session.document.prior and not session.editing:
            session.set_prior(PRIORS[chosen])

    def _draw_hold(self, app: "App") -> None:
        """Draw a slider for the weight of all fixed vertices together."""
        session = app.session
        fixed = [i for i, c in enumerate(session.document.constraints) if isinstance(c, FixedConstraint)]
        if not fixed:
            return
        weight = session.document.constraints[fixed[0]].weight
        imgui.align_text_to_frame_padding()
        imgui.text("Hold weight")
        imgui.same_line(em(6.6))
        imgui.set_next_item_width(-1.0)
        flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.clamp_on_input
        changed, value = imgui.slider_float("##hold", weight, 0.0, LARGEST_HOLD, "%.2f", flags)
        app.marks.note("hold-weight")

        def apply() -> None:
            document = session.document
            for i in fixed:
                constraint = document.constraints[i]
                if isinstance(constraint, FixedConstraint) and not constraint.locked:
                    document = document.with_constraint(i, replace(constraint, weight=value))
            session.replace(document)

        app.slider_edit.follow(session, "hold", "Change the hold weight", changed, apply)
        tooltip("How strongly fixed vertices stay where they were: from free, at 0, to immovable.")
