"""File requests: what a file dialog asks for."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from faceposer.files.names import save_path

Purpose = Literal["open", "save", "folder", "new folder"]


@dataclass(frozen=True)
class FileRequest:
    """A request for a path.

    Attributes:
        purpose: "open" for an existing file, "save" for a file to write, "folder" for an existing folder, "new folder"
            for a folder to write.
        title: Title of the dialog.
        kind: Plural name of the files, for example "Sessions".
        suffixes: Suffixes of the files, with dots; a name without one of them gets the first. For a new folder, those
            of the files in it.
        start: Folder to start in, or file to suggest.
        done: Called with the chosen path.
        others: Further suffixes accepted when saving.
        beside: Returns the other files that saving to a path would replace; the user confirms these, too.
    """

    purpose: Purpose
    title: str
    kind: str
    suffixes: tuple[str, ...]
    start: Path
    done: Callable[[Path], None]
    others: tuple[str, ...] = ()
    beside: Callable[[Path], tuple[Path, ...]] = lambda _: ()

    @property
    def writes(self) -> bool:
        """True if the chosen path will be written."""
        return self.purpose in ("save", "new folder")

    def completed(self, path: Path) -> Path:
        """Return ``path`` with its suffix added, if it will be written.

        Raises:
            FacePoserError: If there is no name before the suffix.
        """
        if self.purpose == "new folder":
            return save_path(path, "")
        if self.purpose == "save":
            return save_path(path, self.suffixes[0], (*self.suffixes, *self.others))
        return path

    def replaced(self, path: Path) -> tuple[Path, ...]:
        """Return the existing files that writing to ``path``, with its suffix, replaces."""
        if self.purpose != "save":
            return ()
        return (*((path,) if path.exists() else ()), *self.beside(path))
