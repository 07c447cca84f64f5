"""The panel's first part: which face, how it follows, and back to neutral."""

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.model.subject import available_subjects
from faceposer.session.session import Session
from faceposer.viewer.panels.widgets import action_button, button_width, choice, heading, tooltip
from faceposer.viewer.theme import Icon, em

if TYPE_CHECKING:
    from faceposer.viewer.app import App

_MODES = ("live", "apply")
_LARGEST_WEIGHT = 10.0
_USUAL_WEIGHT = 1.0


class _Abandoned(Exception):
    """The drag of a slider was taken back."""


class PosePanel:
    """Subject, mode, prior weight, neutral."""

    def __init__(self) -> None:
        self._subjects: list[tuple[str, str]] | None = None
        self._edit: tuple[Session, AbstractContextManager[None]] | None = None

    def draw(self, app: "App") -> None:
        """Draw the part."""
        heading(app.gui.fonts, "Subject", first=True)
        self._draw_subjects(app)
        heading(app.gui.fonts, "Pose")
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
        imgui.spacing()
        width = button_width(2)
        action_button(app.marks, app.actions["reset"], width, "Reset")
        imgui.same_line()
        action_button(app.marks, app.actions["compare"], width, "Compare")

    def _draw_subjects(self, app: "App") -> None:
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
        reset = weight != _USUAL_WEIGHT and self._edit is None
        imgui.set_next_item_width(-em(2.3) if reset else -1.0)
        flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.clamp_on_input
        changed, value = imgui.slider_float("##weight", weight, 0.0, _LARGEST_WEIGHT, "%.2f", flags)
        app.marks.note("weight")
        self._follow_slider(session, changed, value)
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

    def _follow_slider(self, session: Session, changed: bool, value: float) -> None:
        """Keep one edit open while the slider that was drawn last is dragged."""
        if imgui.is_item_activated() and not session.editing:
            edit = session.edit("Change the prior weight")
            edit.__enter__()
            self._edit = (session, edit)
        if changed and self._edit is not None:
            session.set_prior_weight(value)
        if self._edit is not None and imgui.is_key_pressed(imgui.Key.escape, False):
            self._end(abandon=True)
        elif self._edit is not None and not imgui.is_item_active():
            self._end()

    def _end(self, abandon: bool = False) -> None:
        """Close the slider's edit: one step of the history for one drag."""
        assert self._edit is not None
        (_, edit), self._edit = self._edit, None
        if abandon:
            imgui.internal.clear_active_id()
            edit.__exit__(_Abandoned, _Abandoned(), None)
        else:
            edit.__exit__(None, None, None)

    def let_go(self) -> None:
        """End a drag of the slider, as when a dialog comes between."""
        if self._edit is not None:
            self._end()
