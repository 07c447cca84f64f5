"""The built-in file dialog: a list of folders and files, and a field for a name or path."""

import errno
import os
from contextlib import suppress
from pathlib import Path

from imgui_bundle import imgui

from faceposer.errors import FacePoserError, printable, short_name
from faceposer.files import paths
from faceposer.files.names import suffix_replaced
from faceposer.files.user_folders import documents_folder, home_folder
from faceposer.gui.widgets.basic import disabled, text_field
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.text import shortened, widget_id
from faceposer.gui.widgets.theme import ACCENT_DARK, FAINT, WARNING, Fonts, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects

# Maximum number of listed files; further ones can be opened by their names.
_MAX_FILES = 20_000
# Most endings that are named.
_SUFFIXES = 6


class PathBrowser:
    """A modal window with a list of folders and files, and a field for a name or path."""

    def __init__(self, request: FileRequest) -> None:
        """Start in the folder of ``request``."""
        self.request = request
        self.closed = False
        self.message = ""
        self.folder = home_folder()
        self.name = ""
        self.typed = Path()
        self._entries: list[tuple[bool, str]] = []
        self._left_out = 0
        self._replacing: Path | None = None
        self._focus = True
        start = request.start
        if paths.is_dir(start) and request.purpose != "new folder":
            self._enter_first(start)
        else:
            self._enter_first(start.parent)
            self.name = start.name if request.writes else ""

    def _enter_first(self, folder: Path) -> None:
        """Show ``folder``, or if it is gone or may not be entered, the user's documents."""
        self._enter(next((f for f in (folder, documents_folder()) if paths.can_enter(f)), home_folder()))

    def _enter(self, folder: Path) -> None:
        """Show ``folder``, or the reason why it cannot be shown."""
        folder = paths.resolved(folder)
        folders, files = [], []
        try:
            with os.scandir(folder) as entries:
                for entry in entries:
                    if entry.name.startswith("."):
                        continue
                    if _is_folder(entry):
                        folders.append(entry.name)
                    elif Path(entry.name).suffix.lower() in self.request.suffixes:
                        files.append(entry.name)
        except (OSError, ValueError) as error:
            self.message = f"The folder '{folder}' cannot be read: {getattr(error, 'strerror', error)}."
            return
        self.folder, self.message, self._replacing = folder, "", None
        self._left_out = max(len(files) - _MAX_FILES, 0)
        files = sorted(files, key=str.lower)[:_MAX_FILES]
        self._entries = [*((True, name) for name in sorted(folders, key=str.lower)), *((False, name) for name in files)]

    def accept(self, confirmed: Path | None = None) -> Path | None:
        """Return the typed path if it is valid; otherwise open it if it is a folder, or set ``message``.

        Args:
            confirmed: A file whose replacement the user has confirmed.
        """
        if self.request.purpose == "folder":
            return self._accept_folder()
        if not self.name.strip():
            self.message = "Enter a name."
            return None
        path = self._typed_path()
        if path is None:
            return None
        self.typed = path
        if paths.is_dir(path) and self.request.purpose != "new folder":
            self._enter(path)
            self.name = ""
            return None
        try:
            path = self.request.completed(path)
        except FacePoserError as error:
            self.message = str(error)
            return None
        if self.request.purpose == "open":
            if paths.is_file(path):
                return path
            self.message = self._missing("file", path)
            return None
        self.message = self._problem_of_target(path)
        if self.message:
            return None
        if self.request.purpose == "new folder":
            return self._accept_new_folder(path)
        replaced = [file for file in self.request.replaced(path) if file != confirmed]
        if replaced and self._replacing != path:
            self._replacing = path
            names = " and ".join(f"'{file.name}'" for file in replaced)
            verb, pronoun = ("exists", "it") if len(replaced) == 1 else ("exist", "them")
            self.message = f"{names} already {verb}; press Replace to overwrite {pronoun}."
            return None
        return path

    def _problem_of_target(self, path: Path) -> str:
        """Return why ``path`` cannot be written, or ""."""
        if not paths.is_dir(path.parent):
            return self._missing("folder", path.parent)
        if not os.access(path.parent, os.W_OK | os.X_OK):
            return f"The folder '{path.parent}' is not writable; choose another."
        if reason := paths.problem(path):
            return f"'{short_name(path.name)}' cannot be written: {reason}."
        if self.request.purpose == "save" and paths.is_dir(path):
            return f"'{short_name(path.name)}' is a folder; enter another name."
        return ""

    def _accept_new_folder(self, path: Path) -> Path | None:
        try:
            if not paths.exists(path) or (paths.is_dir(path) and not any(path.iterdir())):
                return path
            self.message = f"'{path.name}' already exists and is not an empty folder; enter another name."
        except OSError as error:
            self.message = f"'{path}' cannot be read: {error.strerror}."
        return None

    def _accept_folder(self) -> Path | None:
        path = self._typed_path()
        if path is None:
            return None
        if paths.can_enter(path):
            return path
        if paths.is_dir(path):
            self.message = f"The folder '{path}' cannot be read: {os.strerror(errno.EACCES)}."
        else:
            self.message = self._missing("folder", path)
        return None

    def _typed_path(self) -> Path | None:
        """Return the path in the field, or set ``message`` if it begins with the home folder of no user."""
        text = self.name.strip()
        path = self.folder / paths.expand_user(text)
        home = Path(text).parts[0] if text else ""
        if text.startswith("~") and path == self.folder / text and not paths.exists(self.folder / home):
            self.message = f"There is no user '{short_name(home[1:])}'; enter './{short_name(home)}' for a file."
            return None
        return path

    @staticmethod
    def _missing(kind: str, path: Path) -> str:
        reason = paths.problem(path)
        return f"The {kind} '{path}' cannot be read: {reason}." if reason else f"The {kind} '{path}' does not exist."

    def advice(self) -> tuple[str, bool]:
        """Return the text below the name, and True if it is a warning."""
        if self.message:
            return printable(self.message), True
        if self._left_out:
            return f"{self._left_out} more files are not listed; enter the name of one to open it", True
        request = self.request
        if request.purpose == "folder":
            return "Select a folder, enter a path, or leave empty for the current folder", False
        typed = Path(self.name.strip())
        if request.writes and typed.name:
            with suppress(FacePoserError):
                saved = request.completed(typed)
                if saved.name != typed.name:
                    return f"Will be saved as {saved.name}", suffix_replaced(typed, saved)
        if request.purpose == "new folder":
            return "Name of a new folder, or a path", False
        endings = ", ".join(request.suffixes[:_SUFFIXES])
        more = " and others" if len(request.suffixes) > _SUFFIXES else ""
        return f"Name or path ({endings}{more})", False

    def draw(self, fonts: Fonts, rects: WidgetRects) -> Path | None:
        """Draw the browser and return the chosen path, if any."""
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
        appearing = imgui.is_window_appearing()
        imgui.push_font(fonts.bold, 0.0)
        imgui.text_unformatted(self.request.title)
        imgui.pop_font()
        self._draw_location(rects)
        chosen = self._draw_list(rects)
        chosen = self._draw_footer(rects, appearing) or chosen
        if chosen is not None or (imgui.is_key_pressed(imgui.Key.escape, False) and not appearing):
            self.closed = True
        if self.closed:
            imgui.close_current_popup()
        imgui.end_popup()
        return chosen

    def _draw_location(self, rects: WidgetRects) -> None:
        if imgui.button(f"{Icon.UP}##up"):
            self._enter(self.folder.parent)
        rects.record("files:up")
        tooltip("Parent folder")
        imgui.same_line()
        if imgui.button(f"{Icon.HOME}##home"):
            self._enter(home_folder())
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
        """Draw the folders and files; return the double-clicked file, if any."""
        chosen = None
        foot = 2.0 * imgui.get_frame_height_with_spacing() + imgui.get_text_line_height_with_spacing() + em(0.6)
        imgui.push_style_color(imgui.Col_.child_bg, (0.0, 0.0, 0.0, 0.25))
        imgui.begin_child("##list", (0.0, -foot), imgui.ChildFlags_.always_use_window_padding.value)
        if not self._entries:
            imgui.text_disabled(f"No folders or {self.request.kind.lower()} in this folder.")
        entries = list(self._entries)
        # Only the visible rows are drawn: a folder may hold many thousands of files.
        clipper = imgui.ListClipper()
        clipper.begin(len(entries))
        while clipper.step():
            for is_folder, name in entries[clipper.display_start : clipper.display_end]:
                chosen = self._draw_entry(rects, is_folder, name) or chosen
        clipper.end()
        imgui.end_child()
        imgui.pop_style_color()
        return chosen

    def _draw_entry(self, rects: WidgetRects, is_folder: bool, name: str) -> Path | None:
        """Draw a row of the list; return the double-clicked file, if any."""
        folders_only = self.request.purpose == "folder"
        imgui.text_colored(FAINT, Icon.FOLDER if is_folder else Icon.FILE)
        imgui.same_line(em(2.4))
        label = shortened(name, imgui.get_content_region_avail().x)
        flags = imgui.SelectableFlags_.allow_double_click.value
        # When a folder is requested, files only show its content.
        with disabled(folders_only and not is_folder):
            imgui.selectable(f"{label}##{widget_id(name)}", name == self.name, flags)
        if label != name:
            tooltip(name)
        rects.record(f"files:{name}")
        if not (imgui.is_item_hovered() and imgui.is_mouse_clicked(0)):
            return None
        double_clicked = imgui.is_mouse_double_clicked(0)
        if not is_folder:
            self.name = name
            return self.accept() if double_clicked else None
        self.name = name if folders_only and not double_clicked else "" if folders_only else self.name
        if double_clicked:
            self._enter(self.folder / name)
        return None

    def _draw_footer(self, rects: WidgetRects, appearing: bool) -> Path | None:
        chosen = None
        if self._focus:
            imgui.set_keyboard_focus_here()
            self._focus = False
        imgui.set_next_item_width(-1.0)
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
        entered, name = text_field("##name", self.name, flags=flags.value)
        rects.record("files:name")
        if name != self.name:
            self.name, self._replacing, self.message = name, None, ""
        if entered and not appearing:
            chosen = self.accept()
            self._focus = chosen is None
        text, warns = self.advice()
        shown = shortened(text, imgui.get_content_region_avail().x)
        imgui.text_colored(WARNING if warns else FAINT, shown)
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


def _is_folder(entry: os.DirEntry[str]) -> bool:
    """Return True for a folder or a link to one; False for a link that leads nowhere or in circles."""
    try:
        return entry.is_dir()
    except OSError:
        return False
