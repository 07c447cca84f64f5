"""The options of drawn trajectories: how fast, how smooth, and what becomes of them."""

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.animation.keyframes import TOLERANCE
from faceposer.gui.widgets.basic import action_button, button_width, caption, choice, tooltip
from faceposer.gui.widgets.theme import em

if TYPE_CHECKING:
    from faceposer.gui.features.trajectories.feature import TrajectoriesFeature

_LABEL = 6.6
_LARGEST_SMOOTHNESS = 100.0
_MOST_FRAMES = 10_000


def draw_trajectory_options(following: "TrajectoriesFeature") -> None:
    """Draw the options, and how far the solve is."""
    context = following.context
    options, tool = following.options, following.tool
    rate = following.timeline.keyframes.rate
    tips = (
        "The face goes as fast as you draw; points drawn one after another move at the same time.",
        "The face goes along at an even pace, in as many frames as you say.",
    )
    options.timing = (
        "even"
        if choice(context.widget_rects, "timing", ("As drawn", "Even"), options.timing == "even", tips)
        else "pen"
    )
    if options.timing == "even":
        _label("Frames")
        flags = imgui.SliderFlags_.always_clamp.value
        _, options.frames = imgui.drag_int("##frames", options.frames, 0.2, 2, _MOST_FRAMES, "%d", flags)
        context.widget_rects.record("even-frames")
        tooltip(f"How many frames it takes, {(options.frames - 1) / rate:.2f} s")
    _label("Smoothness")
    flags = imgui.SliderFlags_.logarithmic.value | imgui.SliderFlags_.clamp_on_input.value
    _, options.smoothness = imgui.slider_float(
        "##smoothness", options.smoothness, 0.0, _LARGEST_SMOOTHNESS, "%.2f", flags
    )
    context.widget_rects.record("smoothness")
    tooltip("How little the speed of the face may change from frame to frame; 0 follows every tremor of the hand.")
    tips = (
        f"Only the frames that tell of the others become keys: no shape is off by more than {TOLERANCE:g} in between.",
        "Every frame becomes a key.",
    )
    options.few_keys = not choice(
        context.widget_rects, "few-keys", ("Few keys", "Every frame"), not options.few_keys, tips
    )
    if not tool.drawn:
        caption("Press on a point of the face and draw its path. Draw as many as you like, then let the face follow.")
        return
    lasts = max(len(following.positions(drawn)) for drawn in tool.drawn)
    count = "1 trajectory" if len(tool.drawn) == 1 else f"{len(tool.drawn)} trajectories"
    caption(f"{count}, frames {following.first + 1} to {following.first + lasts}")
    width = button_width(2)
    action_button(context.widget_rects, context.actions["follow"], width, "Follow", strong=True)
    imgui.same_line()
    if imgui.button("Clear", (width, 0.0)):
        tool.clear()
    context.widget_rects.record("clear-trajectories")
    tooltip(f"Remove all trajectories; {context.actions['undo'].shortcut} brings them back")


def _label(text: str) -> None:
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    imgui.same_line(em(_LABEL))
    imgui.set_next_item_width(-1.0)
