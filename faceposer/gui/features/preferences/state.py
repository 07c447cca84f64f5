"""Preferences: navigation, size of the interface, background, light, autosave folder and keymap."""

from collections.abc import Sequence
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.user_folders import home_folder
from faceposer.gui.actions import parsed_key
from faceposer.gui.context import EditorContext
from faceposer.gui.settings import Settings
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.render.options import Look
from faceposer.session.autosave import autosave_dir
from faceposer.tools.tool import Navigation


class PreferencesState:
    """State of the preferences dialog; every choice takes effect at once and is remembered.

    Attributes:
        context: The editor.
        open: True while the dialog is shown.
        capturing: Name of the action that waits for its new key, or "".
        problem: Reason why a key was not assigned, one sentence, or "".
        refused: Action and key that were not assigned because another action has the key, or None.
        ended_capture: True while the key that ended a capture is still down, so that it has no other effect.
    """

    def __init__(self, context: EditorContext) -> None:
        self.context = context
        self.open = False
        self.capturing = ""
        self.problem = ""
        self.refused: tuple[str, str] | None = None
        self.ended_capture = False

    def show(self) -> None:
        """Open the dialog."""
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        self.open, self.capturing, self.problem, self.refused = True, "", "", None
        self.context.redraw()

    def hide(self) -> None:
        """Close the dialog and save the settings."""
        self.open, self.capturing = False, ""
        self.context.save_settings()
        self.context.redraw()

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
        start = folder if paths.can_enter(folder) else home_folder()

        def choose(path: Path) -> None:
            self.settings.autosave_folder = str(paths.absolute(path))

        self.context.ask_for_file(FileRequest("folder", "Choose autosave folder", "Folders", (), start, choose))

    # Keys

    def capture(self, name: str) -> None:
        """Assign the next key that is pressed to the action ``name``; if ``name`` is "", end the capture."""
        self.capturing, self.problem, self.refused = name, "", None
        self.context.redraw()

    def change_keys(self, name: str, keys: Sequence[str]) -> None:
        """Assign ``keys`` to the action ``name``, unless another action has one of them."""
        actions = self.context.actions
        self.refused = None
        try:
            actions.change_keys(name, keys)
        except FacePoserError as error:
            self.problem = str(error)
            taken = [key for key in keys if (other := actions.owner(key)) is not None and other.name != name]
            if len(keys) == 1 and taken:
                self.refused = (name, taken[0])
            return
        self.problem = ""
        if tuple(keys) == actions.default_keys(name):
            self.settings.keys.pop(name, None)
        else:
            self.settings.keys[name] = list(keys)

    def reassign(self) -> None:
        """Take the key that was refused from the action that has it."""
        if self.refused is None:
            return
        name, key = self.refused
        other = self.context.actions.owner(key)
        if other is not None:
            self.change_keys(other.name, tuple(kept for kept in other.keys if parsed_key(kept) != parsed_key(key)))
        self.change_keys(name, (key,))

    def reset_keys(self) -> None:
        """Reset the keys of all actions to their defaults."""
        self.settings.keys.clear()
        self.context.actions.set_keys({})
        self.problem = ""
