"""Heads from scans or photos: the files, the landmarks, the fit in the background, and its result."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import ClassVar, Generic, Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files import paths as files
from faceposer.gui.context import EditorContext
from faceposer.gui.features.head_making.contents import H, M, Words
from faceposer.gui.features.head_making.landmark_edit import LandmarkEdit
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob
from faceposer.session.opening import open_session

Page = Literal["form", "finding", "landmarks", "fitting", "result"]
# Most files, and most names of files in a message.
_MOST_FILES, _MOST_NAMED = 12, 3


class HeadMaking(Generic[M, H]):
    """State of a dialog that makes a character of a person; subclasses say of what, and how.

    Attributes:
        context: The editor.
        words: Texts of the dialog.
        suffixes: Suffixes of the files.
        open: True while the dialog is shown.
        files: The files, all of one person.
        options: Options of the fit by name.
        title: Title of the new character.
        error: Reason why the last step failed, one sentence, or "".
        landmarks: The files with their landmarks, empty before they are found, and moves of landmarks.
        preview: Picture of the fit so far, shape (h, w, 3), or None.
        result: The head that was made, or None.
    """

    words: ClassVar[Words]
    suffixes: ClassVar[tuple[str, ...]]

    def __init__(self, context: EditorContext) -> None:
        self.context = context
        self._on_forget: Callable[[], None] = lambda: None
        self.open = False
        self.files: list[str] = []
        self.options = {name: True for name, _, _ in self.words.options}
        self.title = ""
        self.error = ""
        self.landmarks: LandmarkEdit[M] = LandmarkEdit()
        self.preview: NDArray[np.uint8] | None = None
        self.result: H | None = None
        self._known: dict[str, tuple[tuple[int, int], M]] = {}
        self._sought: tuple[str, ...] = ()
        self._n_fits = 0
        self._cancelled: list[ThreadJob[list[M]] | ThreadJob[H]] = []
        self.finding: ThreadJob[list[M]] | None = None
        self.fitting: ThreadJob[H] | None = None

    # What subclasses do

    def work_of_finding(self, files: Sequence[str]) -> Callable[[Progress], list[M]]:
        """Return the function that reads ``files`` and finds their landmarks, in the background."""
        raise NotImplementedError

    def work_of_fitting(
        self, marked: Sequence[M], show: Callable[[NDArray[np.uint8]], None]
    ) -> Callable[[Progress], H]:
        """Return the function that makes the character, in the background, and calls ``show`` with pictures of it."""
        raise NotImplementedError

    def opened(self, result: H, path: Path) -> None:
        """Show the character in the file ``path``; the user has been asked about unsaved changes."""
        self.context.show_session(lambda worker: open_session(str(path), worker), "The head cannot be shown")

    def draw_options(self) -> None:
        """Draw further options of the fit, on the page of landmarks."""

    @property
    def page(self) -> Page:
        """Current page of the dialog."""
        if self.finding is not None:
            return "finding"
        if self.fitting is not None:
            return "fitting"
        if self.result is not None:
            return "result"
        return "landmarks" if self.landmarks.marked else "form"

    @property
    def job(self) -> ThreadJob[list[M]] | ThreadJob[H] | None:
        """The work in progress, or None."""
        return self.finding or self.fitting

    # The form

    def show(self) -> None:
        """Open the dialog."""
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        self.open, self.error = True, ""
        self.context.redraw()

    def ask_to_close(self) -> None:
        """Close the dialog, after a question if landmarks were moved or a head was made."""
        lost = "The head is not saved." if self.result is not None else ""
        if not lost and any(one.moved for one in self.landmarks.marked):
            lost = "Landmarks were moved."
        if not lost:
            self.close_dialog()
            return
        question = Question(
            "Discard and close?", lost, (Choice("Discard", self.close_dialog), Choice("Continue")), default=1
        )
        self.context.dialogs.ask(question)

    def close_dialog(self) -> None:
        """Close the dialog and forget its files."""
        self.open, self.error, self.result, self.preview = False, "", None, None
        self.files, self.title = [], ""
        self._known.clear()
        self.landmarks.show([])
        self._on_forget()
        self.context.redraw()

    def ask_for_file(self) -> None:
        """Ask for a file."""
        folder, words = last_folder(self.context.settings), self.words
        kinds = f"{words.noun.capitalize()}s"
        self.context.ask_for_file(FileRequest("open", words.files, kinds, self.suffixes, folder, self.add))

    def add(self, *paths: Path) -> None:
        """Add the files ``paths`` to the list, and say which of them are none that can be used."""
        noun = self.words.noun
        foreign = [path.name for path in paths if path.suffix.lower() not in self.suffixes]
        new = [str(path) for path in paths if path.name not in foreign and str(path) not in self.files]
        room = _MOST_FILES - len(self.files)
        self.files += new[:room]
        if new:
            self.context.settings.folder = str(files.resolved(Path(new[0]).parent))
        if new and not self.title:
            self.title = Path(new[0]).stem.replace("_", " ").replace("-", " ").strip().title()
        self.error = ""
        if foreign:
            names = ", ".join(f"'{name}'" for name in foreign[:_MOST_NAMED])
            more = f" and {len(foreign) - _MOST_NAMED} more" if len(foreign) > _MOST_NAMED else ""
            kind = f"is no {noun}" if len(foreign) == 1 else f"are no {noun}s"
            self.error = f"{names}{more} {kind}; choose {', '.join(self.suffixes)} files."
        if len(new) > room:
            self.error = f"{self.error} At most {_MOST_FILES} files can be used at once.".strip()
        self.context.redraw()

    def remove(self, path: str) -> None:
        """Remove the file ``path`` from the list."""
        self.files.remove(path)
        self.error = ""
        if not self.files:
            self.title = ""

    # Landmarks

    def find(self) -> None:
        """Read the files and find their landmarks, in the background; those known from before keep their landmarks."""
        self.error = ""
        self._sought = tuple(path for path in self.files if self._known_of(path) is None)
        self.finding = ThreadJob(self.work_of_finding(self._sought), self.context.wake, "Reading")
        self.context.redraw()

    def take_found(self, found: Sequence[M]) -> None:
        """Show the landmarks ``found`` in the files that were not known."""
        self._known |= {path: (_version(path), one) for path, one in zip(self._sought, found, strict=True)}
        known = [self._known.get(path) for path in self.files]
        self.landmarks.show([one[1] for one in known if one is not None])

    def _known_of(self, path: str) -> M | None:
        version, found = self._known.get(path, (None, None))
        return found if version == _version(path) else None

    def _remember(self) -> None:
        """Keep the landmarks of the files, to which the user may return."""
        for path, one in zip(self.files, self.landmarks.marked, strict=False):
            if path in self._known:
                self._known[path] = (self._known[path][0], one)

    def back(self) -> None:
        """Return to the form; landmarks of files that stay are kept."""
        self._remember()
        self.error = ""
        self.landmarks.show([])
        self._on_forget()

    # The fit

    def fit(self) -> None:
        """Fit the head, in the background."""
        self.error, self.preview = "", None
        self._remember()

        def show(picture: NDArray[np.uint8]) -> None:
            # Work that was cancelled may still draw.
            if self._n_fits == number:
                self.preview = picture

        number = self._n_fits = self._n_fits + 1
        work = self.work_of_fitting(tuple(self.landmarks.marked), show)
        self.fitting = ThreadJob(work, self.context.wake, "Preparing")
        self.context.redraw()

    def fit_again(self) -> None:
        """Return from the result to the landmarks."""
        self.result, self.preview, self.error = None, None, ""

    def stop(self) -> None:
        """Cancel the work, which ends at its next report and is not waited for; nothing is written."""
        if self.job is not None:
            self.job.cancel()
            self._cancelled = [job for job in self._cancelled if not job.done] + [self.job]
            self.finding = self.fitting = None
            self.preview, self._n_fits = None, self._n_fits + 1
            self.context.redraw()

    def join(self) -> None:
        """Wait until the work, and what was cancelled of it, has ended."""
        for job in (*self._cancelled, self.job):
            if job is not None:
                job.join()

    def save(self) -> None:
        """Save the character to the library, open it and close the dialog, after a question about unsaved changes.

        Nothing happens if the user cancels that question: the result is still there.
        """
        self.context.guard_changes(self._save)

    def _save(self) -> None:
        from faceposer.model.character_file import save_character

        result = self.result
        assert result is not None
        library = self.context.characters
        try:
            library.make_folder()
            path = library.new_path(result.character.name)
            save_character(path, replace(result.character, name=path.stem))
        except FacePoserError as error:
            self.error = str(error)
            return
        self.close_dialog()
        self.opened(result, path)
        self.context.notify(f"Saved {result.character.title}. It is in the list of characters at the top of the panel.")


def _version(path: str) -> tuple[int, int]:
    """Return time and size of the file ``path``, by which a change is noticed."""
    try:
        status = Path(path).stat()
    except OSError:
        return (0, 0)
    return (status.st_mtime_ns, status.st_size)
