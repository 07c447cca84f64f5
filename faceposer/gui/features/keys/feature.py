"""The strip of key poses in the window."""

from collections.abc import Callable, Sequence

from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.keys.actions import build_keys_actions
from faceposer.gui.features.keys.commands import KeyCommands
from faceposer.gui.features.keys.panel import KeysPanel
from faceposer.gui.widgets.dialogs import Choice, Question


class KeysFeature(KeyCommands, Feature):
    """The strip of key poses."""

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        Feature.__init__(self, context)
        self._panel = KeysPanel(self)

    # Called by the window

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        if self.shown and self.faces.waiting and not self.context.toolbox.active:
            return 0.0
        return 0.1 if self.work.busy or self.opened.reading or self.covering.busy else super().patience

    @property
    def edited_instead(self) -> str:
        """The key pose that is edited, which the strip says itself while it is shown."""
        edited = None if self.shown else self.editing.edited
        return "" if edited is None else f"Editing the {edited.side} of {edited.title}"

    @property
    def is_modal(self) -> bool:
        """True while a dialog is shown."""
        return self.creation.open or self.adding.open or self.naming.open or self.importance.open or self.work.busy

    @property
    def blocks_files(self) -> bool:
        """True if dropped files are ignored: while work is in progress."""
        return self.work.busy

    @property
    def quit_question(self) -> Question | None:
        """Question before the window closes while keys are written."""
        if not self.work.busy:
            return None
        return Question(
            "Cancel the work and quit?", "Key poses are being written.", (Choice("Quit"), Choice("Continue")), default=1
        )

    def leave(self, proceed: Callable[[], None]) -> bool:
        """Ask about the edited key and the session that was put aside for it."""
        return self.editing.leave(proceed)

    @property
    def strip_height(self) -> float:
        """Height of the strip, or 0 while it is hidden."""
        return self._panel.height if self.shown else 0.0

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the switch of the strip in the menu "Animate", and its commands."""
        return build_keys_actions(self)

    def session_changed(self) -> None:
        """Forget the coverage of another session."""
        self.covering.forget()

    def take_key(self, key: str) -> bool:
        """Save the edited key instead of the session."""
        context = self.context
        blocked = context.dialogs.open or context.file_dialogs.open or context.is_modal or context.busy
        if key not in context.actions["save"].keys or self.editing.edited is None or blocked:
            return False
        self.editing.save()
        return True

    def update(self) -> None:
        """Take results of background work, and draw the next thumbnail unless the user is dragging.

        Raises:
            Exception: The error of the work, unless the user can resolve it; then a dialog shows it.
        """
        self.opened.update()
        self.work.update()
        self.covering.update()
        if not self.shown:
            self.faces.release()
            return
        self.opened.read_changes()
        if not self.context.toolbox.active:
            self.faces.draw_next()

    def draw_strip(self) -> None:
        """Draw the strip."""
        self._panel.draw()

    def draw_dialog(self) -> None:
        """Draw the dialog that is open."""
        if self.work.busy:
            self.work.draw()
            return
        self.creation.draw()
        self.adding.draw()
        self.naming.draw()
        self.importance.draw()

    def close(self) -> None:
        """Cancel the work and release pictures."""
        self.work.cancel()
        self.opened.close()
        self.covering.forget()
        self.faces.release()
        self.importance.release()

    def join(self) -> None:
        """Wait until the cancelled work has ended."""
        self.work.join()
        self.opened.join()
        self.covering.join()
