"""File dialogs: the system's own where there is one, otherwise the built-in browser."""

import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from imgui_bundle import portable_file_dialogs as native

from faceposer.files.names import suffix_replaced
from faceposer.gui.widgets.basic import WidgetRects
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.path_browser import PathBrowser
from faceposer.gui.widgets.theme import Fonts


def native_available() -> bool:
    """Return True if the system has a file dialog; without one the library acts as if the user had cancelled."""
    if os.environ.get("FACEPOSER_OWN_DIALOGS"):
        return False
    if not sys.platform.startswith("linux"):
        return True
    return any(shutil.which(name) for name in ("zenity", "kdialog", "matedialog", "qarma"))


class FileDialogs:
    """The open file dialog, if any."""

    def __init__(
        self,
        fonts: Fonts,
        rects: WidgetRects,
        use_native: bool | None = None,
        notify: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Prepare the dialogs of a window.

        Args:
            fonts: Fonts of the window.
            rects: Records the widgets.
            use_native: Use the system's dialog; if None, only if there is one.
            notify: Shows a short message.
        """
        self._fonts = fonts
        self._notify = notify
        self._rects = rects
        self._use_native = native_available() if use_native is None else use_native
        self._native: tuple[FileRequest, Any] | None = None
        self._browser: PathBrowser | None = None

    @property
    def open(self) -> bool:
        """True if a dialog is open."""
        return self._native is not None or self._browser is not None

    @property
    def browsing(self) -> bool:
        """True if the built-in browser is open."""
        return self._browser is not None

    @property
    def polling(self) -> bool:
        """True if the system's dialog is open; ``poll`` must be called."""
        return self._native is not None

    def ask(self, request: FileRequest) -> None:
        """Open a dialog for ``request``, unless another is open."""
        if self.open:
            return
        if not self._use_native:
            self._browser = PathBrowser(request)
            return
        filters = [request.kind, " ".join(f"*{suffix}" for suffix in request.suffixes), "All files", "*"]
        if request.purpose == "new folder":
            filters = filters[2:]
        start = str(request.start)
        if request.purpose == "folder":
            self._native = (request, native.select_folder(request.title, start))
        elif request.purpose == "open":
            self._native = (request, native.open_file(request.title, start, filters))
        else:
            self._native = (request, native.save_file(request.title, start, filters))

    def poll(self) -> None:
        """Take the answer of the system's dialog, once it is closed."""
        if self._native is None:
            return
        request, dialog = self._native
        if not dialog.ready(0):
            return
        self._native = None
        answer = dialog.result()
        path = answer[0] if isinstance(answer, list) and answer else answer
        if not path:
            return
        browser = PathBrowser(replace(request, start=Path(path)))
        # The system has asked about replacing the file with the typed name, and no other.
        chosen = browser.accept(confirmed=browser.folder / browser.name) if request.writes else Path(path)
        if chosen is None:
            self._browser = browser
        else:
            self._finish(request, browser.typed, chosen)

    def _finish(self, request: FileRequest, typed: Path, path: Path) -> None:
        request.done(path)
        if request.writes and suffix_replaced(typed, path):
            self._notify(f"'{typed.name}' was saved as '{path.name}'")

    def draw(self) -> None:
        """Draw the built-in browser, if it is open."""
        if self._browser is None:
            return
        browser = self._browser
        path = browser.draw(self._fonts, self._rects)
        if browser.closed:
            self._browser = None
        if path is not None:
            self._finish(browser.request, browser.typed, path)
