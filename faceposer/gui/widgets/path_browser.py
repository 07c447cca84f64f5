"""The built-in file dialog: a list of folders and files, and a field for a name or path."""

import os
from contextlib import suppress
from pathlib import Path

from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.files.names import suffix_replaced
from faceposer.gui.widgets.basic import WidgetRects, tooltip
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import ACCENT_DARK, FAINT, WARNING, Fonts, Icon, em

_MAX_ENTRIES = 5000


class PathBrowser:
    """A modal window with a list of folders and files, and a field for a name or path."""

    def __init__(self, request: FileRequest) -> None:
        """Start in the folder of ``request``."""
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
            names = sorted(os.scandir(folder), key=lambda entry: entry.name.lower())[:_MAX_ENTRIES]
        except OSError as error:
            self.message = f"The folder '{folder}' cannot be read: {error.strerror}."
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
        """Return the typed path if it is valid; otherwise open it if it is a folder, or set ``message``.

        Args:
            confirmed: A file whose replacement the user has confirmed.
        """
        if self.request.purpose == "folder":
            return self._accept_folder()
        if not self.name.strip():
            self.message = "Enter a name."
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
            self.message = f"The file '{path}' does not exist."
            return None
        if not path.parent.is_dir():
            self.message = f"The folder '{path.parent}' does not exist."
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

    def _accept_new_folder(self, path: Path) -> Path | None:
        try:
            if not path.exists() or (path.is_dir() and not any(path.iterdir())):
                return path
            self.message = f"'{path.name}' already exists and is not an empty folder; enter another name."
        except OSError as error:
            self.message = f"'{path}' cannot be read: {error.strerror}."
        return None

    def _accept_folder(self) -> Path | None:
        path = self.folder / Path(self.name.strip()).expanduser()
        if path.is_dir():
            return path
        self.message = f"The folder '{path}' does not exist."
        return None

    def advice(self) -> tuple[str, bool]:
        """Return the text below the name, and True if it is a warning."""
        if self.message:
            return self.message, True
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
        return f"Name or path ({', '.join(request.suffixes)})", False

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
        """Draw the folders and files; return the double-clicked file, if any."""
        chosen = None
        foot = 2.0 * imgui.get_frame_height_with_spacing() + imgui.get_text_line_height_with_spacing() + em(0.6)
        imgui.push_style_color(imgui.Col_.child_bg, (0.0, 0.0, 0.0, 0.25))
        imgui.begin_child("##list", (0.0, -foot), imgui.ChildFlags_.always_use_window_padding.value)
        if not self._entries:
            imgui.text_disabled(f"No folders or {self.request.kind.lower()} in this folder.")
        folders_only = self.request.purpose == "folder"
        for is_folder, name in list(self._entries):
            imgui.text_colored(FAINT, Icon.FOLDER if is_folder else Icon.FILE)
            imgui.same_line(em(2.4))
            # When a folder is requested, files only show its content.
            imgui.begin_disabled(folders_only and not is_folder)
            label = shortened(name, imgui.get_content_region_avail().x)
            flags = imgui.SelectableFlags_.allow_double_click.value
            imgui.selectable(f"{label}##{name}", name == self.name, flags)
            imgui.end_disabled()
            if label != name:
                tooltip(name)
            rects.record(f"files:{name}")
            if imgui.is_item_hovered() and imgui.is_mouse_clicked(0):
                double_clicked = imgui.is_mouse_double_clicked(0)
                if is_folder:
                    self.name = name if folders_only and not double_clicked else "" if folders_only else self.name
                    if double_clicked:
                        self._enter(self.folder / name)
                else:
                    self.name = name
                    chosen = self.accept() if double_clicked else None
        imgui.end_child()
        imgui.pop_style_color()
        return chosen

    def _draw_footer(self, rects: WidgetRects, appearing: bool) -> Path | None:
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
