"""What the window can do, and the table of it."""

from typing import TYPE_CHECKING

import numpy as np

from faceposer.tools.tool import Navigation
from faceposer.viewer.actions import Action, Actions, Submenu
from faceposer.viewer.panels.dialogs import Question

if TYPE_CHECKING:
    from faceposer.viewer.app import App

# Name of the view, label, key; Ctrl gives the opposite side, as Blender's users know it.
_VIEWS = (
    ("front", "Front", "1"),
    ("back", "Back", "Ctrl+1"),
    ("three-quarter", "Three-quarter", "2"),
    ("left", "Left side", "3"),
    ("right", "Right side", "Ctrl+3"),
    ("top", "Top", "7"),
    ("bottom", "Bottom", "Ctrl+7"),
)


class Commands:
    """What menus and keys do, files aside."""

    def __init__(self, app: "App") -> None:
        """Serve ``app``."""
        self._app = app

    def apply(self) -> None:
        """Let the face follow the points."""
        self._app.session.apply()

    def delete_selected(self) -> None:
        """Remove the selected points."""
        self._app.toolbox.delete_selected()

    def clear_points(self) -> None:
        """Remove all points."""
        count = len(self._app.session.document.constraints)
        self._app.toolbox.cancel()
        self._app.session.remove_constraints(set(range(count)), "Clear all points")

    def reset(self) -> None:
        """Return to the neutral face."""
        self._app.toolbox.cancel()
        self._app.comparing = False
        if self._app.session.document.constraints or np.any(self._app.session.coefficients):
            self._app.session.reset_pose()

    def cancel(self) -> None:
        """Take back the gesture, or deselect."""
        self._app.toolbox.cancel()

    def compare(self) -> None:
        """Show the neutral face, or the pose again."""
        if not self._app.toolbox.active:
            self._app.comparing = not self._app.comparing

    def look(self, name: str) -> None:
        """Turn the view."""
        if not self._app.toolbox.active:
            self._app.viewport.look(name)

    def navigate(self, preset: Navigation) -> None:
        """Let the mouse buttons move the view as in another program."""
        self._app.viewport.navigation = self._app.settings.navigation = preset

    def toggle_wireframe(self) -> None:
        """Draw the edges of the mesh, or not."""
        self._app.wireframe = not self._app.wireframe

    def toggle_clay(self) -> None:
        """Draw without textures, or with them."""
        self._app.shading = "full" if self._app.shading == "clay" else "clay"

    def toggle_points(self) -> None:
        """Draw the pins, or not."""
        self._app.points_shown = not self._app.points_shown

    def toggle_panel(self) -> None:
        """Show the side panel, or not."""
        self._app.panel_shown = not self._app.panel_shown

    def toggle_keys(self) -> None:
        """Show the sheet of keys."""
        self._app.dialogs.keys_shown = True

    def about(self) -> None:
        """Show who made what."""
        subject = self._app.session.model.subject
        text = f"Pose 3D faces by dragging: the whole face follows as a real face would.\n\n{subject.credits}"
        self._app.dialogs.ask(Question("Face Poser", text))


def build_actions(app: "App") -> Actions:
    """Return the actions of ``app``, in the order of its menus."""
    do = Commands(app)

    def free() -> bool:
        return not app.busy

    def applies() -> bool:
        return free() and app.session.mode == "apply" and bool(app.session.document.constraints)

    def undo() -> None:
        app.session.undo()

    def redo() -> None:
        app.session.redo()

    return Actions(
        [
            Action("open", "Open...", "File", app.files.open_dialog, ("Ctrl+O",), help="Open a session or a subject"),
            Submenu("open-recent", "Open recent", "File", app.files.recent.entries, lambda: bool(app.settings.recent)),
            Action("save", "Save", "File", app.files.save, ("Ctrl+S",), separated=True, help="Save the session"),
            Action("save-as", "Save as...", "File", app.files.save_as, ("Ctrl+Shift+S",)),
            Action("export", "Save OBJ", "File", app.files.export, ("Ctrl+E",), help="Save the posed face as OBJ"),
            Action("export-as", "Save OBJ as...", "File", app.files.export_as, ("Ctrl+Shift+E",)),
            Action("quit", "Quit", "File", app.files.quit, ("Ctrl+Q",), separated=True),
            Action("undo", "Undo", "Edit", undo, ("Ctrl+Z",), lambda: free() and app.session.can_undo, repeats=True),
            Action(
                "redo",
                "Redo",
                "Edit",
                redo,
                ("Ctrl+Shift+Z", "Ctrl+Y"),
                lambda: free() and app.session.can_redo,
                repeats=True,
            ),
            Action(
                "apply",
                "Apply",
                "Edit",
                do.apply,
                ("Enter", "Space"),
                applies,
                separated=True,
                help="Let the face follow the points",
            ),
            Action(
                "delete",
                "Delete selected points",
                "Edit",
                do.delete_selected,
                ("Delete", "Backspace"),
                lambda: free() and bool(app.toolbox.selection),
                separated=True,
            ),
            Action(
                "clear",
                "Clear all points",
                "Edit",
                do.clear_points,
                (),
                lambda: free() and bool(app.session.document.constraints),
                help="Remove all points and return to the pose that they pulled the face away from",
            ),
            Action(
                "reset", "Reset to neutral", "Edit", do.reset, ("R",), free, help="Back to the neutral face, no points"
            ),
            Action(
                "cancel", "Cancel or deselect", "Edit", do.cancel, ("Esc",), help="Take back the gesture, or deselect"
            ),
            *(
                Action(f"view-{name}", label, "View", lambda name=name: do.look(name), (key,))  # type: ignore[misc]
                for name, label, key in _VIEWS
            ),
            Action("frame", "Frame the face", "View", app.viewport.frame_face, ("F",), separated=True),
            Action(
                "compare",
                "Compare with neutral",
                "View",
                do.compare,
                ("C",),
                checked=lambda: app.comparing,
                separated=True,
                help="Show the neutral face: tap to switch, or hold",
            ),
            Action(
                "wireframe",
                "Wireframe",
                "View",
                do.toggle_wireframe,
                ("W",),
                checked=lambda: app.wireframe,
                help="Draw the edges of the mesh",
            ),
            Action(
                "clay",
                "Clay",
                "View",
                do.toggle_clay,
                ("T",),
                checked=lambda: app.shading == "clay",
                help="Draw without textures",
            ),
            Action(
                "points",
                "Show points",
                "View",
                do.toggle_points,
                ("P",),
                checked=lambda: app.points_shown,
                help="Draw the pins over the face",
            ),
            Action(
                "panel",
                "Side panel",
                "View",
                do.toggle_panel,
                ("N",),
                checked=lambda: app.panel_shown,
                help="Show the panel at the right",
            ),
            Action(
                "blender",
                "Navigate as in Blender",
                "View",
                lambda: do.navigate("blender"),
                checked=lambda: app.viewport.navigation == "blender",
                separated=True,
            ),
            Action(
                "maya",
                "Navigate as in Maya",
                "View",
                lambda: do.navigate("maya"),
                checked=lambda: app.viewport.navigation == "maya",
            ),
            Action("keys", "Keys and mouse", "Help", do.toggle_keys, ("F1",)),
            Action("about", "About Face Poser", "Help", do.about),
        ]
    )
