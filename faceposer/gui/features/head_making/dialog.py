"""Pages of the dialogs that make a character of scans or photos."""

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.widgets.basic import caption, text_field, wrapped_text
from faceposer.gui.widgets.modal import (
    draw_job,
    modal,
    modal_body,
    modal_buttons,
    modal_entered,
    modal_escaped,
    modal_room,
    modal_title,
)
from faceposer.gui.widgets.pictures import Picture
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import ACCENT, BAD, INK, Icon, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.model.character_file import load_character

if TYPE_CHECKING:
    from faceposer.gui.features.head_making.state import HeadMaking, Marked

# Heights of pages with a picture and of the others.
_WIDTH, _TALLEST, _LOW, _LABEL = 44.0, 48.0, 24.0, 7.0
# Height of the window in font sizes below which no room is reserved for an error.
_LOWEST = 20.0
# Height of a page beside its picture.
_AROUND = 14.0
_BUTTONS = {
    "form": (("find", "Find landmarks"), ("cancel", "Cancel")),
    "landmarks": (("fit", "Fit"), ("back", "Back"), ("cancel", "Cancel")),
    "result": (("open", "Save and open"), ("again", "Back"), ("cancel", "Discard")),
}
# Distance in font sizes within which the pointer takes a landmark.
_REACH = 0.9


class HeadDialog:
    """The dialog.

    Attributes:
        wiped: Where the line between the pictures of a comparison is, as a share of their width.
    """

    def __init__(self, head: "HeadMaking[Any, Any]") -> None:
        """Show the state of ``head``."""
        self._head = head
        self._picture, self._over = Picture(), Picture()
        self.wiped = 0.5
        self._dragged: str | None = None
        # Height in pixels that the dialog has had, below which it does not fall while it works.
        self._height = 0.0

    @property
    def _prefix(self) -> str:
        """Beginning of the names of its widgets."""
        return self._head.words.action[0]

    def forget(self) -> None:
        """Forget the picture that is shown."""
        self._picture.forget()
        self._over.forget()
        self._dragged, self.wiped = None, 0.5

    def release(self) -> None:
        """Release the textures of the pictures."""
        self._picture.release()
        self._over.release()

    def draw(self, draw_above: Callable[[], None]) -> None:
        """Draw the current page; ``draw_above`` draws the dialogs above it."""
        head = self._head
        pictures = head.page not in ("form", "finding")
        least = 0.0 if head.page == "form" else self._height
        with modal(f"##{self._prefix}", _WIDTH, _TALLEST if pictures else _LOW, least) as shown:
            if not shown:
                draw_above()
                return
            if head.job is not None:
                self._draw_progress()
            else:
                self._draw_page()
            self._height = imgui.get_window_height()
            if not head.open:
                imgui.close_current_popup()
            draw_above()

    def _draw_progress(self) -> None:
        head = self._head
        assert head.job is not None
        title = "Finding landmarks" if head.page == "finding" else "Fitting the head"
        stage = "Stopping..." if head.job.cancelled else f"{head.job.stage}..."
        text = f"{stage} Nothing is written before you save."
        draw_job(head.context.fonts, head.context.widget_rects, self._prefix, title, head.job, text, escapes=False)

    def _draw_page(self) -> None:
        head, page = self._head, self._head.page
        made = head.words.action[1].removesuffix("...")
        titles = {"form": made, "landmarks": "Landmarks", "result": made}
        buttons = _BUTTONS[page]
        modal_title(head.context.fonts, titles[page])
        # Room for an error of two lines is reserved, so that nothing jumps when it appears, unless the window is low.
        lines = 2.0 if modal_room() > _LOWEST else 0.0
        wrap = imgui.get_content_region_avail().x
        tall = imgui.calc_text_size(displayed(head.error), wrap_width=wrap).y if head.error else 0.0
        reserved = max(tall, lines * imgui.get_text_line_height()) + imgui.get_style().item_spacing.y
        with modal_body(buttons, below=reserved):
            {"form": self._draw_form, "landmarks": self._draw_landmarks, "result": self._draw_result}[page]()
        below = imgui.get_cursor_pos_y() + reserved
        if head.error:
            imgui.push_style_color(imgui.Col_.text, BAD)
            wrapped_text(head.error)
            imgui.pop_style_color()
        imgui.set_cursor_pos_y(max(below, imgui.get_cursor_pos_y()))
        missing = page == "form" and not head.files
        disabled = ("find",) if missing else ()
        noun = head.words.noun
        tips = {"find": f"Add a {noun} first" if missing else f"Find the face in each {noun}"}
        pressed = modal_buttons(head.context.widget_rects, self._prefix, buttons, disabled=disabled, tips=tips)
        if not head.context.file_dialogs.open:
            if modal_escaped():
                pressed = "cancel"
            elif modal_entered() and not missing:
                pressed = buttons[0][0]
        if pressed:
            run = {
                "find": head.find,
                "fit": head.fit,
                "back": head.back,
                "again": head.fit_again,
                "open": head.save,
                "cancel": head.close_dialog,
            }
            run[pressed]()

    # The form

    def _draw_form(self) -> None:
        head, rects, prefix = self._head, self._head.context.widget_rects, self._prefix
        words = head.words
        caption(words.form)
        label = f"{words.noun.capitalize()}s"
        for i, path in enumerate(list(head.files)):
            row_label(label if i == 0 else "", width=_LABEL)
            if imgui.button(f"{Icon.CLOSE}##file{i}", (em(1.9), 0.0)):
                head.remove(path)
            rects.record(f"{prefix}:{i}:remove")
            tooltip(f"Remove this {words.noun}")
            imgui.same_line()
            imgui.text_unformatted(displayed(Path(path).name))
            # Recorded so that tooltips of other rows do not cover it.
            rects.record(f"{prefix}:{i}:name")
            tooltip(path)
        row_label("" if head.files else label, width=_LABEL)
        if imgui.button("Add..."):
            head.ask_for_file()
        rects.record(f"{prefix}:add")
        tooltip(f"Choose a {words.noun}; files can also be dropped onto the window")
        row_label("Title", "Title of the character in the window", _LABEL)
        imgui.set_next_item_width(-1.0)
        _, head.title = text_field("##title", head.title)
        rects.record(f"{prefix}:title")
        for name, title, tip in words.options:
            row_label("", width=_LABEL)
            _, head.options[name] = imgui.checkbox(title, head.options[name])
            rects.record(f"{prefix}:{name}")
            tooltip(tip)

    # Landmarks

    def _draw_landmarks(self) -> None:
        head = self._head
        head.shown = min(head.shown, len(head.marked) - 1)
        caption(head.words.landmarks)
        head.draw_options()
        if len(head.marked) > 1:
            names = [displayed(one.name) for one in head.marked]
            imgui.set_next_item_width(-1.0)
            _, head.shown = imgui.combo("##shown", head.shown, names)
            head.context.widget_rects.record(f"{self._prefix}:shown")
        marked: Marked = head.marked[head.shown]
        low, side = self._draw_picture(marked.image)
        factor = side / marked.image.shape[1]
        hovered = imgui.is_item_hovered()
        near = self._dragged or self._nearest(marked, low, factor)
        self._drag(low, factor)
        draw = imgui.get_window_draw_list()
        for name, (u, v) in head.marked[head.shown].pixels.items():
            centre = ImVec2(low.x + factor * u, low.y + factor * v)
            colour = ACCENT if name in marked.moved or name == near else INK
            draw.add_circle_filled(centre, em(0.22), u32(colour))
            draw.add_circle(centre, em(0.26), u32((0.0, 0.0, 0.0, 0.7)))
        if near is not None and (hovered or self._dragged):
            u, v = head.marked[head.shown].pixels[near]
            at = ImVec2(low.x + factor * u + em(0.6), low.y + factor * v - em(0.6))
            title = _titles().get(near, near)
            draw.add_text(ImVec2(at.x + 1.0, at.y + 1.0), u32((0.0, 0.0, 0.0, 1.0)), title)
            draw.add_text(at, u32(INK), title)

    def _drag(self, low: ImVec2, factor: float) -> None:
        head, mouse = self._head, imgui.get_mouse_pos()
        if imgui.is_item_activated():
            self._dragged = self._nearest(head.marked[head.shown], low, factor)
        if self._dragged is None:
            return
        if not imgui.is_item_active():
            self._dragged = None
        elif imgui.is_mouse_dragging(imgui.MouseButton_.left.value, 2.0):
            pixel = ((mouse.x - low.x) / factor, (mouse.y - low.y) / factor)
            head.marked[head.shown] = head.marked[head.shown].with_moved(self._dragged, pixel)

    def _nearest(self, marked: "Marked", low: ImVec2, factor: float) -> str | None:
        """Return the landmark under the pointer, or None."""
        mouse = imgui.get_mouse_pos()
        u, v = (mouse.x - low.x) / factor, (mouse.y - low.y) / factor
        distances = {name: factor * math.hypot(x - u, y - v) for name, (x, y) in marked.pixels.items()}
        name = min(distances, key=distances.__getitem__, default=None)
        return name if name is not None and distances[name] < em(_REACH) else None

    # The result

    def _draw_result(self) -> None:
        result = self._head.result
        assert result is not None
        caption(result.text)
        low, width = self._draw_picture(result.picture)
        if result.over is not None:
            self._draw_wipe(result.over, low, width)

    def _draw_wipe(self, over: NDArray[np.uint8], low: ImVec2, width: float) -> None:
        """Draw ``over`` on the right of a line over the picture at ``low``, and move the line under the pointer."""
        head = self._head
        if imgui.is_item_active():
            self.wiped = min(max((imgui.get_mouse_pos().x - low.x) / width, 0.0), 1.0)
            head.context.redraw(1)
        if imgui.is_item_hovered():
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew.value)
        bottom = low.y + width * over.shape[0] / over.shape[1]
        at = low.x + self.wiped * width
        draw = imgui.get_window_draw_list()
        texture = imgui.ImTextureRef(self._over.texture(head.context.gl, over))
        corners = (ImVec2(at, low.y), ImVec2(low.x + width, bottom), ImVec2(self.wiped, 0.0), ImVec2(1.0, 1.0))
        if self.wiped < 1.0:
            draw.add_image(texture, *corners)
        draw.add_line(ImVec2(at, low.y), ImVec2(at, bottom), u32((0.0, 0.0, 0.0, 0.6)), em(0.2))
        draw.add_line(ImVec2(at, low.y), ImVec2(at, bottom), u32(INK), em(0.1))
        draw.add_circle_filled(ImVec2(at, 0.5 * (low.y + bottom)), em(0.45), u32(INK))

    def _draw_picture(self, image: NDArray[np.uint8]) -> tuple[ImVec2, float]:
        """Draw ``image`` as large as there is room and return its top left corner and its width."""
        texture = self._picture.texture(self._head.context.gl, image)
        room = imgui.get_content_region_avail().x
        tallest = min(em(_TALLEST), imgui.get_main_viewport().work_size.y) - em(_AROUND)
        height, width = image.shape[:2]
        scale = max(min(room / width, tallest / height), 0.05)
        size = ImVec2(scale * width, scale * height)
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + 0.5 * (room - size.x))
        low = imgui.get_cursor_screen_pos()
        imgui.invisible_button("##picture", size)
        self._head.context.widget_rects.record(f"{self._prefix}:picture")
        high = ImVec2(low.x + size.x, low.y + size.y)
        imgui.get_window_draw_list().add_image(imgui.ImTextureRef(texture), low, high)
        return low, size.x


@lru_cache(maxsize=1)
def _titles() -> Mapping[str, str]:
    """Return the readable names of the feature points of people."""
    return load_character("man").feature_titles
