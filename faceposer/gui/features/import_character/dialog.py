"""Dialog that imports a custom character: the form, the progress and the summary."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.files import paths
from faceposer.geometry.mesh_io import MESH_SUFFIXES
from faceposer.gui.features.import_character.advanced import draw_advanced
from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.features.import_character.summary import draw_summary
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.basic import caption, choice, text_field
from faceposer.gui.widgets.file_request import FileRequest, Purpose
from faceposer.gui.widgets.modal import (
    draw_job,
    modal,
    modal_body,
    modal_buttons,
    modal_entered,
    modal_escaped,
    modal_room,
    modal_title,
)
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import BAD, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects

if TYPE_CHECKING:
    from faceposer.gui.features.import_character.state import ImportState
    from faceposer.training.kinds import Kind

_WIDTH, _LABEL = 44.0, 8.4
# Height of the form when all of it is shown.
_TALLEST = 41.0
# Height below which no room is reserved for errors.
_LOW = 14.0
_FORM_BUTTONS = (("start", "Import"), ("cancel", "Cancel"))
_SUMMARY_BUTTONS = (("open", "Open"), ("close", "Close"))
# Largest number of rows for one kind of source: map, scan, regions and their number.
_MOST_FIELDS = 4
_KINDS: tuple["Kind", ...] = ("rig", "examples", "markers")
_KIND_LABELS = ("Rig", "Examples", "Markers")
_KIND_TIPS = (
    "A glTF file (.glb, .gltf, .vrm) or a folder with one mesh per ARKit shape",
    "A folder or an .npz file of meshes with the same topology, one of them neutral",
    "The motion of markers on a performer's face (.c3d, .csv, .trc), and a map of their places on a scan",
)
_KIND_DESCRIPTIONS = (
    "A face with ARKit shapes: .glb, .gltf, .vrm, or a folder with one mesh per shape. Mesh and names are kept.",
    "Meshes of one face in different expressions: a folder or an .npz file. The modes of the character are learned "
    "from their differences.",
    "Motion of markers on a face: .c3d, .csv or .trc. The markers deform a scan, from which the character is learned.",
)
_REGIONS = ("face", "whole", "parts")
_REGION_LABELS = ("Parts of the face", "Whole face", "By motion")
_REGION_TIPS = (
    "Brows, eyes and mouth move independently.",
    "The whole face is one region, as in Lau et al. (2009).",
    "Vertices that move together in the examples form a region.",
)
# Names and suffixes of the files that a field accepts.
_MESHES = ("Meshes", MESH_SUFFIXES)
_SOURCES = {
    "rig": ("Rigs", (".glb", ".gltf", ".vrm")),
    "examples": ("Arrays of meshes", (".npz",)),
    "markers": ("Motion of markers", (".c3d", ".csv", ".trc")),
}


class ImportDialog:
    """Pages of the dialog."""

    def __init__(self, importing: "ImportState") -> None:
        """Show the state of ``importing``."""
        self._importing = importing

    def draw(self, draw_above: Callable[[], None]) -> None:
        """Draw the current page; ``draw_above`` draws the dialogs above it."""
        importing = self._importing
        with modal("##import", _WIDTH, _TALLEST) as shown:
            if not shown:
                draw_above()
                return
            # A dialog of the system receives the keys.
            has_keys = not importing.context.file_dialogs.open
            draw_page = {"form": self._draw_form, "running": self._draw_progress, "summary": self._draw_summary}
            draw_page[importing.page](importing, has_keys)
            if not importing.open:
                imgui.close_current_popup()
            draw_above()

    # Form

    def _draw_form(self, importing: "ImportState", has_keys: bool) -> None:
        form, rects = importing.form, importing.context.widget_rects
        modal_title(importing.context.fonts, "Import character")
        # Room for an error of two lines is reserved, so that nothing jumps when it appears, unless the window is low.
        wrap = imgui.get_content_region_avail().x - em(2.2)
        lines = 2.0 if modal_room() > _LOW else 0.0
        height = imgui.calc_text_size(displayed(importing.error), wrap_width=wrap).y if importing.error else 0.0
        reserved = max(height, lines * imgui.get_text_line_height()) + em(0.1) + imgui.get_style().item_spacing.y
        with modal_body(_FORM_BUTTONS, below=reserved):
            self._draw_entries(importing)
        below = imgui.get_cursor_pos_y() + reserved
        if importing.error:
            _draw_error(importing.error)
        imgui.set_cursor_pos_y(below)
        reason = form.missing
        tips = {"start": reason or "Learn the character and write its file"}
        pressed = modal_buttons(rects, "import", _FORM_BUTTONS, disabled=("start",) if reason else (), tips=tips)
        if has_keys and modal_escaped():
            pressed = "cancel"
        elif has_keys and modal_entered() and not reason:
            pressed = "start"
        if pressed == "cancel":
            importing.close_dialog()
        elif pressed == "start":
            importing.start()

    def _draw_entries(self, importing: "ImportState") -> None:
        """Draw the fields of the form."""
        form, rects = importing.form, importing.context.widget_rects
        self._draw_source(importing)
        kind = _KINDS.index(form.kind)
        row_label("Kind", "What the source consists of", _LABEL)
        form.kind = _KINDS[choice(rects, "import:kind", _KIND_LABELS, kind, _KIND_TIPS)]
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + em(_LABEL))
        # Reserve two lines for all kinds.
        below = imgui.get_cursor_pos_y() + 2.0 * imgui.get_text_line_height() + imgui.get_style().item_spacing.y
        caption(_KIND_DESCRIPTIONS[_KINDS.index(form.kind)])
        imgui.set_cursor_pos_y(max(imgui.get_cursor_pos_y(), below))
        self._draw_fields_of_kind(importing)
        form.title = _text_row(rects, "title", "Title", form.title, "Title of the character in the window")
        tip = "Character file to write; without a folder it is saved in the library of characters"
        form.output = _path_row(
            importing, "output", "Save as", form.output, tip, ("Characters", (".npz",)), purpose="save"
        )
        opened = imgui.tree_node_ex("Advanced", imgui.TreeNodeFlags_.span_avail_width.value)
        rects.record("import:advanced")
        if opened:
            draw_advanced(rects, form, _LABEL)
            imgui.tree_pop()

    def _draw_fields_of_kind(self, importing: "ImportState") -> None:
        """Draw the fields of the chosen kind of source."""
        form, rects = importing.form, importing.context.widget_rects
        # The height is the same for all kinds, so that nothing jumps when another one is chosen.
        top, reserved = imgui.get_cursor_pos_y(), _MOST_FIELDS * imgui.get_frame_height_with_spacing()
        if form.kind == "rig":
            self._draw_captures(importing)
        if form.kind == "markers":
            tip = "JSON file that maps each marker to a place on the scan (docs/training.md)"
            form.marker_map = _path_row(importing, "marker_map", "Map", form.marker_map, tip, ("Maps", (".json",)))
            tip = "Face that the markers deform: a mesh, a character file or the name of a character"
            form.scan = _path_row(importing, "scan", "Scan", form.scan, tip, ("Scans", (*MESH_SUFFIXES, ".npz")))
        if form.accepts_neutral:
            tip = "Mesh of the neutral face; needed if no file is named neutral, rest or base"
            form.neutral = _path_row(importing, "neutral", "Neutral", form.neutral, tip, _MESHES, "Detected by name")
        if form.kind != "rig":
            self._draw_regions(rects, form)
        imgui.dummy((0.0, max(top + reserved - imgui.get_cursor_pos_y(), 0.0) + em(0.1)))

    def _draw_source(self, importing: "ImportState") -> None:
        tip = "File or folder to learn the character from. It can also be dropped onto the window."
        every = tuple(suffix for _, suffixes in _SOURCES.values() for suffix in suffixes)
        if imgui.is_window_appearing() and not importing.form.source:
            imgui.set_keyboard_focus_here()
        source = _path_row(
            importing,
            "source",
            "Source",
            importing.form.source,
            tip,
            ("Sources of characters", every),
            "File or folder",
            folder=True,
            done=importing.set_source,
        )
        importing.set_source(source)

    def _draw_captures(self, importing: "ImportState") -> None:
        """Draw the performances, each with a button that removes it, and a button that adds one."""
        tip = "Recordings of ARKit weights by Live Link Face or Face Cap, to learn the prior from"
        form, rects = importing.form, importing.context.widget_rects

        def add(path: Path) -> None:
            if str(path) not in form.captures:
                form.captures.append(str(path))

        row_label("Performances", tip, _LABEL)
        for i, path in enumerate(list(form.captures)):
            if i:
                row_label("", width=_LABEL)
            if imgui.button(f"{Icon.CLOSE}##capture{i}", (em(1.9), 0.0)):
                form.captures.remove(path)
            rects.record(f"import:capture:{i}:remove")
            tooltip("Remove this performance")
            imgui.same_line()
            imgui.text_unformatted(displayed(Path(path).name))
            tooltip(path)
        if form.captures:
            row_label("", width=_LABEL)
        if imgui.button("Add..."):
            from faceposer.training.recordings import WEIGHTS

            importing.context.ask_for_file(
                FileRequest(
                    "open",
                    "Add performance",
                    "Performances",
                    WEIGHTS,
                    _start_folder(importing, form.source),
                    add,
                )
            )
        rects.record("import:capture:add")
        tooltip(tip)
        if not form.captures:
            imgui.same_line()
            caption("None: use the built-in prior of natural expressions")

    def _draw_regions(self, rects: WidgetRects, form: ImportForm) -> None:
        row_label("Regions", "Parts of the face that move independently", _LABEL)
        chosen = choice(rects, "import:regions", _REGION_LABELS, _REGIONS.index(form.regions), _REGION_TIPS)
        form.regions = _REGIONS[chosen]  # type: ignore[assignment]
        if form.regions == "parts":
            row_label("", width=_LABEL)
            imgui.set_next_item_width(-1.0)
            _, form.n_parts = imgui.slider_int(
                "##parts", form.n_parts, 2, 12, "%d regions", imgui.SliderFlags_.always_clamp.value
            )
            rects.record("import:parts")

    # Progress

    def _draw_progress(self, importing: "ImportState", _has_keys: bool) -> None:
        training, context = importing.training, importing.context
        assert training is not None
        stage = "Stopping..." if training.cancelled else f"{training.stage}..."
        text = f"{stage} Many meshes take minutes. The file is written when the import is complete."
        title = f"Importing {importing.output.stem}"
        draw_job(context.fonts, context.widget_rects, "import", title, training, text, escapes=False)

    # Summary

    def _draw_summary(self, importing: "ImportState", has_keys: bool) -> None:
        assert importing.about is not None
        with modal_body(_SUMMARY_BUTTONS):
            draw_summary(importing.context.fonts, importing.context.widget_rects, importing.about)
        pressed = modal_buttons(importing.context.widget_rects, "import", _SUMMARY_BUTTONS)
        if has_keys and modal_entered():
            pressed = "open"
        if has_keys and modal_escaped():
            pressed = "close"
        if pressed == "open":
            importing.open_learned()
        elif pressed == "close":
            importing.close_dialog()


def _text_row(rects: WidgetRects, key: str, label: str, value: str, tip: str) -> str:
    row_label(label, tip, _LABEL)
    imgui.set_next_item_width(-1.0)
    _, value = text_field(f"##{key}", value, flags=imgui.InputTextFlags_.auto_select_all.value)
    rects.record(f"import:{key}")
    tooltip(tip)
    return value


def _path_row(
    importing: "ImportState",
    key: str,
    label: str,
    value: str,
    tip: str,
    files: tuple[str, tuple[str, ...]],
    hint: str = "",
    purpose: Purpose = "open",
    folder: bool = False,
    done: Callable[[str], None] | None = None,
) -> str:
    """Draw a field for a path, with a button that chooses a file and, with ``folder``, one that chooses a folder.

    Return the text of the field. A chosen path is passed to ``done``, or else stored in the form's field ``key``.
    """
    form = importing.form

    def store(path: Path) -> None:
        if done is None:
            setattr(form, key, str(path))
        else:
            done(str(path))

    row_label(label, tip, _LABEL)
    side, gap = em(2.2), imgui.get_style().item_inner_spacing.x
    count = 1 + folder
    imgui.set_next_item_width(-(count * (side + gap)))
    _, value = text_field(f"##{key}", value, hint, imgui.InputTextFlags_.auto_select_all.value)
    importing.context.widget_rects.record(f"import:{key}")
    tooltip(f"{tip}\n{value}" if value else tip)
    imgui.same_line(0.0, gap)
    if imgui.button(f"{Icon.FILE}##{key}", (side, 0.0)):
        importing.context.ask_for_file(
            FileRequest(purpose, label, *files, _start_folder(importing, value or form.source, purpose), store)
        )
    importing.context.widget_rects.record(f"import:{key}:file")
    tooltip("Choose a file" if purpose == "open" else "Choose where to save the file")
    if folder:
        imgui.same_line(0.0, gap)
        if imgui.button(f"{Icon.FOLDER}##{key}", (side, 0.0)):
            start = _start_folder(importing, value)
            importing.context.ask_for_file(FileRequest("folder", label, *files, start, store))
        importing.context.widget_rects.record(f"import:{key}:folder")
        tooltip("Choose a folder")
    return value


def _start_folder(importing: "ImportState", near: str, purpose: Purpose = "open") -> Path:
    """Return the path at which a file dialog opens: that of the field, or the last folder."""
    path = paths.expand_user(near.strip()) if near.strip() else None
    if path is not None and paths.can_enter(path.parent):
        return path if purpose == "save" else path.parent
    return last_folder(importing.context.settings)


def _draw_error(text: str) -> None:
    imgui.dummy((0.0, em(0.1)))
    imgui.text_colored(BAD, Icon.WARNING)
    imgui.same_line()
    imgui.push_text_wrap_pos(0.0)
    imgui.push_style_color(imgui.Col_.text, BAD)
    imgui.text_unformatted(displayed(text))
    imgui.pop_style_color()
    imgui.pop_text_wrap_pos()
