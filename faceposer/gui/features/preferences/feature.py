"""The preferences in the window: their dialog, and keys that it captures."""

from collections.abc import Callable, Sequence

from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.preferences.dialog import PreferencesDialog
from faceposer.gui.features.preferences.state import PreferencesState

# Key that ends a capture and cannot be assigned to an action.
_ENDS_CAPTURE = "Esc"


class PreferencesFeature(PreferencesState, Feature):
    """The dialog of preferences."""

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        Feature.__init__(self, context)
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

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw the dialog, if it is open, with file dialogs above it."""
        if self.open:
            self._dialog.draw(draw_dialogs)
        return self.open

    def take_key(self, key: str) -> bool:
        """Assign ``key`` to the action that waits for one; return True if there is one."""
        if not self.open or not self.capturing:
            return False
        name, self.capturing, self.ended_capture = self.capturing, "", True
        if key != _ENDS_CAPTURE:
            self.change_keys(name, (key,))
        self.context.redraw()
        return True
