"""Modal dialogs: errors, questions and the list of keys. One is shown at a time; the others wait."""

from collections.abc import Callable
from dataclasses import dataclass, field

from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.gui.actions import Actions, display_key
from faceposer.gui.widgets.basic import caption, text_field
from faceposer.gui.widgets.modal import (
    buttons_width,
    modal,
    modal_body,
    modal_buttons,
    modal_entered,
    modal_escaped,
    modal_title,
)
from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import FAINT, Fonts, em, u32
from faceposer.gui.widgets.widget_rects import WidgetRects

# Widths of a question, of one with details, and of its buttons, in units of the font size.
_QUESTION, _DETAILS, _BUTTON = 30.0, 37.0, 5.5
_MOUSE = (
    ("Drag on the face", "pull that point and pin it"),
    ("Drag a point", "move it and all selected points"),
    ("Right click on a point", "remove it"),
    ("Shift+click on a point", "select more"),
    ("Arrow keys", "nudge the selection by 1 pixel, with Shift by 10"),
    ("Drag beside the face", "orbit"),
    ("Wheel", "zoom"),
)
_NAVIGATION = {
    "blender": (
        ("Middle drag", "orbit"),
        ("Shift+middle drag", "pan"),
        ("Ctrl+middle drag", "zoom"),
    ),
    "maya": (
        ("Alt+left drag", "orbit"),
        ("Alt+middle drag, middle drag", "pan"),
        ("Alt+right drag", "zoom"),
    ),
}


def _do_nothing() -> None:
    pass


@dataclass(frozen=True)
class Choice:
    """A button of a question."""

    label: str
    run: Callable[[], None] = _do_nothing


@dataclass(frozen=True)
class Question:
    """Text with buttons; Enter takes the default, Esc the last.

    Attributes:
        title: Title, in bold.
        text: One or two sentences.
        choices: Buttons, at least one.
        details: Additional text, such as a traceback, or "".
        bad: True for an error or a warning.
        default: Index of the choice for Enter: the last one if the first cannot be undone.
        holds: Returns False once the question has lost its object; it then disappears.
    """

    title: str
    text: str
    choices: tuple[Choice, ...] = (Choice("OK"),)
    details: str = ""
    bad: bool = False
    default: int = 0
    holds: Callable[[], bool] = lambda: True


@dataclass
class TextQuestion:
    """A dialog for a line of text.

    Attributes:
        title: Title, in bold.
        text: Text of the field, at first the suggestion.
        verb: Label of the button that accepts the text.
        done: Called with the text; its FacePoserError is shown, and the dialog remains open.
        problem: Message of that error, or "".
    """

    title: str
    text: str
    verb: str
    done: Callable[[str], None]
    problem: str = ""


@dataclass
class Dialogs:
    """The dialogs that are open or waiting."""

    fonts: Fonts
    rects: WidgetRects
    waiting: list[Question | TextQuestion] = field(default_factory=list)
    keys_shown: bool = False

    @property
    def open(self) -> bool:
        """True if a dialog is open."""
        return bool(self.waiting) or self.keys_shown

    def ask(self, question: Question | TextQuestion) -> None:
        """Add ``question`` to the queue, unless the same question is in it."""
        if not any(
            type(other) is type(question) and other.title == question.title and other.text == question.text
            for other in self.waiting
        ):
            self.waiting.append(question)

    def report(self, title: str, text: str, details: str = "") -> None:
        """Report an error."""
        self.ask(Question(title, text, details=details, bad=True))

    def draw(self, actions: Actions, navigation: str) -> None:
        """Draw the open dialog."""
        first = self.waiting[0] if self.waiting else None
        if isinstance(first, TextQuestion):
            self._draw_text_question(first)
        elif first is not None:
            self._draw_question(first)
        elif self.keys_shown:
            self._draw_keys(actions, navigation)

    def _draw_question(self, question: Question) -> None:
        taken: Choice | None = None
        width = max(_QUESTION, _DETAILS if question.details else 0.0, buttons_width(_labels(question), _BUTTON))
        with modal("##question", width) as shown:
            if shown:
                taken = self._draw_content(question)
                if taken is not None or not question.holds():
                    self.waiting.remove(question)
                    imgui.close_current_popup()
        if taken is not None:
            taken.run()

    def _draw_content(self, question: Question) -> Choice | None:
        """Draw ``question`` and return the choice of the user, if any."""
        modal_title(self.fonts, question.title, question.bad)
        labels = _labels(question)
        with modal_body(labels, _BUTTON):
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(displayed(question.text))
            imgui.pop_text_wrap_pos()
            if question.details:
                imgui.dummy((0.0, em(0.3)))
                details = displayed(question.details, label=False)
                imgui.input_text_multiline("##details", details, (-1.0, em(10)), imgui.InputTextFlags_.read_only.value)
        pressed = modal_buttons(self.rects, "choice", labels, default=question.default, least=_BUTTON)
        taken = question.choices[int(pressed)] if pressed else None
        if modal_entered():
            taken = question.choices[question.default]
        if modal_escaped():
            taken = question.choices[-1]
        return taken

    def _draw_text_question(self, question: TextQuestion) -> None:
        pressed = ""
        with modal("##text-question", 26.0) as shown:
            if shown:
                pressed = self._draw_field(question)
                if pressed == "cancel":
                    self.waiting.remove(question)
                    imgui.close_current_popup()
                elif pressed == "accept":
                    try:
                        question.done(question.text)
                    except FacePoserError as error:
                        question.problem = str(error)
                    else:
                        self.waiting.remove(question)
                        imgui.close_current_popup()

    def _draw_field(self, question: TextQuestion) -> str:
        """Draw the field and the buttons, and return the name of the pressed button, or ""."""
        modal_title(self.fonts, question.title)
        buttons = (("accept", question.verb), ("cancel", "Cancel"))
        with modal_body(buttons):
            if imgui.is_window_appearing():
                imgui.set_keyboard_focus_here()
            imgui.set_next_item_width(-1.0)
            flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
            entered, text = text_field("##text", question.text, flags=flags.value)
            self.rects.record("text:field")
            if text != question.text:
                question.text, question.problem = text, ""
            # The line is always reserved, so that the dialog does not change its size.
            caption(question.problem or " ")
        pressed = modal_buttons(self.rects, "text", buttons)
        if entered and not imgui.is_window_appearing():
            pressed = "accept"
        if modal_escaped():
            pressed = "cancel"
        return pressed

    def _draw_keys(self, actions: Actions, navigation: str) -> None:
        room = imgui.get_main_viewport().size.x - em(4)
        with modal("##keys", min(66.0, room / em()) + 2.8) as shown:
            if not shown:
                return
            modal_title(self.fonts, "Keys and mouse")
            with modal_body((), below=imgui.get_text_line_height()):
                self._draw_columns(actions, navigation)
            caption("Press Esc or click outside to close.")
            outside = imgui.is_mouse_clicked(imgui.MouseButton_.left.value) and not imgui.is_window_hovered(
                imgui.HoveredFlags_.child_windows.value
            )
            appearing = imgui.is_window_appearing()
            if modal_escaped() or (not appearing and (imgui.is_key_pressed(imgui.Key.f1, False) or outside)):
                self.keys_shown = False
                imgui.close_current_popup()

    def _draw_columns(self, actions: Actions, navigation: str) -> None:
        """Draw the list in as many columns as have room for a key and its description."""
        width, menus = imgui.get_content_region_avail().x, actions.menus
        count = min(max(int(width // em(18)), 1), 3)
        if imgui.begin_table("##columns", count, imgui.TableFlags_.sizing_stretch_same.value, (width, 0.0)):
            imgui.table_next_column()
            _section(self.fonts, "Mouse", (*_MOUSE, *_NAVIGATION[navigation]))
            for menu in (menus[0], menus[-1]):
                _section(self.fonts, menu, _rows(actions, menu))
            for column in (menus[1:3], menus[3:-1]):
                imgui.table_next_column()
                for menu in column:
                    _section(self.fonts, menu, _rows(actions, menu))
            imgui.end_table()


def _labels(question: Question) -> list[tuple[str, str]]:
    """Return name and label of each button of ``question``."""
    return [(str(i), choice.label) for i, choice in enumerate(question.choices)]


def _rows(actions: Actions, menu: str) -> tuple[tuple[str, str], ...]:
    return tuple(
        (", ".join(map(display_key, action.keys)), action.help or action.label)
        for action in actions.in_menu(menu)
        if action.keys
    )


def _section(fonts: Fonts, title: str, rows: tuple[tuple[str, str], ...]) -> None:
    if not rows:
        return
    imgui.push_font(fonts.bold, 0.0)
    imgui.text_unformatted(title)
    imgui.pop_font()
    low = imgui.get_cursor_screen_pos()
    imgui.get_window_draw_list().add_line(
        (low.x, low.y - em(0.15)), (low.x + imgui.get_content_region_avail().x, low.y - em(0.15)), u32(FAINT, 0.3)
    )
    if imgui.begin_table(f"##{title}", 2):
        imgui.table_setup_column("", imgui.TableColumnFlags_.width_fixed.value, em(8.6))
        imgui.table_setup_column("", imgui.TableColumnFlags_.width_stretch.value)
        for keys, description in rows:
            imgui.table_next_column()
            imgui.text_disabled(keys)
            imgui.table_next_column()
            imgui.text_wrapped(description)
        imgui.end_table()
    imgui.dummy((0.0, em(0.4)))
