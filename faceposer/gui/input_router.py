"""Routing of events to tools and actions.

Dear ImGui gets every event first, in its own callbacks. A press on the view belongs to the tools unless a menu or a
dialog is open; the owner of the press owns the pointer until the last button is released.
"""

from typing import Literal

from faceposer.gui.actions import format_key
from faceposer.gui.events import CloseRequest, Drop, Event, FocusLost, Key, Pointer
from faceposer.gui.shell import Shell
from faceposer.tools.tool import Button, EventKind, PointerEvent

# Seconds from which a pressed key counts as held.
_HOLD = 0.3


class Router:
    """Router of events, with the owner of the pointer and the held keys."""

    def __init__(self, context: Shell) -> None:
        """Route the events of ``context``."""
        self._context = context
        self._owner: Literal["view", "widget"] | None = None
        self._held: list[Button] = []
        self._compare: tuple[float, bool] | None = None
        self._compare_key = ""
        self._pointer: Pointer | None = None
        self._hovered: object = None

    @property
    def over_widget(self) -> bool:
        """True if the pointer is over a panel, a menu or a dialog."""
        pointer = self._pointer
        return pointer is not None and pointer.kind != "leave" and not self._in_view(pointer)

    def route(self, events: list[Event]) -> None:
        """Handle ``events`` in order."""
        for event in events:
            if isinstance(event, Pointer):
                self._on_pointer(event)
            elif isinstance(event, Key):
                self._on_key(event)
            elif isinstance(event, Drop):
                self._on_drop(event.paths)
            elif isinstance(event, FocusLost):
                self._on_focus_lost()
            elif isinstance(event, CloseRequest):
                self._context.files.quit()

    def update(self) -> None:
        """Update the hovered point of the face when face, view or tool change under the pointer."""
        context, pointer = self._context, self._pointer
        if context.toolbox.active:
            self._hovered = None
            return
        # Picking is too slow while the face changes with every frame, as during playback.
        idle = self._owner is None and not context.features.busy
        inside = pointer is not None and idle and pointer.kind != "leave" and self._in_view(pointer)
        state = (
            pointer,
            inside,
            context.session,
            context.session.revision,
            context.viewport.view,
            context.viewport.size,
            context.toolbox.chosen,
        )
        if state == self._hovered:
            return
        self._hovered = state
        if inside and pointer is not None:
            context.toolbox.dispatch(self._as_tool_event("hover", pointer, None))
        else:
            context.toolbox.leave()

    def _in_view(self, pointer: Pointer) -> bool:
        context = self._context
        if context.is_modal or context.features.contains(pointer.position):
            return False
        return context.viewport.contains(pointer.position)

    def _as_tool_event(self, kind: EventKind, pointer: Pointer, button: Button | None) -> PointerEvent:
        position = self._context.viewport.local(pointer.position)
        return PointerEvent(kind, position, button, pointer.modifiers, pointer.time, wheel=pointer.wheel)

    def _on_pointer(self, pointer: Pointer) -> None:
        context = self._context
        self._pointer = pointer
        if pointer.kind == "press" and pointer.button is not None:
            if self._owner is None:
                self._owner = "view" if self._in_view(pointer) else "widget"
            self._held.append(pointer.button)
            if self._owner == "view":
                self._press_view(self._as_tool_event("press", pointer, pointer.button))
        elif pointer.kind == "release" and pointer.button in self._held:
            if self._owner == "view":
                context.toolbox.dispatch(self._as_tool_event("release", pointer, pointer.button))
            self._held.remove(pointer.button)
            if not self._held:
                self._owner = None
        elif pointer.kind == "move" and self._owner == "view" and context.toolbox.active:
            context.toolbox.dispatch(self._as_tool_event("move", pointer, self._held[0]))
        elif pointer.kind == "wheel" and self._owner != "widget" and self._in_view(pointer):
            context.toolbox.dispatch(self._as_tool_event("wheel", pointer, None))

    def _press_view(self, event: PointerEvent) -> None:
        context = self._context
        if not context.features.busy:
            context.before_press()
        elif not context.toolbox.camera_tool.begins(event, context.viewport):
            # A press that stops playback must not pose the face.
            context.before_press()
            self._owner = "widget"
            return
        context.toolbox.dispatch(event)

    def _on_key(self, key: Key) -> None:
        context = self._context
        if key.kind == "release":
            if key.key == self._compare_key:
                self._release_compare(key.time)
            return
        if key.kind == "press" and context.features.take_key(format_key(key.key, key.modifiers)):
            return
        if context.dialogs.open or context.file_dialogs.browsing or context.features.is_modal:
            return
        if context.gui.popup_open or context.palette.open:
            toggles = (
                context.palette.open and context.actions.for_key(key.key, key.modifiers) is context.actions["palette"]
            )
            if key.key == "Esc" or (toggles and key.kind == "press"):
                context.palette.close()
                context.gui.close_popups()
            return
        if context.gui.io.want_text_input or (context.session.editing and not context.toolbox.active):
            return
        action = context.actions.for_key(key.key, key.modifiers)
        if action is None or (key.kind == "repeat" and not action.repeats) or not action.enabled():
            return
        if action.name == "compare":
            self._compare, self._compare_key = (key.time, context.comparing), key.key
        action.run()

    def _on_drop(self, paths: tuple[str, ...]) -> None:
        context = self._context
        if not context.features.blocks_files and not context.features.accept_files(paths):
            context.files.open(paths[0])

    def _release_compare(self, time: float) -> None:
        if self._compare is not None:
            begun, before = self._compare
            self._compare = None
            if time - begun > _HOLD:
                self._context.comparing = before

    def _on_focus_lost(self) -> None:
        self._context.toolbox.finish()
        self._held.clear()
        self._owner = None
        if self._compare is not None:
            self._context.comparing = self._compare[1]
            self._compare = None
