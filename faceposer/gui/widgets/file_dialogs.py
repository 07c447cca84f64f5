"""Asks for a file or a folder: by the system's own dialog where there is one, else by a small browser of our own."""

import os
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from imgui_bundle import imgui
from imgui_bundle import portable_file_dialogs as native

from faceposer.errors import FacePoserError
from faceposer.files.names import save_path, suffix_replaced
from faceposer.gui.widgets.basic import WidgetRects, tooltip
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import ACCENT_DARK, FAINT, WARNING, Fonts, Icon, em

Purpose = Literal["open", "save", "folder", "new folder"]
_MOST_ENTRIES = 5000


@dataclass(frozen=True)
class FileRequest:
    """What to ask for.

    Attributes:
        purpose: "open" for a file that exists, "save" for one to write, "folder" for a folder that exists, "new folder"
            for one to write.
        title: What the file is for.
        kind: What such files are called, for example "Sessions".
        suffixes: Their endings, with dots; a name without one of them gets the first. Of a new folder, those of the
            files in it.
        start: A folder to begin in, or a file to propose.
        done: Is called with the chosen path.
        others: Endings that may be typed instead when saving.
        beside: Returns further files that saving a path would replace, to ask about them too.
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
        """Whether what is chosen will be written."""
        return self.purpose in ("save", "new folder")

    def completed(self, path: Path) -> Path:
        """Return ``path`` with the suffix that it is written with, if it is to be written.

        Raises:
            FacePoserError: If there is no name before the suffix.
        """
        if self.purpose == "new folder":
            return save_path(path, "")
        if self.purpose == "save":
            return save_path(path, self.suffixes[0], (*self.suffixes, *self.others))
        return path

    def replaced(self, path: Path) -> tuple[Path, ...]:
        """Return the files that writing ``path``, which is complete, replaces."""
        if self.purpose != "save":
            return ()
        return (*((path,) if path.exists() else ()), *self.beside(path))


def native_available() -> bool:
    """Whether the system has a dialog of its own; without one the library acts as if the user had cancelled."""
    if os.environ.get("FACEPOSER_OWN_DIALOGS"):
        return False
    if not sys.platform.startswith("linux"):
        return True
    return any(shutil.which(name) for name in ("zenity", "kdialog", "matedialog", "qarma"))


class FileDialogs:
    """The file dialog that is open, if any."""

    def __init__(
        self,
        fonts: Fonts,
        rects: WidgetRects,
        use_native: bool | None = None,
        notify: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Serve a window.

        Args:
            fonts: The window's.
            rects: Records the widgets.
            use_native: Use the system's dialog; if None, where there is one.
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
        """Whether one is open."""
        return self._native is not None or self._browser is not None

    @property
    def browsing(self) -> bool:
        """Whether our own browser is open, over the view."""
        return self._browser is not None

    @property
    def polling(self) -> bool:
        """Whether the answer comes from elsewhere and has to be looked for."""
        return self._native is not None

    def ask(self, request: FileRequest) -> None:
        """Open a dialog for ``request``, unless one is open."""
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
        """Take the system dialog's answer if it has come."""
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
        # The system has asked whether to replace the file of the name that was typed, and no other.
        chosen = browser.accept(confirmed=browser.folder / browser.name) if request.writes else Path(path)
        if chosen is None:
            self._browser = browser
        else:
            self._finish(request, browser.typed, chosen)

    def _finish(self, request: FileRequest, typed: Path, path: Path) -> None:
        request.done(path)
        if request.writes and suffix_replaced(typed, path):
            self._notify(f"'{typed.name}' is saved as '{path.name}'")

    def draw(self) -> None:
        """Draw the browser if it is open."""
        if self._browser is None:
            return
        browser = self._browser
        path = browser.draw(self._fonts, self._rects)
        if browser.closed:
            self._browser = None
        if path is not None:
            self._finish(browser.request, browser.typed, path)


class PathBrowser:
    """A modal window with a list of files and a field for a name or a whole path."""

    def __init__(self, request: FileRequest) -> None:
        """Begin where ``request`` says."""
        self.request = request
        self.closed = False
        self.message = ""
        self.folder = Path.home()
        self.name = ""
        self.typed = Path()
        self._entries: list[tuple[bool, str]] = []
        self._replacing: Path | None = None
        self._focus = True
        start = request.start
        if start.is_dir() and request.purpose != "new folder":
            self._enter(start)
        else:
            self._enter(start.parent if start.parent.is_dir() else Path.cwd())
            self.name = start.name if request.writes else ""

    def _enter(self, folder: Path) -> None:
        """Show ``folder``."""
        try:
            folder = folder.resolve()
            names = sorted(os.scandir(folder), key=lambda entry: entry.name.lower())[:_MOST_ENTRIES]
        except OSError as error:
            self.message = f"'{folder}' cannot be shown: {error.strerror}."
            return
        self.folder, self.message, self._replacing = folder, "", None
        self._entries = []
        for entry in names:
            if entry.name.startswith("."):
                continue
            is_folder = entry.is_dir()
            if is_folder or Path(entry.name).suffix.lower() in self.request.suffixes:
                self._entries.append((is_folder, entry.name))
        self._entries.sort(key=lambda entry: not entry[0])

    def accept(self, confirmed: Path | None = None) -> Path | None:
        """Return the path that is typed, if it will do; else go there or say why not.

        Args:
            confirmed: A file that the user has agreed to replace.
        """
        if self.request.purpose == "folder":
            return self._accept_folder()
        if not self.name.strip():
            self.message = "Give a name."
            return None
        path = self.typed = self.folder / Path(self.name.strip()).expanduser()
        if path.is_dir() and self.request.purpose != "new folder":
            self._enter(path)
            self.name = ""
            return None
        try:
            path = self.request.completed(path)
        except FacePoserError as error:
            self.message = str(error)
            return None
        if self.request.purpose == "open":
            if path.is_file():
                return path
            self.message = f"There is no file '{path}'."
            return None
        if not path.parent.is_dir():
            self.message = f"There is no folder '{path.parent}'."
            return None
        if self.request.purpose == "new folder":
            return self._accept_new_folder(path)
        replaced = [file for file in self.request.replaced(path) if file != confirmed]
        if replaced and self._replacing != path:
            self._replacing = path
            names = " and ".join(f"'{file.name}'" for file in replaced)
            verb, pronoun = ("exists", "it") if len(replaced) == 1 else ("exist", "them")
            self.message = f"{names} {verb}; accept again to replace {pronoun}."
            return None
        return path

    def _accept_new_folder(self, path: Path) -> Path | None:
        try:
            if not path.exists() or (path.is_dir() and not any(path.iterdir())):
                return path
            self.message = f"'{path.name}' exists and is not an empty folder; type another name."
        except OSError as error:
            self.message = f"'{path}' cannot be read: {error.strerror}."
        return None

    def _accept_folder(self) -> Path | None:
        path = self.folder / Path(self.name.strip()).expanduser()
        if path.is_dir():
            return path
        self.message = f"There is no folder '{path}'."
        return None

    def advice(self) -> tuple[str, bool]:
        """Return what is written below the name, and whether it deserves attention."""
        if self.message:
            return self.message, True
        request = self.request
        if request.purpose == "folder":
            return "A folder in the list, a whole path, or nothing for the folder that is shown", False
        typed = Path(self.name.strip())
        if request.writes and typed.name:
            with suppress(FacePoserError):
                saved = request.completed(typed)
                if saved.name != typed.name:
                    return f"Will be saved as {saved.name}", suffix_replaced(typed, saved)
        if request.purpose == "new folder":
            return "The name of a new folder, or a whole path", False
        return f"A name, or a whole path ({', '.join(request.suffixes)})", False

    def draw(self, fonts: Fonts, rects: WidgetRects) -> Path | None:
        """Draw the browser and return the path once one is chosen."""
        name = "##files"
        if not imgui.is_popup_open(name):
            imgui.open_popup(name)
        view = imgui.get_main_viewport()
        imgui.set_next_window_pos(view.get_center(), imgui.Cond_.always, (0.5, 0.5))
        room = (view.size.x - em(1), view.size.y - em(1))
        imgui.set_next_window_size((min(em(40), room[0]), min(em(30), room[1])))
        flags = imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move
        if not imgui.begin_popup_modal(name, None, flags)[0]:
            return None
        fresh = imgui.is_window_appearing()
        imgui.push_font(fonts.bold, 0.0)
        imgui.text_unformatted(self.request.title)
        imgui.pop_font()
        self._draw_places(rects)
        chosen = self._draw_list(rects)
        chosen = self._draw_foot(rects, fresh) or chosen
        if chosen is not None or (imgui.is_key_pressed(imgui.Key.escape, False) and not fresh):
            self.closed = True
        if self.closed:
            imgui.close_current_popup()
        imgui.end_popup()
        return chosen

    def _draw_places(self, rects: WidgetRects) -> None:
        if imgui.button(f"{Icon.UP}##up"):
            self._enter(self.folder.parent)
        rects.record("files:up")
        tooltip("One folder up")
        imgui.same_line()
        if imgui.button(f"{Icon.HOME}##home"):
            self._enter(Path.home())
        rects.record("files:home")
        tooltip("Home folder")
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        folder = str(self.folder)
        shown = shortened(folder, imgui.get_content_region_avail().x)
        imgui.text_unformatted(shown)
        if shown != folder:
            tooltip(folder)

    def _draw_list(self, rects: WidgetRects) -> Path | None:
        """Draw folders and files; return the one that was clicked twice."""
        chosen = None
        foot = 2.0 * imgui.get_frame_height_with_spacing() + imgui.get_text_line_height_with_spacing() + em(0.6)
        imgui.push_style_color(imgui.Col_.child_bg, (0.0, 0.0, 0.0, 0.25))
        imgui.begin_child("##list", (0.0, -foot), imgui.ChildFlags_.always_use_window_padding.value)
        if not self._entries:
            imgui.text_disabled(f"No folders and no {self.request.kind.lower()} here.")
        folders_only = self.request.purpose == "folder"
        for is_folder, name in list(self._entries):
            imgui.text_colored(FAINT, Icon.FOLDER if is_folder else Icon.FILE)
            imgui.same_line(em(2.4))
            # Files only show what is in the folder where one of those is wanted.
            imgui.begin_disabled(folders_only and not is_folder)
            label = shortened(name, imgui.get_content_region_avail().x)
            flags = imgui.SelectableFlags_.allow_double_click.value
            imgui.selectable(f"{label}##{name}", name == self.name, flags)
            imgui.end_disabled()
            if label != name:
                tooltip(name)
            rects.record(f"files:{name}")
            if imgui.is_item_hovered() and imgui.is_mouse_clicked(0):
                twice = imgui.is_mouse_double_clicked(0)
                if is_folder:
                    self.name = name if folders_only and not twice else "" if folders_only else self.name
                    if twice:
                        self._enter(self.folder / name)
                else:
                    self.name = name
                    chosen = self.accept() if twice else None
        imgui.end_child()
        imgui.pop_style_color()
        return chosen

    def _draw_foot(self, rects: WidgetRects, fresh: bool) -> Path | None:
        chosen = None
        if self._focus:
            imgui.set_keyboard_focus_here()
            self._focus = False
        imgui.set_next_item_width(-1.0)
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
        entered, name = imgui.input_text("##name", self.name, flags)
        rects.record("files:name")
        if name != self.name:
            self.name, self._replacing, self.message = name, None, ""
        if entered and not fresh:
            chosen = self.accept()
            self._focus = chosen is None
        text, notable = self.advice()
        shown = shortened(text, imgui.get_content_region_avail().x)
        imgui.text_colored(WARNING if notable else FAINT, shown)
        if shown != text:
            tooltip(text)
        save = "Replace" if self._replacing else "Save"
        verb = {"open": "Open", "folder": "Choose", "save": save, "new folder": "Save"}[self.request.purpose]
        width = em(6)
        imgui.set_cursor_pos_x(imgui.get_window_width() - 2 * width - em(0.55) - imgui.get_style().window_padding.x)
        imgui.push_style_color(imgui.Col_.button, ACCENT_DARK)
        if imgui.button(f"{verb}##accept", (width, 0.0)):
            chosen = self.accept()
        imgui.pop_style_color()
        rects.record("files:accept")
        imgui.same_line()
        if imgui.button("Cancel", (width, 0.0)):
            self.closed = True
        rects.record("files:cancel")
        return chosen
