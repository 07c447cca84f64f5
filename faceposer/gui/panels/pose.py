"""The solver settings at the top of the Pose tab."""

from collections.abc import Callable
from dataclasses import replace

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.fixed import LARGEST_HOLD
from faceposer.gui.widgets.basic import action_button, button_width, caption, choice, section
from faceposer.gui.widgets.sliders import reset_button, row_label, slider, slider_room
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.priors import PRIORS, Prior
from faceposer.solve.problem import SPREAD

_MODES = ("live", "apply")
_MAX_WEIGHT = 10.0
_DEFAULT_WEIGHT = 1.0
_PRIOR_LABELS: dict[Prior, str] = {"regions": "By region", "whole": "Whole face", "plain": "As learned"}
# In the order of ``PRIORS``.
_PRIOR_TEXTS = (
    "Default. Muscles that act together in real faces move together, to the degree set by Spread.",
    "Evaluate the whole face at once: everything that moved together in the captured performances moves together.",
    "Use the learned expressions directly, as in the paper. The face drifts towards common expressions.",
)


class PosePanel:
    """Mode, spread, prior weight, hold weight and prior, and the buttons of the pose."""

    def draw(self, context: EditorContext) -> None:
        """Draw the panel."""
        tips = (
            "Solve while you drag.",
            f"Solve only when you press Apply{context.actions['apply'].bracketed_shortcut}",
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
            "How much of the face follows a pulled point: from only the required muscles at 0 (Local) to everything "
            "that usually moves with it in real faces at 1 (Whole face). Ctrl+click to type; Esc cancels a drag."
        )
        # The other priors have no spread.
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
            "How strongly the face is kept to natural expressions. At 0 only the constraints count. "
            "Ctrl+click to type a value; Esc cancels a drag."
        )
        self._draw_slider(
            context,
            "weight",
            "Prior weight",
            session.document.prior_weight,
            (_DEFAULT_WEIGHT, _MAX_WEIGHT, "%.2f"),
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
        """Draw a slider from 0, with a button that resets it to the default.

        Args:
            context: The editor.
            name: Name of the widget.
            title: Label at the left.
            value: Current value.
            measures: Default, maximum, and format of the value.
            change: Sets the value in the session.
            step: Label of the step in the history.
            tip: Tooltip.
            logarithmic: True for a logarithmic scale.
            ends: Texts in place of the minimum and the maximum, or "".
        """
        session = context.session
        default, largest, form = measures
        # An end with a name shows that in place of the value.
        form = {0.0: ends[0], largest: ends[1]}.get(value) or form
        row_label(title, tip)
        imgui.set_next_item_width(slider_room())
        flags = imgui.SliderFlags_.clamp_on_input.value | (imgui.SliderFlags_.logarithmic.value if logarithmic else 0)
        changed, new = slider(f"##pose:{name}", value, 0.0, largest, form, flags)
        context.widget_rects.record(name)
        context.slider_edit.update(session, name, step, changed, lambda: change(new))
        tooltip(tip)
        if reset_button(context.widget_rects, name, value == default, f"Reset to {default:g}") and not session.editing:
            change(default)

    def _draw_advanced(self, context: EditorContext) -> None:
        """Draw the choice of the prior under a header that is collapsed at first."""
        session = context.session
        prior = session.document.prior
        # The header is open if the session has another prior than the default.
        if prior != "regions":
            imgui.set_next_item_open(True, imgui.Cond_.once)
        opened = section("Advanced")
        context.widget_rects.record("advanced")
        tooltip("Prior of natural expressions")
        if not opened:
            return
        chosen = choice(
            context.widget_rects, "prior", tuple(_PRIOR_LABELS[p] for p in PRIORS), PRIORS.index(prior), _PRIOR_TEXTS
        )
        caption(_PRIOR_TEXTS[chosen])
        if PRIORS[chosen] != prior and not session.editing:
            session.set_prior(PRIORS[chosen])

    def _draw_hold(self, context: EditorContext) -> None:
        """Draw a slider for the weight of all fixed vertices."""
        session = context.session
        fixed = [i for i, c in enumerate(session.document.constraints) if isinstance(c, FixedConstraint)]
        # With the Fix tool the row is there before the first area, so that no button moves under the pointer.
        if not fixed and context.toolbox.chosen is not context.toolbox.fix_tool:
            return
        weight = session.document.constraints[fixed[0]].weight if fixed else FixedConstraint.weight
        tip = "How strongly all fixed areas are held in place, from 0 (free) upwards."

        def change(value: float) -> None:
            document = session.document
            for i in fixed:
                constraint = document.constraints[i]
                if isinstance(constraint, FixedConstraint) and not constraint.locked:
                    document = document.with_constraint(i, replace(constraint, weight=value))
            if session.editing:
                session.replace(document)
                return
            with session.edit("Change the hold weight"):
                session.replace(document)

        imgui.begin_disabled(not fixed)
        self._draw_slider(
            context,
            "hold-weight",
            "Hold weight",
            weight,
            (FixedConstraint.weight, LARGEST_HOLD, "%.2f"),
            change,
            "Change the hold weight",
            tip,
            logarithmic=True,
        )
        imgui.end_disabled()
