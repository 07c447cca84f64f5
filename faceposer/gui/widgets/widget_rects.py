"""Rectangles of the named widgets of a frame."""

from collections.abc import Iterator

from imgui_bundle import imgui

Rectangle = tuple[float, float, float, float]

# The view of the face lies below all overlays; it is no widget that a tooltip could hide.
_CANVAS = "view"


class WidgetRects:
    """Rectangles of the named widgets of the last frame, in window units: left, top, right, bottom.

    Tests and the demo use them to click on widgets; tooltips keep off them.
    """

    def __init__(self) -> None:
        self._rectangles: dict[str, Rectangle] = {}
        self._visible: dict[str, tuple[int, Rectangle]] = {}

    def clear(self) -> None:
        """Remove all names, at the start of a frame."""
        self._rectangles.clear()
        self._visible.clear()

    def record(self, name: str) -> None:
        """Record the rectangle of the last drawn widget as ``name``."""
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self._rectangles[name] = (low.x, low.y, high.x, high.y)
        window = imgui.internal.get_current_window()
        clip = window.clip_rect
        seen = (max(low.x, clip.min.x), max(low.y, clip.min.y), min(high.x, clip.max.x), min(high.y, clip.max.y))
        if name != _CANVAS and seen[0] < seen[2] and seen[1] < seen[3]:
            self._visible[name] = (window.root_window.id_, seen)

    def place(self, name: str, rectangle: Rectangle) -> None:
        """Record ``rectangle``, drawn over the view without a widget, as ``name``."""
        self._rectangles[name] = rectangle

    def pressable(self, window: int | None = None) -> list[Rectangle]:
        """Return the visible parts of all widgets, or of those in the root window with the id ``window``."""
        return [rect for owner, rect in self._visible.values() if window in (None, owner)]

    def __contains__(self, name: str) -> bool:
        return name in self._rectangles

    def __iter__(self) -> Iterator[str]:
        return iter(self._rectangles)

    def __getitem__(self, name: str) -> Rectangle:
        return self._rectangles[name]

    def center(self, name: str) -> tuple[float, float]:
        """Return the centre of the widget ``name``.

        Raises:
            KeyError: If the last frame had no such widget.
        """
        left, top, right, bottom = self._rectangles[name]
        return ((left + right) / 2.0, (top + bottom) / 2.0)


def overlap(first: Rectangle, second: Rectangle) -> bool:
    """Return True if two rectangles have common area."""
    return first[0] < second[2] and second[0] < first[2] and first[1] < second[3] and second[1] < first[3]
