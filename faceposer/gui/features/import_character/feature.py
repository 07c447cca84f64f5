"""Import of custom characters: the form, training in the background, and the summary."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.import_character.dialog import ImportDialog
from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob

Page = Literal["form", "running", "summary"]

# Performances that are dropped on the form; dropped glTF files are rigs.
_TAKES = (".csv", ".txt", ".json")


class ImportCharacterFeature(Feature):
    """State of the dialog that imports a character.

    Attributes:
        open: True while the dialog is shown.
        form: Entries of the user, kept until an import succeeds.
        error: Reason why the last import failed, one sentence, or "".
        training: The training in progress, or None. Its result is the description of the character
            (``description_of``).
        output: Character file that the training writes.
        about: Description of the character that was imported last, with its file as "path", or None.
    """

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self._dialog = ImportDialog(self)
        self.open = False
        self.form = ImportForm()
        self.error = ""
        self.training: ThreadJob[dict[str, Any]] | None = None
        self.output = Path()
        self.about: dict[str, Any] | None = None

    @property
    def page(self) -> Page:
        """Current page of the dialog."""
        if self.training is not None:
            return "running"
        return "form" if self.about is None else "summary"

    @property
    def running(self) -> bool:
        """True while a training is in progress."""
        return self.training is not None

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

    # Form

    def show(self, source: str = "") -> None:
        """Open the dialog, with ``source`` entered if given."""
        if self.running:
            return
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        self.open, self.about, self.error = True, None, ""
        if source:
            self.set_source(source)
        self.context.redraw()

    def close_dialog(self) -> None:
        """Close the dialog; the entries are kept until it is opened again."""
        self.open, self.about, self.error = False, None, ""
        self.context.redraw()

    def set_source(self, source: str) -> None:
        """Enter ``source`` into the form and detect its kind."""
        if source == self.form.source:
            return
        self.form.source, self.error = source, ""
        self.form.follow_source(self.context.characters)

    def accepts(self, path: str) -> bool:
        """Return True if the dropped file or folder ``path`` can be the source of a character."""
        from faceposer.geometry.gltf_io import GLTF_SUFFIXES
        from faceposer.training.kinds import MARKER_SUFFIXES

        on_form = self.open and self.page == "form"
        suffix = Path(path).suffix.lower()
        if self._takes_performances and suffix in _TAKES:
            return True
        return paths.is_dir(path) or suffix in (*GLTF_SUFFIXES, *MARKER_SUFFIXES) or (on_form and suffix == ".npz")

    @property
    def _takes_performances(self) -> bool:
        """True if the form is shown for a rig, whose prior is learned from performances."""
        return self.open and self.page == "form" and bool(self.form.source) and self.form.kind == "rig"

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Use dropped files as the source, or as performances if the source is a rig already."""
        if not self.accepts(dropped[0]):
            if self.open:
                self.close_dialog()
            return False
        takes = [path for path in dropped if Path(path).suffix.lower() in _TAKES]
        if self._takes_performances and takes:
            self.form.captures += [path for path in takes if path not in self.form.captures]
        else:
            self.show(dropped[0])
        self.context.redraw()
        return True

    # Training

    def start(self) -> None:
        """Start the import, after asking whether an existing file may be replaced."""
        self.error = ""
        try:
            if self.context.characters.holds(self.form.output.strip()):
                self.context.characters.make_folder()
            output = self.form.checked_output()
        except FacePoserError as error:
            self.error = str(error)
            return
        if not paths.exists(output):
            self._train(output)
            return
        self.context.dialogs.ask(
            Question(
                f"Replace {output.name}?",
                f"A file of this name exists in '{output.parent}'.",
                (Choice("Replace", lambda: self._train(output)), Choice("Cancel")),
                default=1,
            )
        )

    def _train(self, output: Path) -> None:
        self.form.output = str(output)
        self.output = output
        form = replace(self.form, captures=list(self.form.captures))
        self.training = ThreadJob(partial(_learn, form, output), self.context.wake, "Preparing")
        self.context.redraw()

    def stop(self) -> None:
        """Cancel the training; nothing is written."""
        if self.training is not None:
            self.training.cancel()

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
        if training.result is not None:
            self.about = training.result | {"path": str(self.output)}
            self.form = ImportForm()
        elif isinstance(training.error, FacePoserError):
            self.error = str(training.error)
        elif isinstance(training.error, MemoryError):
            self.error = "There is not enough memory; use fewer or smaller meshes."
        elif training.error is not None:
            raise training.error

    def open_learned(self) -> None:
        """Open the new character, after asking about unsaved changes."""
        if self.about is not None:
            path = self.about["path"]
            self.close_dialog()
            self.context.open_file(path)

    def close(self) -> None:
        """Cancel the training."""
        if self.training is not None:
            self.training.cancel()

    def join(self) -> None:
        """Wait until the cancelled training has removed its temporary files."""
        if self.training is not None:
            self.training.join()


def _learn(form: ImportForm, output: Path, progress: Progress) -> dict[str, Any]:
    # Imported here, because the libraries take more than a second to load.
    from faceposer.model.character_file import save_character
    from faceposer.training.request import train
    from faceposer.training.summary import description_of

    progress.at("Preparing")
    character = train(form.request(output), progress)
    progress.at("Saving")
    save_character(output, character)
    return description_of(character)
