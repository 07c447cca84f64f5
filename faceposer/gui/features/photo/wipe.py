"""A line over the view that divides photo and face, dragged with the pointer or moved by keys."""

from imgui_bundle import ImVec2, imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import EDGE, INK, u32
from faceposer.tools.tool import PointerEvent

# Distance within which the pointer takes the line, and radius of its handle, in pixels at normal density.
_REACH, _HANDLE = 4.0, 6.0
# Step of the keys, as a share of the width of the view, and stride of the vertices that are looked for in the view.
_STEP, _STRIDE = 0.02, 7
_FLAGS = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_scroll_with_mouse
    | imgui.WindowFlags_.no_background
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
)


class Wipe:
    """The line: on its left the view shows the photo, on its right the face.

    Attributes:
        on: True if the user has switched it on.
        share: Where it is, as a share of the width of the view.
        shown: True if the view shows it: it needs a photo, seen through its camera.
        hovered: True if the pointer is on it, or drags it.
    """

    def __init__(self, context: EditorContext) -> None:
        """Divide the view of ``context``."""
        self._context = context
        self.reset()

    def reset(self) -> None:
        """Switch it off and move it to the middle, such as for another session."""
        self.on = self.shown = self.hovered = False
        self.share = 0.5

    def toggle(self) -> None:
        """Switch it on or off; where it would not cross the face, it moves there."""
        self.on = not self.on
        viewport = self._context.viewport
        across = viewport.camera.project(self._context.scene.vertices[::_STRIDE])[:, 0] / viewport.size[0]
        low, high = float(across.min()), float(across.max())
        if self.on and not low < self.share < high and low < 1.0 and high > 0.0:
            self.share = 0.5 * (max(low, 0.0) + min(high, 1.0))
        self._context.redraw()

    def move(self, steps: int) -> None:
        """Move it by ``steps`` to the right, negative to the left."""
        self.share = min(max(self.share + steps * _STEP, 0.0), 1.0)
        self._context.redraw()

    @property
    def _across(self) -> float:
        """Its place in the window."""
        viewport = self._context.viewport
        return round(viewport.origin[0] + self.share * viewport.size[0])

    def contains(self, position: Pixel) -> bool:
        """Return True if a position in the window is within reach of the line."""
        viewport = self._context.viewport
        near = abs(position[0] - self._across) <= _REACH * viewport.ui_scale
        return self.shown and near and viewport.contains(position)

    def draw_line(self, draw: imgui.ImDrawList) -> None:
        """Draw the line over the view."""
        if not self.shown:
            return
        viewport, x = self._context.viewport, self._across
        scale, top = viewport.ui_scale, viewport.origin[1]
        bottom = top + viewport.size[1]
        draw.add_line((x, top), (x, bottom), u32(EDGE, 0.7), 3.0 * scale)
        draw.add_line((x, top), (x, bottom), u32(INK), 1.0 * scale)
        middle = (x, top + 0.5 * viewport.size[1])
        draw.add_circle_filled(middle, (_HANDLE + 1.5) * scale, u32(EDGE, 0.7))
        draw.add_circle_filled(middle, (_HANDLE + 1.5 * self.hovered) * scale, u32(INK))

    def draw_handle(self) -> None:
        """Draw the invisible strip along the line that takes the pointer, and move the line with it."""
        self.hovered = False
        if not self.shown:
            return
        context, viewport = self._context, self._context.viewport
        reach = _REACH * viewport.ui_scale
        # Not beyond the view, where other widgets are.
        left = max(self._across - reach, viewport.origin[0])
        right = min(self._across + reach, viewport.origin[0] + viewport.size[0])
        size = ImVec2(max(right - left, 1.0), viewport.size[1])
        imgui.set_next_window_pos(ImVec2(left, viewport.origin[1]))
        imgui.set_next_window_size(size)
        imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.window_min_size, ImVec2(1.0, 1.0))
        imgui.begin("##photo-wipe", None, _FLAGS)
        imgui.pop_style_var(2)
        imgui.invisible_button("##line", size)
        context.widget_rects.record("photo-wipe-line")
        self.hovered = (imgui.is_item_hovered() or imgui.is_item_active()) and not context.toolbox.active
        if imgui.is_item_active():
            at = imgui.get_mouse_pos().x - viewport.origin[0]
            share = min(max(at / viewport.size[0], 0.0), 1.0)
            if share != self.share:
                self.share = share
                context.redraw()
        if self.hovered:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew.value)
            self._zoom()
        imgui.end()

    def _zoom(self) -> None:
        """Zoom with the wheel as beside the line."""
        context, mouse, wheel = self._context, imgui.get_mouse_pos(), imgui.get_io().mouse_wheel
        if wheel:
            position = context.viewport.local((mouse.x, mouse.y))
            context.toolbox.dispatch(PointerEvent("wheel", position, time=context.clock(), wheel=wheel))
            context.redraw()
