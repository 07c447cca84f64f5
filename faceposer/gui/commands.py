"""Commands behind the actions, other than those for files."""

from importlib import metadata

import numpy as np

from faceposer.gui.shell import Shell
from faceposer.gui.widgets.dialogs import Question
from faceposer.tools.tool import Navigation


class Commands:
    """Implementation of the actions in menus and on keys."""

    def __init__(self, context: Shell) -> None:
        """Act on ``context``."""
        self._context = context

    def apply(self) -> None:
        """Finish the pending work of the tool; if there is none, solve the constraints."""
        if not self._context.toolbox.accept() and self._context.session.mode == "apply":
            self._context.session.apply()

    def undo(self) -> None:
        """Undo the last step, first that of the tool's pending work."""
        self._context.toolbox.undo()

    def redo(self) -> None:
        """Redo the last undone step."""
        if not self._context.toolbox.step_forward():
            self._context.session.redo()

    def choose_tool(self, name: str) -> None:
        """Choose the tool ``name``."""
        self._context.toolbox.choose(name)

    def toggle_symmetry(self) -> None:
        """Switch symmetry on or off."""
        symmetry = self._context.toolbox.tool_settings.symmetry
        symmetry.on = not symmetry.on

    def accept_pose(self) -> None:
        """Make the current face the start pose."""
        self._context.toolbox.cancel()
        self._context.session.accept_pose()

    def widen_brush(self, factor: float) -> None:
        """Multiply the width of the chosen tool's brush by ``factor``."""
        options = self._context.toolbox.tool_settings.options
        if self._context.toolbox.chosen is self._context.toolbox.fix_tool:
            options.fix_brush = min(max(options.fix_brush * factor, 4.0), 160.0)
        else:
            options.brush = min(max(options.brush * factor, 1.0), 60.0)

    def nudge(self, dx: float, dy: float) -> None:
        """Move the selected targets by (``dx``, ``dy``) pixels."""
        self._context.toolbox.nudge(dx, dy)

    def delete_selected(self) -> None:
        """Remove the selected pin of a photo, or the selected constraints and the selection of features."""
        if self.pin_selected:
            photo_tool = self._context.toolbox.photo_tool
            photo_tool.remove(photo_tool.selected or 0, self._context.viewport)
        else:
            # First, since without a selection of constraints a feature may remove what is not one yet.
            self._context.features.delete_selected()
            self._context.toolbox.delete_selected()

    @property
    def pin_selected(self) -> bool:
        """True if a pin of a photo is selected."""
        toolbox = self._context.toolbox
        return toolbox.chosen is toolbox.photo_tool and toolbox.photo_tool.selected is not None

    def clear_points(self) -> None:
        """Remove all constraints that are not locked."""
        self._context.toolbox.cancel()
        free = {i for i, c in enumerate(self._context.session.document.constraints) if not c.locked}
        self._context.session.remove_constraints(free, "Remove all constraints")

    def reset(self) -> None:
        """Return to the neutral face."""
        self._context.toolbox.cancel()
        self._context.comparing = False
        if self._context.session.document.constraints or np.any(self._context.session.coefficients):
            self._context.session.reset_pose()

    def cancel(self) -> None:
        """Cancel the gesture, or deselect, or close the guided pose."""
        if not self._context.toolbox.cancel():
            self._context.features.cancel()

    def compare(self) -> None:
        """Switch between the neutral face and the pose."""
        if not self._context.toolbox.active:
            self._context.comparing = not self._context.comparing

    def look(self, name: str) -> None:
        """Turn the view to the direction ``name``."""
        if not self._context.toolbox.active:
            self._context.viewport.look(name)

    def navigate(self, preset: Navigation) -> None:
        """Navigate with the mouse buttons of another program."""
        self._context.viewport.navigation = self._context.settings.navigation = preset

    def toggle_wireframe(self) -> None:
        """Show or hide the edges of the mesh."""
        self._context.wireframe = not self._context.wireframe

    def toggle_clay(self) -> None:
        """Switch between clay and textures."""
        self._context.shading = "full" if self._context.shading == "clay" else "clay"

    def toggle_expression_lines(self) -> None:
        """Show or hide expression lines."""
        shown = not self._context.settings.expression_lines
        self._context.settings.expression_lines = self._context.scene.expression_lines = shown

    def toggle_contact(self) -> None:
        """Switch contact on or off."""
        session = self._context.session
        if not session.editing:
            session.set_contact(not session.document.contact)

    def toggle_points(self) -> None:
        """Show or hide the marks of constraints."""
        self._context.points_shown = not self._context.points_shown

    def toggle_panel(self) -> None:
        """Show or hide the side panel."""
        self._context.panel_shown = not self._context.panel_shown

    def show_keys(self) -> None:
        """Show the list of keys."""
        self._context.dialogs.keys_shown = True

    def show_messages(self) -> None:
        """Show the notices of this run again, the last one first."""
        said = self._context.messages[::-1]
        text = "Notices of the view since the start, the last one first." if said else "There was no notice yet."
        self._context.dialogs.ask(Question("Messages", text, details="\n\n".join(said)))

    def about(self) -> None:
        """Show version, licence and credits."""
        character = self._context.session.model.character
        self._context.dialogs.ask(Question("Face Poser", about_text(character.title, character.credits)))


def about_text(character: str, credits: str) -> str:
    """Return the text of "About": version, licence, and the credits of the ``character``."""
    try:
        version = f"Version {metadata.version('faceposer')}"
    except metadata.PackageNotFoundError:
        version = "Version unknown (the package is not installed)"
    return (
        "Pose 3D faces by dragging: the whole face follows, as a real face would.\n\n"
        f"{version}. Licence: MIT; see the file LICENSE.\n\n{character}: {credits}"
    )
