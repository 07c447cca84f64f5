"""Pages of the dialog that makes a character of scans."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

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
from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import ACCENT, BAD, INK, Icon, em, u32
from faceposer.gui.widgets.tooltips import tooltip

if TYPE_CHECKING:
    from faceposer.gui.features.scan.feature import ScanFeature
    from faceposer.gui.features.scan.work import MarkedScan

# Heights of pages with a picture and of the others.
_WIDTH, _TALLEST, _LOW, _LABEL = 44.0, 48.0, 24.0, 7.0
# Height of a page beside its picture.
_AROUND = 14.0
_BUTTONS = {
    "form": (("find", "Find landmarks"), ("cancel", "Cancel")),
    "landmarks": (("fit", "Fit"), ("back", "Back"), ("cancel", "Cancel")),
    "result": (("open", "Save and open"), ("cancel", "Discard")),
}
# Distance in font sizes within which the pointer takes a landmark.
_REACH = 0.9


class ScanDialog:
    """The dialog."""

    def __init__(self, scan: "ScanFeature") -> None:
        """Show the state of ``scan``."""
        self._scan = scan
        self._picture = Picture()
        self._dragged: str | None = None

    def forget(self) -> None:
        """Forget the picture that is shown."""
        self._picture.forget()
        self._dragged = None

    def release(self) -> None:
        """Release the picture's texture."""
        self._picture.release()

    def draw(self, draw_above: Callable[[], None]) -> None:
        """Draw the current page; ``draw_above`` draws the dialogs above it."""
        scan = self._scan
        pictures = scan.job is None and scan.page != "form"
        with modal("##scan", _WIDTH, _TALLEST if pictures else _LOW) as shown:
            if not shown:
                draw_above()
                return
            if scan.job is not None:
                self._draw_progress()
            else:
                self._draw_page()
            if not scan.open:
                imgui.close_current_popup()
            draw_above()

    def _draw_progress(self) -> None:
        scan = self._scan
        assert scan.job is not None
        title = "Finding landmarks" if scan.page == "finding" else "Fitting the head"
        stage = "Stopping..." if scan.job.cancelled else f"{scan.job.stage}..."
        text = f"{stage} It takes half a minute; nothing is written before you save."
        draw_job(scan.context.fonts, scan.context.widget_rects, "scan", title, scan.job, text, escapes=False)

    def _draw_page(self) -> None:
        scan, page = self._scan, self._scan.page
        titles = {"form": "Head from scan", "landmarks": "Landmarks", "result": "Head from scan"}
        buttons = _BUTTONS[page]
        modal_title(scan.context.fonts, titles[page])
        with modal_body(buttons, below=2.0 * imgui.get_text_line_height_with_spacing()):
            {"form": self._draw_form, "landmarks": self._draw_landmarks, "result": self._draw_result}[page]()
        below = imgui.get_cursor_pos_y() + 2.0 * imgui.get_text_line_height_with_spacing()
        if scan.error:
            imgui.push_style_color(imgui.Col_.text, BAD)
            wrapped_text(scan.error)
            imgui.pop_style_color()
        imgui.set_cursor_pos_y(max(below, imgui.get_cursor_pos_y()))
        missing = page == "form" and not scan.files
        disabled = ("find",) if missing else ()
        tips = {"find": "Add a scan first" if missing else "Find the face on each scan"}
        pressed = modal_buttons(scan.context.widget_rects, "scan", buttons, disabled=disabled, tips=tips)
        if not scan.context.file_dialogs.open:
            if modal_escaped():
                pressed = "cancel"
            elif modal_entered() and not missing:
                pressed = buttons[0][0]
        if pressed:
            run = {
                "find": scan.find,
                "fit": scan.fit,
                "back": scan.back,
                "open": scan.save,
                "cancel": scan.close_dialog,
            }
            run[pressed]()

    # The form

    def _draw_form(self) -> None:
        scan, rects = self._scan, self._scan.context.widget_rects
        caption(
            "Meshes of one person's head: OBJ, PLY, STL, OFF or glTF, with or without texture, in any unit and "
            "orientation. Holes, hair and an expression are fine; the character gets a neutral head."
        )
        for i, path in enumerate(list(scan.files)):
            row_label("Scans" if i == 0 else "", width=_LABEL)
            if imgui.button(f"{Icon.CLOSE}##scan{i}", (em(1.9), 0.0)):
                scan.files.remove(path)
            rects.record(f"scan:{i}:remove")
            tooltip("Remove this scan")
            imgui.same_line()
            imgui.text_unformatted(displayed(Path(path).name))
            tooltip(path)
        row_label("" if scan.files else "Scans", width=_LABEL)
        if imgui.button("Add..."):
            scan.ask_for_scan()
        rects.record("scan:add")
        tooltip("Choose the file of a scan; files can also be dropped onto the window")
        row_label("Title", "Title of the character in the window", _LABEL)
        imgui.set_next_item_width(-1.0)
        _, scan.title = text_field("##scan-title", scan.title)
        rects.record("scan:title")
        row_label("", width=_LABEL)
        _, scan.detail = imgui.checkbox("Detail of the scan", scan.detail)
        rects.record("scan:detail")
        tooltip("Follow the scan beyond what the model of heads can show")
        row_label("", width=_LABEL)
        _, scan.texture = imgui.checkbox("Texture of the scan", scan.texture)
        rects.record("scan:texture")
        tooltip("Paint the skin with the colours of the scan, if it has any")

    # Landmarks

    def _draw_landmarks(self) -> None:
        scan = self._scan
        scan.shown = min(scan.shown, len(scan.marked) - 1)
        caption("Drag points that are not in their place; the others follow the fit.")
        if len(scan.marked) > 1:
            names = [one.scan.name for one in scan.marked]
            imgui.set_next_item_width(-1.0)
            _, scan.shown = imgui.combo("##shown-scan", scan.shown, [displayed(name) for name in names])
            scan.context.widget_rects.record("scan:shown")
        marked = scan.marked[scan.shown]
        low, side = self._draw_picture(marked.drawing.image)
        factor = side / marked.drawing.image.shape[1]
        pixels = {name: marked.camera.project(place[None])[0] for name, place in marked.places.items()}
        self._drag(marked, pixels, low, factor)
        draw = imgui.get_window_draw_list()
        mouse = imgui.get_mouse_pos()
        near = self._dragged or self._nearest(pixels, low, factor, mouse)
        for name, pixel in pixels.items():
            centre = ImVec2(low.x + factor * float(pixel[0]), low.y + factor * float(pixel[1]))
            colour = ACCENT if name in marked.moved or name == near else INK
            draw.add_circle_filled(centre, em(0.22), u32(colour))
            draw.add_circle(centre, em(0.26), u32((0.0, 0.0, 0.0, 0.7)))
        if near is not None and imgui.is_item_hovered():
            titles = scan.context.session.model.character.feature_titles
            tooltip(titles.get(near, near))

    def _drag(self, marked: "MarkedScan", pixels: dict[str, NDArray[np.float64]], low: ImVec2, factor: float) -> None:
        mouse = imgui.get_mouse_pos()
        if imgui.is_item_activated():
            self._dragged = self._nearest(pixels, low, factor, mouse)
        if self._dragged is None:
            return
        if not imgui.is_item_active():
            self._dragged = None
            return
        if imgui.is_mouse_dragging(imgui.MouseButton_.left.value, 2.0):
            pixel = ((mouse.x - low.x) / factor, (mouse.y - low.y) / factor)
            self._scan.marked[self._scan.shown] = marked.with_moved(self._dragged, pixel)

    def _nearest(self, pixels: dict[str, NDArray[np.float64]], low: ImVec2, factor: float, mouse: ImVec2) -> str | None:
        """Return the landmark under the pointer, or None."""
        at = np.array([(mouse.x - low.x) / factor, (mouse.y - low.y) / factor])
        distances = {name: float(np.linalg.norm(pixel - at)) * factor for name, pixel in pixels.items()}
        name = min(distances, key=distances.__getitem__, default=None)
        return name if name is not None and distances[name] < em(_REACH) else None

    # The result

    def _draw_result(self) -> None:
        result = self._scan.result
        assert result is not None
        report = result.report
        caption(
            f"Distance of the head from the scan: {report['surface_mm_median']:.2f} mm median, "
            f"{report['surface_mm_mean']:.2f} mm mean. Left the scan, middle the head, right their distance, "
            "from blue to red at 2 mm."
        )
        self._draw_picture(result.picture)

    def _draw_picture(self, image: NDArray[np.uint8]) -> tuple[ImVec2, float]:
        """Draw ``image`` as large as there is room and return its top left corner and its width."""
        texture = self._picture.texture(self._scan.context.gl, image)
        room = imgui.get_content_region_avail().x
        tallest = min(em(_TALLEST), imgui.get_main_viewport().work_size.y) - em(_AROUND)
        height, width = image.shape[:2]
        scale = max(min(room / width, tallest / height), 0.05)
        size = ImVec2(scale * width, scale * height)
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + 0.5 * (room - size.x))
        low = imgui.get_cursor_screen_pos()
        imgui.invisible_button("##picture", size)
        self._scan.context.widget_rects.record("scan:picture")
        high = ImVec2(low.x + size.x, low.y + size.y)
        imgui.get_window_draw_list().add_image(imgui.ImTextureRef(texture), low, high)
        return low, size.x
