"""Pages of the dialog that animates the face by a film."""

from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.errors import counted
from faceposer.gui.features.film.state import FilmState
from faceposer.gui.widgets.basic import caption, text_field, wrapped_text
from faceposer.gui.widgets.modal import (
    draw_job,
    modal,
    modal_body,
    modal_buttons,
    modal_entered,
    modal_escaped,
    modal_title,
)
from faceposer.gui.widgets.pictures import Picture
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import BAD, em
from faceposer.gui.widgets.tooltips import tooltip

if TYPE_CHECKING:
    from faceposer.film.film import Film

_WIDTH, _TALLEST, _LABEL, _TIME, _PICTURE = 32.0, 30.0, 4.6, 7.0, 16.0
# Most of the height of the window that the picture takes.
_MOST_SHARE = 0.38
_PREFIX, _TITLE = "film", "Expressions from a film"
_FORM = (("follow", "Follow the face"), ("cancel", "Cancel"))


class FilmDialog:
    """The dialog."""

    def __init__(self, film: FilmState) -> None:
        """Show and change the state of ``film``."""
        self._film = film
        self._picture = Picture()

    def forget(self) -> None:
        """Forget the picture that is shown."""
        self._picture.forget()

    def release(self) -> None:
        """Release the picture's texture."""
        self._picture.release()

    def draw(self) -> None:
        """Draw the current page."""
        film = self._film
        with modal("##film", _WIDTH, _TALLEST) as shown:
            if not shown:
                return
            {"form": self._draw_form, "working": self._draw_progress, "result": self._draw_result}[film.page]()
            if not film.open:
                imgui.close_current_popup()

    def _draw_form(self) -> None:
        state = self._film
        context, rects, film = state.context, state.context.widget_rects, state.film
        if film is None:
            return
        modal_title(context.fonts, _TITLE)
        with modal_body(_FORM):
            caption(
                "The largest face is followed through the shot that shows a face longest; frames in which it is turned "
                "by more than 60 degrees are filled in from those around. The motion of the head is not part of the "
                "animation."
            )
            row_label("Film", width=_LABEL)
            imgui.text_unformatted(shortened(film.path.name, imgui.get_content_region_avail().x))
            tooltip(str(film.path))
            row_label("", width=_LABEL)
            imgui.text_unformatted(_length_of(film))
            row_label("Part", "Times in seconds, or as 1:02.5; empty for the beginning and the end of the film", _LABEL)
            imgui.set_next_item_width(em(_TIME))
            before = (state.start, state.end)
            _, state.start = text_field("##from", state.start, "beginning")
            rects.record(f"{_PREFIX}:from")
            tooltip("Time at which the part begins")
            imgui.same_line()
            imgui.text_unformatted("to")
            imgui.same_line()
            imgui.set_next_item_width(em(_TIME))
            _, state.end = text_field("##to", state.end, "end")
            rects.record(f"{_PREFIX}:to")
            tooltip("Time at which the part ends")
            if (state.start, state.end) != before:
                state.error = ""
            row_label("", width=_LABEL)
            _, state.colours = imgui.checkbox("Follow colours", state.colours)
            rects.record(f"{_PREFIX}:colours")
            tooltip("Compare the colours of the face, too: closer than its landmarks alone, and takes longer")
            for note in film.notes:
                caption(note)
            if state.error:
                imgui.push_style_color(imgui.Col_.text, BAD)
                wrapped_text(state.error)
                imgui.pop_style_color()
        pressed = modal_buttons(rects, _PREFIX, _FORM)
        if modal_escaped():
            pressed = "cancel"
        elif modal_entered():
            pressed = "follow"
        if pressed:
            {"follow": state.follow, "cancel": state.close_dialog}[pressed]()

    def _draw_progress(self) -> None:
        state = self._film
        job = state.job
        assert job is not None
        text = "Stopping..." if job.cancelled else f"{job.stage}..."
        preview = None if state.stills is None else state.stills.preview
        draw_job(
            state.context.fonts,
            state.context.widget_rects,
            _PREFIX,
            "Following the face",
            job,
            text,
            more=None if preview is None else lambda: self._draw_picture(preview),
        )

    def _draw_picture(self, image: NDArray[np.uint8]) -> None:
        """Draw ``image`` in the middle."""
        texture = self._picture.texture(self._film.context.gl, image)
        room = imgui.get_content_region_avail().x
        height, width = image.shape[:2]
        # The dialog is not scrolled on small screens.
        tall = min(em(_PICTURE), _MOST_SHARE * imgui.get_io().display_size.y)
        scale = min(room / width, tall / height)
        size = ImVec2(scale * width, scale * height)
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + 0.5 * (room - size.x))
        imgui.image(imgui.ImTextureRef(texture), size)
        self._film.context.widget_rects.record(f"{_PREFIX}:picture")

    def _draw_result(self) -> None:
        state = self._film
        result = state.result
        assert result is not None
        performance = result.found.performance
        n_few, n_all = len(result.few.keys), len(result.dense.keys)
        buttons = (
            *([("few", counted(n_few, "key"))] if n_few < n_all else []),
            ("all", "Every frame"),
            ("back", "Back"),
            ("cancel", "Discard"),
        )
        modal_title(state.context.fonts, "How many keys?")
        with modal_body(buttons):
            few = f" With {counted(n_few, 'key')}, differences are small, and the animation is easier to edit."
            wrapped_text(
                f"The animation has {counted(len(performance), 'frame')} at {performance.rate:.5g} fps, "
                f"{performance.seconds:.2f} s.{few if n_few < n_all else ''} A key at every frame keeps the animation "
                "unchanged."
            )
            for note in result.found.notes:
                caption(note)
        pressed = modal_buttons(state.context.widget_rects, _PREFIX, buttons)
        if modal_escaped():
            pressed = "cancel"
        elif modal_entered():
            pressed = buttons[0][0]
        if pressed == "cancel":
            state.ask_to_discard()
        elif pressed == "back":
            state.back()
        elif pressed:
            state.take(pressed == "few")


def _length_of(film: "Film") -> str:
    """Return size, rate and duration of ``film`` in words."""
    seconds = "" if film.n_frames is None else f", {film.n_frames / film.rate:.2f} s"
    return f"{film.size[0]} x {film.size[1]}, {film.rate:.5g} fps{seconds}"
