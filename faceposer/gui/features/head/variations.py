"""A grid of random variations of the head, to choose from."""

import math
from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.features.head.state import HeadState
from faceposer.gui.features.poses.portraits import Portraits
from faceposer.gui.widgets.theme import ACCENT, FIELD, RAISED_MORE, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.identity.identity import Identity

_COUNT = 9
# Columns of the grid, of which the first are chosen with which all of it is visible at once.
_COLUMNS = (3, 5)


class Variations:
    """Random heads with thumbnails; the first is the head from which they were made."""

    def __init__(self, head: HeadState) -> None:
        """Offer heads of ``head``."""
        self._head = head
        self._portraits = Portraits(head.context)
        self._identities: list[Identity] = []
        self._round = 0
        self._unseen = False

    @property
    def shown(self) -> bool:
        """True while the grid is shown."""
        return bool(self._identities)

    @property
    def waiting(self) -> bool:
        """True if thumbnails are still to be drawn."""
        return self.shown and self._portraits.waiting

    def offers(self, identity: Identity) -> bool:
        """Return True if ``identity`` is one of the heads offered."""
        return any(identity is one for one in self._identities)

    def make(self) -> None:
        """Offer other heads: mixtures of the present one with random heads."""
        self.close()
        self._round += 1
        present = self._head.identity
        others = (self._head.random_head(1000 * self._round + i) for i in range(_COUNT - 1))
        mixed = (present.mixed(other, 0.5) for other in others)
        # The thumbnails show the present skin.
        self._identities = [present, *(replace(head, texture=present.texture) for head in mixed)]
        self._unseen = True

    def scroll_to(self) -> bool:
        """Return True once after heads were offered: the tab then scrolls to the grid, if it is not in sight."""
        unseen, self._unseen = self._unseen, False
        return unseen

    def close(self) -> None:
        """Close the grid."""
        self._identities = []
        self._portraits.forget()

    def draw_next(self) -> None:
        """Draw the next thumbnail."""
        if self.waiting:
            self._portraits.draw_next()

    def release(self) -> None:
        """Release the thumbnails."""
        self._portraits.release()

    def draw(self) -> None:
        """Draw the grid."""
        gap, room = round(em(0.35)), imgui.get_content_region_avail().x
        high = imgui.get_window_height() - imgui.get_frame_height_with_spacing()
        fitting = (n for n in _COLUMNS if math.ceil(_COUNT / n) * (room + gap) / n <= high)
        columns = next(fitting, _COLUMNS[-1])
        side = max(int((room - gap * (columns - 1)) / columns), 8)
        imgui.push_style_var(imgui.StyleVar_.item_spacing, (gap, gap))
        for i, identity in enumerate(self._identities):
            if i % columns:
                imgui.same_line()
            self._draw_cell(i, identity, side)
        imgui.pop_style_var()

    def _draw_cell(self, i: int, identity: Identity, side: int) -> None:
        context = self._head.context
        low = imgui.get_cursor_screen_pos()
        pressed = imgui.invisible_button(f"##variation{i}", ImVec2(side, side))
        context.widget_rects.record(f"head:variation:{i}")
        hovered = imgui.is_item_hovered()
        tooltip("The head as it was" if i == 0 else "Choose this head")
        high = ImVec2(low.x + side, low.y + side)
        draw = imgui.get_window_draw_list()
        draw.add_rect_filled(low, high, u32(FIELD), em(0.2))
        texture = self._portraits.of_vertices(i, lambda: self._vertices(identity), round(side * context.pixel_ratio))
        if texture is not None:
            white = u32((1.0, 1.0, 1.0, 1.0))
            corner, opposite = ImVec2(0.0, 0.0), ImVec2(1.0, 1.0)
            draw.add_image_rounded(imgui.ImTextureRef(texture), low, high, corner, opposite, white, em(0.2))
        chosen = self._head.identity is identity
        if chosen or hovered:
            draw.add_rect(low, high, u32(ACCENT if chosen else RAISED_MORE), em(0.2), thickness=max(em(0.1), 1.0))
        if pressed and not context.busy:
            self._head.set_identity(identity, "Choose a head")

    def _vertices(self, identity: Identity) -> NDArray[np.float32]:
        session = self._head.context.session
        editor, contact = self._head.require_editor(), session.document.contact
        return editor.preview(session.model, session.coefficients, identity, contact)
