"""The files that were opened or saved last, for the File menu."""

from pathlib import Path

from faceposer.gui.actions import Action
from faceposer.gui.context import EditorContext
from faceposer.gui.settings import MAX_RECENT, save_settings

# Longer paths are shown without their middle.
_MOST_LETTERS = 64


class RecentFiles:
    """Sessions and characters' files, newest first."""

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``."""
        self._context = context

    def add(self, path: Path) -> None:
        """Put ``path`` first."""
        text = str(path.resolve())
        self._keep([text, *(other for other in self._context.settings.recent if other != text)])

    def remove(self, path: str) -> None:
        """Forget ``path``."""
        self._keep([other for other in self._context.settings.recent if other != path])

    def clear(self) -> None:
        """Forget all."""
        self._keep([])

    def open(self, path: str) -> None:
        """Open ``path``, after asking about changes that are not saved, or tell that it is gone and forget it."""
        if Path(path).is_file():
            self._context.open_file(path)
            return
        self.remove(path)
        self._context.dialogs.report("This file is gone", f"'{path}' has been moved or deleted since it was used last.")

    def entries(self) -> list[Action]:
        """Return what the menu shows now: the files that are there, and the end of them all."""
        there = [path for path in self._context.settings.recent if Path(path).is_file()]
        return [
            *(
                Action(f"recent:{i}", shown_path(path), "File", lambda path=path: self.open(path))  # type: ignore[misc]
                for i, path in enumerate(there)
            ),
            Action("recent-clear", "Clear recent files", "File", self.clear, separated=bool(there)),
        ]

    def _keep(self, paths: list[str]) -> None:
        """Remember ``paths`` at once: the next start may come without a proper end."""
        if paths[:MAX_RECENT] != self._context.settings.recent:
            self._context.settings.recent = paths[:MAX_RECENT]
            if self._context.remembers:
                save_settings(self._context.settings)


def shown_path(path: str) -> str:
    """Return ``path`` as the menu shows it: from the home folder where it lies there, and short."""
    full = Path(path)
    home = Path.home()
    text = f"~/{full.relative_to(home).as_posix()}" if full.is_relative_to(home) else path
    # What stands behind two of these, Dear ImGui does not show; and it takes nothing but UTF-8.
    text = text.replace("##", "#").encode(errors="replace").decode()
    if len(text) > _MOST_LETTERS:
        text = f"{text[: _MOST_LETTERS // 3]}...{text[-(_MOST_LETTERS - _MOST_LETTERS // 3 - 3) :]}"
    return text
