"""Orbit, pan and zoom with the mouse conventions of Blender or Maya."""

from typing import Literal

from faceposer.tools.tool import Button, Gesture, Navigation, PointerEvent, ToolContext

Motion = Literal["orbit", "pan", "zoom"]

_BLENDER: dict[tuple[Button, frozenset[str]], Motion] = {
    ("middle", frozenset()): "orbit",
    ("middle", frozenset({"shift"})): "pan",
    ("middle", frozenset({"ctrl"})): "zoom",
}
_MAYA: dict[tuple[Button, frozenset[str]], Motion] = {
    ("left", frozenset({"alt"})): "orbit",
    ("middle", frozenset({"alt"})): "pan",
    ("right", frozenset({"alt"})): "zoom",
}
# Alt and the middle button work in both presets: neither collides with posing.
PRESETS: dict[Navigation, dict[tuple[Button, frozenset[str]], Motion]] = {
    "blender": _BLENDER | _MAYA,
    "maya": _MAYA | {("middle", frozenset()): "pan"},
}
_ZOOM_PER_PIXEL = 1.006
_ZOOM_PER_NOTCH = 1.12


class CameraTool:
    """Moves the view; the session and its history remain unchanged."""

    def motion(self, event: PointerEvent, context: ToolContext) -> Motion | None:
        """Return the motion of the view for a drag from the press ``event``, by button and modifiers, or None."""
        if event.button is None:
            return None
        return PRESETS[context.navigation].get((event.button, event.modifiers))

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` moves the view, at any position."""
        return self.motion(event, context) is not None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Move the view with the pointer; a press without a motion of its own orbits."""
        # on press
        motion = self.motion(event, context) or "orbit"
        before = context.view
        last = event.position
        try:
            while True:
                event = yield
                # on release
                if event.kind == "release":
                    return
                # on move
                dx, dy = event.position[0] - last[0], event.position[1] - last[1]
                last = event.position
                if motion == "orbit":
                    context.view = context.view.orbited(dx, dy, context.size)
                elif motion == "pan":
                    context.view = context.view.panned(dx, dy, context.size)
                else:
                    context.view = context.view.zoomed(_ZOOM_PER_PIXEL ** (dx - dy))
        except GeneratorExit:
            context.view = before
            raise

    def wheel(self, event: PointerEvent, context: ToolContext) -> None:
        """Zoom with the wheel towards the pointer."""
        factor = _ZOOM_PER_NOTCH**event.wheel
        zoomed = context.view.zoomed(factor)
        achieved = context.view.distance / zoomed.distance
        offset = [event.position[i] - context.size[i] / 2 for i in range(2)]
        shift = 1.0 - achieved
        context.view = zoomed.panned(offset[0] * shift, offset[1] * shift, context.size)
