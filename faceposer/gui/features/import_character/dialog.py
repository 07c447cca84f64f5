"""Dialog that imports a custom character: the form, the progress and the summary."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.geometry.mesh_io import MESH_SUFFIXES
from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.features.import_character.summary import draw_summary
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.basic import WidgetRects, caption, choice, tooltip
from faceposer.gui.widgets.file_request import FileRequest, Purpose
from faceposer.gui.widgets.modal import draw_job, modal, modal_buttons, modal_title
from faceposer.gui.widgets.theme import BAD, Icon, em

if TYPE_CHECKING:
    from faceposer.gui.features.import_character.feature import ImportCharacterFeature
    from faceposer.training.kinds import Kind

_WIDTH, _LABEL = 44.0, 8.4
# Largest number of rows for one kind of source: map, scan, regions and their number.
_MOST_FIELDS = 4
_KINDS: tuple["Kind", ...] = ("rig", "examples", "markers")
_KIND_LABELS = ("Rig", "Examples", "Markers")
_KIND_TIPS = (
    "A glTF file (.glb, .gltf, .vrm) or a folder with one mesh per ARKit shape",
    "A folder or an .npz file of meshes with the same topology, one of them neutral",
    "The motion of markers on a performer's face (.c3d, .csv), and a map of their places on a scan",
)
_KIND_DESCRIPTIONS = (
    "A face with ARKit shapes: .glb, .gltf, .vrm, or a folder with one mesh per shape. It is imported unchanged.",
    "Meshes of one face in different expressions: a folder or an .npz file. The modes of the character are learned "
    "from their differences.",
    "Motion of markers on a face: .c3d or .csv. The markers deform a scan, from which the character is learned.",
)
_REGIONS = ("face", "whole", "parts")
_REGION_LABELS = ("Parts of the face", "Whole face", "By motion")
_REGION_TIPS = (
    "Brows, eyes and mouth move independently.",
    "The whole face is one region, as in Lau et al. (2009).",
    "Vertices that move together in the examples form a region.",
)
_NUMBERS = (
    ("dimensions", "Dimensions", 500, "Number of modes; 0 chooses it from the energy of the examples"),
    ("components", "Components", 500, "Number of factor analyzers of the prior; 0 chooses it from held-out data"),
    ("factors", "Factors", 500, "Number of factors of each analyzer; 0 chooses it from held-out data"),
)
# Names and suffixes of the files that a field accepts.
_MESHES = ("Meshes", MESH_SUFFIXES)
_SOURCES = {
    "rig": ("Rigs", (".glb", ".gltf", ".vrm")),
    "examples": ("Arrays of meshes", (".npz",)),
    "markers": ("Motion of markers", (".c3d", ".csv")),
}


class ImportDialog:
    """Pages of the dialog."""

    def __init__(self, importing: "ImportCharacterFeature") -> None:
        """Show the state of ``importing``."""
        self._importing = importing

    def draw(self, draw_above: Callable[[], None]) -> None:
        """Draw the current page; ``draw_above`` draws the dialogs above it."""
        importing = self._importing
        with modal("##import", _WIDTH, scrolls=False) as shown:
            if not shown:
                draw_above()
                return
            # A dialog above receives the keys.
            context = importing.context
            has_keys = not (context.dialogs.open or context.file_dialogs.open or imgui.is_window_appearing())
            draw_page = {"form": self._draw_form, "running": self._draw_progress, "summary": self._draw_summary}
            draw_page[importing.page](importing, has_keys)
            if not importing.open:
                imgui.close_current_popup()
            draw_above()

    # Form

    def _draw_form(self, importing: "ImportCharacterFeature", has_keys: bool) -> None:
        form, rects = importing.form, importing.context.widget_rects
        modal_title(importing.context.fonts, "Import character")
        error_height = 0.0
        if importing.error:
            # The warning icon in front of the text needs room.
            wrap = imgui.get_content_region_avail().x - em(2.2)
            text_height = imgui.calc_text_size(importing.error, wrap_width=wrap).y
            error_height = text_height + em(0.1) + 2.0 * imgui.get_style().item_spacing.y
        _begin_body(error_height)
        self._draw_source(importing)
        kind = _KINDS.index(form.kind)
        _label("Kind")
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
        opened = imgui.tree_node("Advanced")
        rects.record("import:advanced")
        if opened:
            self._draw_advanced(rects, form)
            imgui.tree_pop()
        imgui.end_child()
        if importing.error:
            _draw_error(importing.error)
        pressed = modal_buttons(rects, "import", (("start", "Import"), ("cancel", "Cancel")))
        typing = imgui.get_io().want_text_input
        if has_keys and imgui.is_key_pressed(imgui.Key.escape, False) and not typing:
            pressed = "cancel"
        if has_keys and _enter_pressed() and form.source.strip():
            pressed = "start"
        if pressed == "cancel":
            importing.close_dialog()
        elif pressed == "start":
            importing.start()

    def _draw_fields_of_kind(self, importing: "ImportCharacterFeature") -> None:
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

    def _draw_source(self, importing: "ImportCharacterFeature") -> None:
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
            ("Rigs, arrays and motions", every),
            "File or folder",
            folder=True,
            done=importing.set_source,
        )
        importing.set_source(source)

    def _draw_captures(self, importing: "ImportCharacterFeature") -> None:
        """Draw the performances, each with a button that removes it, and a button that adds one."""
        form, rects = importing.form, importing.context.widget_rects

        def add(path: Path) -> None:
            if str(path) not in form.captures:
                form.captures.append(str(path))

        _label("Performances")
        for i, path in enumerate(list(form.captures)):
            if i:
                _label("")
            if imgui.button(f"{Icon.CLOSE}##capture{i}", (em(1.9), 0.0)):
                form.captures.remove(path)
            rects.record(f"import:capture:{i}:remove")
            tooltip("Remove this performance")
            imgui.same_line()
            imgui.text_unformatted(Path(path).name)
            tooltip(path)
        if form.captures:
            _label("")
        if imgui.button("Add..."):
            importing.context.ask_for_file(
                FileRequest(
                    "open",
                    "Add performance",
                    "Performances",
                    (".csv", ".txt"),
                    _start_folder(importing, form.source),
                    add,
                )
            )
        rects.record("import:capture:add")
        tooltip("Recordings of ARKit weights by Live Link Face or Face Cap, to learn the prior from")
        if not form.captures:
            imgui.same_line()
            caption("None: use the built-in prior of natural expressions")

    def _draw_regions(self, rects: WidgetRects, form: ImportForm) -> None:
        _label("Regions")
        chosen = choice(rects, "import:regions", _REGION_LABELS, _REGIONS.index(form.regions), _REGION_TIPS)
        form.regions = _REGIONS[chosen]  # type: ignore[assignment]
        if form.regions == "parts":
            _label("")
            imgui.set_next_item_width(-1.0)
            _, form.n_parts = imgui.slider_int(
                "##parts", form.n_parts, 2, 12, "%d regions", imgui.SliderFlags_.always_clamp.value
            )
            rects.record("import:parts")

    def _draw_advanced(self, rects: WidgetRects, form: ImportForm) -> None:
        for key, label, most, tip in _NUMBERS:
            if key == "dimensions" and form.kind == "rig":
                continue
            value = getattr(form, key)
            _label(label, em(_LABEL) - imgui.get_style().indent_spacing)
            imgui.set_next_item_width(em(8))
            _, value = imgui.input_int(f"##{key}", value)
            rects.record(f"import:{key}")
            tooltip(tip)
            setattr(form, key, min(max(value, 0), most))
            if not value:
                imgui.same_line()
                imgui.text_disabled("Chosen from the data")
        _label("Credits", em(_LABEL) - imgui.get_style().indent_spacing)
        imgui.set_next_item_width(-1.0)
        _, form.credits = imgui.input_text_with_hint("##credits", "Origin and licence", form.credits)
        rects.record("import:credits")

    # Progress

    def _draw_progress(self, importing: "ImportCharacterFeature", _has_keys: bool) -> None:
        training, context = importing.training, importing.context
        assert training is not None
        stage = "Stopping..." if training.cancelled else f"{training.stage}..."
        text = f"{stage} Many meshes take minutes. The file is written when the import is complete."
        title = f"Importing {importing.output.stem}"
        draw_job(context.fonts, context.widget_rects, "import", title, training, text, escapes=False)

    # Summary

    def _draw_summary(self, importing: "ImportCharacterFeature", has_keys: bool) -> None:
        assert importing.about is not None
        _begin_body()
        draw_summary(importing.context.fonts, importing.context.widget_rects, importing.about)
        imgui.end_child()
        pressed = modal_buttons(importing.context.widget_rects, "import", (("open", "Open"), ("close", "Close")))
        if has_keys and _enter_pressed():
            pressed = "open"
        if has_keys and imgui.is_key_pressed(imgui.Key.escape, False):
            pressed = "close"
        if pressed == "open":
            importing.open_learned()
        elif pressed == "close":
            importing.close_dialog()


def _begin_body(below: float = 0.0) -> None:
    """Begin a child window that scrolls if it does not fit above the buttons and ``below`` pixels more."""
    foot = imgui.get_frame_height() + em(0.3) + 3.0 * imgui.get_style().item_spacing.y + below
    # Dear ImGui does not let an auto-sized window grow beyond this height.
    room = imgui.get_main_viewport().work_size.y - 2.0 * imgui.get_style().display_safe_area_padding.y
    height = room - imgui.get_cursor_pos_y() - foot - em(1.25)
    width = imgui.get_content_region_avail().x
    imgui.set_next_window_size_constraints((width, em(3)), (width, max(height, em(3))))
    imgui.begin_child("##body", (width, 0.0), imgui.ChildFlags_.auto_resize_y.value)


def _label(text: str, width: float | None = None) -> None:
    left = imgui.get_cursor_pos_x()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(text)
    imgui.same_line(left + (em(_LABEL) if width is None else width))


def _text_row(rects: WidgetRects, key: str, label: str, value: str, tip: str) -> str:
    _label(label)
    imgui.set_next_item_width(-1.0)
    _, value = imgui.input_text(f"##{key}", value, imgui.InputTextFlags_.auto_select_all.value)
    rects.record(f"import:{key}")
    tooltip(tip)
    return value


def _path_row(
    importing: "ImportCharacterFeature",
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

    _label(label)
    side, gap = em(2.2), imgui.get_style().item_inner_spacing.x
    count = 1 + folder
    imgui.set_next_item_width(-(count * (side + gap)))
    _, value = imgui.input_text_with_hint(f"##{key}", hint, value, imgui.InputTextFlags_.auto_select_all.value)
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


def _start_folder(importing: "ImportCharacterFeature", near: str, purpose: Purpose = "open") -> Path:
    """Return the path at which a file dialog opens: that of the field, or the last folder."""
    path = Path(near.strip()).expanduser() if near.strip() else None
    if path is not None and path.parent.is_dir():
        return path if purpose == "save" else path.parent
    return last_folder(importing.context.settings)


def _draw_error(text: str) -> None:
    imgui.dummy((0.0, em(0.1)))
    imgui.text_colored(BAD, Icon.WARNING)
    imgui.same_line()
    imgui.push_text_wrap_pos(0.0)
    imgui.push_style_color(imgui.Col_.text, BAD)
    imgui.text_unformatted(text)
    imgui.pop_style_color()
    imgui.pop_text_wrap_pos()


def _enter_pressed() -> bool:
    return imgui.is_key_pressed(imgui.Key.enter, False) or imgui.is_key_pressed(imgui.Key.keypad_enter, False)
