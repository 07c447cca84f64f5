"""Dialog that adds the present pose as a key pose: its name, and its part in compositions."""

from collections.abc import Callable, Mapping

from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import caption, choice, text_field
from faceposer.gui.widgets.modal import modal, modal_body, modal_buttons, modal_escaped, modal_title
from faceposer.gui.widgets.sliders import row_label
from faceposer.poses.library import safe_stem
from faceposer.session.key_entries import checked_key_name
from faceposer.session.key_folder import EXPRESSION, VISEME

_WIDTH, _LABEL = 30.0, 5.0
_KINDS = (EXPRESSION, VISEME, "")
#: Titles of the kinds of key poses that an artist chooses from, in the order of the list.
KIND_TITLES = {EXPRESSION: "Emotional", VISEME: "Verbal", "": "Neither"}
_TIPS = (
    "Compose combines it with each verbal key pose",
    "Compose combines it with each emotional key pose",
    "It has no part in compositions",
)


class AddingDialog:
    """The dialog.

    Attributes:
        open: True while it is shown.
        name: Name of the key pose.
        kind: Its kind: "expression", "viseme" or "".
    """

    def __init__(self, context: EditorContext, add: Callable[[str, str, bool], object]) -> None:
        """Ask in the window of ``context``, then call ``add`` with name, kind, and True to replace the key pose."""
        self._context, self._add = context, add
        self.open = False
        self.name = ""
        self.kind = EXPRESSION
        self._taken: Mapping[str, str] = {}
        self._proposes = True
        self._problem = ""

    def show(self, taken: Mapping[str, str], proposes: bool) -> None:
        """Open the dialog.

        Args:
            taken: Titles of the present key poses by the names of their files.
            proposes: True if the target's pose is proposed; False for meshes without shapes, which are sculpted.
        """
        self._context.toolbox.finish()
        self._context.slider_edit.let_go()
        free = (f"Key pose {i}" for i in range(1, len(taken) + 2))
        self.name = next(name for name in free if safe_stem(name) not in taken)
        self.open, self._taken, self._proposes, self._problem = True, taken, proposes, ""
        self._context.redraw()

    @property
    def replaced(self) -> str | None:
        """Title of the key pose of this name, or None."""
        return self._taken.get(safe_stem(self.name.strip()))

    def draw(self) -> None:
        """Draw the dialog if it is open."""
        if not self.open:
            return
        with modal("##keys-add", _WIDTH) as shown:
            if shown:
                self._draw_content()

    def _draw_content(self) -> None:
        context, rects = self._context, self._context.widget_rects
        modal_title(context.fonts, "Add key pose")
        replaced = self.replaced
        buttons = (("accept", "Add" if replaced is None else "Replace"), ("cancel", "Cancel"))
        with modal_body(buttons):
            row_label("Name", width=_LABEL)
            if imgui.is_window_appearing():
                imgui.set_keyboard_focus_here()
            imgui.set_next_item_width(-1.0)
            flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
            entered, name = text_field("##name", self.name, flags=flags.value)
            rects.record("keys-add:name")
            if name != self.name:
                self.name, self._problem = name, ""
            row_label("Kind", "Its part in compositions", _LABEL)
            chosen = choice(rects, "keys-add:kind", tuple(KIND_TITLES.values()), _KINDS.index(self.kind), _TIPS)
            self.kind = _KINDS[chosen]
            # Two lines are always reserved, so that the dialog does not change its size.
            top = imgui.get_cursor_pos_y()
            text = "The target's pose is proposed, for you to edit."
            if not self._proposes:
                text = "Sculpt the target's mesh in another program."
            if replaced is not None:
                sides = "both its sides are" if self._proposes else "its source is"
                text = f"There is a key pose {replaced} already: {sides} replaced, which cannot be undone."
            caption(self._problem or text)
            imgui.set_cursor_pos_y(top + 2.0 * imgui.get_text_line_height_with_spacing())
            imgui.dummy((0.0, 0.0))
        pressed = modal_buttons(rects, "keys-add", buttons)
        if entered and not imgui.is_window_appearing():
            pressed = "accept"
        if modal_escaped():
            pressed = "cancel"
        if pressed == "accept":
            self._accept(replaced is not None)
        elif pressed:
            self.open = False
        if not self.open:
            imgui.close_current_popup()

    def _accept(self, replaces: bool) -> None:
        try:
            name = checked_key_name(self.name)
        except FacePoserError as error:
            self._problem = str(error)
            return
        self.open = False
        self._add(name, self.kind, replaces)
