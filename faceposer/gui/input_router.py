"""Sends what happens to the window to where it belongs: a tool, an action, or nobody because a widget has it.

Dear ImGui gets every event first, in its own callbacks. A press belongs to the view if it falls on it while no menu or
dialog is open; whoever has the press has the pointer until the last button is up.
"""

from typing import TYPE_CHECKING, Literal

from faceposer.gui.events import CloseRequest, Drop, Event, FocusLost, Key, Pointer
from faceposer.tools.tool import Button, EventKind, PointerEvent

if TYPE_CHECKING:
    from faceposer.gui.app import App

# A key that is held longer than this many seconds was not tapped.
_HOLD = 0.3


class Router:
    """Knows who has the pointer, and which key is held."""

    def __init__(self, app: "App") -> None:
        """Serve ``app``."""
        self._app = app
        self._owner: Literal["view", "widget"] | None = None
        self._held: list[Button] = []
        self._compare: tuple[float, bool] | None = None
        self._pointer: Pointer | None = None
        self._hovered: object = None

    @property
    def over_widget(self) -> bool:
        """Whether the pointer is over a panel, a menu or a dialog."""
        pointer = self._pointer
        return pointer is not None and pointer.kind != "leave" and not self._in_view(pointer)

    def route(self, events: list[Event]) -> None:
        """Handle ``events`` in their order."""
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
                self._app.files.quit()

    def follow(self) -> None:
        """Bring up to date what lies under a pointer that rests while the face or the view changes."""
        app, pointer = self._app, self._pointer
        if app.toolbox.active:
            self._hovered = None
            return
        # What lies under the pointer is not asked for while it changes by itself with every frame.
        rests = self._owner is None and not app.features.busy
        inside = pointer is not None and rests and pointer.kind != "leave" and self._in_view(pointer)
        state = (pointer, inside, app.session, app.session.revision, app.viewport.view, app.viewport.size)
        if state == self._hovered:
            return
        self._hovered = state
        if inside and pointer is not None:
            app.toolbox.dispatch(self._as_tool_event("hover", pointer, None))
        else:
            app.toolbox.leave()

    def _in_view(self, pointer: Pointer) -> bool:
        app = self._app
        if app.covered or app.guide.contains(pointer.position):
            return False
        return app.viewport.contains(pointer.position)

    def _as_tool_event(self, kind: EventKind, pointer: Pointer, button: Button | None) -> PointerEvent:
        position = self._app.viewport.local(pointer.position)
        return PointerEvent(kind, position, button, pointer.modifiers, pointer.time, wheel=pointer.wheel)

    def _on_pointer(self, pointer: Pointer) -> None:
        app = self._app
        self._pointer = pointer
        if pointer.kind == "press" and pointer.button is not None:
            if self._owner is None:
                self._owner = "view" if self._in_view(pointer) else "widget"
            self._held.append(pointer.button)
            if self._owner == "view":
                self._press_view(self._as_tool_event("press", pointer, pointer.button))
        elif pointer.kind == "release" and pointer.button in self._held:
            if self._owner == "view":
                app.toolbox.dispatch(self._as_tool_event("release", pointer, pointer.button))
            self._held.remove(pointer.button)
            if not self._held:
                self._owner = None
        elif pointer.kind == "move" and self._owner == "view" and app.toolbox.active:
            app.toolbox.dispatch(self._as_tool_event("move", pointer, self._held[0]))
        elif pointer.kind == "wheel" and self._owner != "widget" and self._in_view(pointer):
            app.toolbox.dispatch(self._as_tool_event("wheel", pointer, None))

    def _press_view(self, event: PointerEvent) -> None:
        app = self._app
        if not app.features.busy:
            app.before_press()
        elif not app.toolbox.camera_tool.begins(event, app.viewport):
            # Who stops what plays does not mean to pose what happens to be there.
            app.before_press()
            self._owner = "widget"
            return
        app.toolbox.dispatch(event)

    def _on_key(self, key: Key) -> None:
        app = self._app
        if key.kind == "release":
            if key.key == "C":
                self._release_compare(key.time)
            return
        if app.dialogs.open or app.file_dialogs.browsing or app.importing.open or app.features.covers:
            return
        if app.gui.popup_open or app.palette.open:
            again = app.palette.open and app.actions.for_key(key.key, key.modifiers) is app.actions["palette"]
            if key.key == "Esc" or (again and key.kind == "press"):
                app.palette.close()
                app.gui.close_popups()
            return
        if app.gui.io.want_text_input or (app.session.editing and not app.toolbox.active):
            return
        action = app.actions.for_key(key.key, key.modifiers)
        if action is None or (key.kind == "repeat" and not action.repeats) or not action.enabled():
            return
        if action.name == "compare":
            self._compare = (key.time, app.comparing)
        action.run()

    def _on_drop(self, paths: tuple[str, ...]) -> None:
        app = self._app
        if not app.importing.running and app.features.drop(paths):
            return
        if app.importing.takes(paths[0]):
            app.importing.drop(paths)
        elif not app.importing.running:
            app.importing.close()
            app.files.open(paths[0])

    def _release_compare(self, time: float) -> None:
        if self._compare is not None:
            begun, before = self._compare
            self._compare = None
            if time - begun > _HOLD:
                self._app.comparing = before

    def _on_focus_lost(self) -> None:
        self._app.toolbox.finish()
        self._held.clear()
        self._owner = None
        if self._compare is not None:
            self._app.comparing = self._compare[1]
            self._compare = None
