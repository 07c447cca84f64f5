"""Import of custom characters: the form, training in the background, and the summary."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.gui.context import EditorContext
from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob

Page = Literal["form", "running", "summary"]

#: Suffixes of performances that are dropped on the form; dropped glTF files are rigs.
TAKES = (".csv", ".txt", ".json")


class ImportState:
    """State of the dialog that imports a character.

    Attributes:
        context: The editor.
        open: True while the dialog is shown.
        form: Entries of the user, kept until an import succeeds.
        error: Reason why the last import failed, one sentence, or "".
        training: The training in progress, or None. Its result is the description of the character
            (``description_of``).
        output: Character file that the training writes.
        about: Description of the character that was imported last, with its file as "path", or None.
    """

    def __init__(self, context: EditorContext) -> None:
        self.context = context
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
        if self._takes_performances and suffix in TAKES:
            return True
        return paths.is_dir(path) or suffix in (*GLTF_SUFFIXES, *MARKER_SUFFIXES) or (on_form and suffix == ".npz")

    @property
    def _takes_performances(self) -> bool:
        """True if the form is shown for a rig, whose prior is learned from performances."""
        return self.open and self.page == "form" and bool(self.form.source) and self.form.kind == "rig"

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

    def open_learned(self) -> None:
        """Open the new character, after asking about unsaved changes."""
        if self.about is not None:
            path = self.about["path"]
            self.close_dialog()
            self.context.open_file(path)


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
