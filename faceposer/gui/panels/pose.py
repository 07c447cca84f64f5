"""The first part of the tab Pose: how the face follows, and back to neutral."""

from collections.abc import Callable
from dataclasses import replace

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.fixed import LARGEST_HOLD
from faceposer.gui.widgets.basic import action_button, button_width, caption, choice, tooltip
from faceposer.gui.widgets.theme import FIELD, RAISED, Icon, em
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.priors import PRIORS, Prior
from faceposer.solve.problem import SPREAD

_MODES = ("live", "apply")
_LARGEST_WEIGHT = 10.0
_USUAL_WEIGHT = 1.0
_PRIOR_LABELS: dict[Prior, str] = {"regions": "By region", "whole": "Whole face", "plain": "As learned"}
# In the order of ``PRIORS``.
_PRIOR_TEXTS = (
    "The usual way: muscles that work together in real faces move together, as far as Spread says.",
    "The face is judged as a whole: whatever moved together in the captured performances moves together here.",
    "The learned expressions as they are, as in the paper: the face drifts to its usual expressions by itself.",
)


class PosePanel:
    """Mode, spread, prior weight, neutral."""

    def draw(self, context: EditorContext) -> None:
        """Draw the part."""
        tips = (
            "The face follows while you drag.",
            f"The points wait until you press Apply  ({context.actions['apply'].shortcut})",
        )
        session = context.session
        mode = _MODES.index(session.mode)
        chosen = choice(context.widget_rects, "mode", ("Live", "On apply"), mode, tips)
        if chosen != mode:
            context.set_mode("live" if chosen == 0 else "apply")
        if session.mode == "apply":
            action_button(context.widget_rects, context.actions["apply"], -1.0, strong=session.pending)
        imgui.spacing()
        self._draw_spread(context)
        self._draw_weight(context)
        self._draw_hold(context)
        self._draw_advanced(context)
        imgui.spacing()
        width = button_width(3)
        action_button(context.widget_rects, context.actions["reset"], width, "Reset")
        imgui.same_line()
        action_button(context.widget_rects, context.actions["compare"], width, "Compare")
        imgui.same_line()
        action_button(context.widget_rects, context.actions["accept-pose"], width, "Accept")

    def _draw_spread(self, context: EditorContext) -> None:
        session = context.session

        tip = (
            "How much of the face follows what you pull. Local: only the muscles that it takes. Whole face: all that "
            "usually moves along in real faces. Ctrl+click to type a value from 0 to 1, Esc to take a drag back."
        )
        # The other priors know no spread.
        imgui.begin_disabled(session.document.prior != "regions")
        self._draw_slider(
            context,
            "spread",
            "Spread",
            session.document.spread,
            (SPREAD, 1.0, "%.2f"),
            session.set_spread,
            "Change the spread",
            tip,
            ends=("Local", "Whole face"),
        )
        imgui.end_disabled()

    def _draw_weight(self, context: EditorContext) -> None:
        session = context.session
        tip = (
            "How strongly the face keeps to natural expressions. At 0 only the points count. "
            "Ctrl+click to type a value, Esc to take a drag back."
        )
        self._draw_slider(
            context,
            "weight",
            "Prior weight",
            session.document.prior_weight,
            (_USUAL_WEIGHT, _LARGEST_WEIGHT, "%.2f"),
            session.set_prior_weight,
            "Change the prior weight",
            tip,
            logarithmic=True,
        )

    def _draw_slider(
        self,
        context: EditorContext,
        name: str,
        title: str,
        value: float,
        measures: tuple[float, float, str],
        change: Callable[[float], None],
        step: str,
        tip: str,
        logarithmic: bool = False,
        ends: tuple[str, str] = ("", ""),
    ) -> None:
        """Draw a slider from 0, with a button that brings the default back.

        Args:
            context: The window.
            name: Of the widget.
            title: Beside it.
            value: Now.
            measures: Its default, its largest value, and how the value is written.
            change: Brings a value into the session.
            step: What the history calls it.
            tip: Of the tooltip.
            logarithmic: Whether small values get more room.
            ends: What its left and its right end are called, in place of their values.
        """
        session = context.session
        usual, largest, form = measures
        # At an end its name, which no value follows.
        form = {0.0: ends[0], largest: ends[1]}.get(value) or form
        imgui.align_text_to_frame_padding()
        imgui.text(title)
        imgui.same_line(em(6.6))
        reset = value != usual and not context.slider_edit.active
        imgui.set_next_item_width(-em(2.3) if reset else -1.0)
        flags = imgui.SliderFlags_.clamp_on_input | (imgui.SliderFlags_.logarithmic if logarithmic else 0)
        changed, new = imgui.slider_float(f"##pose:{name}", value, 0.0, largest, form, flags)
        context.widget_rects.record(name)
        context.slider_edit.follow(session, name, step, changed, lambda: change(new))
        tooltip(tip)
        if reset:
            imgui.same_line()
            if imgui.button(f"{Icon.UNDO}##pose:{name}", (em(1.8), 0.0)) and not session.editing:
                change(usual)
            context.widget_rects.record(f"{name}:reset")
            tooltip(f"Back to {usual:g}")

    def _draw_advanced(self, context: EditorContext) -> None:
        """Draw which prior judges, under a header that is closed at first."""
        session = context.session
        prior = session.document.prior
        # A session that has another prior shows it.
        if prior != "regions":
            imgui.set_next_item_open(True, imgui.Cond_.once)
        imgui.push_style_color(imgui.Col_.header, imgui.ImVec4(*FIELD))
        imgui.push_style_color(imgui.Col_.header_hovered, imgui.ImVec4(*RAISED))
        opened = imgui.collapsing_header("Advanced")
        imgui.pop_style_color(2)
        context.widget_rects.record("advanced")
        tooltip("Other ways to judge what is natural")
        if not opened:
            return
        chosen = choice(
            context.widget_rects, "prior", tuple(_PRIOR_LABELS[p] for p in PRIORS), PRIORS.index(prior), _PRIOR_TEXTS
        )
        caption(_PRIOR_TEXTS[chosen])
        if PRIORS[chosen] != prior and not session.editing:
            session.set_prior(PRIORS[chosen])

    def _draw_hold(self, context: EditorContext) -> None:
        """Draw a slider for the weight of all fixed vertices together."""
        session = context.session
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
        context.widget_rects.record("hold-weight")

        def apply() -> None:
            document = session.document
            for i in fixed:
                constraint = document.constraints[i]
                if isinstance(constraint, FixedConstraint) and not constraint.locked:
                    document = document.with_constraint(i, replace(constraint, weight=value))
            session.replace(document)

        context.slider_edit.follow(session, "hold", "Change the hold weight", changed, apply)
        tooltip("How strongly fixed vertices stay where they were: from free, at 0, to immovable.")
