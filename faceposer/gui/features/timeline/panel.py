"""The strip of the timeline: buttons and fields above, ruler and keys below."""

from dataclasses import replace
from typing import TYPE_CHECKING

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.animation.keyframes import INBETWEENS, LONGEST
from faceposer.gui.features.timeline.editor import TimelineEditor
from faceposer.gui.features.timeline.track import Track, track_height
from faceposer.gui.widgets.theme import (
    ACCENT_DARK,
    ACCENT_MID,
    FAINT,
    INK,
    KEYED,
    RAISED_MORE,
    WARNING,
    Colour,
    Icon,
    em,
)
from faceposer.gui.widgets.tooltips import tooltip

if TYPE_CHECKING:
    from faceposer.session.animating import Shown
    from faceposer.sketch.inbetweens import Inbetweens

_RATES = (24000 / 1001, 24.0, 25.0, 30000 / 1001, 30.0, 48.0, 50.0, 60000 / 1001, 60.0, 120.0)
_SLOWEST, _FASTEST = 0.1, 1000.0
# Relative difference of rates that are the same, of which files have two to six decimals.
_SAME_RATE = 2e-4
_PAD = 0.45
# Widths of the strip, in units of the font size, below which the least important widgets are hidden.
_NO_INBETWEENS, _NO_RATE, _NO_LENGTH, _NO_ENDS = 46.0, 37.0, 30.0, 24.0
# Ways to the poses between keys: label and tooltip.
_INBETWEENS: dict["Inbetweens", tuple[str, str]] = {
    "poses": (
        "Poses",
        "Each shape moves from key to key and never beyond: a closed lid stays closed between two keys that close it.",
    ),
    "feature points": (
        "Feature points",
        "Feature points move along splines through the keys, and the face follows: rounder, but the motion may go "
        "beyond the keys.",
    ),
}
# State of the current pose: label, colour and tooltip.
_STATES: dict["Shown", tuple[str, Colour, str]] = {
    "unkeyed": ("No keys yet", FAINT, "Pose the face and set a key, then go to another frame and set the next one."),
    "key": ("Key", KEYED, "This pose is a key of the animation."),
    "between": ("Between keys", INK, "This pose is interpolated from the keys."),
    "changed": (
        "Changed, no key",
        WARNING,
        "This pose differs from the animation. Set a key to keep it; going to another frame discards it.",
    ),
}
# State of a pose outside of all keys.
_BEFORE = ("Before the first key", INK, "The animation holds the pose of its first key here.")
_AFTER = ("After the last key", INK, "The animation holds the pose of its last key here.")


def state_of(timeline: TimelineEditor) -> tuple[str, Colour, str]:
    """Return label, colour and tooltip of the state of the current pose."""
    keyframes, frame = timeline.keyframes, timeline.animation.frame
    if timeline.animation.shown == "between" and not keyframes.loop:
        if keyframes.next_frame(frame) is None:
            return _AFTER
        if keyframes.previous_frame(frame) is None:
            return _BEFORE
    return _STATES[timeline.animation.shown]


def _width_in_em() -> float:
    """Return the width of the strip in units of the font size."""
    return imgui.get_window_width() / em()


def timeline_height() -> float:
    """Return the height of the strip."""
    return round(imgui.get_frame_height() + track_height() + em(2 * _PAD))


def draw_timeline(timeline: TimelineEditor, track: Track) -> None:
    """Draw the strip into the current window."""
    pad = em(_PAD)
    imgui.set_cursor_pos(ImVec2(em(0.6), pad))
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(em(0.4), pad))
    _draw_buttons(timeline)
    _draw_fields(timeline)
    _draw_state(timeline)
    imgui.set_cursor_pos(ImVec2(0.0, round(imgui.get_frame_height() + 2 * pad)))
    track.draw(imgui.get_window_width(), track_height())
    imgui.pop_style_var()


def _icon_button(timeline: TimelineEditor, name: str, icon: str, on: bool = False, wide: float = 1.9) -> None:
    action = timeline.context.actions[name]
    imgui.push_style_color(imgui.Col_.button, ImVec4(*ACCENT_DARK) if on else ImVec4(0.0, 0.0, 0.0, 0.0))
    imgui.push_style_color(imgui.Col_.button_hovered, ImVec4(*(ACCENT_MID if on else RAISED_MORE)))
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, imgui.get_style().frame_padding.y))
    imgui.begin_disabled(not action.enabled())
    if imgui.button(f"{icon}##{name}", ImVec2(em(wide), 0.0)):
        action.run()
    imgui.end_disabled()
    imgui.pop_style_var()
    imgui.pop_style_color(2)
    timeline.context.widget_rects.record(name)
    # A tooltip would distract from the playback.
    if not timeline.playing:
        tooltip(action.tooltip)
    imgui.same_line(0.0, em(0.15))


def _draw_buttons(timeline: TimelineEditor) -> None:
    wide = _width_in_em() > _NO_ENDS
    if wide:
        _icon_button(timeline, "first-frame", Icon.FIRST)
    _icon_button(timeline, "previous-key", Icon.PREVIOUS)
    playing = timeline.playing
    _icon_button(timeline, "play", Icon.PAUSE if playing else Icon.PLAY, playing, 2.6)
    _icon_button(timeline, "next-key", Icon.NEXT)
    if wide:
        _icon_button(timeline, "last-frame", Icon.LAST)
    _icon_button(timeline, "loop", Icon.LOOP, timeline.keyframes.loop)
    imgui.same_line(0.0, em(0.9))


def _draw_fields(timeline: TimelineEditor) -> None:
    """Draw the current frame, the length, the rate and the in-betweens, as far as there is room."""
    rects = timeline.context.widget_rects
    imgui.begin_disabled(not timeline.reachable)
    imgui.set_next_item_width(em(3.9))
    flags = imgui.SliderFlags_.always_clamp.value
    changed, frame = imgui.drag_int("##frame", timeline.animation.frame + 1, 0.2, 1, LONGEST, "%d", flags)
    if changed:
        timeline.go_to(frame - 1)
    rects.record("frame-shown")
    tooltip("Current frame. Drag, or Ctrl+click to type a value.")
    imgui.same_line()
    if _width_in_em() > _NO_LENGTH:
        _draw_length(timeline)
    if _width_in_em() > _NO_RATE:
        _draw_rate(timeline)
    if _width_in_em() > _NO_INBETWEENS:
        _draw_inbetweens(timeline)
    imgui.end_disabled()
    imgui.same_line(0.0, em(0.9))


def _draw_length(timeline: TimelineEditor) -> None:
    keyframes, rects = timeline.keyframes, timeline.context.widget_rects
    imgui.align_text_to_frame_padding()
    imgui.text_colored(FAINT, "of")
    imgui.same_line()
    imgui.set_next_item_width(em(3.9))
    flags = imgui.SliderFlags_.always_clamp.value
    changed, length = imgui.drag_int("##length", keyframes.length, 0.2, 1, LONGEST, "%d", flags)
    if changed:
        timeline.change(replace(keyframes, length=length), "Change the length", merges=True)
    rects.record("length")
    seconds = keyframes.length / keyframes.rate
    tooltip(f"Length of the animation in frames, {seconds:.2f} s. Drag, or Ctrl+click to type a value.")
    imgui.same_line()


def _draw_rate(timeline: TimelineEditor) -> None:
    keyframes, rects = timeline.keyframes, timeline.context.widget_rects
    imgui.set_next_item_width(em(5.6))
    opened = imgui.begin_combo("##rate", f"{keyframes.rate:.5g} fps", imgui.ComboFlags_.height_largest.value)
    rects.record("rate")
    if not opened:
        tooltip("Frames per second. Keys keep their frame numbers.")
    else:
        for rate in _RATES:
            pressed, _ = imgui.selectable(f"{rate:.5g} fps", abs(rate - keyframes.rate) < _SAME_RATE * rate)
            rects.record(f"rate:{rate:.5g}")
            if pressed:
                timeline.change(replace(keyframes, rate=rate), "Change the frame rate", merges=True)
        imgui.set_next_item_width(-1.0)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        entered, rate = imgui.input_float("##other-rate", keyframes.rate, 0.0, 0.0, "%.5g", flags)
        rects.record("rate:other")
        tooltip("Any other rate. Enter accepts it.")
        if entered and _SLOWEST <= rate <= _FASTEST:
            timeline.change(replace(keyframes, rate=rate), "Change the frame rate", merges=True)
            imgui.close_current_popup()
        imgui.end_combo()


def _draw_inbetweens(timeline: TimelineEditor) -> None:
    present, rects = timeline.keyframes.inbetweens, timeline.context.widget_rects
    imgui.same_line()
    imgui.set_next_item_width(em(8.6))
    opened = imgui.begin_combo("##inbetweens", _INBETWEENS[present][0])
    rects.record("inbetweens-shown")
    if not opened:
        tooltip(f"In-betweens: the motion between two keys.\n{_INBETWEENS[present][1]}")
        return
    for value in INBETWEENS:
        label, meaning = _INBETWEENS[value]
        pressed, _ = imgui.selectable(label, value == present)
        rects.record(f"inbetweens:{value}")
        tooltip(meaning)
        if pressed:
            timeline.set_inbetweens(value)
    imgui.end_combo()


def _draw_state(timeline: TimelineEditor) -> None:
    """Draw the buttons that set keys, and the state of the current pose."""
    context = timeline.context
    action = context.actions["set-key"]
    imgui.begin_disabled(not action.enabled())
    text, colour, meaning = state_of(timeline)
    # The colour of the icon shows the state where there is no room for the text.
    imgui.push_style_color(imgui.Col_.text, ImVec4(*colour))
    pressed = imgui.button(f"{Icon.KEY}##set-key")
    imgui.pop_style_color()
    if pressed:
        action.run()
    imgui.end_disabled()
    context.widget_rects.record("set-key")
    tooltip(f"{action.tooltip}\n{meaning}")
    imgui.same_line()
    _icon_button(timeline, "auto-key", "Auto", context.settings.auto_key, 3.0)
    imgui.same_line(0.0, em(0.6))
    if imgui.calc_text_size(text).x > imgui.get_content_region_avail().x:
        return
    imgui.align_text_to_frame_padding()
    imgui.text_colored(colour, text)
    context.widget_rects.record("shown")
    tooltip(meaning)
