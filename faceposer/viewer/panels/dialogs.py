"""Modal dialogs: errors, questions and the sheet of keys. One is shown at a time, the others wait."""

from collections.abc import Callable
from dataclasses import dataclass, field

from imgui_bundle import imgui

from faceposer.viewer.actions import Actions
from faceposer.viewer.panels.widgets import Marks, caption
from faceposer.viewer.theme import ACCENT_DARK, BAD, FAINT, Fonts, Icon, em, u32

_MOUSE = (
    ("Drag on the face", "pull that point; it stays pinned"),
    ("Drag a point", "move it, with all selected points"),
    ("Right click on a point", "remove it"),
    ("Shift+click on a point", "select more"),
    ("Arrow keys, with Shift", "nudge what is selected by 1, by 10 pixels"),
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


def _nothing() -> None:
    pass


@dataclass(frozen=True)
class Choice:
    """A button of a question."""

    label: str
    run: Callable[[], None] = _nothing


@dataclass(frozen=True)
class Question:
    """Text with buttons; Enter takes the default, Esc the last.

    Attributes:
        title: In bold.
        text: A sentence or two.
        choices: At least one.
        details: Small print, such as a traceback, or "".
        bad: Whether it reports that something went wrong.
        default: Index of the choice that Enter takes: the last one where the first destroys what nothing brings back.
    """

    title: str
    text: str
    choices: tuple[Choice, ...] = (Choice("OK"),)
    details: str = ""
    bad: bool = False
    default: int = 0


@dataclass
class Dialogs:
    """The dialogs that are shown or wait."""

    fonts: Fonts
    marks: Marks
    waiting: list[Question] = field(default_factory=list)
    keys_shown: bool = False

    @property
    def open(self) -> bool:
        """Whether one is shown."""
        return bool(self.waiting) or self.keys_shown

    def ask(self, question: Question) -> None:
        """Show ``question`` when its turn comes; the same one is not asked twice."""
        if not any(other.title == question.title and other.text == question.text for other in self.waiting):
            self.waiting.append(question)

    def report(self, title: str, text: str, details: str = "") -> None:
        """Tell that something went wrong."""
        self.ask(Question(title, text, details=details, bad=True))

    def draw(self, actions: Actions, navigation: str) -> None:
        """Draw what is to be shown."""
        if self.waiting:
            self._draw_question(self.waiting[0])
        elif self.keys_shown:
            self._draw_keys(actions, navigation)

    def _begin(self, name: str, width: float) -> bool:
        if not imgui.is_popup_open(name):
            imgui.open_popup(name)
        view = imgui.get_main_viewport()
        imgui.set_next_window_pos(view.get_center(), imgui.Cond_.always, (0.5, 0.5))
        imgui.set_next_window_size_constraints((min(width, view.size.x - em(1)), 0.0), (view.size.x, view.size.y))
        imgui.push_style_var(imgui.StyleVar_.window_padding, (em(1.4), em(1.2)))
        flags = (
            imgui.WindowFlags_.no_title_bar
            | imgui.WindowFlags_.no_resize
            | imgui.WindowFlags_.no_move
            | imgui.WindowFlags_.always_auto_resize
            | imgui.WindowFlags_.no_saved_settings
        )
        shown = imgui.begin_popup_modal(name, None, flags)[0]
        imgui.pop_style_var()
        return shown

    def _title(self, text: str, bad: bool = False) -> None:
        if bad:
            imgui.text_colored(BAD, Icon.WARNING)
            imgui.same_line()
        imgui.push_font(self.fonts.bold, 0.0)
        imgui.text_unformatted(text)
        imgui.pop_font()
        imgui.dummy((0.0, em(0.2)))

    def _draw_question(self, question: Question) -> None:
        if not self._begin("##question", em(27)):
            return
        fresh = imgui.is_window_appearing()
        self._title(question.title, question.bad)
        imgui.push_text_wrap_pos(em(28))
        imgui.text_unformatted(question.text)
        imgui.pop_text_wrap_pos()
        if question.details:
            imgui.dummy((0.0, em(0.3)))
            imgui.input_text_multiline(
                "##details", question.details, (em(34), em(10)), imgui.InputTextFlags_.read_only.value
            )
        imgui.dummy((0.0, em(0.7)))
        taken = self._buttons(question, fresh)
        if taken is not None:
            self.waiting.remove(question)
            imgui.close_current_popup()
        imgui.end_popup()
        if taken is not None:
            taken.run()

    def _buttons(self, question: Question, fresh: bool) -> Choice | None:
        """Draw the buttons from the right and return the one that was taken."""
        taken: Choice | None = None
        style = imgui.get_style()
        widths = [
            max(imgui.calc_text_size(choice.label).x + 2.0 * style.frame_padding.x, em(5.5))
            for choice in question.choices
        ]
        room = imgui.get_content_region_avail().x
        left = room - sum(widths) - style.item_spacing.x * (len(widths) - 1)
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(left, 0.0))
        for i, choice in enumerate(question.choices):
            if i:
                imgui.same_line()
            if i == question.default:
                imgui.push_style_color(imgui.Col_.button, ACCENT_DARK)
            if imgui.button(choice.label, (widths[i], 0.0)):
                taken = choice
            if i == question.default:
                imgui.pop_style_color()
            self.marks.note(f"choice:{i}")
        if not fresh:
            if _pressed(imgui.Key.enter, imgui.Key.keypad_enter):
                taken = question.choices[question.default]
            if _pressed(imgui.Key.escape):
                taken = question.choices[-1]
        return taken

    def _draw_keys(self, actions: Actions, navigation: str) -> None:
        room = imgui.get_main_viewport().size.x - em(4)
        if not self._begin("##keys", em(40)):
            return
        fresh = imgui.is_window_appearing()
        self._title("Keys and mouse")
        if imgui.begin_table("##columns", 3, imgui.TableFlags_.sizing_stretch_same.value, (min(em(66), room), 0.0)):
            menus = actions.menus
            imgui.table_next_column()
            _section(self.fonts, "Mouse", (*_MOUSE, *_NAVIGATION[navigation]))
            for menu in (menus[0], menus[-1]):
                _section(self.fonts, menu, _rows(actions, menu))
            for column in (menus[1:3], menus[3:-1]):
                imgui.table_next_column()
                for menu in column:
                    _section(self.fonts, menu, _rows(actions, menu))
            imgui.end_table()
        caption("Esc or F1 closes this.")
        outside = imgui.is_mouse_clicked(imgui.MouseButton_.left.value) and not imgui.is_window_hovered()
        if not fresh and (_pressed(imgui.Key.escape, imgui.Key.f1) or outside):
            self.keys_shown = False
            imgui.close_current_popup()
        imgui.end_popup()


def _pressed(*keys: imgui.Key) -> bool:
    return any(imgui.is_key_pressed(key, False) for key in keys)


def _rows(actions: Actions, menu: str) -> tuple[tuple[str, str], ...]:
    return tuple((_keys(action.keys), action.help or action.label) for action in actions.in_menu(menu) if action.keys)


def _keys(keys: tuple[str, ...]) -> str:
    return ", ".join(keys)


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
        for keys, meaning in rows:
            imgui.table_next_column()
            imgui.text_disabled(keys)
            imgui.table_next_column()
            imgui.text_wrapped(meaning)
        imgui.end_table()
    imgui.dummy((0.0, em(0.4)))
