"""The tab of the character's shapes: sliders that show the weights of the pose and change them."""

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import caption
from faceposer.gui.widgets.sliders import slider
from faceposer.gui.widgets.text import displayed, widget_id
from faceposer.gui.widgets.theme import em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.solve.constraints.gaze import GazeConstraint


class ShapesPanel:
    """Sliders of the shapes.

    A slider changes the start pose. Without constraints the pose is exactly that of the sliders; with constraints it is
    a compromise.
    """

    def __init__(self) -> None:
        self._filter = ""
        self._begun: tuple[NDArray[np.float64], float] = (np.zeros(0), 0.0)
        self._value = 0.0

    def draw(self, context: EditorContext) -> None:
        """Draw the tab."""
        caption("Weights of the current pose. Drag to change them; constraints remain in effect.")
        imgui.set_next_item_width(-1.0)
        _, self._filter = imgui.input_text_with_hint("##filter", "Find a shape", self._filter)
        context.widget_rects.record("shapes:filter")
        names = context.session.model.character.shape_names
        weights = context.session.model.weights_of(context.session.coefficients)
        held = any(isinstance(c, GazeConstraint) and c.enabled for c in context.session.document.constraints)
        imgui.begin_child("##shapes")
        for j, name in enumerate(names):
            if self._filter.strip().lower() in name.lower() and np.any(context.session.model.gram[j, j] > 0):
                self._draw_slider(context, j, name, float(weights[j]), held and name.startswith("eyeLook"))
        imgui.end_child()

    def _draw_slider(self, context: EditorContext, j: int, name: str, weight: float, held: bool) -> None:
        key = f"shape:{name}"
        session = context.session
        lower, upper = session.model.character.shape_limits[j].tolist()
        shown = self._value if context.slider_edit.dragging(key) else min(max(weight, lower), upper)
        # Not as "-0.00".
        shown = 0.0 if abs(shown) < 0.005 else shown
        imgui.begin_disabled(held or context.toolbox.active)
        imgui.set_next_item_width(em(7.2))
        label = f"{displayed(name)}##{widget_id(key)}"
        changed, value = slider(label, shown, lower, upper, "%.2f", imgui.SliderFlags_.clamp_on_input.value)
        context.widget_rects.record(key)
        imgui.end_disabled()
        tooltip(
            "Controlled by the gaze constraint."
            if held
            else f"{name}\nDrag, or Ctrl+click to type a value; Esc cancels a drag."
        )

        def begin() -> None:
            start = session.document.start
            self._begun = (session.model.neutral() if start is None else start, weight)
            self._value = shown

        def apply() -> None:
            self._value = value
            start, before = self._begun
            session.set_start(start + session.model.subspace.projection[:, j] * (value - before))

        context.slider_edit.update(session, key, f"Set {name}", changed, apply, begin)
