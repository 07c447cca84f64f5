"""Custom characters in the window: the form, learning in the background, and the summary of what was learned."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from faceposer.errors import FacePoserError
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.import_character.dialog import ImportDialog
from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob

Page = Literal["form", "running", "summary"]


class ImportCharacterFeature(Feature):
    """The dialog that imports a character: which page is shown, and what is on it.

    Attributes:
        open: Whether the dialog is shown.
        form: What the user has entered; kept until a character came of it.
        error: What was wrong with it, one sentence, or "".
        training: The learning under way, which returns what was learned (``description_of``).
        output: The file that it writes.
        about: What was learned last.
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
        """What the dialog shows."""
        if self.training is not None:
            return "running"
        return "form" if self.about is None else "summary"

    @property
    def running(self) -> bool:
        """Whether something is being learned."""
        return self.training is not None

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return 0.1 if self.running else super().patience

    @property
    def is_modal(self) -> bool:
        """Whether the dialog is shown."""
        return self.open

    @property
    def blocks_files(self) -> bool:
        """Whether dropped files are ignored, as while something is learned."""
        return self.running

    @property
    def quit_question(self) -> Question | None:
        """What to ask before the window closes while something is learned."""
        if not self.running:
            return None
        text = "A character is being learned. What has been learned of it so far would be lost."
        return Question(
            "Stop learning and quit?", text, (Choice("Stop and quit"), Choice("Continue learning")), default=1
        )

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the File menu."""
        help_ = "Make a character of your own from a rig, from example meshes or from the motion of markers"
        return (
            Action("import", "Import character...", "File", self.show, (), lambda: not self.context.busy, help=help_),
        )

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw the dialog, if it is open, with questions and file dialogs above it."""
        if self.open:
            self._dialog.draw(draw_dialogs)
        return self.open

    # The form

    def show(self, source: str = "") -> None:
        """Open the dialog, with ``source`` filled in if given."""
        if self.running:
            return
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        self.open, self.about, self.error = True, None, ""
        if source:
            self.set_source(source)
        self.context.redraw()

    def close_dialog(self) -> None:
        """Put the dialog away; what was entered is there the next time."""
        self.open, self.about, self.error = False, None, ""
        self.context.redraw()

    def set_source(self, source: str) -> None:
        """Learn from ``source``, whose kind is guessed."""
        if source == self.form.source:
            return
        self.form.source, self.error = source, ""
        self.form.follow_source(self.context.characters)

    def takes(self, path: str) -> bool:
        """Whether a file or folder that was dropped is something for this dialog."""
        from faceposer.geometry.gltf_io import GLTF_SUFFIXES
        from faceposer.training.kinds import MARKER_SUFFIXES

        on_form = self.open and self.page == "form"
        suffix = Path(path).suffix.lower()
        return Path(path).is_dir() or suffix in (*GLTF_SUFFIXES, *MARKER_SUFFIXES) or (on_form and suffix == ".npz")

    def accept_files(self, paths: tuple[str, ...]) -> bool:
        """Take what was dropped: a source, or performances for the rig that is the source already."""
        if not self.takes(paths[0]):
            was_open = self.open
            if was_open:
                self.close_dialog()
                self.context.open_file(paths[0])
            return was_open
        csv = [path for path in paths if path.lower().endswith(".csv")]
        if self.open and self.page == "form" and self.form.source and self.form.kind == "rig" and csv:
            self.form.captures += [path for path in csv if path not in self.form.captures]
        else:
            self.show(paths[0])
        self.context.redraw()
        return True

    # Learning

    def start(self) -> None:
        """Learn what the form asks for, after asking whether a file that is there may be replaced."""
        self.error = ""
        try:
            if self.context.characters.holds(self.form.output.strip()):
                self.context.characters.make_folder()
            output = self.form.checked_output()
        except FacePoserError as error:
            self.error = str(error)
            return
        if not output.exists():
            self._train(output)
            return
        self.context.dialogs.ask(
            Question(
                f"Replace {output.name}?",
                f"There is a file of this name in '{output.parent}'.",
                (Choice("Replace", lambda: self._train(output)), Choice("Cancel")),
                default=1,
            )
        )

    def _train(self, output: Path) -> None:
        self.form.output = str(output)
        self.output = output
        form = replace(self.form, captures=list(self.form.captures))
        self.training = ThreadJob(partial(_learn, form, output), self.context.wake, "Getting ready")
        self.context.redraw()

    def stop(self) -> None:
        """Stop learning; nothing is written."""
        if self.training is not None:
            self.training.cancel()

    def update(self) -> None:
        """Show what there is to be known of the learning under way.

        Raises:
            Exception: What went wrong in it, unless the user can mend it or wanted it.
        """
        training = self.training
        if training is None:
            return
        # One frame, not several as after an event: the bar moves many times a second.
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
            self.error = "There is not enough memory for this; learn from fewer or from smaller meshes."
        elif training.error is not None:
            raise training.error

    def open_learned(self) -> None:
        """Pose the new character, after asking about changes that are not saved."""
        if self.about is not None:
            path = self.about["path"]
            self.close_dialog()
            self.context.open_file(path)

    def close(self) -> None:
        """Cancel what is under way."""
        if self.training is not None:
            self.training.cancel()

    def join(self) -> None:
        """Wait for the end of what was cancelled, so that it can clear away what it has begun."""
        if self.training is not None:
            self.training.join()


def _learn(form: ImportForm, output: Path, progress: Progress) -> dict[str, Any]:
    # Here and not above: the libraries behind take more than a second to load.
    from faceposer.model.character_file import save_character
    from faceposer.training.request import train
    from faceposer.training.summary import description_of

    progress.at("Getting ready")
    character = train(form.request(output), progress)
    progress.at("Saving")
    save_character(output, character)
    return description_of(character)
