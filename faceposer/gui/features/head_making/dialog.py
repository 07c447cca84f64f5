"""Pages of the dialogs that make a character of scans or photos."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from imgui_bundle import imgui

from faceposer.gui.features.head_making.landmark_page import LandmarkPage
from faceposer.gui.features.head_making.result_page import ResultPage
from faceposer.gui.widgets.basic import caption, text_field, wrapped_text
from faceposer.gui.widgets.modal import (
    draw_job,
    job_bar,
    modal,
    modal_body,
    modal_buttons,
    modal_columns,
    modal_entered,
    modal_escaped,
    modal_next_column,
    modal_room,
    modal_title,
)
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.text import displayed, shortened
from faceposer.gui.widgets.theme import BAD, Icon, em
from faceposer.gui.widgets.tooltips import tooltip

if TYPE_CHECKING:
    from faceposer.gui.features.head_making.state import HeadMaking

# Width and greatest height of the form, and width of its labels, in font sizes.
_WIDTH, _TALLEST, _LABEL = 44.0, 24.0, 7.0
# Share of the operating system's window that pages with a picture take, and width of the column beside it.
_LARGE, _COLUMN = 0.96, 20.0
# Height of the window in font sizes below which no room is reserved for an error.
_LOWEST = 20.0
_BUTTONS = {
    "form": (("find", "Find landmarks"), ("cancel", "Cancel")),
    "landmarks": (("fit", "Fit"), ("back", "Back"), ("cancel", "Cancel")),
    "fitting": (("cancel", "Cancel"),),
    "result": (("open", "Save and open"), ("again", "Back"), ("discard", "Discard")),
}
_TITLES = {"landmarks": "Landmarks", "fitting": "Fitting the head"}


class HeadDialog:
    """The dialog.

    Attributes:
        landmarks: The page of landmarks.
        compared: The page of the result.
    """

    def __init__(self, head: "HeadMaking[Any, Any]") -> None:
        """Show the state of ``head``."""
        self._head = head
        self.landmarks = LandmarkPage(head.context, self._prefix)
        self.compared = ResultPage(head.context, self._prefix)
        # Height of the form in pixels, which stays while landmarks are looked for.
        self._height = 0.0

    @property
    def _prefix(self) -> str:
        """Beginning of the names of its widgets."""
        return self._head.words.action[0]

    def forget(self) -> None:
        """Forget the pictures that are shown."""
        self.landmarks.forget()
        self.compared.forget()

    def release(self) -> None:
        """Release the textures of the pictures."""
        self.landmarks.release()
        self.compared.release()

    def draw(self, draw_above: Callable[[], None]) -> None:
        """Draw the current page; ``draw_above`` draws the dialogs above it."""
        head = self._head
        large = head.page in _TITLES or head.page == "result"
        view = imgui.get_main_viewport().size
        least = self._height if head.page == "finding" else 0.0
        sizes = (
            (_LARGE * view.x / em(), _LARGE * view.y / em(), _LARGE * view.y) if large else (_WIDTH, _TALLEST, least)
        )
        with modal(f"##{self._prefix}", *sizes) as shown:
            if not shown:
                draw_above()
                return
            if head.page == "finding":
                self._draw_finding()
            elif large:
                self._draw_large()
            else:
                self._draw_form()
                self._height = imgui.get_window_height()
            if not head.open:
                imgui.close_current_popup()
            draw_above()

    # The form

    def _draw_finding(self) -> None:
        head = self._head
        job, context = head.job, head.context
        assert job is not None
        stage = f"{job.stage}..."
        draw_job(context.fonts, context.widget_rects, self._prefix, "Finding landmarks", job, stage, escapes=False)
        if job.cancelled:
            head.stop()

    def _draw_form(self) -> None:
        head, buttons = self._head, _BUTTONS["form"]
        modal_title(head.context.fonts, head.words.action[1].removesuffix("..."))
        # Room for an error of two lines is reserved, so that nothing jumps when it appears, unless the window is low.
        lines = 2.0 if modal_room() > _LOWEST else 0.0
        wrap = imgui.get_content_region_avail().x
        tall = imgui.calc_text_size(displayed(head.error), wrap_width=wrap).y if head.error else 0.0
        reserved = max(tall, lines * imgui.get_text_line_height()) + imgui.get_style().item_spacing.y
        with modal_body(buttons, below=reserved):
            self._draw_fields()
        below = imgui.get_cursor_pos_y() + reserved
        self._draw_error()
        imgui.set_cursor_pos_y(max(below, imgui.get_cursor_pos_y()))
        missing, noun = not head.files, head.words.noun
        self._draw_buttons(
            "form",
            ("find",) if missing else (),
            {"find": f"Add a {noun} first" if missing else f"Find the face in each {noun}"},
        )

    def _draw_fields(self) -> None:
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
            imgui.text_unformatted(shortened(Path(path).name, imgui.get_content_region_avail().x))
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

    # Pages with a picture

    def _draw_large(self) -> None:
        head, page = self._head, self._head.page
        buttons = _BUTTONS[page]
        modal_title(head.context.fonts, _TITLES.get(page, head.words.action[1].removesuffix("...")))
        with modal_columns(buttons, _COLUMN) as room:
            self._draw_picture(room)
            modal_next_column()
            self._draw_error()
            self._draw_column()
        self._draw_buttons(page)

    def _draw_picture(self, room: tuple[float, float]) -> None:
        head = self._head
        if head.page == "landmarks":
            self.landmarks.draw_picture(head.landmarks, room)
        elif head.result is not None:
            self.compared.draw_picture(head.result, room)
        else:
            preview = head.landmarks.marked[0].image if head.preview is None else head.preview
            self.compared.draw_plain(preview, room, self.compared.zoom)

    def _draw_column(self) -> None:
        head = self._head
        if head.page == "landmarks":
            caption(head.words.landmarks)
            self.landmarks.draw_actions(head.landmarks)
            imgui.separator()
            head.draw_options()
        elif head.result is not None:
            self.compared.draw_column(head.result)
        elif head.job is not None:
            job_bar(head.context.widget_rects, self._prefix, head.job)
            wrapped_text(f"{head.job.stage}...")
            caption("Nothing is written before you save.")

    def _draw_error(self) -> None:
        if self._head.error:
            imgui.push_style_color(imgui.Col_.text, BAD)
            wrapped_text(self._head.error)
            imgui.pop_style_color()

    def _draw_buttons(self, page: str, without: tuple[str, ...] = (), tips: dict[str, str] | None = None) -> None:
        """Draw the buttons of ``page``, some disabled, and do what the pressed one, Enter or Esc asks for."""
        head, buttons = self._head, _BUTTONS[page]
        default = None if page == "fitting" else 0
        pressed = modal_buttons(head.context.widget_rects, self._prefix, buttons, default, disabled=without, tips=tips)
        if not head.context.file_dialogs.open and page != "fitting":
            if modal_escaped():
                pressed = "" if page == "landmarks" and self.landmarks.escape(head.landmarks) else "cancel"
            elif modal_entered() and buttons[0][0] not in without:
                pressed = buttons[0][0]
        if pressed:
            run = {
                "find": head.find,
                "fit": head.fit,
                "back": head.back,
                "again": head.fit_again,
                "open": head.save,
                "cancel": head.stop if page == "fitting" else head.ask_to_close,
                "discard": head.close_dialog,
            }
            run[pressed]()
