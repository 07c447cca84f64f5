"""Dialog that asks for the name of a pose."""

from collections.abc import Callable

from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import toggle_button
from faceposer.gui.widgets.modal import modal, modal_title
from faceposer.gui.widgets.theme import ACCENT_DARK, WARNING, em
from faceposer.poses.library import PoseExistsError
from faceposer.poses.pose_file import LONGEST_NAME


class NameDialog:
    """Dialog that asks for the name of a pose, and for confirmation if the name is in use."""

    def __init__(self, context: EditorContext) -> None:
        """Ask in the window of ``context``."""
        self._context = context
        self._done: Callable[[str, bool], None] | None = None
        self._title = self._verb = self._name = self._problem = ""
        self._exists = False

    @property
    def open(self) -> bool:
        """True while the dialog is shown."""
        return self._done is not None

    def ask(self, title: str, verb: str, name: str, done: Callable[[str, bool], None]) -> None:
        """Ask for a name.

        Args:
            title: Title of the dialog.
            verb: Label of the button that accepts.
            name: Proposed name.
            done: Called with the name, and with True if it may replace an existing pose. It raises PoseExistsError
                if it would replace one without permission, and FacePoserError if the name is not possible; the dialog
                then stays open.
        """
        self._title, self._verb, self._name, self._done = title, verb, name, done
        self._problem, self._exists = "", False

    def draw(self) -> None:
        """Draw the dialog if it is open."""
        if self._done is None:
            return
        with modal("##pose-name", 24.8) as shown:
            if shown:
                self._draw_content()
                if not self.open:
                    imgui.close_current_popup()

    def _draw_content(self) -> None:
        context = self._context
        fresh = imgui.is_window_appearing()
        modal_title(context.fonts, self._title)
        if fresh:
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(em(22))
        before = self._name
        _, self._name = imgui.input_text_with_hint(
            "##name", "Name of the pose", self._name, imgui.InputTextFlags_.auto_select_all
        )
        context.widget_rects.record("pose-name:name")
        if self._name != before:
            self._problem, self._exists = "", False
        if self._problem:
            imgui.push_text_wrap_pos(em(23.4))
            imgui.text_colored(WARNING, self._problem)
            imgui.pop_text_wrap_pos()
        imgui.dummy((0.0, em(0.4)))
        width = em(6.5)
        left = imgui.get_content_region_avail().x - 2.0 * width - imgui.get_style().item_spacing.x
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(left, 0.0))
        imgui.begin_disabled(not self._name.strip() or len(self._name.strip()) > LONGEST_NAME)
        accepted = toggle_button("Replace" if self._exists else self._verb, True, ACCENT_DARK, width)
        imgui.end_disabled()
        context.widget_rects.record("pose-name:accept")
        imgui.same_line()
        cancelled = imgui.button("Cancel", (width, 0.0))
        context.widget_rects.record("pose-name:cancel")
        if not fresh:
            entered = any(imgui.is_key_pressed(key, False) for key in (imgui.Key.enter, imgui.Key.keypad_enter))
            accepted |= entered and bool(self._name.strip()) and not self._exists
            cancelled |= imgui.is_key_pressed(imgui.Key.escape, False)
        if cancelled:
            self._done = None
        elif accepted:
            self._accept()

    def _accept(self) -> None:
        assert self._done is not None
        try:
            self._done(self._name.strip(), self._exists)
        except PoseExistsError:
            self._problem, self._exists = f"A pose named '{self._name.strip()}' exists already.", True
        except FacePoserError as error:
            self._problem, self._exists = str(error), False
        else:
            self._done = None
