"""Sends each pointer event to the tool that it belongs to."""

from collections.abc import Callable

from faceposer.tools.camera_tool import CameraTool
from faceposer.tools.point_tool import PointTool
from faceposer.tools.tool import Button, Gesture, Hover, PointerEvent, Selection, Tool, ToolContext


class Toolbox:
    """The tools and the gesture under way."""

    def __init__(self, context: ToolContext) -> None:
        """Serve ``context``."""
        self._context = context
        self._selected = Selection()
        self.camera_tool = CameraTool()
        self.point_tool = PointTool(self._selected)
        self._gesture: Gesture | None = None
        self._gesture_button: Button | None = None
        self._active: Tool | None = None
        self.hover: Hover | None = None

    @property
    def selection(self) -> frozenset[int]:
        """Indices of the selected constraints."""
        return self._selected.within(len(self._context.session.document.constraints))

    @property
    def active(self) -> bool:
        """Whether a gesture is under way."""
        return self._gesture is not None

    @property
    def dragging_pin(self) -> bool:
        """Whether the gesture under way poses the face."""
        return self._active is self.point_tool

    @property
    def cursor(self) -> str:
        """Name of the pointer's shape for what the mouse does, or would do now; the window knows how it looks."""
        if self._gesture is not None:
            return "orbit" if self._active is self.camera_tool else "grab"
        if self.hover is not None and self.hover.pin is not None:
            return "grab"
        return "press" if self.hover is not None and self.hover.surface else "arrow"

    def select(self, index: int, extend: bool = False) -> None:
        """Select the constraint ``index``, or with ``extend`` change only whether it is selected."""
        if extend:
            self._selected.toggle(index)
        else:
            self._selected.set(index)

    def dispatch(self, event: PointerEvent) -> None:
        """Handle ``event``: begin, continue or end a gesture, zoom, remove a pin, or note what the pointer is over."""
        if event.kind == "wheel":
            self.camera_tool.wheel(event, self._context)
        elif event.kind == "press":
            self._press(event)
        elif self._gesture is not None and (event.kind != "release" or event.button == self._gesture_button):
            self._send(event)
        if self._gesture is None:
            self._note_hover(event)

    def _press(self, event: PointerEvent) -> None:
        if self._gesture is not None:
            return
        if event.button == "right" and not event.modifiers:
            self.point_tool.remove_at(event.position, self._context)
            return
        for tool in (self.camera_tool, self.point_tool):
            if tool.begins(event, self._context):
                self._begin(tool, event)
                return
        if event.button == "left" and not event.modifiers:
            self._begin(self.camera_tool, event)

    def _begin(self, tool: Tool, event: PointerEvent) -> None:
        self._active, self._gesture_button = tool, event.button
        self._gesture = tool.gesture(event, self._context)
        self._advance(next)

    def _send(self, event: PointerEvent) -> None:
        self._advance(lambda gesture: gesture.send(event))

    def _advance(self, step: Callable[[Gesture], None]) -> None:
        assert self._gesture is not None
        try:
            step(self._gesture)
        except StopIteration:
            self._gesture = self._active = None
        except Exception:
            self._gesture = self._active = None
            raise

    def cancel(self) -> bool:
        """Take back the gesture under way, or else deselect; return whether there was anything to do (Esc)."""
        if self._gesture is not None:
            gesture, self._gesture, self._active = self._gesture, None, None
            gesture.close()
            return True
        had_selection = bool(self.selection)
        self._selected.set()
        return had_selection

    def finish(self) -> None:
        """End the gesture under way where it is, as when the window loses the pointer."""
        if self._gesture is not None:
            position = self.hover.position if self.hover else (0.0, 0.0)
            self._send(PointerEvent("release", position, self._gesture_button))

    def delete_selected(self) -> bool:
        """Remove the selected constraints as one step; return whether there were any."""
        chosen = set(self.selection)
        if self._gesture is not None or not chosen:
            return False
        self._selected.set()
        label = "Remove a point" if len(chosen) == 1 else f"Remove {len(chosen)} points"
        self._context.session.remove_constraints(chosen, label)
        return True

    def _note_hover(self, event: PointerEvent) -> None:
        pin = self.point_tool.pin_at(event.position, self._context)
        surface = pin is None and self._context.pick(event.position) is not None
        self.hover = Hover(pin, surface, event.position)

    def leave(self) -> None:
        """Note that the pointer has left the view."""
        self.hover = None

    def hint(self) -> str:
        """Return what the mouse will do now, for the status bar."""
        if self._active is self.point_tool:
            return "Move: pull the face   ·   release: keep   ·   Esc: take back"
        if self._gesture is not None:
            return "Move: turn the view   ·   release: keep   ·   Esc: back to where it was"
        if self.hover is None:
            return "Press on the face and drag to pose it   ·   F1: all keys"
        if self.hover.pin is not None:
            return "Drag: move the point   ·   right click: remove it   ·   Shift+click: select more"
        if self.hover.surface:
            return "Drag: pull the face here   ·   click: pin it here"
        return "Drag: orbit   ·   wheel: zoom   ·   Shift+middle: pan"
