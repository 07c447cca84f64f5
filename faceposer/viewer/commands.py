"""The table of what the window can do."""

from typing import TYPE_CHECKING

from faceposer.viewer.actions import Action, Actions

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


def build_actions(app: "App") -> Actions:
    """Return the actions of ``app``, in the order of its menus."""

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
                app.apply,
                ("Enter", "Space"),
                applies,
                separated=True,
                help="Let the face follow the points",
            ),
            Action(
                "delete",
                "Delete selected points",
                "Edit",
                app.delete_selected,
                ("Delete", "Backspace"),
                lambda: free() and bool(app.toolbox.selection),
                separated=True,
            ),
            Action(
                "clear",
                "Clear all points",
                "Edit",
                app.clear_points,
                (),
                lambda: free() and bool(app.session.document.constraints),
                help="Remove all points and return to the pose that they pulled the face away from",
            ),
            Action(
                "reset", "Reset to neutral", "Edit", app.reset, ("R",), free, help="Back to the neutral face, no points"
            ),
            Action(
                "cancel", "Cancel or deselect", "Edit", app.cancel, ("Esc",), help="Take back the gesture, or deselect"
            ),
            *(
                Action(f"view-{name}", label, "View", lambda name=name: app.look(name), (key,))  # type: ignore[misc]
                for name, label, key in _VIEWS
            ),
            Action("frame", "Frame the face", "View", app.viewport.frame_face, ("F",), separated=True),
            Action(
                "compare",
                "Compare with neutral",
                "View",
                app.compare,
                ("C",),
                checked=lambda: app.comparing,
                separated=True,
                help="Show the neutral face: tap to switch, or hold",
            ),
            Action(
                "wireframe",
                "Wireframe",
                "View",
                app.toggle_wireframe,
                ("W",),
                checked=lambda: app.wireframe,
                help="Draw the edges of the mesh",
            ),
            Action(
                "clay",
                "Clay",
                "View",
                app.toggle_clay,
                ("T",),
                checked=lambda: app.shading == "clay",
                help="Draw without textures",
            ),
            Action(
                "points",
                "Show points",
                "View",
                app.toggle_points,
                ("P",),
                checked=lambda: app.points_shown,
                help="Draw the pins over the face",
            ),
            Action(
                "panel",
                "Side panel",
                "View",
                app.toggle_panel,
                ("N",),
                checked=lambda: app.panel_shown,
                help="Show the panel at the right",
            ),
            Action(
                "blender",
                "Navigate as in Blender",
                "View",
                lambda: app.navigate("blender"),
                checked=lambda: app.viewport.navigation == "blender",
                separated=True,
            ),
            Action(
                "maya",
                "Navigate as in Maya",
                "View",
                lambda: app.navigate("maya"),
                checked=lambda: app.viewport.navigation == "maya",
            ),
            Action("keys", "Keys and mouse", "Help", app.toggle_keys, ("F1",)),
            Action("about", "About Face Poser", "Help", app.about),
        ]
    )
