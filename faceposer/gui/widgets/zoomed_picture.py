"""A picture that can be enlarged and moved: wheel, middle drag or Space and drag, double click to see all of it."""

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from faceposer.gui.widgets.theme import EDGE, u32
from faceposer.gui.widgets.widget_rects import WidgetRects

# Factor of a notch of the wheel, and largest magnification of the picture beyond the size at which all of it is seen.
_NOTCH, _MOST = 1.18, 40.0
Box = tuple[float, float, float, float]
_FLAGS = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_middle


@dataclass(frozen=True)
class Placed:
    """Where a picture is drawn, in pixels of the window.

    Attributes:
        low: Its left top corner.
        size: Its width and height.
        canvas: The part of the window in which it is seen: left, top, right, bottom.
        hovered: True if the pointer is over the canvas.
        panning: True while the picture is moved.
    """

    low: tuple[float, float]
    size: tuple[float, float]
    canvas: Box
    hovered: bool
    panning: bool

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the place in the window of the shares ``x`` and ``y`` of width and height of the picture."""
        return (self.low[0] + x * self.size[0], self.low[1] + y * self.size[1])

    def share(self, x: float, y: float) -> tuple[float, float]:
        """Return the shares of width and height of the picture at a place in the window."""
        return ((x - self.low[0]) / self.size[0], (y - self.low[1]) / self.size[1])


class ZoomedPicture:
    """The part of a picture that is shown; pictures of other resolutions but the same shape may take its place.

    Attributes:
        zoom: Magnification relative to the size at which all of it is seen, at least 1.
        middle: Shares of width and height of the picture that are in the middle.
    """

    def __init__(self) -> None:
        self.zoom = 1.0
        self.middle = (0.5, 0.5)
        self._panning: imgui.MouseButton_ | None = None

    def fit(self) -> None:
        """Show all of the picture."""
        self.zoom, self.middle = 1.0, (0.5, 0.5)

    def draw(
        self,
        rects: WidgetRects,
        name: str,
        texture: int,
        size: tuple[int, int],
        room: tuple[float, float],
        free: bool = True,
    ) -> Placed:
        """Draw the picture, respond to the pointer, and return where it is; the canvas is the last widget.

        Args:
            rects: Records the canvas as ``name``:canvas and the picture, seen or not, as ``name``.
            name: Name of the widget.
            texture: Its texture.
            size: Its width and height in its own pixels.
            room: Width and height of the canvas.
            free: False if a double click is not for the picture.
        """
        corner = imgui.get_cursor_screen_pos()
        room = (max(room[0], 1.0), max(room[1], 1.0))
        imgui.invisible_button(f"##{name}", ImVec2(*room), _FLAGS.value)
        rects.record(f"{name}:canvas")
        canvas = (corner.x, corner.y, corner.x + room[0], corner.y + room[1])
        hovered = imgui.is_item_hovered()
        scale = min(room[0] / size[0], room[1] / size[1])
        fitting = (max(scale * size[0], 1.0), max(scale * size[1], 1.0))
        if hovered:
            self._take_pointer(fitting, canvas, free)
        self._pan(fitting)
        self.zoom = min(max(self.zoom, 1.0), _MOST)
        whole = (fitting[0] * self.zoom, fitting[1] * self.zoom)
        across, down = (_kept(self.middle[k], room[k] / whole[k]) for k in range(2))
        self.middle = (across, down)
        low = tuple(corner[k] + 0.5 * room[k] - self.middle[k] * whole[k] for k in range(2))
        placed = Placed((low[0], low[1]), whole, canvas, hovered, self._panning is not None)
        rects.place(name, (*placed.at(0.0, 0.0), *placed.at(1.0, 1.0)))
        draw = imgui.get_window_draw_list()
        draw.add_rect_filled(ImVec2(*canvas[:2]), ImVec2(*canvas[2:]), u32(EDGE))
        draw.push_clip_rect(ImVec2(*canvas[:2]), ImVec2(*canvas[2:]), True)
        draw.add_image(imgui.ImTextureRef(texture), ImVec2(*placed.at(0.0, 0.0)), ImVec2(*placed.at(1.0, 1.0)))
        draw.pop_clip_rect()
        return placed

    def _take_pointer(
        self, fitting: tuple[float, float], canvas: tuple[float, float, float, float], free: bool
    ) -> None:
        """Zoom by the wheel around the pointer, fit at a double click, and begin to pan."""
        io, mouse = imgui.get_io(), imgui.get_mouse_pos()
        if io.mouse_wheel:
            before = self.zoom
            self.zoom = min(max(self.zoom * _NOTCH**io.mouse_wheel, 1.0), _MOST)
            away = (mouse.x - 0.5 * (canvas[0] + canvas[2]), mouse.y - 0.5 * (canvas[1] + canvas[3]))
            # The share of the picture under the pointer stays there.
            change = 1.0 / before - 1.0 / self.zoom
            across, down = (self.middle[k] + away[k] / fitting[k] * change for k in range(2))
            self.middle = (across, down)
        if imgui.is_mouse_clicked(imgui.MouseButton_.middle.value):
            self._panning = imgui.MouseButton_.middle
        elif imgui.is_mouse_clicked(imgui.MouseButton_.left.value) and imgui.is_key_down(imgui.Key.space):
            self._panning = imgui.MouseButton_.left
        elif free and imgui.is_mouse_double_clicked(imgui.MouseButton_.left.value):
            self.fit()

    def _pan(self, fitting: tuple[float, float]) -> None:
        if self._panning is None:
            return
        if not imgui.is_mouse_down(self._panning.value):
            self._panning = None
            return
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all.value)
        moved = imgui.get_io().mouse_delta
        across, down = (self.middle[k] - moved[k] / (fitting[k] * self.zoom) for k in range(2))
        self.middle = (across, down)


def _kept(middle: float, seen: float) -> float:
    """Return the ``middle`` of what is shown so that no room is left empty; ``seen`` is the share that fits."""
    if seen >= 1.0:
        return 0.5
    return min(max(middle, 0.5 * seen), 1.0 - 0.5 * seen)
