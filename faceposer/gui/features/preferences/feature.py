"""Preferences: navigation, size of the interface, background and light, where unsaved work is kept, and the keys."""

from collections.abc import Callable, Sequence
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.preferences.dialog import PreferencesDialog
from faceposer.gui.settings import Settings, save_settings
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.render.options import Look
from faceposer.session.autosave import autosave_dir
from faceposer.tools.tool import Navigation

# Keys that end a capture and are never given to an action.
_ENDS_CAPTURE = "Esc"


class PreferencesFeature(Feature):
    """The dialog's state; every choice holds at once and is remembered.

    Attributes:
        open: Whether the dialog is shown.
        capturing: Name of the action that waits for its new key, or "".
        problem: Why a key was not taken, one sentence, or "".
        ended_capture: Whether a key that is still down ended a capture: it means nothing else.
    """

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self.open = False
        self.capturing = ""
        self.problem = ""
        self.ended_capture = False
        self._dialog = PreferencesDialog(self)

    @property
    def is_modal(self) -> bool:
        """Whether the dialog keeps the pointer from the view."""
        return self.open

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the menu "Edit"."""
        return [
            Action(
                "preferences",
                "Preferences...",
                "Edit",
                self.show,
                ("Ctrl+,",),
                lambda: not self.context.busy,
                separated=True,
                help="Navigation, size of the interface, background, light, folders and keys",
            )
        ]

    def show(self) -> None:
        """Open the dialog."""
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        self.open, self.capturing, self.problem = True, "", ""
        self.context.redraw()

    def hide(self) -> None:
        """Close the dialog and write what was chosen."""
        self.open, self.capturing = False, ""
        if self.context.remembers:
            save_settings(self.context.settings)
        self.context.redraw()

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw the dialog, if it is open, with file dialogs above it."""
        if self.open:
            self._dialog.draw(draw_dialogs)
        return self.open

    # Choices

    @property
    def settings(self) -> Settings:
        """What is remembered."""
        return self.context.settings

    def navigate(self, preset: Navigation) -> None:
        """Let the mouse buttons move the view as in another program."""
        self.context.viewport.navigation = self.settings.navigation = preset

    def set_look(self, look: Look) -> None:
        """Show the face in this light, before this background."""
        settings = self.settings
        settings.backdrop, settings.key_light, settings.ambient_light = look.backdrop, look.key, look.ambient
        self.context.scene.look = look
        self.context.redraw()

    @property
    def autosave_folder(self) -> Path:
        """Where unsaved work will be kept from the next start on."""
        return Path(self.settings.autosave_folder) if self.settings.autosave_folder else autosave_dir()

    def ask_for_autosave_folder(self) -> None:
        """Ask for another folder."""
        folder = self.autosave_folder
        start = folder if folder.is_dir() else Path.home()

        def choose(path: Path) -> None:
            self.settings.autosave_folder = str(path.absolute())

        self.context.ask_for_file(FileRequest("folder", "A folder for unsaved work", "Folders", (), start, choose))

    # Keys

    def capture(self, name: str) -> None:
        """Let the next key be that of the action ``name``; without a name, end the capture."""
        self.capturing, self.problem = name, ""
        self.context.redraw()

    def take_key(self, key: str) -> bool:
        """Give ``key`` to the action that waits for one."""
        if not self.open or not self.capturing:
            return False
        name, self.capturing, self.ended_capture = self.capturing, "", True
        if key != _ENDS_CAPTURE:
            self.change_keys(name, (key,))
        self.context.redraw()
        return True

    def change_keys(self, name: str, keys: Sequence[str]) -> None:
        """Give the action ``name`` other keys, unless another action has one of them."""
        actions = self.context.actions
        try:
            actions.change_keys(name, keys)
        except FacePoserError as error:
            self.problem = str(error)
            return
        self.problem = ""
        if tuple(keys) == actions.usual_keys(name):
            self.settings.keys.pop(name, None)
        else:
            self.settings.keys[name] = list(keys)

    def reset_keys(self) -> None:
        """Give all actions the keys that they come with."""
        self.settings.keys.clear()
        self.context.actions.set_keys({})
        self.problem = ""
