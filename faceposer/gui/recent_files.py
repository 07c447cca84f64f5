"""Recently opened or saved files, for the File menu."""

from pathlib import Path

from faceposer.files import paths
from faceposer.gui.actions import Action
from faceposer.gui.context import EditorContext
from faceposer.gui.settings import MAX_RECENT
from faceposer.gui.widgets.text import displayed

# Longer paths are shortened in the middle.
_MAX_LETTERS = 64


class RecentFiles:
    """Sessions and character files, newest first."""

    def __init__(self, context: EditorContext) -> None:
        """Keep the list in the settings of ``context``."""
        self._context = context

    def add(self, path: Path) -> None:
        """Add ``path`` at the top."""
        text = str(paths.resolved(path))
        self._save([text, *(other for other in self._context.settings.recent if other != text)])

    def remove(self, path: str) -> None:
        """Remove ``path``."""
        self._save([other for other in self._context.settings.recent if other != path])

    def clear(self) -> None:
        """Remove all files."""
        self._save([])

    def open(self, path: str) -> None:
        """Open ``path``, after asking about unsaved changes; report and remove a missing file."""
        if paths.is_file(path):
            self._context.open_file(path)
            return
        if reason := paths.problem(path):
            self._context.dialogs.report("The file cannot be opened", f"'{path}' cannot be read: {reason}.")
            return
        self.remove(path)
        self._context.dialogs.report("File not found", f"'{path}' has been moved or deleted since its last use.")

    def entries(self) -> list[Action]:
        """Return the menu entries: the existing files, and an entry that clears the list."""
        # A file that cannot be looked up is listed: it may be back at the next try, and its entry says what is wrong.
        existing = [path for path in self._context.settings.recent if paths.is_file(path) or paths.problem(path)]
        return [
            *(
                Action(f"recent:{i}", shown_path(path), "File", lambda path=path: self.open(path))  # type: ignore[misc]
                for i, path in enumerate(existing)
            ),
            Action("recent-clear", "Clear recent files", "File", self.clear, separated=bool(existing)),
        ]

    def _save(self, files: list[str]) -> None:
        """Save ``files`` immediately, in case the program is killed."""
        if files[:MAX_RECENT] != self._context.settings.recent:
            self._context.settings.recent = files[:MAX_RECENT]
            self._context.save_settings()


def shown_path(path: str) -> str:
    """Return ``path`` for the menu: relative to the home folder if it is inside, and shortened."""
    full = Path(path)
    home = paths.expand_user("~")
    text = f"~/{full.relative_to(home).as_posix()}" if full.is_relative_to(home) else path
    if len(text) > _MAX_LETTERS:
        text = f"{text[: _MAX_LETTERS // 3]}...{text[-(_MAX_LETTERS - _MAX_LETTERS // 3 - 3) :]}"
    return displayed(text)
