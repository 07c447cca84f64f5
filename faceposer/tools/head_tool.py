"""Dragging of points of the head: its identity changes, not the expression (Blanz and Vetter 1999)."""

from typing import TYPE_CHECKING

import numpy as np

from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.identity.identity import is_editable
from faceposer.model.character import Character
from faceposer.session.session import Session
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

if TYPE_CHECKING:
    from faceposer.identity.dragging import HeadDrag

#: A gesture shorter than this, in pixels of a display at normal density, changes nothing.
CLICK_THRESHOLD = 3.0


class HeadTool(PosingTool):
    """Changes the head by dragging points of its skin.

    Attributes:
        spread: Share of the head that follows a point, 0 to 1.
        locked: Names of the segments of the face that stay.
    """

    name = "head"
    label = "Head"
    key = "B"
    help = "Drag points of the head to change who it is; the expression stays"
    empty_text = "Drag a point of the head: its shape follows, as heads differ from one another."
    cursor = "press"
    drag_cursor = "grab"
    drag_hint = "Move: shape the head   ·   release: confirm   ·   Esc: cancel"
    edited_by_points = False

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use the shared ``tool_settings``."""
        super().__init__(tool_settings)
        self.spread = 0.15
        self.locked: frozenset[str] = frozenset()

    def usable(self, character: Character) -> bool:
        """Return True if ``character`` has a head that the morphable model describes."""
        return is_editable(character)

    def held(self, session: Session) -> str:
        """Return why the head cannot be changed at present."""
        return session.head_held

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` hits the face."""
        return event.button == "left" and not event.modifiers and context.pick(event.position) is not None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Drag a point, with symmetry also its mirror image; a gesture that ends where it began changes nothing."""
        # on press
        session, press = context.session, event.position
        point = context.pick(press)
        if point is None:
            return
        drag = self._drag(point, context)
        if drag is None:
            return
        begun = context.camera.project(drag.positions)
        farthest, threshold = 0.0, CLICK_THRESHOLD * context.ui_scale
        try:
            while True:
                event = yield
                # on release
                if event.kind == "release":
                    break
                # on move
                offset = np.subtract(event.position, press)
                farthest = max(farthest, float(np.hypot(*offset)))
                if farthest >= threshold:
                    session.preview_identity(drag.moved_to(begun + offset, context.camera))
            changed = None if session.preview is None else session.preview.identity
        finally:
            session.preview_identity(None)
        if changed is not None:
            session.set_identity(changed, "Shape the head")

    def _drag(self, point: SurfacePoint, context: ToolContext) -> "HeadDrag | None":
        """Return the drag of ``point``, or None with a notice if the head does not follow it."""
        from faceposer.identity.dragging import HeadDrag
        from faceposer.identity.editing import head_editor

        session = context.session
        if session.head_held:
            context.notify(session.head_held)
            return None
        editor = head_editor(session.base_model.character)
        if self.locked >= set(editor.segment_names):
            context.notify("All parts of the head are locked: unlock one in the tab Head")
            return None
        points = SurfacePoints.of([point])
        if not editor.on_skin(points):
            context.notify("Eyes, teeth and lashes follow the skin: drag a point of the skin")
            return None
        positions = points.positions(session.vertices, session.model.triangles)
        identity = session.document.identity or editor.own
        free = [name not in self.locked for name in editor.segment_names]
        return HeadDrag(editor, identity, points, positions, free, self.spread, self._settings.symmetry.on)

    def hint(self, context: ToolContext) -> str:
        """Return the effect of the mouse, for the status bar."""
        return "Drag on the head: change its shape   ·   Ctrl+Z: undo"
