"""The dialog that carries the pose to another character: to whom, by which way, which distances, and how it looks."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui
from numpy.typing import NDArray

from faceposer.geometry.camera import OrbitView
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.basic import caption, choice, tooltip
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.modal import modal, modal_title
from faceposer.gui.widgets.theme import ACCENT_DARK, BAD, FAINT, INK, Icon, em
from faceposer.model.face_model import FaceModel
from faceposer.render.scene import Scene
from faceposer.transfer.pairs import PRESETS

if TYPE_CHECKING:
    from faceposer.gui.features.transfer.feature import TransferFeature

_FORM, _PICTURE, _LABEL, _LIST, _NUMBER = 29.0, 12.6, 4.6, 14.5, 4.2
_METHODS = ("distances", "weights")
_METHOD_LABELS = ("By distances", "By weights")
_METHOD_TIPS = (
    "Keeps distances between points of the face, each within what the character can do. Works between any two faces.",
    "Gives the same weights to ARKit's shapes, where both characters have them.",
)
_PRESETS = (
    ("full", "All", "All distances that the program knows"),
    ("paper", "Three", "Heights of mouth and eyes alone"),
)
_SAMPLES = 4


class TransferDialog:
    """Draws the dialog."""

    def __init__(self, state: "TransferFeature") -> None:
        """Show and change ``state``."""
        self._state = state
        self._lists = self._listing = False

    def draw(self) -> None:
        """Draw the dialog."""
        context = self._state.context
        with modal("##transfer", _FORM + _PICTURE + 3.8) as shown:
            if not shown:
                return
            fresh = imgui.is_window_appearing()
            modal_title(context.fonts, "Transfer expression")
            # Pictures beside the form, or below it where the window is too narrow.
            room = imgui.get_content_region_avail().x
            beside = room >= em(_FORM + _PICTURE + 1.0)
            width = em(_FORM) if beside else room
            imgui.begin_child("##form", (width, 0.0), imgui.ChildFlags_.auto_resize_y.value)
            self._draw_form()
            imgui.end_child()
            if beside:
                imgui.same_line(0.0, em(1.0))
            imgui.begin_child("##pictures", (em(_PICTURE), 0.0), imgui.ChildFlags_.auto_resize_y.value)
            self._draw_pictures()
            imgui.end_child()
            self._draw_foot(fresh)
            if not self._state.open:
                imgui.close_current_popup()

    # Choices

    def _draw_form(self) -> None:
        state = self._state
        context, marks = state.context, state.context.widget_rects
        _label("To")
        imgui.set_next_item_width(-em(2.8))
        titles = dict(state.characters)
        opened = imgui.begin_combo("##to", titles.get(state.to, Path(state.to).stem))
        marks.record("transfer:to")
        self._lists = opened
        if opened:
            for name, title in state.characters:
                if imgui.selectable(f"{title}##{name}", name == state.to)[0]:
                    state.to = name
                marks.record(f"transfer:to:{name}")
            imgui.end_combo()
        else:
            tooltip("The character that gets the expression")
        imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        if imgui.button(f"{Icon.FILE}##to", (-1.0, 0.0)):
            folder = last_folder(context.settings)
            context.ask_for_file(FileRequest("open", "A character", "Characters", (".npz",), folder, state.choose_file))
        marks.record("transfer:to:file")
        tooltip("Choose the file of a character")
        _label("Method")
        chosen = choice(marks, "transfer:method", _METHOD_LABELS, _METHODS.index(state.method), _METHOD_TIPS)
        state.method = "distances" if chosen == 0 else "weights"
        imgui.dummy((0.0, em(0.2)))
        if state.method == "distances":
            self._draw_list()
        else:
            caption("Each of ARKit's shapes gets the weight that it has here, within the limits of both characters.")
        if state.error:
            imgui.push_style_color(imgui.Col_.text, ImVec4(*BAD))
            imgui.text_wrapped(f"{Icon.WARNING}  {state.error}")
            imgui.pop_style_color()

    def _draw_list(self) -> None:
        state = self._state
        context, marks = state.context, state.context.widget_rects
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted("Distances")
        tooltip("In the unit of each mesh, from one feature point to another")
        for preset, label, tip in _PRESETS:
            imgui.same_line()
            if imgui.button(f"{label}##preset"):
                state.pairs = PRESETS[preset]
            marks.record(f"transfer:preset:{preset}")
            tooltip(tip)
        for name, label, tip in (("load", "Load...", "Read a list from a file"), ("save", "Save...", "Write the list")):
            imgui.same_line()
            if imgui.button(label):
                self._ask(name)
            marks.record(f"transfer:{name}")
            tooltip(tip)
        flags = (
            imgui.TableFlags_.scroll_y
            | imgui.TableFlags_.row_bg
            | imgui.TableFlags_.borders_outer
            | imgui.TableFlags_.sizing_fixed_fit
        )
        if imgui.begin_table("##pairs", 4, flags, (-1.0, em(_LIST))):
            imgui.table_setup_scroll_freeze(0, 1)
            imgui.table_setup_column("between", imgui.TableColumnFlags_.width_stretch.value)
            imgui.table_setup_column("here", imgui.TableColumnFlags_.width_fixed.value, em(_NUMBER))
            imgui.table_setup_column("there", imgui.TableColumnFlags_.width_fixed.value, em(_NUMBER))
            imgui.table_setup_column("", imgui.TableColumnFlags_.width_fixed.value, em(1.6))
            imgui.table_headers_row()
            for index in range(len(state.pairs)):
                if index < len(state.pairs):
                    self._draw_pair(index)
            imgui.end_table()
        self._draw_add()
        if context.session.model.character.feature_points:
            on = sum(pair.enabled for pair in state.pairs)
            caption(f"{on} of {len(state.pairs)} are kept; lengths in the unit of each mesh")

    def _draw_pair(self, index: int) -> None:
        state = self._state
        marks, pair = state.context.widget_rects, state.pairs[index]
        imgui.push_id(index)
        imgui.table_next_row()
        imgui.table_next_column()
        changed, on = imgui.checkbox(pair.name, pair.enabled)
        marks.record(f"transfer:pair:{index}")
        if changed:
            state.enable(index, on)
        tooltip(f"{self._title(pair.first)}  -  {self._title(pair.second)}")
        for lengths in state.lengths:
            imgui.table_next_column()
            length = lengths[index] if index < len(lengths) else None
            text = "-" if length is None else f"{length:.2f}"
            room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
            imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
            imgui.align_text_to_frame_padding()
            imgui.text_colored(ImVec4(*(INK if pair.enabled else FAINT)), text)
        imgui.table_next_column()
        if imgui.small_button(Icon.CLOSE):
            state.remove(index)
        marks.record(f"transfer:pair:{index}:remove")
        tooltip("Take it out of the list")
        imgui.pop_id()

    def _draw_add(self) -> None:
        """Draw the choice of two feature points, and the button that adds their distance."""
        state = self._state
        marks, points = state.context.widget_rects, state.context.session.model.character.feature_points
        if not points:
            return
        gap, button = imgui.get_style().item_inner_spacing.x, em(4.0)
        width = (imgui.get_content_region_avail().x - button - 2.0 * gap) / 2.0
        for end in range(2):
            imgui.set_next_item_width(width)
            opened = imgui.begin_combo(f"##end{end}", self._title(state.added[end]))
            marks.record(f"transfer:end:{end}")
            self._lists |= opened
            if opened:
                for name in points:
                    if imgui.selectable(f"{self._title(name)}##{name}", name == state.added[end])[0]:
                        state.added[end] = name
                    marks.record(f"transfer:end:{end}:{name}")
                imgui.end_combo()
            imgui.same_line(0.0, gap)
        imgui.begin_disabled(state.added[0] == state.added[1])
        if imgui.button("Add", (button, 0.0)):
            state.add()
        imgui.end_disabled()
        marks.record("transfer:add")
        tooltip("Keep the distance between these two points too")

    def _title(self, point: str) -> str:
        """Return what people call the feature point ``point``."""
        return self._state.context.session.model.character.feature_titles.get(point, point)

    def _ask(self, what: str) -> None:
        state = self._state
        folder = last_folder(state.context.settings)
        if what == "load":
            request = FileRequest("open", "A list of pairs", "Lists of pairs", (".json",), folder, state.load_pairs)
        else:
            place = folder / "pairs.json"
            request = FileRequest("save", "Save the pairs", "Lists of pairs", (".json",), place, state.save_pairs)
        state.context.ask_for_file(request)

    # Pictures

    def _draw_pictures(self) -> None:
        state = self._state
        session = state.context.session
        source, target = state.scenes
        self._draw_picture("source", source, session.model, session.coefficients)
        imgui.dummy((0.0, em(0.1)))
        if state.target is not None and state.result is not None:
            self._draw_picture("target", target, state.target, state.result)
        else:
            imgui.dummy((em(_PICTURE), em(_PICTURE)))

    def _draw_picture(self, name: str, scene: Scene, model: FaceModel, pose: NDArray[np.float64]) -> None:
        context, side = self._state.context, em(_PICTURE)
        pixels = max(round(side * context.pixel_ratio), 1)
        scene.set_model(model)
        scene.set_pose(pose, context.session.document.contact)
        scene.expression_lines = context.settings.expression_lines
        texture = scene.draw(portrait(model).camera((pixels, pixels)), context.shading, False, _SAMPLES)
        imgui.image(imgui.ImTextureRef(texture.glo), ImVec2(side, side), ImVec2(0.0, 1.0), ImVec2(1.0, 0.0))
        context.widget_rects.record(f"transfer:picture:{name}")
        tooltip(model.character.title)

    def _draw_foot(self, fresh: bool) -> None:
        state = self._state
        marks = state.context.widget_rects
        width, gap = em(7), imgui.get_style().item_spacing.x
        imgui.dummy((0.0, em(0.3)))
        room = imgui.get_content_region_avail().x - 2.0 * width - gap
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
        imgui.begin_disabled(state.result is None)
        imgui.push_style_color(imgui.Col_.button, ACCENT_DARK)
        accepted = imgui.button("Open", (width, 0.0))
        imgui.pop_style_color()
        imgui.end_disabled()
        marks.record("transfer:open")
        tooltip("Edit it as a new pose")
        imgui.same_line()
        cancelled = imgui.button("Cancel", (width, 0.0))
        marks.record("transfer:cancel")
        # A list that was open in the last frame takes the key for itself.
        if not fresh and not self._listing:
            cancelled = cancelled or imgui.is_key_pressed(imgui.Key.escape, False)
            accepted = accepted or (state.result is not None and imgui.is_key_pressed(imgui.Key.enter, False))
        self._listing = self._lists
        if accepted:
            state.accept()
        elif cancelled:
            state.hide()


def portrait(model: FaceModel) -> OrbitView:
    """Return the front view that frames the face of ``model``, ears and neck aside."""
    character = model.character
    inner = [vertex for name, vertex in character.feature_points.items() if not name.startswith("10.")]
    face = character.vertices[inner] if inner else character.vertices
    return OrbitView.preset(face.min(axis=0), face.max(axis=0))


def _label(text: str) -> None:
    left = imgui.get_cursor_pos_x()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(text)
    imgui.same_line(left + em(_LABEL))
