"""Options of drawn trajectories: timing, smoothness and number of keys."""

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.features.trajectories.options import ShownTrajectories
from faceposer.gui.widgets.basic import action_button, button_width, caption, choice
from faceposer.gui.widgets.sliders import row_label, slider
from faceposer.gui.widgets.tooltips import tooltip

_LARGEST_SMOOTHNESS = 100.0
_MOST_FRAMES = 10_000


def draw_trajectory_options(context: EditorContext, shown: ShownTrajectories) -> None:
    """Draw the options, and the buttons that follow or clear the trajectories."""
    options, tool, rate = shown.options, shown.tool, shown.rate
    tips = (
        "Move at the speed at which you draw. All points start at the same time.",
        "Move at constant speed over a number of frames.",
    )
    options.timing = (
        "even"
        if choice(context.widget_rects, "timing", ("As drawn", "Even"), options.timing == "even", tips)
        else "pen"
    )
    if options.timing == "even":
        row_label("Frames", f"Duration of the motion in frames, {(options.frames - 1) / rate:.2f} s")
        imgui.set_next_item_width(-1.0)
        flags = imgui.SliderFlags_.always_clamp.value
        _, options.frames = imgui.drag_int("##frames", options.frames, 0.2, 2, _MOST_FRAMES, "%d", flags)
        context.widget_rects.record("even-frames")
        tooltip(f"Duration of the motion in frames, {(options.frames - 1) / rate:.2f} s")
    row_label("Smoothness", "Smoothness of the motion. 0 follows every jitter of the hand.")
    imgui.set_next_item_width(-1.0)
    flags = imgui.SliderFlags_.logarithmic.value | imgui.SliderFlags_.clamp_on_input.value
    _, options.smoothness = slider("##smoothness", options.smoothness, 0.0, _LARGEST_SMOOTHNESS, "%.2f", flags)
    context.widget_rects.record("smoothness")
    tooltip("Smoothness of the motion. 0 follows every jitter of the hand.")
    tips = (
        "Set few keys, with small differences; they are easier to edit.",
        "Set a key at every frame.",
    )
    options.few_keys = not choice(
        context.widget_rects, "few-keys", ("Few keys", "Every frame"), not options.few_keys, tips
    )
    if not tool.drawn:
        caption("Press on a point of the face and draw its path. Add paths of other points, then choose Follow.")
        return
    n_frames = max(len(shown.positions(drawn)) for drawn in tool.drawn)
    count = "1 trajectory" if len(tool.drawn) == 1 else f"{len(tool.drawn)} trajectories"
    caption(f"{count}, frames {shown.first + 1} to {shown.first + n_frames}")
    width = button_width(2)
    action_button(context.widget_rects, context.actions["follow"], width, "Follow", strong=True)
    imgui.same_line()
    if imgui.button("Clear", (width, 0.0)):
        tool.clear()
    context.widget_rects.record("clear-trajectories")
    tooltip(f"Remove all trajectories; {context.actions['undo'].shortcut} restores them")
