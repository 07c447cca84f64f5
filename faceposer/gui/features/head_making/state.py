"""Heads from scans or photos: the files, the landmarks, the fit in the background, and its result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Generic, Literal, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.model.character import Character
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob
from faceposer.session.opening import open_session

Page = Literal["form", "finding", "landmarks", "fitting", "result"]
_MOST_FILES = 12


class Marked(Protocol):
    """A scan or photo with a picture of the face, and its landmarks in it."""

    @property
    def name(self) -> str:
        """Name of its file."""
        ...

    @property
    def image(self) -> NDArray[np.uint8]:
        """The picture, shape (h, w, 3)."""
        ...

    @property
    def pixels(self) -> Mapping[str, tuple[float, float]]:
        """Pixels of the feature points that can be moved, by name."""
        ...

    @property
    def moved(self) -> frozenset[str]:
        """Names of those that the user has moved."""
        ...

    def with_moved(self, name: str, pixel: tuple[float, float]) -> Self:
        """Return it with feature point ``name`` at ``pixel`` of the picture, or as it is if that is not possible."""
        ...


M = TypeVar("M", bound=Marked)
H = TypeVar("H", bound="MadeHead")


@dataclass(frozen=True, eq=False)
class MadeHead:
    """The character that was made.

    Attributes:
        character: The character.
        text: Sentences on how well it fits.
        picture: Pictures of it beside what it was made of, shape (h, w, 3).
    """

    character: Character
    text: str
    picture: NDArray[np.uint8]

    @property
    def over(self) -> NDArray[np.uint8] | None:
        """A picture of the same size that covers `picture` on the right of a line that can be dragged, or None."""
        return None


@dataclass(frozen=True)
class Words:
    """Texts of the dialog.

    Attributes:
        action: Name and label of the entry of the File menu, and its help.
        noun: One of the files, such as "scan".
        files: Title of the dialog that asks for one.
        form: Explanation of the form.
        landmarks: Explanation of the page of landmarks.
        options: Options of the fit: name, label and tooltip.
    """

    action: tuple[str, str, str]
    noun: str
    files: str
    form: str
    landmarks: str
    options: tuple[tuple[str, str, str], ...]


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
        marked: The files with their landmarks, or empty before they are found.
        shown: Index of the one whose landmarks are shown.
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
        self.marked: list[M] = []
        self.shown = 0
        self.result: H | None = None
        self.finding: ThreadJob[list[M]] | None = None
        self.fitting: ThreadJob[H] | None = None

    # What subclasses do

    def work_of_finding(self, files: Sequence[str]) -> Callable[[Progress], list[M]]:
        """Return the function that reads ``files`` and finds their landmarks, in the background."""
        raise NotImplementedError

    def work_of_fitting(self, marked: Sequence[M]) -> Callable[[Progress], H]:
        """Return the function that makes the character, in the background."""
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
        return "landmarks" if self.marked else "form"

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

    def close_dialog(self) -> None:
        """Close the dialog and forget its files."""
        self.open, self.error, self.result = False, "", None
        self.files, self.marked, self.title = [], [], ""
        self._on_forget()
        self.context.redraw()

    def ask_for_file(self) -> None:
        """Ask for a file."""
        folder, words = last_folder(self.context.settings), self.words
        kinds = f"{words.noun.capitalize()}s"
        self.context.ask_for_file(FileRequest("open", words.files, kinds, self.suffixes, folder, self.add))

    def add(self, path: Path) -> None:
        """Add the file ``path`` to the list."""
        self.error = ""
        if path.suffix.lower() not in self.suffixes:
            self.error = f"'{path.name}' is no {self.words.noun}; choose {', '.join(self.suffixes)} files."
        elif len(self.files) >= _MOST_FILES:
            self.error = f"At most {_MOST_FILES} files can be used at once."
        elif str(path) not in self.files:
            self.files.append(str(path))
            self.title = self.title or path.stem.replace("_", " ").replace("-", " ").strip().title()
        self.context.redraw()

    def remove(self, path: str) -> None:
        """Remove the file ``path`` from the list."""
        self.files.remove(path)
        self.error = ""
        if not self.files:
            self.title = ""

    # Landmarks

    def find(self) -> None:
        """Read the files and find their landmarks, in the background."""
        self.error, self.shown = "", 0
        self.finding = ThreadJob(self.work_of_finding(tuple(self.files)), self.context.wake, "Reading")
        self.context.redraw()

    def back(self) -> None:
        """Return to the form."""
        self.marked, self.error = [], ""
        self._on_forget()

    # The fit

    def fit(self) -> None:
        """Fit the head, in the background."""
        self.error = ""
        self.fitting = ThreadJob(self.work_of_fitting(tuple(self.marked)), self.context.wake, "Preparing")
        self.context.redraw()

    def fit_again(self) -> None:
        """Return from the result to the landmarks."""
        self.result, self.error = None, ""

    def stop(self) -> None:
        """Cancel the work; nothing is written."""
        if self.job is not None:
            self.job.cancel()

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
