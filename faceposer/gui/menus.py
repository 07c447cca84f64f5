"""The table of all actions in menus and on keys."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from faceposer.gui.actions import Action, Actions, Submenu
from faceposer.gui.commands import Commands
from faceposer.gui.shell import Shell
from faceposer.tools.tool import PosingTool

# Name of the view, label, key; Ctrl gives the opposite side, as in Blender.
_VIEWS = (
    ("front", "Front", "1"),
    ("back", "Back", "Ctrl+1"),
    ("three-quarter", "Three-quarter", "2"),
    ("left", "Left", "3"),
    ("right", "Right", "Ctrl+3"),
    ("top", "Top", "7"),
    ("bottom", "Bottom", "Ctrl+7"),
)


# Entries of the menu "File" that make characters.
_CHARACTERS = ("import", "scan", "photo-head")


def _tool_actions(context: Shell, do: Commands, idle: Callable[[], bool]) -> list[Action]:
    """Return the actions that choose tools and change their settings."""

    def chosen(name: str) -> Callable[[], bool]:
        return lambda: context.toolbox.chosen.name == name

    def usable(tool: PosingTool) -> Callable[[], bool]:
        return lambda: idle() and tool.usable(context.session.model.character) and not tool.held(context.session)

    tools = [
        Action(
            f"tool-{tool.name}",
            tool.label,
            "Tools",
            partial(do.choose_tool, tool.name),
            (tool.key,) if tool.key else (),
            usable(tool),
            chosen(tool.name),
            help=tool.help,
        )
        for tool in context.toolbox.tools.values()
    ]
    nudges = [
        Action(
            f"nudge-{key.lower()}{'-far' if step > 1 else ''}",
            f"Nudge {key.lower()}{' far' if step > 1 else ''}",
            "Tools",
            partial(do.nudge, dx * step, dy * step),
            (f"Shift+{key}" if step > 1 else key,),
            lambda: idle() and context.toolbox.selects_unlocked,
            repeats=True,
            help=f"Move the selection by {step} pixel{'s' if step > 1 else ''}",
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
        idle,
        lambda: context.toolbox.tool_settings.symmetry.on,
        separated=True,
        help="Mirror edits to the other side of the face; existing asymmetry is kept",
    )
    brushes = [
        Action("brush-thinner", "Decrease brush width", "Tools", partial(do.widen_brush, 0.8), ("[",), repeats=True),
        Action("brush-wider", "Increase brush width", "Tools", partial(do.widen_brush, 1.25), ("]",), repeats=True),
    ]
    return [*tools, symmetry, *brushes, *nudges]


def _file_entries(context: Shell, idle: Callable[[], bool], others: list[Action | Submenu]) -> list[Action | Submenu]:
    """Return the entries of the menu "File" in groups: sessions, files, characters, saving, the end."""
    files = context.files
    opened = Action("open", "Open...", "File", files.open_dialog, ("Ctrl+O",), help="Open a session or a character")
    groups: list[list[Action | Submenu]] = [
        [
            Action("new", "New", "File", files.new, ("Ctrl+N",), idle, help="Start a new session with this character"),
            Submenu("new-with", "New with", "File", files.new_with, idle),
        ],
        [
            opened,
            Submenu("open-recent", "Open recent", "File", files.recent.entries, lambda: bool(context.settings.recent)),
            *(entry for entry in others if entry.label.startswith("Open")),
        ],
        [entry for entry in others if entry.name in _CHARACTERS],
        [
            Action("save", "Save", "File", files.save, ("Ctrl+S",), help="Save the session"),
            Action("save-as", "Save as...", "File", files.save_as, ("Ctrl+Shift+S",)),
        ],
        [
            Action("export", "Save OBJ", "File", files.export, ("Ctrl+E",), help="Save the posed face as OBJ"),
            Action("export-as", "Save OBJ as...", "File", files.export_as, ("Ctrl+Shift+E",)),
        ],
        [Action("quit", "Quit", "File", files.quit, ("Ctrl+Q",))],
    ]
    placed = {entry.name for group in groups for entry in group}
    groups[-2] += [entry for entry in others if entry.name not in placed]
    return [
        replace(entry, separated=i == 0 and group is not groups[0]) for group in groups for i, entry in enumerate(group)
    ]


def build_actions(context: Shell) -> Actions:
    """Return the actions of ``context``, in the order of its menus."""
    do = Commands(context)

    def idle() -> bool:
        return not context.busy

    def can_apply() -> bool:
        solvable = context.session.mode == "apply" and bool(context.session.document.constraints)
        return idle() and (solvable or context.toolbox.chosen.can_accept)

    def can_undo() -> bool:
        return idle() and (context.toolbox.can_step_back or context.session.can_undo)

    def can_redo() -> bool:
        return idle() and (context.toolbox.can_step_forward or context.session.can_redo)

    entries = context.features.actions()
    # This one has a fixed place in the menus.
    guide = entries.pop("guide")
    others = list(entries.values())
    return Actions(
        [
            *_file_entries(context, idle, [entry for entry in others if entry.menu == "File"]),
            Action("undo", "Undo", "Edit", do.undo, ("Ctrl+Z",), can_undo, repeats=True),
            Action(
                "redo",
                "Redo",
                "Edit",
                do.redo,
                ("Ctrl+Shift+Z", "Ctrl+Y"),
                can_redo,
                repeats=True,
            ),
            Action(
                "apply",
                "Apply",
                "Edit",
                do.apply,
                ("Enter", "Space"),
                can_apply,
                separated=True,
                help="Solve the constraints, or accept the curve",
            ),
            Action(
                "delete",
                "Remove selected",
                "Edit",
                do.delete_selected,
                ("Delete", "Backspace"),
                lambda: idle() and (do.pin_selected or context.toolbox.selects_unlocked or context.features.selects),
                separated=True,
            ),
            Action(
                "clear",
                "Remove all constraints",
                "Edit",
                do.clear_points,
                (),
                lambda: idle() and any(not c.locked for c in context.session.document.constraints),
                help="Remove all constraints except locked ones; the face returns to the start pose",
            ),
            Action(
                "reset",
                "Reset to neutral",
                "Edit",
                do.reset,
                ("R",),
                idle,
                help="Return to the neutral face and remove all constraints",
            ),
            Action(
                "cancel",
                "Cancel or deselect",
                "Edit",
                do.cancel,
                ("Esc",),
                help="Cancel the gesture, or deselect everything",
            ),
            Action(
                "accept-pose",
                "Accept the pose",
                "Edit",
                do.accept_pose,
                ("Ctrl+Enter",),
                lambda: idle() and bool(context.session.document.constraints),
                help="Make the current face the start pose and remove the constraints",
            ),
            *_tool_actions(context, do, idle),
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
                help="Show the neutral face; tap the key to switch, or hold it",
            ),
            Action(
                "wireframe",
                "Wireframe",
                "View",
                do.toggle_wireframe,
                ("W",),
                checked=lambda: context.wireframe,
                help="Show the edges of the mesh",
            ),
            Action(
                "clay",
                "Clay",
                "View",
                do.toggle_clay,
                ("T",),
                checked=lambda: context.shading == "clay",
                help="Show the face in plain clay, without textures",
            ),
            Action(
                "expression-lines",
                "Expression lines",
                "View",
                do.toggle_expression_lines,
                checked=lambda: context.settings.expression_lines,
                help="Show the lines of the skin in a pose: forehead, frown lines, crow's feet, nose, cheeks",
            ),
            Action(
                "contact",
                "Contact",
                "View",
                do.toggle_contact,
                checked=lambda: context.session.document.contact,
                help="Prevent lids, eyes, lips and teeth from intersecting",
            ),
            Action(
                "points",
                "Show constraints",
                "View",
                do.toggle_points,
                ("P",),
                checked=lambda: context.points_shown,
                help="Show pins, strokes and curves over the face",
            ),
            Action(
                "panel",
                "Side panel",
                "View",
                do.toggle_panel,
                ("N",),
                checked=lambda: context.panel_shown,
                help="Show the tools and the side panel",
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
                idle,
                help="Search all commands by name",
            ),
            guide,
            Action("keys", "Keys and mouse", "Help", do.show_keys, ("F1",), idle),
            Action("messages", "Messages", "Help", do.show_messages, (), idle, help="Read the last notices again"),
            Action("about", "About Face Poser", "Help", do.about, (), idle),
        ]
    )
