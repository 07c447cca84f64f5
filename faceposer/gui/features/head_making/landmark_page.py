"""The page on which landmarks are moved: the picture with the points, and what can be done with them."""

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from imgui_bundle import ImVec2, imgui

from faceposer.errors import counted
from faceposer.gui.context import EditorContext
from faceposer.gui.features.head_making.contents import Marked
from faceposer.gui.features.head_making.landmark_edit import LandmarkEdit
from faceposer.gui.widgets.basic import button_width, caption, disabled, fitted_button, wrapped_text
from faceposer.gui.widgets.pictures import Picture
from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import ACCENT, EDGE, INK, WARNING, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.zoomed_picture import Placed, ZoomedPicture
from faceposer.model.character_file import load_character

# In font sizes: distance within which the pointer takes a landmark, radii of points, and offset of their names.
_REACH, _RADIUS, _LIT, _NAME = 0.9, 0.24, 0.34, 0.7
# Pixels by which the pointer moves before a press is a drag, and by which an arrow key moves the selected point.
_DRAGGED, _NUDGE = 2.0, 1.0
_ARROWS = (
    (imgui.Key.left_arrow, (-_NUDGE, 0.0)),
    (imgui.Key.right_arrow, (_NUDGE, 0.0)),
    (imgui.Key.up_arrow, (0.0, -_NUDGE)),
    (imgui.Key.down_arrow, (0.0, _NUDGE)),
)


class LandmarkPage:
    """The page.

    Attributes:
        zoom: The part of the picture that is shown.
    """

    def __init__(self, context: EditorContext, prefix: str) -> None:
        """Draw in ``context``; names of widgets begin with ``prefix``."""
        self._context, self._prefix = context, prefix
        self.zoom = ZoomedPicture()
        self._picture = Picture()
        # The landmark under the pointer.
        self._near: str | None = None
        # The landmark that is dragged, and its distance from the pointer.
        self._dragged: tuple[str, float, float] | None = None

    def forget(self) -> None:
        """Forget the pictures and what is shown of them."""
        self._picture.forget()
        self._dragged = self._near = None
        self.zoom.fit()

    def release(self) -> None:
        """Release the textures."""
        self._picture.release()

    # The picture

    def draw_picture(self, edit: LandmarkEdit[Any], room: tuple[float, float]) -> None:
        """Draw the picture shown with its landmarks, and respond to the pointer."""
        marked: Marked = edit.current
        height, width = marked.image.shape[:2]
        texture = self._picture.texture(self._context.gl, marked.image)
        near = self._near if self._near in marked.pixels else None
        placed = self.zoom.draw(
            self._context.widget_rects, f"{self._prefix}:picture", texture, (width, height), room, near is None
        )
        self._near = self._nearest(marked, placed) if placed.hovered and not placed.panning else None
        self._drag(edit, placed)
        self._nudge(edit, placed)
        marked = edit.current
        lit = self._dragged[0] if self._dragged else self._near
        self._draw_points(marked, placed, edit.selected, lit)
        if lit is not None:
            imgui.set_mouse_cursor(imgui.MouseCursor_.hand.value)

    def _drag(self, edit: LandmarkEdit[Any], placed: Placed) -> None:
        mouse, left = imgui.get_mouse_pos(), imgui.MouseButton_.left.value
        marked: Marked = edit.current
        if imgui.is_item_activated() and imgui.is_mouse_clicked(left) and not placed.panning:
            edit.selected = self._near or ""
            if self._near is not None:
                x, y = _seen(marked, placed, marked.pixels[self._near])
                self._dragged = (self._near, x - mouse.x, y - mouse.y)
        if self._dragged is None:
            return
        name, right, below = self._dragged
        if not imgui.is_mouse_down(left):
            self._dragged = None
            edit.end_move(f"Move {title_of(name)}")
        elif edit.moving or imgui.is_mouse_dragging(left, _DRAGGED):
            edit.move(name, _pixel(marked, placed, (mouse.x + right, mouse.y + below)))

    def _nudge(self, edit: LandmarkEdit[Any], placed: Placed) -> None:
        """Move the selected landmark by arrow keys, a pixel of the window at a time."""
        name = edit.selected
        if self._dragged or name not in edit.current.pixels or imgui.get_io().want_text_input:
            return
        for key, (across, down) in _ARROWS:
            if imgui.is_key_pressed(key):
                x, y = _seen(edit.current, placed, edit.current.pixels[name])
                edit.move(name, _pixel(edit.current, placed, (x + across, y + down)))
                edit.end_move(f"Move {title_of(name)}")

    def escape(self, edit: LandmarkEdit[Any]) -> bool:
        """Cancel the drag of a landmark; return True if there was one."""
        if self._dragged is None:
            return False
        self._dragged = None
        edit.cancel_move()
        return True

    @staticmethod
    def _nearest(marked: Marked, placed: Placed) -> str | None:
        """Return the landmark under the pointer, or None."""
        mouse = imgui.get_mouse_pos()
        distances = {}
        for name, pixel in marked.pixels.items():
            x, y = _seen(marked, placed, pixel)
            distances[name] = math.hypot(x - mouse.x, y - mouse.y)
        nearest = min(distances, key=distances.__getitem__, default=None)
        return nearest if nearest is not None and distances[nearest] < em(_REACH) else None

    @staticmethod
    def _draw_points(marked: Marked, placed: Placed, selected: str, lit: str | None) -> None:
        draw, canvas = imgui.get_window_draw_list(), placed.canvas
        draw.push_clip_rect(ImVec2(*canvas[:2]), ImVec2(*canvas[2:]), True)
        for name in marked.moved:
            begin = ImVec2(*_seen(marked, placed, marked.found_pixels[name]))
            end = ImVec2(*_seen(marked, placed, marked.pixels[name]))
            draw.add_line(begin, end, u32(EDGE, 0.8), em(0.22))
            draw.add_line(begin, end, u32(ACCENT), em(0.1))
            draw.add_circle(begin, em(_RADIUS), u32(EDGE, 0.8), 0, em(0.2))
            draw.add_circle(begin, em(_RADIUS), u32(ACCENT), 0, em(0.08))
        for name, pixel in marked.pixels.items():
            centre = ImVec2(*_seen(marked, placed, pixel))
            radius = em(_LIT if name in (lit, selected) else _RADIUS)
            draw.add_circle_filled(centre, radius + em(0.1), u32(EDGE, 0.85))
            draw.add_circle_filled(centre, radius, u32(ACCENT if name in marked.moved else INK))
            if name in (lit, selected):
                # The centre is open to show the place.
                draw.add_circle_filled(centre, em(0.12), u32(EDGE, 0.9))
        for name in dict.fromkeys((selected, lit or "")):
            if name in marked.pixels and (name == lit or lit is None):
                _draw_name(draw, placed, _seen(marked, placed, marked.pixels[name]), title_of(name))
        draw.pop_clip_rect()

    # What can be done

    def draw_actions(self, edit: LandmarkEdit[Any]) -> None:
        """Draw the choice of the picture, and the buttons that undo and reset."""
        rects, prefix = self._context.widget_rects, self._prefix
        if len(edit.marked) > 1:
            names = [f"{number + 1}: {displayed(one.name)}" for number, one in enumerate(edit.marked)]
            imgui.set_next_item_width(-1.0)
            changed, shown = imgui.combo("##shown", edit.shown, names)
            rects.record(f"{prefix}:shown")
            if changed:
                edit.shown, edit.selected = shown, ""
                self.zoom.fit()
        marked: Marked = edit.current
        if marked.note:
            imgui.push_style_color(imgui.Col_.text, WARNING)
            wrapped_text(marked.note)
            imgui.pop_style_color()
        here = f"{len(marked.moved)} of {counted(len(marked.pixels), 'point')} moved"
        elsewhere = edit.n_moved - len(marked.moved)
        caption(f"{here}{f', {elsewhere} in other pictures' if elsewhere else ''}.")
        actions, width = self._context.actions, button_width(2)
        for name, label, step, run in (
            ("undo", "Undo", edit.steps.undo_label, edit.undo),
            ("redo", "Redo", edit.steps.redo_label, edit.redo),
        ):
            if name == "redo":
                imgui.same_line()
            with disabled(not step):
                tip = f"{label}{f': {step}' if step else ''}{actions[name].bracketed_shortcut}"
                if fitted_button(rects, label, f"{prefix}:{name}", width, tip):
                    run()
        with disabled(edit.selected not in marked.moved):
            tip = "Back to where the selected point was found  (Delete)"
            if fitted_button(rects, "Reset point", f"{prefix}:reset-point", width, tip):
                edit.reset((edit.selected,))
        imgui.same_line()
        with disabled(not edit.n_moved):
            tip = "All points of all pictures back to where they were found"
            if fitted_button(rects, "Reset all", f"{prefix}:reset-all", width, tip):
                edit.reset()
        self.draw_fit_button()

    def draw_fit_button(self) -> None:
        """Draw the button that shows all of the picture."""
        rects, key = self._context.widget_rects, self._context.actions["frame"].bracketed_shortcut
        with disabled(self.zoom.zoom <= 1.0):
            if imgui.button(f"Whole picture##{self._prefix}", (-1.0, 0.0)):
                self.zoom.fit()
        rects.record(f"{self._prefix}:whole")
        tooltip(
            f"Wheel: zoom around the pointer. Middle drag or Space and drag: move. Double click: whole picture{key}"
        )


def _seen(marked: Marked, placed: Placed, pixel: tuple[float, float]) -> tuple[float, float]:
    """Return the place in the window of a pixel of the picture."""
    height, width = marked.image.shape[:2]
    return placed.at(pixel[0] / width, pixel[1] / height)


def _pixel(marked: Marked, placed: Placed, place: tuple[float, float]) -> tuple[float, float]:
    """Return the pixel of the picture at a place in the window."""
    height, width = marked.image.shape[:2]
    across, down = placed.share(*place)
    return (across * width, down * height)


def _draw_name(draw: imgui.ImDrawList, placed: Placed, at: tuple[float, float], text: str) -> None:
    """Draw ``text`` on a dark ground beside a point, where the canvas has room for it."""
    extent, gap, padding = imgui.calc_text_size(text), em(_NAME), em(0.3)
    left, top, right, _ = placed.canvas
    x = at[0] + gap if at[0] + gap + extent.x + padding <= right else at[0] - gap - extent.x
    y = at[1] - gap - extent.y if at[1] - gap - extent.y - padding >= top else at[1] + gap
    x = max(x, left + padding)
    low, high = ImVec2(x - padding, y - 0.5 * padding), ImVec2(x + extent.x + padding, y + extent.y + 0.5 * padding)
    draw.add_rect_filled(low, high, u32(EDGE, 0.85), em(0.25))
    draw.add_text(ImVec2(x, y), u32(INK), text)


def title_of(name: str) -> str:
    """Return the readable name of a feature point of people."""
    return _titles().get(name, name)


@lru_cache(maxsize=1)
def _titles() -> Mapping[str, str]:
    return load_character("man").feature_titles
