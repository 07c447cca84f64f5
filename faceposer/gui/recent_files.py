"""Recently opened or saved files, for the File menu."""

from pathlib import Path

from faceposer.gui.actions import Action
from faceposer.gui.context import EditorContext
from faceposer.gui.settings import MAX_RECENT, save_settings

# Longer paths are shortened in the middle.
_MAX_LETTERS = 64


class RecentFiles:
    """Sessions and character files, newest first."""

    def __init__(self, context: EditorContext) -> None:
        """Keep the list in the settings of ``context``."""
        self._context = context

    def add(self, path: Path) -> None:
        """Add ``path`` at the top."""
        text = str(path.resolve())
        self._save([text, *(other for other in self._context.settings.recent if other != text)])

    def remove(self, path: str) -> None:
        """Remove ``path``."""
        self._save([other for other in self._context.settings.recent if other != path])

    def clear(self) -> None:
        """Remove all files."""
        self._save([])

    def open(self, path: str) -> None:
        """Open ``path``, after asking about unsaved changes; report and remove a missing file."""
        if Path(path).is_file():
            self._context.open_file(path)
            return
        self.remove(path)
        self._context.dialogs.report("File not found", f"'{path}' has been moved or deleted since its last use.")

    def entries(self) -> list[Action]:
        """Return the menu entries: the existing files, and an entry that clears the list."""
        existing = [path for path in self._context.settings.recent if Path(path).is_file()]
        return [
            *(
                Action(f"recent:{i}", shown_path(path), "File", lambda path=path: self.open(path))  # type: ignore[misc]
                for i, path in enumerate(existing)
            ),
            Action("recent-clear", "Clear recent files", "File", self.clear, separated=bool(existing)),
        ]

    def _save(self, paths: list[str]) -> None:
        """Save ``paths`` immediately, in case the program is killed."""
        if paths[:MAX_RECENT] != self._context.settings.recent:
            self._context.settings.recent = paths[:MAX_RECENT]
            if self._context.remembers:
                save_settings(self._context.settings)


def shown_path(path: str) -> str:
    """Return ``path`` for the menu: relative to the home folder if it is inside, and shortened."""
    full = Path(path)
    home = Path.home()
    text = f"~/{full.relative_to(home).as_posix()}" if full.is_relative_to(home) else path
    # Dear ImGui does not show text after "##", and accepts only UTF-8.
    text = text.replace("##", "#").encode(errors="replace").decode()
    if len(text) > _MAX_LETTERS:
        text = f"{text[: _MAX_LETTERS // 3]}...{text[-(_MAX_LETTERS - _MAX_LETTERS // 3 - 3) :]}"
    return text
