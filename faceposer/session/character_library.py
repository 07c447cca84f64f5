"""The available characters: installed with the program, imported or made by the user, and in other files."""

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.names import is_hidden
from faceposer.files.user_folders import data_folder
from faceposer.model.character_file import available_characters, load_character, read_title, save_character
from faceposer.model.character_names import checked_title, is_installed

SUFFIX = ".npz"

Home = Literal["installed", "library", "elsewhere"]


def library_folder() -> Path:
    """Return the folder of the user's characters, imported or made, which may not exist."""
    return data_folder() / "characters"


@dataclass(frozen=True)
class LibraryEntry:
    """A character that can be opened.

    Attributes:
        name: Name of an installed character, or the absolute path of its file.
        title: Displayed title.
        home: Origin: "installed" with the program, of the user's "library", or a file "elsewhere".
    """

    name: str
    title: str
    home: Home


class CharacterLibrary:
    """Lists, renames and removes characters."""

    def __init__(self, folder: Path | None = None) -> None:
        """Manage the characters in ``folder``; None for the user's library."""
        self._folder = folder
        self._titles: dict[Path, tuple[tuple[int, int], str | None]] = {}
        self._installed: list[LibraryEntry] | None = None

    @property
    def folder(self) -> Path:
        """The folder of the library, which may not exist."""
        return library_folder() if self._folder is None else self._folder

    def all(self, elsewhere: list[str] | tuple[str, ...] = ()) -> list[LibraryEntry]:
        """Return the installed characters, those of the library by title, and those of the paths ``elsewhere``."""
        if self._installed is None:
            self._installed = [LibraryEntry(name, title, "installed") for name, title in available_characters()]
        found = self.folder.glob(f"*{SUFFIX}") if paths.is_dir(self.folder) else ()
        files = sorted(path for path in found if not is_hidden(path))
        own = [LibraryEntry(str(path), title, "library") for path in files if (title := self.title(path)) is not None]
        others = [
            LibraryEntry(path, title, "elsewhere")
            for path in elsewhere
            if not self.holds(path) and (title := self.title(Path(path))) is not None
        ]
        return [*self._installed, *sorted(own, key=lambda character: character.title.lower()), *others]

    def holds(self, path: str | Path) -> bool:
        """Return True if the file ``path`` is in the library."""
        return paths.expand_user(path).absolute().parent == self.folder.absolute()

    def title(self, path: Path) -> str | None:
        """Return the title of the character in the file ``path``, or None if it is not a character file."""
        try:
            status = path.stat()
        except (OSError, ValueError):
            return None
        stamp = (status.st_mtime_ns, status.st_size)
        if self._titles.get(path, ((0, 0), None))[0] != stamp:
            self._titles[path] = (stamp, _read_title(path))
        return self._titles[path][1]

    def new_path(self, stem: str) -> Path:
        """Return an unused file name in the library for a new character; the folder may not exist.

        It is not that of an installed character either.
        """
        path, number = self.folder / f"{stem}{SUFFIX}", 2
        while paths.exists(path) or is_installed(path.stem):
            path, number = self.folder / f"{stem}-{number}{SUFFIX}", number + 1
        return path

    def make_folder(self) -> None:
        """Create the folder of the library.

        Raises:
            FacePoserError: If it cannot be created.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FacePoserError(f"The folder '{self.folder}' cannot be created: {error.strerror}.") from error

    def rename(self, character: LibraryEntry, title: str) -> None:
        """Change the title of a character of the library; its file, by which sessions refer to it, keeps its name.

        Raises:
            FacePoserError: If the title is not possible, or if the file cannot be read or written.
        """
        title = checked_title(title)
        if character.home != "library":
            raise FacePoserError("Only characters under 'My characters' can be renamed.")
        save_character(character.name, replace(load_character(character.name), title=title))

    def remove(self, character: LibraryEntry) -> None:
        """Delete the file of a character of the library.

        Raises:
            FacePoserError: If it cannot be deleted.
        """
        if character.home != "library":
            raise FacePoserError("Only characters under 'My characters' can be removed.")
        try:
            Path(character.name).unlink()
        except OSError as error:
            raise FacePoserError(f"'{character.name}' cannot be deleted: {error.strerror}.") from error


def _read_title(path: Path) -> str | None:
    """Return the title in the file ``path`` without reading its meshes, or None if it is not a character file."""
    with suppress(FacePoserError):
        return read_title(path)
    return None
