"""The page with the head that was made: beside what it was made of, or over it, with a line to drag."""

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.features.head_making.contents import Compared, MadeHead
from faceposer.gui.widgets.basic import caption, wrapped_text
from faceposer.gui.widgets.pictures import Picture
from faceposer.gui.widgets.sliders import slider
from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import EDGE, INK, WARNING, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.zoomed_picture import Placed, ZoomedPicture


class ResultPage:
    """The page.

    Attributes:
        zoom: The part of the picture that is shown.
        shown: Index of the picture.
        wiped: Where the line between the pictures is, as a share of their width.
    """

    def __init__(self, context: EditorContext, prefix: str) -> None:
        """Draw in ``context``; names of widgets begin with ``prefix``."""
        self._context, self._prefix = context, prefix
        self.zoom = ZoomedPicture()
        self.shown, self.wiped = 0, 0.5
        self._picture, self._over = Picture(), Picture()
        self._wiping = False

    def forget(self) -> None:
        """Forget the pictures and what is shown of them."""
        self._picture.forget()
        self._over.forget()
        self.zoom.fit()
        self.shown, self.wiped, self._wiping = 0, 0.5, False

    def release(self) -> None:
        """Release the textures."""
        self._picture.release()
        self._over.release()

    def draw_plain(self, image: NDArray[np.uint8], room: tuple[float, float], zoom: ZoomedPicture) -> None:
        """Draw an image that can only be enlarged and moved by ``zoom``."""
        texture = self._picture.texture(self._context.gl, image)
        height, width = image.shape[:2]
        zoom.draw(self._context.widget_rects, f"{self._prefix}:picture", texture, (width, height), room)

    def draw_picture(self, result: MadeHead, room: tuple[float, float]) -> None:
        """Draw the picture shown, and the line that can be dragged over it."""
        compared = self._compared(result)
        image = compared.picture
        texture = self._picture.texture(self._context.gl, image)
        height, width = image.shape[:2]
        size = (width, height)
        # A drag, and with it a double click, moves the line.
        free = compared.over is None
        placed = self.zoom.draw(self._context.widget_rects, f"{self._prefix}:picture", texture, size, room, free)
        if compared.over is not None:
            self._wipe(placed)
            self._draw_over(compared.over, placed)

    def draw_column(self, result: MadeHead) -> None:
        """Draw the choice of the picture, the place of the line, and what was measured."""
        rects, views = self._context.widget_rects, result.views
        if len(views) > 1:
            names = [f"{number + 1}: {displayed(view.name)}" for number, view in enumerate(views)]
            imgui.set_next_item_width(-1.0)
            changed, shown = imgui.combo("##compared", self.shown, names)
            rects.record(f"{self._prefix}:compared")
            if changed:
                self.shown = shown
                self.zoom.fit()
        if self._compared(result).over is not None:
            imgui.set_next_item_width(-1.0)
            _, share = slider("##wipe", 100.0 * self.wiped, 0.0, 100.0, "%.0f %%")
            rects.record(f"{self._prefix}:wipe")
            tooltip("Share of the width before the line, which can be dragged in the picture, too")
            self.wiped = min(max(0.01 * share, 0.0), 1.0)
        if result.doubt:
            imgui.push_style_color(imgui.Col_.text, WARNING)
            wrapped_text(result.doubt)
            imgui.pop_style_color()
        caption(result.text)

    def _compared(self, result: MadeHead) -> Compared:
        views = result.views
        self.shown = min(self.shown, len(views) - 1)
        return views[self.shown]

    def _wipe(self, placed: Placed) -> None:
        """Move the line under the pointer."""
        left, mouse = imgui.MouseButton_.left.value, imgui.get_mouse_pos()
        if imgui.is_item_activated() and imgui.is_mouse_clicked(left) and not placed.panning:
            self._wiping = True
        if not imgui.is_mouse_down(left):
            self._wiping = False
        if self._wiping:
            self.wiped = min(max(placed.share(mouse.x, mouse.y)[0], 0.0), 1.0)
            self._context.redraw(1)
        if (placed.hovered or self._wiping) and not placed.panning:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew.value)

    def _draw_over(self, over: NDArray[np.uint8], placed: Placed) -> None:
        """Draw ``over`` on the right of the line, and the line with its handle in the middle of what is seen."""
        draw, canvas = imgui.get_window_draw_list(), placed.canvas
        texture = imgui.ImTextureRef(self._over.texture(self._context.gl, over))
        top, bottom = placed.at(self.wiped, 0.0), placed.at(self.wiped, 1.0)
        draw.push_clip_rect(ImVec2(*canvas[:2]), ImVec2(*canvas[2:]), True)
        if self.wiped < 1.0:
            draw.add_image(
                texture, ImVec2(*top), ImVec2(*placed.at(1.0, 1.0)), ImVec2(self.wiped, 0.0), ImVec2(1.0, 1.0)
            )
        begin, end = ImVec2(top[0], max(top[1], canvas[1])), ImVec2(bottom[0], min(bottom[1], canvas[3]))
        draw.add_line(begin, end, u32(EDGE, 0.8), em(0.26))
        draw.add_line(begin, end, u32(INK), em(0.12))
        x, y = top[0], 0.5 * (begin.y + end.y)
        draw.add_circle_filled(ImVec2(x, y), em(0.95), u32(EDGE, 0.8))
        draw.add_circle_filled(ImVec2(x, y), em(0.85), u32(INK))
        for side in (-1.0, 1.0):
            tip, back, half = x + side * em(0.6), x + side * em(0.2), em(0.3)
            draw.add_triangle_filled(ImVec2(tip, y), ImVec2(back, y - half), ImVec2(back, y + half), u32(EDGE))
        draw.pop_clip_rect()
