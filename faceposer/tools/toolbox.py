"""Dispatch of pointer events to the tools."""

from collections.abc import Callable

from faceposer.geometry.picture_view import PictureView
from faceposer.tools.camera_tool import CameraTool
from faceposer.tools.curve_tool import CurveTool
from faceposer.tools.distance_tool import DistanceTool
from faceposer.tools.fix_tool import FixTool
from faceposer.tools.gaze_tool import GazeTool
from faceposer.tools.head_tool import HeadTool
from faceposer.tools.photo_tool import PhotoTool
from faceposer.tools.point_tool import PointTool
from faceposer.tools.sketch_tool import SketchTool
from faceposer.tools.stroke_tool import StrokeTool
from faceposer.tools.symmetry import Mirroring
from faceposer.tools.tool import Button, Gesture, Hover, PointerEvent, PosingTool, Tool, ToolContext, ToolSettings
from faceposer.tools.trajectory_tool import TrajectoryTool


class Toolbox:
    """The tools, the chosen one, and the running gesture."""

    def __init__(self, context: ToolContext, tool_settings: ToolSettings | None = None) -> None:
        """Serve ``context`` with the options and the symmetry of ``tool_settings`` and an empty selection."""
        self._context = context
        self.tool_settings = tool_settings or ToolSettings()
        self.tool_settings.selection.set()
        self.camera_tool = CameraTool()
        self.point_tool = PointTool(self.tool_settings)
        self.distance_tool = DistanceTool(self.tool_settings)
        self.stroke_tool = StrokeTool(self.tool_settings)
        self.sketch_tool = SketchTool(self.tool_settings)
        self.curve_tool = CurveTool(self.tool_settings)
        self.fix_tool = FixTool(self.tool_settings)
        self.gaze_tool = GazeTool(self.tool_settings)
        self.trajectory_tool = TrajectoryTool(self.tool_settings)
        self.head_tool = HeadTool(self.tool_settings)
        everything: tuple[PosingTool, ...] = (
            self.point_tool,
            self.distance_tool,
            self.stroke_tool,
            self.sketch_tool,
            self.curve_tool,
            self.fix_tool,
            self.gaze_tool,
            self.trajectory_tool,
            self.head_tool,
        )
        self.tools: dict[str, PosingTool] = {tool.name: tool for tool in everything}
        # Of several handles at the same place, the first tool's is grabbed.
        with_handles = [tool for tool in everything if tool.edited_by_points]
        self._by_handle = sorted(with_handles, key=lambda tool: tool.handle_order)
        # Not listed with the others: it sets pins on photos, not constraints, and needs a photo.
        self.photo_tool = PhotoTool(self.tool_settings)
        self.chosen: PosingTool = self.point_tool
        self._gesture: Gesture | None = None
        self._gesture_button: Button | None = None
        self._active: Tool | None = None
        self.hover: Hover | None = None
        self._off_face: tuple[Hover, PosingTool, bool] | None = None

    @property
    def selection(self) -> frozenset[int]:
        """Indices of the selected constraints."""
        return self.tool_settings.selection.within(len(self._context.session.document.constraints))

    @property
    def active(self) -> bool:
        """True if a gesture is running."""
        return self._gesture is not None

    @property
    def posing(self) -> bool:
        """True if the running gesture poses the face or prepares a constraint."""
        return self._active is not None and self._active is not self.camera_tool

    @property
    def drags_points(self) -> bool:
        """True if the running gesture drags the selected points."""
        return self._active is self.point_tool

    @property
    def usable_tools(self) -> tuple[PosingTool, ...]:
        """The tools that apply to the open character."""
        return tuple(tool for tool in self.tools.values() if tool.usable(self._context.session.model.character))

    @property
    def cursor(self) -> str:
        """Name of the mouse cursor over the view; see ``faceposer.gui.cursors``."""
        if self._active is self.camera_tool:
            return "orbit"
        if self._active is not None:
            return self.chosen.drag_cursor or self.chosen.cursor if self._active is self.chosen else "grab"
        if self.hover is None:
            return "arrow"
        if self.hover.pin is not None:
            return "grab"
        return self.chosen.cursor if self.hover.surface or self._works_off_face(self.hover) else "arrow"

    def _works_off_face(self, hover: Hover) -> bool:
        """Return True if a press at ``hover`` has an effect, although it is off the face.

        Found once for each place of the pointer and not in every frame, since a tool may look around the place.
        """
        known = self._off_face
        if known is None or known[0] is not hover or known[1] is not self.chosen:
            works = self.chosen.works_at(hover.position, self._context)
            known = self._off_face = (hover, self.chosen, works)
        return known[2]

    def choose(self, name: str) -> None:
        """Choose the tool ``name``; the unfinished edit of another tool is discarded."""
        tool = self.photo_tool if name == self.photo_tool.name else self.tools[name]
        if self._gesture is None and self.chosen is not tool:
            self.chosen.left()
            self.chosen = tool

    def select(self, index: int, extend: bool = False) -> None:
        """Select the constraint ``index``, or with ``extend`` toggle its selection."""
        if extend:
            self.tool_settings.selection.toggle(index)
        else:
            self.tool_settings.selection.set(index)

    def dispatch(self, event: PointerEvent) -> None:
        """Handle ``event``: start, continue or end a gesture, zoom, remove an object, or update the hover."""
        if event.kind == "wheel":
            self.camera_tool.wheel(event, self._context)
        elif event.kind == "press":
            self._press(event)
        elif self._gesture is not None and (event.kind != "release" or event.button == self._gesture_button):
            self._send(event)
        if self._gesture is None:
            self._update_hover(event)

    def _press(self, event: PointerEvent) -> None:
        if self._gesture is not None:
            return
        if event.button == "right" and not event.modifiers:
            self._remove(event)
            return
        if self.camera_tool.begins(event, self._context):
            self._begin(self.camera_tool, event)
            return
        tool = self._tool_for(event)
        if tool is not None:
            self._begin(tool, event)
        elif event.button == "left" and not event.modifiers:
            self._begin(self.camera_tool, event)

    def _tool_for(self, event: PointerEvent) -> PosingTool | None:
        """Return the tool that handles the press ``event``, or None.

        With the point tool, a press grabs the handles of all tools; the others draw over existing handles.
        """
        if self.chosen is self.point_tool:
            for tool in self._by_handle:
                if tool.hits_handle(event, self._context):
                    return tool
        return self.chosen if self.chosen.begins(event, self._context) else None

    def _remove(self, event: PointerEvent) -> None:
        if self.chosen.remove_at(event.position, self._context):
            return
        if self.chosen is self.point_tool:
            any(tool.remove_at(event.position, self._context) for tool in self._by_handle)

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
        """Cancel the running gesture, or discard a tool's edit, or else deselect (Esc); return True if any was done."""
        if self._gesture is not None:
            gesture, self._gesture, self._active = self._gesture, None, None
            gesture.close()
            return True
        if self.chosen.discard():
            return True
        had_selection = bool(self.selection)
        self.tool_settings.selection.set()
        return had_selection

    def accept(self) -> bool:
        """Finish the edit of the tool (Enter); return True if there was one."""
        return self._gesture is None and self.chosen.accept(self._context)

    @property
    def can_step_back(self) -> bool:
        """True if ``step_back`` would revert a step."""
        self.chosen.follow_history(self._context.session.depth)
        return self.chosen.can_step_back

    @property
    def can_step_forward(self) -> bool:
        """True if ``step_forward`` would repeat a step."""
        self.chosen.follow_history(self._context.session.depth)
        return self.chosen.can_step_forward

    def step_back(self) -> bool:
        """Revert the last step of the tool's unfinished edit; return True if there was one."""
        self.chosen.follow_history(self._context.session.depth)
        return self._gesture is None and self.chosen.step_back()

    def step_forward(self) -> bool:
        """Repeat the step last reverted by ``step_back``; return True if there was one."""
        self.chosen.follow_history(self._context.session.depth)
        return self._gesture is None and self.chosen.step_forward()

    def finish(self) -> None:
        """End the running gesture at its present position, as when the window loses the pointer."""
        if self._gesture is not None:
            position = self.hover.position if self.hover else (0.0, 0.0)
            self._send(PointerEvent("release", position, self._gesture_button))

    def delete_selected(self) -> bool:
        """Remove the selected constraints that are not locked as one step; return True if there were any."""
        session = self._context.session
        constraints = session.document.constraints
        chosen = {i for i in self.selection if not constraints[i].locked}
        if self._gesture is not None or not chosen:
            return False
        chosen = self.tool_settings.symmetry.with_partners(session, chosen)
        nouns = {constraints[i].noun for i in chosen}
        noun = nouns.pop() if len(nouns) == 1 else "constraint"
        self.tool_settings.selection.before_removal(constraints)
        article = "an" if noun[0] in "aeiou" else "a"
        label = f"Remove {article} {noun}" if len(chosen) == 1 else f"Remove {len(chosen)} {noun}s"
        session.remove_constraints(chosen, label)
        return True

    def undo(self) -> None:
        """Revert the last step of the tool's unfinished edit, or else undo, with the selection before a removal."""
        session = self._context.session
        if not self.step_back() and session.can_undo:
            session.undo()
            self.tool_settings.selection.return_to(session.document.constraints)

    @property
    def selects_unlocked(self) -> bool:
        """True if a selected constraint is not locked."""
        constraints = self._context.session.document.constraints
        return any(not constraints[i].locked for i in self.selection if i < len(constraints))

    def nudge(self, dx: float, dy: float) -> bool:
        """Move the targets of the selected constraints by (dx, dy) pixels of the view; return True if any moved.

        Distances grow with an upward nudge. Consecutive nudges are one step of the history.
        """
        context = self._context
        session = context.session
        constraints = session.document.constraints
        chosen = [i for i in sorted(self.selection) if not constraints[i].locked and constraints[i].camera is not None]
        if self._gesture is not None or session.editing or not chosen:
            return False
        with session.edit("Nudge", merges=True):
            mirroring = Mirroring(self.tool_settings.symmetry, session)
            document = session.document
            for i in chosen:
                constraint = document.constraints[i]
                camera = constraint.camera
                assert camera is not None
                scale = camera.focal / context.camera.focal
                nudged = constraint.nudged((dx * scale, dy * scale))
                if nudged is not None:
                    document = document.with_constraint(i, nudged)
            session.replace(mirroring.with_images(document, chosen))
        return True

    def _update_hover(self, event: PointerEvent) -> None:
        handle = self._handle_under(event.position)
        point = self._context.pick(event.position) if handle is None else None
        self.hover = Hover(handle, point, event.position)

    def _handle_under(self, position: tuple[float, float]) -> int | None:
        """Return the constraint whose handle would be grabbed by a press at ``position``, or None."""
        context, chosen = self._context, self.chosen
        if chosen is self.point_tool:
            found = (tool.handle_under(position, context) for tool in self._by_handle)
            return next((index for index in found if index is not None), None)
        return chosen.handle_under(position, context)

    def leave(self) -> None:
        """Clear the hover: the pointer has left the view."""
        self.hover = None

    def hint(self) -> str:
        """Return the effect of the mouse, for the status bar."""
        if self._active is self.camera_tool:
            return "Move: navigate the view   ·   release: confirm   ·   Esc: cancel"
        if self._active is not None:
            return self._active.drag_hint if isinstance(self._active, PosingTool) else self.chosen.drag_hint
        pin = None if self.hover is None else self.hover.pin
        if pin is not None and self._context.session.document.constraints[pin].locked:
            return "Locked: unlock it in the list to move or remove it   ·   click: select it"
        if self.chosen is not self.point_tool:
            if pin is not None:
                return self.chosen.handle_hint
            return self.chosen.hint(self._context)
        if self.hover is None:
            return "Drag on the face: pose it   ·   F1: all keys"
        if self.hover.pin is not None:
            return "Drag: move the point   ·   right click: remove it   ·   Shift+click: extend the selection"
        if self.hover.surface:
            return self.chosen.hint(self._context)
        view = self._context.view
        if isinstance(view, PictureView) and view.locked:
            return "Wheel: zoom the photo   ·   Shift+middle drag: pan   ·   the view is locked to the photo"
        return "Drag: orbit   ·   wheel: zoom   ·   Shift+middle drag: pan"
