"""Ruler and keys of the timeline, and how the mouse edits them."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from faceposer.gui.features.timeline.editor import TimelineEditor
from faceposer.gui.widgets.theme import ACCENT, BAR, EDGE, FAINT, INK, KEYED, em, u32

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_STEPS = (1, 2, 5, 10, 20, 25, 50, 100, 200, 250, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000)
_RULER, _KEYS = 1.5, 1.9
# Pixels at normal density: distance from which a press is a drag, pick radius of a key, half width of a diamond.
_DRAG, _REACH, _SIZE = 3.0, 7.0, 6.0
_FEWEST_FRAMES = 8.0
_ZOOM = 1.2
# Margin at both ends of the frames, in units of the font size.
_MARGIN = 1.2


def frames_span(left: float, width: float) -> tuple[float, float]:
    """Return the left end and the width of the frames in a strip that begins at ``left`` and is ``width`` wide."""
    return left + em(_MARGIN), max(width - 2.0 * em(_MARGIN), 1.0)


def track_height() -> float:
    """Return the height of the track: ruler and keys."""
    return round(em(_RULER) + em(_KEYS))


@dataclass(frozen=True)
class _Press:
    """Mouse gesture that began at ``x``, ``y``."""

    kind: Literal["scrub", "keys", "box", "pan"]
    x: float
    y: float
    frame: int = 0
    view: tuple[float, float] = (0.0, 0.0)


class Track:
    """Ruler and keys of the timeline.

    Attributes:
        hint: Description of the mouse buttons at the pointer, or "" while it is elsewhere.
    """

    def __init__(self, timeline: TimelineEditor) -> None:
        """Show and edit ``timeline``."""
        self._timeline = timeline
        self.hint = ""
        self._press: _Press | None = None
        self._dragged = False
        # First and last visible frame; None for the whole animation.
        self._zoomed_range: tuple[float, float] | None = None
        self._left, self._width, self._top = 0.0, 1.0, 0.0

    def reset(self) -> None:
        """Show all frames, and end the gesture of the mouse."""
        self._zoomed_range = None
        self._set_press(None)

    def _set_press(self, press: _Press | None) -> None:
        self._press = press
        self._timeline.dragging = press is not None and press.kind in ("keys", "box")

    # Coordinates

    @property
    def visible_range(self) -> tuple[float, float]:
        """First and last visible frame."""
        if self._zoomed_range is not None:
            return self._zoomed_range
        keyframes = self._timeline.keyframes
        last = max(keyframes.length - 1, *keyframes.frames[-1:], self._timeline.animation.frame, 1)
        return (0.0, float(last))

    def x_of(self, frame: float) -> float:
        """Return the x coordinate of ``frame`` in the window."""
        low, high = self.visible_range
        return self._left + (frame - low) / (high - low) * self._width

    def frame_at(self, x: float) -> float:
        """Return the frame at ``x`` in the window, not rounded."""
        low, high = self.visible_range
        return low + (x - self._left) / self._width * (high - low)

    def place(self, frame: int) -> tuple[float, float]:
        """Return the position in the window of a key at ``frame``."""
        return (self.x_of(frame), self._top + em(_RULER) + em(_KEYS) / 2.0)

    def ruler_place(self, frame: int) -> tuple[float, float]:
        """Return the position in the window of ``frame`` on the ruler."""
        return (self.x_of(frame), self._top + em(_RULER) / 2.0)

    # Drawing

    def draw(self, width: float, height: float) -> None:
        """Draw ruler and keys, and handle the mouse."""
        timeline = self._timeline
        scale = timeline.context.viewport.ui_scale
        corner = imgui.get_cursor_screen_pos()
        flags = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_middle
        imgui.invisible_button("##track", (max(width, 1.0), height), flags | imgui.ButtonFlags_.mouse_button_right)
        timeline.context.widget_rects.record("track")
        self._left, self._width = frames_span(corner.x, width)
        self._top = corner.y
        self._handle_mouse(scale)
        self._keep_playhead_visible()
        draw = imgui.get_window_draw_list()
        draw.push_clip_rect((corner.x, corner.y), (corner.x + width, corner.y + height), True)
        draw.add_rect_filled((corner.x, corner.y), (corner.x + width, corner.y + height), u32(BAR))
        self._draw_ruler(draw, corner.x, corner.x + width, height, scale)
        self._draw_playhead(draw, height, scale)
        self._draw_keys(draw, scale)
        self._draw_box(draw, height, scale)
        draw.pop_clip_rect()

    def _draw_ruler(self, draw: imgui.ImDrawList, left: float, right: float, height: float, scale: float) -> None:
        keyframes = self._timeline.keyframes
        ruler = self._top + round(em(_RULER))
        first, last = self.x_of(0), self.x_of(keyframes.length - 1)
        # The played range is brighter than the frames before and after it.
        draw.add_rect_filled(
            (max(first - em(0.6), left), ruler), (min(last + em(0.6), right), self._top + height), u32(INK, 0.06)
        )
        low, high = self.visible_range
        spacing = self._width / (high - low)
        step = next((step for step in _STEPS if step * spacing >= em(3.2)), _STEPS[-1])
        fine = next((small for small in _STEPS if small * spacing >= em(0.5) and step % small == 0), step)
        line = max(round(scale), 1)
        playhead = self.x_of(self._timeline.animation.frame)
        # Users count frames from 1.
        frame = math.floor((low + 1) / fine) * fine
        while frame <= high + 1 + step:
            x = round(self.x_of(frame - 1))
            if frame >= 1 and left <= x <= right + em(2):
                labelled = frame % step == 0 or frame == 1
                inside = frame <= keyframes.length
                tall = em(0.45) if labelled else em(0.22)
                draw.add_rect_filled((x, ruler - tall), (x + line, ruler), u32(FAINT, 0.9 if inside else 0.35))
                if labelled:
                    draw.add_rect_filled((x, ruler), (x + line, self._top + height), u32(INK, 0.05))
                text = str(frame)
                half = imgui.calc_text_size(text).x / 2.0
                # The first two labels may overlap, and the playhead draws its own number.
                crowded = frame == step and spacing * (step - 1) < em(1.6) and step > 1
                hidden = abs(x - playhead) < half + _tag_width(self._timeline.animation.frame)
                if labelled and not (crowded or hidden):
                    draw.add_text((round(x - half), self._top), u32(FAINT, 1.0 if inside else 0.5), text)
            frame = 1 if frame == 0 and fine > 1 else fine if frame == 1 and fine > 1 else frame + fine
        draw.add_rect_filled((left, ruler), (right, ruler + line), u32(EDGE))

    def _draw_keys(self, draw: imgui.ImDrawList, scale: float) -> None:
        timeline = self._timeline
        low, high = self.visible_range
        spacing = self._width / (high - low)
        reach = _SIZE * scale / spacing
        frames = np.array(timeline.keyframes.frames, dtype=np.float64)
        frames = frames[(frames >= low - reach) & (frames <= high + reach)]
        chosen, by = np.isin(frames, list(timeline.selected)), self._drag_offset()
        gap = float(np.median(np.diff(frames))) if len(frames) > 1 else high
        size = min(max(gap * spacing / 2.0, 2.5 * scale), _SIZE * scale)
        if by == 0:
            self._draw_diamonds(draw, frames, chosen, size, scale)
            return
        unmoved = frames if self._has_modifier("ctrl") else frames[~chosen]
        shown = np.concatenate([unmoved, frames[chosen] + by])
        self._draw_diamonds(draw, shown, np.arange(len(shown)) >= len(unmoved), size, scale)

    def _draw_diamonds(self, draw: imgui.ImDrawList, frames: Array, chosen: Bools, size: float, scale: float) -> None:
        """Draw keys at ``frames``, those that are ``chosen`` as selected; of keys that overlap, only some."""
        y = round(self.place(0)[1]) + 0.5
        low, high = self.visible_range
        spacing = self._width / (high - low)
        # Where keys overlap, one key per ``step`` pixels looks the same.
        step = max(round(size), 1) if spacing < size else 1
        places = np.round((self._left + (frames - low) * spacing) / step).astype(np.int64)
        inside = frames < self._timeline.keyframes.length
        codes = np.unique(places * 4 + chosen * 2 + inside).tolist()
        marks = [(code // 4 * step + 0.5, bool(code & 2), bool(code & 1)) for code in codes]
        # All edges are drawn first, so that dense keys do not hide one another.
        for x, selected, _ in marks:
            if selected:
                _diamond(draw, x, y, size + 3.0 * scale, u32(KEYED, 0.35))
            _diamond(draw, x, y, size + 1.5 * scale, u32(EDGE))
        for x, selected, played in marks:
            _diamond(draw, x, y, size, u32(KEYED if selected else INK, 1.0 if played else 0.4))

    def _draw_playhead(self, draw: imgui.ImDrawList, height: float, scale: float) -> None:
        frame = self._timeline.animation.frame
        x = round(self.x_of(frame))
        half = max(round(scale), 1)
        ruler = self._top + round(em(_RULER))
        draw.add_rect_filled((x - half, ruler - em(0.2)), (x + half, self._top + height), u32(ACCENT))
        text = str(frame + 1)
        size = imgui.calc_text_size(text)
        wide = _tag_width(frame)
        top = self._top + round(em(0.08))
        draw.add_rect_filled((x - wide, top), (x + wide, top + size.y + em(0.12)), u32(ACCENT), 3.0 * scale)
        draw.add_text((round(x - size.x / 2.0), top), u32(EDGE), text)

    def _draw_box(self, draw: imgui.ImDrawList, height: float, scale: float) -> None:
        press = self._press
        if press is None or press.kind != "box" or not self._dragged:
            return
        ruler = self._top + em(_RULER)
        left, right = sorted((press.x, imgui.get_io().mouse_pos.x))
        draw.add_rect_filled((left, ruler), (right, self._top + height), u32(ACCENT, 0.18))
        draw.add_rect((left, ruler), (right, self._top + height), u32(ACCENT, 0.9), 0.0, max(round(scale), 1))

    # Mouse

    def _has_modifier(self, modifier: str) -> bool:
        return modifier in self._timeline.context.modifiers

    def _key_at(self, x: float, y: float, scale: float) -> int | None:
        """Return the frame of the key at (x, y), or None."""
        if y < self._top + em(_RULER):
            return None
        keyframes, pressed = self._timeline.keyframes, self.frame_at(x)
        neighbours = (keyframes.previous_frame(math.floor(pressed) + 1), keyframes.next_frame(math.floor(pressed)))
        nearest = min((f for f in neighbours if f is not None), key=lambda frame: abs(frame - pressed), default=None)
        return nearest if nearest is not None and abs(self.x_of(nearest) - x) <= _REACH * scale else None

    def _drag_offset(self) -> int:
        """Return the number of frames by which keys are being dragged."""
        press = self._press
        if press is None or press.kind != "keys" or not self._dragged:
            return 0
        low, high = self.visible_range
        by = round((imgui.get_io().mouse_pos.x - press.x) * (high - low) / self._width)
        return max(by, -min(self._timeline.selected, default=0))

    def _handle_mouse(self, scale: float) -> None:
        io, mouse = imgui.get_io(), imgui.get_io().mouse_pos
        hovered = imgui.is_item_hovered()
        self.hint = self._hint_at(mouse.x, mouse.y, scale) if hovered and self._press is None else ""
        if self._press is not None and self._press.kind == "keys":
            self.hint = "Release: confirm   ·   Ctrl: copy   ·   Esc: cancel"
        if hovered:
            self._handle_wheel(io.mouse_wheel, io.mouse_wheel_h, mouse.x)
        if self._press is None:
            if imgui.is_item_activated():
                self._start_press(mouse.x, mouse.y, scale)
        elif imgui.is_key_pressed(imgui.Key.escape, False) or not self._timeline.reachable:
            self._set_press(None)
        press = self._press
        if press is None:
            return
        if max(abs(mouse.x - press.x), abs(mouse.y - press.y)) > _DRAG * scale:
            self._dragged = True
        if press.kind == "scrub":
            self._scrub(mouse.x)
        elif press.kind == "pan" and self._dragged:
            low, high = press.view
            self._set_visible_range(low, high, (press.x - mouse.x) * (high - low) / self._width)
        if not imgui.is_item_active():
            self._finish_press(press, mouse.x)

    def _start_press(self, x: float, y: float, scale: float) -> None:
        timeline = self._timeline
        self._dragged = False
        frame = self._key_at(x, y, scale)
        if imgui.is_mouse_clicked(imgui.MouseButton_.middle.value):
            self._set_press(_Press("pan", x, y, view=self.visible_range))
        elif imgui.is_mouse_clicked(imgui.MouseButton_.right.value):
            if frame is not None and timeline.free:
                timeline.delete(timeline.selected if frame in timeline.selected else {frame})
        elif y < self._top + em(_RULER):
            self._set_press(_Press("scrub", x, y))
        elif frame is None:
            self._set_press(_Press("box", x, y))
        else:
            timeline.stop()
            if self._has_modifier("shift"):
                timeline.select(timeline.selected ^ {frame})
            elif frame not in timeline.selected:
                timeline.select({frame})
            self._set_press(_Press("keys", x, y, frame))

    def _finish_press(self, press: _Press, x: float) -> None:
        timeline = self._timeline
        by = self._drag_offset()
        self._set_press(None)
        if press.kind == "box":
            found = set[int]()
            if self._dragged:
                low, high = sorted((self.frame_at(press.x), self.frame_at(x)))
                found = {frame for frame in timeline.keyframes.frames if low <= frame <= high}
            else:
                self._scrub(x)
            timeline.select(timeline.selected | found if self._has_modifier("shift") else found)
        elif press.kind == "keys" and by:
            (timeline.duplicate if self._has_modifier("ctrl") else timeline.move)(timeline.selected, by)
        elif press.kind == "keys" and not self._dragged and not self._has_modifier("shift"):
            timeline.select({press.frame})
            timeline.go_to(press.frame)

    def _scrub(self, x: float) -> None:
        frame = round(self.frame_at(x))
        last = max(self._timeline.keyframes.length - 1, *self._timeline.keyframes.frames[-1:], 0)
        self._timeline.go_to(min(max(frame, 0), last))

    def _handle_wheel(self, turned: float, across: float, x: float) -> None:
        low, high = self.visible_range
        if turned and self._has_modifier("shift"):
            across, turned = turned, 0.0
        if turned:
            pivot = self.frame_at(x)
            wide = max((high - low) * _ZOOM**-turned, _FEWEST_FRAMES)
            share = (pivot - low) / (high - low)
            self._set_visible_range(pivot - share * wide, pivot + (1.0 - share) * wide, 0.0)
        elif across and self._zoomed_range is not None:
            self._set_visible_range(low, high, -across * 0.1 * (high - low))

    def _set_visible_range(self, low: float, high: float, by: float) -> None:
        """Show the frames from ``low`` to ``high``, shifted by ``by``, or the whole animation if that is shorter."""
        self._zoomed_range, width = None, high - low
        first, last = self.visible_range
        if width >= last - first:
            return
        low = min(max(low + by, first), last - width)
        self._zoomed_range = (low, low + width)

    def _keep_playhead_visible(self) -> None:
        """Scroll by a page when the playhead leaves the visible range."""
        if self._zoomed_range is None or not self._timeline.playing:
            return
        low, high = self._zoomed_range
        frame = self._timeline.animation.frame
        if not low <= frame <= high:
            self._set_visible_range(frame, frame + high - low, 0.0)

    def _hint_at(self, x: float, y: float, scale: float) -> str:
        frame = self._key_at(x, y, scale)
        if frame is not None:
            hints = ("drag: move", "Ctrl+drag: copy", "right click: delete", "Shift+click: select more")
            return "   ·   ".join((f"Key at frame {frame + 1}", *hints))
        if y < self._top + em(_RULER):
            return "Drag: change the frame   ·   wheel: zoom   ·   middle drag: pan"
        return "Drag: select keys   ·   click: go to a frame   ·   wheel: zoom"


def _tag_width(frame: int) -> float:
    """Return half the width of the playhead's number."""
    return max(imgui.calc_text_size(str(frame + 1)).x / 2.0 + em(0.35), em(0.9))


def _diamond(draw: imgui.ImDrawList, x: float, y: float, size: float, colour: int) -> None:
    draw.add_quad_filled((x, y - size), (x + size, y), (x, y + size), (x - size, y), colour)
