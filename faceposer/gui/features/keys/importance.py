"""Dialog that shows how important each vertex is for speech, on the face (Pyun et al., figures 4 and 14)."""

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import caption
from faceposer.gui.widgets.modal import modal, modal_body, modal_buttons, modal_entered, modal_escaped, modal_title
from faceposer.gui.widgets.pictures import Picture
from faceposer.progress import Progress
from faceposer.session.key_compositions import folder_importance, importance_picture
from faceposer.session.key_folder import KeyFolder, Side

_WIDTH = 58.0
_BUTTONS = (("close", "Close"),)
_TITLES = ("Verbal key poses", "Emotional key poses", "Combined")


def drawn_importance(folder: KeyFolder, side: Side, progress: Progress) -> NDArray[np.uint8]:
    """Return the picture of the importance by verbal keys, by emotional ones, and of both, side by side.

    Raises:
        FacePoserError: If there are no keys of a kind, or a file cannot be used.
        CancelledError: If the progress was cancelled.
    """
    progress.at("Comparing keys")
    found, character = folder_importance(folder, side)
    progress.check()
    progress.at("Drawing")
    return importance_picture(character, [found.verbal_spread, found.emotional_spread, found.values])


class ImportanceDialog:
    """The dialog.

    Attributes:
        picture: Picture that is shown, shape (h, w, 3), or None while the dialog is closed.
    """

    def __init__(self, context: EditorContext) -> None:
        """Show pictures in the window of ``context``."""
        self._context = context
        self._texture = Picture()
        self.picture: NDArray[np.uint8] | None = None
        self._of = ""

    @property
    def open(self) -> bool:
        """True while the dialog is shown."""
        return self.picture is not None

    def show(self, picture: NDArray[np.uint8], of: str) -> None:
        """Show ``picture`` of the character with the title ``of``."""
        self.picture, self._of = picture, of
        self._context.redraw()

    def draw(self) -> None:
        """Draw the dialog if it is open."""
        if self.picture is None:
            return
        context = self._context
        with modal("##keys-importance", _WIDTH) as shown:
            if not shown:
                return
            modal_title(context.fonts, f"Importance for speech: {self._of}")
            with modal_body(_BUTTONS):
                self._draw_picture(self.picture)
                caption(
                    "Brighter places move more in verbal or emotional key poses. Where the combined one is bright, "
                    "composed key poses keep the motion of speech, elsewhere that of the emotion."
                )
            pressed = modal_buttons(context.widget_rects, "keys-importance", _BUTTONS)
            if pressed or modal_escaped() or modal_entered():
                self.picture = None
                self._texture.forget()
                imgui.close_current_popup()

    def _draw_picture(self, picture: NDArray[np.uint8]) -> None:
        height, width = picture.shape[:2]
        room = imgui.get_content_region_avail().x
        texture = self._texture.texture(self._context.gl, picture)
        imgui.image(imgui.ImTextureRef(texture), ImVec2(room, room * height / width))
        self._context.widget_rects.record("keys-importance:picture")
        left = imgui.get_cursor_pos_x()
        for i, title in enumerate(_TITLES):
            across = imgui.calc_text_size(title).x
            imgui.set_cursor_pos_x(left + (i + 0.5) * room / len(_TITLES) - 0.5 * across)
            imgui.text_unformatted(title)
            if i + 1 < len(_TITLES):
                imgui.same_line()

    def release(self) -> None:
        """Release the picture."""
        self._texture.release()
