"""Dialog that asks for the name of a pose or a key pose."""

from collections.abc import Callable

from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.modal import modal, modal_body, modal_buttons, modal_entered, modal_escaped, modal_title
from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import WARNING
from faceposer.poses.library import PoseExistsError
from faceposer.poses.pose_file import LONGEST_NAME


class NameDialog:
    """Dialog that asks for a name, and for confirmation if a pose of this name exists."""

    def __init__(self, context: EditorContext) -> None:
        """Ask in the window of ``context``."""
        self._context = context
        self._done: Callable[[str, bool], None] | None = None
        self._title = self._verb = self._name = self._problem = ""
        self._exists = self._refused = False

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
        modal_title(context.fonts, self._title)
        buttons = (("accept", "Replace" if self._exists else self._verb), ("cancel", "Cancel"))
        with modal_body(buttons):
            if imgui.is_window_appearing() or self._refused:
                # A name that was refused is typed again.
                imgui.set_keyboard_focus_here()
                self._refused = False
            imgui.set_next_item_width(-1.0)
            before = self._name
            _, self._name = imgui.input_text_with_hint(
                "##name", "Name of the pose", self._name, imgui.InputTextFlags_.auto_select_all
            )
            context.widget_rects.record("pose-name:name")
            if self._name != before:
                self._problem, self._exists = "", False
            # The line is always reserved, so that the dialog does not change its size.
            imgui.push_text_wrap_pos(0.0)
            imgui.text_colored(WARNING, displayed(self._problem) or " ")
            imgui.pop_text_wrap_pos()
        named = bool(self._name.strip()) and len(self._name.strip()) <= LONGEST_NAME
        disabled = () if named else ("accept",)
        pressed = modal_buttons(context.widget_rects, "pose-name", buttons, disabled=disabled)
        if modal_escaped():
            pressed = "cancel"
        elif modal_entered() and named and not self._exists:
            pressed = "accept"
        if pressed == "cancel":
            self._done = None
        elif pressed == "accept":
            self._accept()

    def _accept(self) -> None:
        assert self._done is not None
        try:
            self._done(self._name.strip(), self._exists)
        except PoseExistsError:
            self._problem, self._exists = f"A pose named '{self._name.strip()}' exists already.", True
        except FacePoserError as error:
            self._problem, self._exists, self._refused = str(error), False, True
        else:
            self._done = None
