"""The table of everything that menus and keys do."""

from collections.abc import Callable
from functools import partial

from faceposer.gui.actions import Action, Actions, Submenu
from faceposer.gui.commands import Commands
from faceposer.gui.shell import Shell
from faceposer.tools.gaze_tool import eyes_of

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

# Name of the tool, label, key, what it is for.
_TOOLS = (
    ("point", "Points", "Q", "Drag points of the face, and whatever has a handle"),
    ("distance", "Distance", "D", "Set how far apart two points appear, such as the height of the mouth"),
    ("stroke", "Stroke", "S", "Draw on the face what should move, then where it should be"),
    ("curve", "Curve", "K", "Click a curve on the face and drag its points"),
    ("fix", "Fix", "H", "Hold vertices where they are"),
    ("gaze", "Gaze", "G", "Let both eyes follow a ring, by dragging anywhere in the view"),
    ("trajectory", "Trajectories", "J", "Draw the paths of points over time, which the face then follows"),
)


def _tool_actions(context: Shell, do: Commands, free: Callable[[], bool]) -> list[Action]:
    """Return the actions that choose tools and change how they work."""

    def chosen(name: str) -> Callable[[], bool]:
        return lambda: context.toolbox.chosen.name == name

    def usable(name: str) -> Callable[[], bool]:
        return lambda: free() and (name != "gaze" or eyes_of(context.session.model.character) is not None)

    tools = [
        Action(
            f"tool-{name}", label, "Tools", partial(do.choose_tool, name), (key,), usable(name), chosen(name), help=text
        )
        for name, label, key, text in _TOOLS
    ]
    nudges = [
        Action(
            f"nudge-{key.lower()}{'-far' if step > 1 else ''}",
            f"Nudge {key.lower()}{' far' if step > 1 else ''}",
            "Tools",
            partial(do.nudge, dx * step, dy * step),
            (f"Shift+{key}" if step > 1 else key,),
            lambda: free() and bool(context.toolbox.selection),
            repeats=True,
            help=f"Move what is selected by {step} pixel{'s' if step > 1 else ''}",
            listed=False,
        )
        for step in (1, 10)
        for key, dx, dy in (("Left", -1, 0), ("Right", 1, 0), ("Up", 0, -1), ("Down", 0, 1))
    ]
    symmetry = Action(
        "symmetry",
        "Symmetry",
        "Tools",
        do.toggle_symmetry,
        ("X",),
        free,
        lambda: context.toolbox.tool_settings.symmetry.on,
        separated=True,
        help="Mirror what is drawn to the other side; what is uneven already stays so",
    )
    brushes = [
        Action("brush-thinner", "Thinner brush", "Tools", partial(do.widen_brush, 0.8), ("[",), repeats=True),
        Action("brush-wider", "Wider brush", "Tools", partial(do.widen_brush, 1.25), ("]",), repeats=True),
    ]
    return [*tools, symmetry, *brushes, *nudges]


def _draws_trajectories(context: Shell) -> bool:
    tool = context.toolbox.trajectory_tool
    return context.toolbox.chosen is tool and bool(tool.drawn)


def build_actions(context: Shell) -> Actions:
    """Return the actions of ``context``, in the order of its menus."""
    do = Commands(context)

    def free() -> bool:
        return not context.busy

    def applies() -> bool:
        waits = context.session.mode == "apply" and bool(context.session.document.constraints)
        begun = bool(context.toolbox.curve_tool.points) or _draws_trajectories(context)
        return free() and (waits or begun)

    def undoes() -> bool:
        toolbox = context.toolbox
        begun = toolbox.curve_tool.points or toolbox.stroke_tool.draws_target or toolbox.distance_tool.first
        drawn = toolbox.chosen is toolbox.trajectory_tool and toolbox.trajectory_tool.can_step_back
        return free() and (bool(begun) or drawn or context.session.can_undo)

    def redoes() -> bool:
        toolbox = context.toolbox
        drawn = toolbox.chosen is toolbox.trajectory_tool and toolbox.trajectory_tool.can_step_forward
        return free() and (drawn or context.session.can_redo)

    of_features = context.features.actions()
    # These two stand among the program's own entries.
    importing, guide = of_features.pop("import"), of_features.pop("guide")
    others = list(of_features.values())
    return Actions(
        [
            Action(
                "new",
                "New",
                "File",
                context.files.new,
                ("Ctrl+N",),
                free,
                help="Begin a new session with this character; changes that are not saved are asked about",
            ),
            Submenu("new-with", "New with", "File", context.files.new_with, free),
            Action(
                "open", "Open...", "File", context.files.open_dialog, ("Ctrl+O",), help="Open a session or a character"
            ),
            Submenu(
                "open-recent",
                "Open recent",
                "File",
                context.files.recent.entries,
                lambda: bool(context.settings.recent),
            ),
            importing,
            Action("save", "Save", "File", context.files.save, ("Ctrl+S",), separated=True, help="Save the session"),
            Action("save-as", "Save as...", "File", context.files.save_as, ("Ctrl+Shift+S",)),
            Action("export", "Save OBJ", "File", context.files.export, ("Ctrl+E",), help="Save the posed face as OBJ"),
            Action("export-as", "Save OBJ as...", "File", context.files.export_as, ("Ctrl+Shift+E",)),
            *(entry for entry in others if entry.menu == "File"),
            Action("quit", "Quit", "File", context.files.quit, ("Ctrl+Q",), separated=True),
            Action("undo", "Undo", "Edit", do.undo, ("Ctrl+Z",), undoes, repeats=True),
            Action(
                "redo",
                "Redo",
                "Edit",
                do.redo,
                ("Ctrl+Shift+Z", "Ctrl+Y"),
                redoes,
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
                help="Accept the curve, or let the face follow the constraints",
            ),
            Action(
                "delete",
                "Delete selected",
                "Edit",
                do.delete_selected,
                ("Delete", "Backspace"),
                lambda: free() and (do.pin_selected or bool(context.toolbox.selection) or context.features.selects),
                separated=True,
            ),
            Action(
                "clear",
                "Clear all constraints",
                "Edit",
                do.clear_points,
                (),
                lambda: free() and any(not c.locked for c in context.session.document.constraints),
                help="Remove all constraints that are not locked; the face returns to where it was without them",
            ),
            Action(
                "reset",
                "Reset to neutral",
                "Edit",
                do.reset,
                ("R",),
                free,
                help="Back to the neutral face, no constraints",
            ),
            Action(
                "cancel", "Cancel or deselect", "Edit", do.cancel, ("Esc",), help="Take back the gesture, or deselect"
            ),
            Action(
                "accept-pose",
                "Accept the pose",
                "Edit",
                do.accept_pose,
                ("Ctrl+Enter",),
                lambda: free() and bool(context.session.document.constraints),
                help="Make this face the one to start from, and clear the constraints",
            ),
            *_tool_actions(context, do, free),
            *(
                Action(f"view-{name}", label, "View", lambda name=name: do.look(name), (key,))  # type: ignore[misc]
                for name, label, key in _VIEWS
            ),
            Action("frame", "Frame the face", "View", context.viewport.frame_face, ("F",), separated=True),
            Action(
                "compare",
                "Compare with neutral",
                "View",
                do.compare,
                ("C",),
                checked=lambda: context.comparing,
                separated=True,
                help="Show the neutral face: tap to switch, or hold",
            ),
            Action(
                "wireframe",
                "Wireframe",
                "View",
                do.toggle_wireframe,
                ("W",),
                checked=lambda: context.wireframe,
                help="Draw the edges of the mesh",
            ),
            Action(
                "clay",
                "Clay",
                "View",
                do.toggle_clay,
                ("T",),
                checked=lambda: context.shading == "clay",
                help="Draw without textures",
            ),
            Action(
                "expression-lines",
                "Expression lines",
                "View",
                do.toggle_expression_lines,
                checked=lambda: context.settings.expression_lines,
                help="Draw the lines that a pose makes in the skin: forehead, frown lines, crow's feet, nose, cheeks",
            ),
            Action(
                "contact",
                "Contact",
                "View",
                do.toggle_contact,
                checked=lambda: context.session.document.contact,
                help="Keep lids on the eyes and off each other, lips before the teeth, and teeth inside",
            ),
            Action(
                "points",
                "Show constraints",
                "View",
                do.toggle_points,
                ("P",),
                checked=lambda: context.points_shown,
                help="Draw pins, strokes and curves over the face",
            ),
            Action(
                "panel",
                "Side panel",
                "View",
                do.toggle_panel,
                ("N",),
                checked=lambda: context.panel_shown,
                help="Show the panel at the right",
            ),
            Action(
                "blender",
                "Navigate as in Blender",
                "View",
                lambda: do.navigate("blender"),
                checked=lambda: context.viewport.navigation == "blender",
                separated=True,
            ),
            Action(
                "maya",
                "Navigate as in Maya",
                "View",
                lambda: do.navigate("maya"),
                checked=lambda: context.viewport.navigation == "maya",
            ),
            *(entry for entry in others if entry.menu != "File"),
            Action(
                "palette",
                "Find a command...",
                "Help",
                context.palette.show,
                ("Ctrl+P",),
                free,
                help="The command palette: everything there is, by a few letters of its name",
            ),
            guide,
            Action("keys", "Keys and mouse", "Help", do.toggle_keys, ("F1",)),
            Action("about", "About Face Poser", "Help", do.about),
        ]
    )
