"""Preferences: navigation, size of the interface, background, light, autosave folder and keymap."""

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

# Key that ends a capture and cannot be assigned to an action.
_ENDS_CAPTURE = "Esc"


class PreferencesFeature(Feature):
    """State of the preferences dialog; every choice takes effect at once and is remembered.

    Attributes:
        open: True while the dialog is shown.
        capturing: Name of the action that waits for its new key, or "".
        problem: Reason why a key was not assigned, one sentence, or "".
        ended_capture: True while the key that ended a capture is still down, so that it has no other effect.
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
        """True while the dialog is shown."""
        return self.open

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the Edit menu."""
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
        """Close the dialog and save the settings."""
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
        """The settings that are saved."""
        return self.context.settings

    def navigate(self, preset: Navigation) -> None:
        """Use the mouse buttons of ``preset`` to navigate."""
        self.context.viewport.navigation = self.settings.navigation = preset

    def set_look(self, look: Look) -> None:
        """Set the light and the background."""
        settings = self.settings
        settings.backdrop, settings.key_light, settings.ambient_light = look.backdrop, look.key, look.ambient
        self.context.scene.look = look
        self.context.redraw()

    @property
    def autosave_folder(self) -> Path:
        """Folder for unsaved work from the next start on."""
        return Path(self.settings.autosave_folder) if self.settings.autosave_folder else autosave_dir()

    def ask_for_autosave_folder(self) -> None:
        """Ask for the folder for unsaved work."""
        folder = self.autosave_folder
        start = folder if folder.is_dir() else Path.home()

        def choose(path: Path) -> None:
            self.settings.autosave_folder = str(path.absolute())

        self.context.ask_for_file(FileRequest("folder", "Choose autosave folder", "Folders", (), start, choose))

    # Keys

    def capture(self, name: str) -> None:
        """Assign the next key that is pressed to the action ``name``; if ``name`` is "", end the capture."""
        self.capturing, self.problem = name, ""
        self.context.redraw()

    def take_key(self, key: str) -> bool:
        """Assign ``key`` to the action that waits for one; return True if there is one."""
        if not self.open or not self.capturing:
            return False
        name, self.capturing, self.ended_capture = self.capturing, "", True
        if key != _ENDS_CAPTURE:
            self.change_keys(name, (key,))
        self.context.redraw()
        return True

    def change_keys(self, name: str, keys: Sequence[str]) -> None:
        """Assign ``keys`` to the action ``name``, unless another action has one of them."""
        actions = self.context.actions
        try:
            actions.change_keys(name, keys)
        except FacePoserError as error:
            self.problem = str(error)
            return
        self.problem = ""
        if tuple(keys) == actions.default_keys(name):
            self.settings.keys.pop(name, None)
        else:
            self.settings.keys[name] = list(keys)

    def reset_keys(self) -> None:
        """Reset the keys of all actions to their defaults."""
        self.settings.keys.clear()
        self.context.actions.set_keys({})
        self.problem = ""
