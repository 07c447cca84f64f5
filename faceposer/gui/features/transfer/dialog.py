"""Dialog that transfers the pose to another character: target, method, distances and previews."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui
from numpy.typing import NDArray

from faceposer.geometry.camera import OrbitView
from faceposer.gui.features.transfer.keys_choice import draw_keys_choice
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.basic import caption, choice, wrapped_text
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.modal import modal, modal_body, modal_buttons, modal_entered, modal_escaped, modal_title
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.text import displayed, widget_id
from faceposer.gui.widgets.theme import BAD, FAINT, INK, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.model.face_model import FaceModel
from faceposer.render.scene import Scene
from faceposer.transfer.pairs import PRESETS
from faceposer.transfer.transfer import Method

if TYPE_CHECKING:
    from faceposer.gui.features.transfer.state import TransferState

_FORM, _PREVIEW, _LABEL, _LIST, _NUMBER = 29.0, 12.6, 5.2, 14.5, 4.2
_METHODS: tuple[Method, ...] = ("distances", "weights", "examples")
_METHOD_LABELS = ("By distances", "By weights", "By examples")
_METHOD_TIPS = (
    "Preserve distances between points of the face, within the range of the target. Works for any two characters.",
    "Copy the weights of ARKit shapes that both characters have.",
    "Follow pairs of key poses, which say what expressions look like on the target.",
)
_PRESETS = (
    ("full", "All", "Use all built-in distances"),
    ("paper", "Three", "Use only the heights of mouth and eyes"),
)
_SAMPLES = 4
_BUTTONS, _LEAST = (("open", "Transfer"), ("cancel", "Cancel")), 7.0


class TransferDialog:
    """Content of the dialog."""

    def __init__(self, state: "TransferState") -> None:
        """Show and change ``state``."""
        self._state = state

    def draw(self) -> None:
        """Draw the dialog."""
        context = self._state.context
        with modal("##transfer", _FORM + _PREVIEW + 3.8) as shown:
            if not shown:
                return
            modal_title(context.fonts, "Transfer expression")
            with modal_body(_BUTTONS, _LEAST):
                self._draw_body()
            self._draw_foot()
            if not self._state.open:
                imgui.close_current_popup()

    def _draw_body(self) -> None:
        # Previews are next to the form, or below it if the window is too narrow.
        room = imgui.get_content_region_avail().x
        fits = room >= em(_FORM + _PREVIEW + 1.0) - 2.0
        width = em(_FORM) if fits else room
        imgui.begin_child("##form", (width, 0.0), imgui.ChildFlags_.auto_resize_y.value)
        self._draw_form()
        imgui.end_child()
        if fits:
            imgui.same_line(0.0, em(1.0))
        imgui.begin_child("##pictures", (em(_PREVIEW), 0.0), imgui.ChildFlags_.auto_resize_y.value)
        self._draw_previews()
        imgui.end_child()

    # Choices

    def _draw_form(self) -> None:
        state = self._state
        context, marks = state.context, state.context.widget_rects
        row_label("Target", "Character to which the expression is transferred", _LABEL)
        imgui.set_next_item_width(-em(2.8))
        titles = dict(state.characters)
        opened = imgui.begin_combo("##to", displayed(titles.get(state.to, Path(state.to).stem)))
        marks.record("transfer:to")
        if opened:
            for name, title in state.characters:
                if imgui.selectable(f"{displayed(title)}##{widget_id(name)}", name == state.to)[0]:
                    state.choose_target(name)
                marks.record(f"transfer:to:{name}")
            imgui.end_combo()
        else:
            tooltip("Target character")
        imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        if imgui.button(f"{Icon.FILE}##to", (-1.0, 0.0)):
            folder = last_folder(context.settings)
            context.ask_for_file(
                FileRequest("open", "Choose character", "Characters", (".npz",), folder, state.choose_file)
            )
        marks.record("transfer:to:file")
        tooltip("Choose a character file")
        row_label("Method", "How the expression is transferred", _LABEL)
        chosen = choice(marks, "transfer:method", _METHOD_LABELS, _METHODS.index(state.method), _METHOD_TIPS)
        if _METHODS[chosen] != state.method:
            state.choose_method(_METHODS[chosen])
        imgui.dummy((0.0, em(0.2)))
        if state.method == "distances":
            self._draw_list()
        elif state.method == "examples":
            draw_keys_choice(state)
        else:
            caption("Each ARKit shape of the target gets the same weight, within the limits of both characters.")
        if state.error:
            imgui.push_style_color(imgui.Col_.text, ImVec4(*BAD))
            wrapped_text(f"{Icon.WARNING}  {state.error}")
            imgui.pop_style_color()

    def _draw_list(self) -> None:
        state = self._state
        context, marks = state.context, state.context.widget_rects
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted("Distances")
        tooltip("Distances between feature points, in the unit of each mesh")
        for preset, label, tip in _PRESETS:
            imgui.same_line()
            if imgui.button(f"{label}##preset"):
                state.pairs = PRESETS[preset]
            marks.record(f"transfer:preset:{preset}")
            tooltip(tip)
        for name, label, tip in (
            ("load", "Load...", "Load the list from a file"),
            ("save", "Save...", "Save the list"),
        ):
            imgui.same_line()
            if imgui.button(label):
                self._ask_for_pairs(name)
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
            imgui.table_setup_column("Distance", imgui.TableColumnFlags_.width_stretch.value)
            imgui.table_setup_column("Source", imgui.TableColumnFlags_.width_fixed.value, em(_NUMBER))
            imgui.table_setup_column("Target", imgui.TableColumnFlags_.width_fixed.value, em(_NUMBER))
            imgui.table_setup_column("", imgui.TableColumnFlags_.width_fixed.value, em(1.6))
            imgui.table_headers_row()
            for index in range(len(state.pairs)):
                if index < len(state.pairs):
                    self._draw_pair(index)
            imgui.end_table()
        self._draw_add()
        if context.session.model.character.feature_points:
            on = sum(pair.enabled for pair in state.pairs)
            caption(f"{on} of {len(state.pairs)} distances are preserved. Lengths are in the unit of each mesh.")

    def _draw_pair(self, index: int) -> None:
        state = self._state
        marks, pair = state.context.widget_rects, state.pairs[index]
        imgui.push_id(index)
        imgui.table_next_row()
        imgui.table_next_column()
        changed, on = imgui.checkbox(displayed(pair.name), pair.enabled)
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
        tooltip("Remove this distance from the list")
        imgui.pop_id()

    def _draw_add(self) -> None:
        """Draw two combo boxes of feature points, and the button that adds their distance."""
        state = self._state
        marks, points = state.context.widget_rects, state.context.session.model.character.feature_points
        if not points:
            return
        gap, button = imgui.get_style().item_inner_spacing.x, em(4.0)
        width = (imgui.get_content_region_avail().x - button - 2.0 * gap) / 2.0
        for end in range(2):
            imgui.set_next_item_width(width)
            opened = imgui.begin_combo(f"##end{end}", displayed(self._title(state.added[end])))
            marks.record(f"transfer:end:{end}")
            if opened:
                for name in points:
                    if imgui.selectable(f"{displayed(self._title(name))}##{widget_id(name)}", name == state.added[end])[
                        0
                    ]:
                        state.added[end] = name
                    marks.record(f"transfer:end:{end}:{name}")
                imgui.end_combo()
            imgui.same_line(0.0, gap)
        imgui.begin_disabled(state.added[0] == state.added[1])
        if imgui.button("Add", (button, 0.0)):
            state.add()
        imgui.end_disabled()
        marks.record("transfer:add")
        tooltip("Add the distance between these two points to the list")

    def _title(self, point: str) -> str:
        """Return the title of the feature point ``point``."""
        return self._state.context.session.model.character.feature_titles.get(point, point)

    def _ask_for_pairs(self, command: str) -> None:
        """Ask for the file of the list, to "load" or to "save"."""
        state = self._state
        folder = last_folder(state.context.settings)
        if command == "load":
            request = FileRequest("open", "Load list of pairs", "Lists of pairs", (".json",), folder, state.load_pairs)
        else:
            place = folder / "pairs.json"
            request = FileRequest("save", "Save list of pairs", "Lists of pairs", (".json",), place, state.save_pairs)
        state.context.ask_for_file(request)

    # Previews

    def _draw_previews(self) -> None:
        state = self._state
        session = state.context.session
        source, target = state.scenes
        self._draw_preview("source", source, session.model, session.coefficients)
        imgui.dummy((0.0, em(0.1)))
        if state.target is not None and state.result is not None:
            self._draw_preview("target", target, state.target, state.result)
        else:
            imgui.dummy((em(_PREVIEW), em(_PREVIEW)))

    def _draw_preview(self, name: str, scene: Scene, model: FaceModel, pose: NDArray[np.float64]) -> None:
        context, side = self._state.context, em(_PREVIEW)
        pixels = max(round(side * context.pixel_ratio), 1)
        scene.set_model(model)
        scene.set_pose(pose, context.session.document.contact)
        scene.expression_lines = context.settings.expression_lines
        texture = scene.draw(portrait(model).camera((pixels, pixels)), context.shading, False, _SAMPLES)
        imgui.image(imgui.ImTextureRef(texture.glo), ImVec2(side, side), ImVec2(0.0, 1.0), ImVec2(1.0, 0.0))
        context.widget_rects.record(f"transfer:picture:{name}")
        tooltip(model.character.title)

    def _draw_foot(self) -> None:
        state = self._state
        ready = state.result is not None
        tips = {"open": "Open the result as a new session"}
        disabled = () if ready else ("open",)
        pressed = modal_buttons(state.context.widget_rects, "transfer", _BUTTONS, 0, _LEAST, disabled, tips)
        if modal_escaped():
            pressed = "cancel"
        elif modal_entered() and ready:
            pressed = "open"
        if pressed == "open":
            state.accept()
        elif pressed:
            state.hide()


def portrait(model: FaceModel) -> OrbitView:
    """Return the front view that frames the face of ``model`` without ears and neck."""
    character = model.character
    inner = [vertex for name, vertex in character.feature_points.items() if not name.startswith("10.")]
    face = character.vertices[inner] if inner else character.vertices
    return OrbitView.preset(face.min(axis=0), face.max(axis=0))
