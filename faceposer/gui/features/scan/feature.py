"""Heads from scans: the files, the landmarks, the fit in the background, and its result."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import MESH_SUFFIXES
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.scan.dialog import ScanDialog
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.session.jobs import ThreadJob

if TYPE_CHECKING:
    from faceposer.gui.features.scan.work import FittedHead, MarkedScan

Page = Literal["form", "finding", "landmarks", "fitting", "result"]
#: Meshes and rigs that can be scans.
SUFFIXES = MESH_SUFFIXES
_MOST_SCANS = 12


class ScanFeature(Feature):
    """State of the dialog that makes a character of scans of a head.

    Attributes:
        open: True while the dialog is shown.
        files: The scans of one person.
        detail: True to follow the scans beyond the model.
        texture: True to take the colours of the scans.
        title: Title of the new character.
        error: Reason why the last step failed, one sentence, or "".
        marked: The scans with their landmarks, or empty before they are found.
        shown: Index of the scan whose landmarks are shown.
        result: The head that was made, or None.
    """

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self._dialog = ScanDialog(self)
        self.open = False
        self.files: list[str] = []
        self.detail = self.texture = True
        self.title = ""
        self.error = ""
        self.marked: list[MarkedScan] = []
        self.shown = 0
        self.result: FittedHead | None = None
        self.finding: ThreadJob[list[MarkedScan]] | None = None
        self.fitting: ThreadJob[FittedHead] | None = None

    @property
    def page(self) -> Page:
        """Current page of the dialog."""
        if self.finding is not None:
            return "finding"
        if self.fitting is not None:
            return "fitting"
        if self.result is not None:
            return "result"
        return "landmarks" if self.marked else "form"

    @property
    def job(self) -> "ThreadJob[list[MarkedScan]] | ThreadJob[FittedHead] | None":
        """The work in progress, or None."""
        return self.finding or self.fitting

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return 0.1 if self.job is not None else super().patience

    @property
    def is_modal(self) -> bool:
        """True while the dialog is shown."""
        return self.open

    @property
    def blocks_files(self) -> bool:
        """True if dropped files are ignored: while work is in progress."""
        return self.job is not None

    @property
    def quit_question(self) -> Question | None:
        """Question before the window closes while a head is being made."""
        if self.job is None:
            return None
        choices = (Choice("Quit"), Choice("Continue"))
        return Question("Cancel the scan and quit?", "A head is being made from a scan.", choices, default=1)

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the File menu."""
        help_ = "Make a character of 3D scans of a person's head"
        return (Action("scan", "Head from scan...", "File", self.show, (), lambda: not self.context.busy, help=help_),)

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw the dialog, if it is open, with file dialogs above it."""
        if self.open:
            self._dialog.draw(draw_dialogs)
        return self.open

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Add dropped scans while the form is shown."""
        if not self.open or self.page != "form":
            return False
        for path in dropped:
            self.add(Path(path))
        return True

    # The form

    def show(self) -> None:
        """Open the dialog."""
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        self.open, self.error = True, ""
        self.context.redraw()

    def close_dialog(self) -> None:
        """Close the dialog and forget its scans."""
        self.open, self.error, self.result = False, "", None
        self.files, self.marked, self.title = [], [], ""
        self._dialog.forget()
        self.context.redraw()

    def ask_for_scan(self) -> None:
        """Ask for the file of a scan."""
        folder = last_folder(self.context.settings)
        self.context.ask_for_file(FileRequest("open", "Add scan", "Scans", SUFFIXES, folder, self.add))

    def add(self, path: Path) -> None:
        """Add the scan ``path`` to the list."""
        self.error = ""
        if path.suffix.lower() not in SUFFIXES:
            self.error = f"'{path.name}' is no mesh; scans are {', '.join(SUFFIXES)} files."
        elif len(self.files) >= _MOST_SCANS:
            self.error = f"At most {_MOST_SCANS} scans can be used at once."
        elif str(path) not in self.files:
            self.files.append(str(path))
            self.title = self.title or path.stem.replace("_", " ").replace("-", " ").strip().title()
        self.context.redraw()

    # Landmarks

    def find(self) -> None:
        """Read the scans and find their landmarks, in the background."""
        from faceposer.gui.features.scan.work import find_landmarks

        self.error, self.shown = "", 0
        files = list(self.files)
        self.finding = ThreadJob(lambda progress: find_landmarks(files, progress), self.context.wake, "Reading")
        self.context.redraw()

    def back(self) -> None:
        """Return to the form."""
        self.marked, self.error = [], ""
        self._dialog.forget()

    # The fit

    def fit(self) -> None:
        """Fit the head, in the background."""
        from faceposer.gui.features.scan.work import fit_head

        self.error = ""
        work = partial(fit_head, list(self.marked), self.detail, self.texture, self.title.strip())
        self.fitting = ThreadJob(work, self.context.wake, "Preparing")
        self.context.redraw()

    def stop(self) -> None:
        """Cancel the work; nothing is written."""
        if self.job is not None:
            self.job.cancel()

    def update(self) -> None:
        """Show the progress of the work, and its result when it ends.

        Raises:
            Exception: The error of the work, unless the user can resolve it; then the dialog shows it.
        """
        job = self.job
        if job is None:
            return
        self.context.redraw(1)
        if not job.done:
            return
        finding, fitting, self.finding, self.fitting = self.finding, self.fitting, None, None
        self.context.redraw()
        if isinstance(job.error, FacePoserError):
            self.error = str(job.error)
        elif isinstance(job.error, MemoryError):
            self.error = "There is not enough memory; reduce the scan."
        elif job.error is not None:
            raise job.error
        elif finding is not None and finding.result is not None:
            self.marked = finding.result
        elif fitting is not None and fitting.result is not None:
            self.result = fitting.result

    def save(self) -> None:
        """Save the character to the library, open it and close the dialog."""
        from faceposer.model.character_file import save_character

        assert self.result is not None
        library = self.context.characters
        try:
            library.make_folder()
            path = library.new_path(self.result.character.name)
            save_character(path, self.result.character)
        except FacePoserError as error:
            self.error = str(error)
            return
        self.close_dialog()
        self.context.open_file(str(path))

    def close(self) -> None:
        """Cancel the work and release pictures."""
        self.stop()
        self._dialog.release()

    def join(self) -> None:
        """Wait until the cancelled work has ended."""
        if self.job is not None:
            self.job.join()
