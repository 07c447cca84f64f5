"""Import of characters in the window: the entry of the menu, the dialog, and dropped files."""

from collections.abc import Callable, Sequence
from pathlib import Path

from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.import_character.dialog import ImportDialog
from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.features.import_character.state import TAKES, ImportState
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.session.jobs import outcome


class ImportCharacterFeature(ImportState, Feature):
    """The dialog that imports characters."""

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        Feature.__init__(self, context)
        self._dialog = ImportDialog(self)

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return 0.1 if self.running else super().patience

    @property
    def is_modal(self) -> bool:
        """True while the dialog is shown."""
        return self.open

    @property
    def blocks_files(self) -> bool:
        """True if dropped files are ignored: while a training is in progress."""
        return self.running

    @property
    def quit_question(self) -> Question | None:
        """Question before the window closes while a training is in progress."""
        if not self.running:
            return None
        text = "A character is being imported. Quitting now cancels the import."
        choices = (Choice("Quit"), Choice("Continue the import"))
        return Question("Cancel the import and quit?", text, choices, default=1)

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the File menu."""
        help_ = "Create a custom character from a rig, from example meshes or from the motion of markers"
        return (
            Action("import", "Import character...", "File", self.show, (), lambda: not self.context.busy, help=help_),
        )

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw the dialog, if it is open, with questions and file dialogs above it."""
        if self.open:
            self._dialog.draw(draw_dialogs)
        return self.open

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Use dropped files as the source, or as performances if the source is a rig already."""
        if not self.accepts(dropped[0]):
            if self.open:
                self.close_dialog()
            return False
        takes = [path for path in dropped if Path(path).suffix.lower() in TAKES]
        if self._takes_performances and takes:
            self.form.captures += [path for path in takes if path not in self.form.captures]
        else:
            self.show(dropped[0])
        self.context.redraw()
        return True

    def update(self) -> None:
        """Show the progress of the training, and its result when it ends.

        Raises:
            Exception: The error of the training, unless the user can resolve it; then the form shows it.
        """
        training = self.training
        if training is None:
            return
        # One frame only, unlike after an event: the progress bar advances many times per second.
        self.context.redraw(1)
        if not training.done:
            return
        self.training = None
        self.context.redraw()
        learned, self.error = outcome(training, "use fewer or smaller meshes.")
        if learned is not None:
            self.about = learned | {"path": str(self.output)}
            self.form = ImportForm()

    def close(self) -> None:
        """Cancel the training."""
        if self.training is not None:
            self.training.cancel()

    def join(self) -> None:
        """Wait until the cancelled training has removed its temporary files."""
        if self.training is not None:
            self.training.join()
