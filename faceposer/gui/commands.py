"""What menus and keys do, files aside."""

from importlib import metadata

import numpy as np

from faceposer.gui.shell import Shell
from faceposer.gui.widgets.dialogs import Question
from faceposer.tools.tool import Navigation


class Commands:
    """The functions behind the menus' entries."""

    def __init__(self, context: Shell) -> None:
        """Serve ``context``."""
        self._context = context

    def apply(self) -> None:
        """Finish what the tool has begun, or else let the face follow the constraints."""
        if not self._context.toolbox.accept() and self._context.session.mode == "apply":
            self._context.session.apply()

    def undo(self) -> None:
        """Take back the last step, first of what the tool has begun."""
        if not self._context.toolbox.step_back():
            self._context.session.undo()

    def redo(self) -> None:
        """Do the last undone step again."""
        if not self._context.toolbox.step_forward():
            self._context.session.redo()

    def choose_tool(self, name: str) -> None:
        """Take up the tool ``name``."""
        self._context.toolbox.choose(name)

    def toggle_symmetry(self) -> None:
        """Mirror what is drawn, or not."""
        symmetry = self._context.toolbox.tool_settings.symmetry
        symmetry.on = not symmetry.on

    def accept_pose(self) -> None:
        """Start from the current face."""
        self._context.toolbox.cancel()
        self._context.session.accept_pose()

    def widen_brush(self, factor: float) -> None:
        """Make the brush of the chosen tool wider or thinner."""
        options = self._context.toolbox.tool_settings.options
        if self._context.toolbox.chosen is self._context.toolbox.fix_tool:
            options.fix_brush = min(max(options.fix_brush * factor, 4.0), 160.0)
        else:
            options.brush = min(max(options.brush * factor, 1.0), 60.0)

    def nudge(self, dx: float, dy: float) -> None:
        """Move the targets of what is selected by pixels."""
        self._context.toolbox.nudge(dx, dy)

    def delete_selected(self) -> None:
        """Remove the selected pin of a photo, or the selected points and what else is selected."""
        if self.pin_selected:
            photo_tool = self._context.toolbox.photo_tool
            photo_tool.remove(photo_tool.selected or 0, self._context.viewport)
        else:
            self._context.toolbox.delete_selected()
            self._context.features.delete_selected()

    @property
    def pin_selected(self) -> bool:
        """Whether what would be deleted is a pin of a photo."""
        toolbox = self._context.toolbox
        return toolbox.chosen is toolbox.photo_tool and toolbox.photo_tool.selected is not None

    def clear_points(self) -> None:
        """Remove all constraints that are not locked."""
        self._context.toolbox.cancel()
        free = {i for i, c in enumerate(self._context.session.document.constraints) if not c.locked}
        self._context.session.remove_constraints(free, "Clear all constraints")

    def reset(self) -> None:
        """Return to the neutral face."""
        self._context.toolbox.cancel()
        self._context.comparing = False
        if self._context.session.document.constraints or np.any(self._context.session.coefficients):
            self._context.session.reset_pose()

    def cancel(self) -> None:
        """Take back the gesture, or deselect, or put the guided pose away."""
        if not self._context.toolbox.cancel():
            self._context.features.cancel()

    def compare(self) -> None:
        """Show the neutral face, or the pose again."""
        if not self._context.toolbox.active:
            self._context.comparing = not self._context.comparing

    def look(self, name: str) -> None:
        """Turn the view."""
        if not self._context.toolbox.active:
            self._context.viewport.look(name)

    def navigate(self, preset: Navigation) -> None:
        """Let the mouse buttons move the view as in another program."""
        self._context.viewport.navigation = self._context.settings.navigation = preset

    def toggle_wireframe(self) -> None:
        """Draw the edges of the mesh, or not."""
        self._context.wireframe = not self._context.wireframe

    def toggle_clay(self) -> None:
        """Draw without textures, or with them."""
        self._context.shading = "full" if self._context.shading == "clay" else "clay"

    def toggle_expression_lines(self) -> None:
        """Draw the lines of the skin that a pose makes, or not."""
        shown = not self._context.settings.expression_lines
        self._context.settings.expression_lines = self._context.scene.expression_lines = shown

    def toggle_contact(self) -> None:
        """Keep surfaces apart, or not."""
        session = self._context.session
        if not session.editing:
            session.set_contact(not session.document.contact)

    def toggle_points(self) -> None:
        """Draw the pins, or not."""
        self._context.points_shown = not self._context.points_shown

    def toggle_panel(self) -> None:
        """Show the side panel, or not."""
        self._context.panel_shown = not self._context.panel_shown

    def toggle_keys(self) -> None:
        """Show the sheet of keys."""
        self._context.dialogs.keys_shown = True

    def about(self) -> None:
        """Show who made what."""
        character = self._context.session.model.character
        self._context.dialogs.ask(Question("Face Poser", about_text(character.title, character.credits)))


def about_text(character: str, credits: str) -> str:
    """Return what "About" says: version, licence, and where the ``character`` comes from."""
    try:
        version = f"Version {metadata.version('faceposer')}"
    except metadata.PackageNotFoundError:
        version = "Version unknown: the package is not installed"
    return (
        "Pose 3D faces by dragging: the whole face follows as a real face would.\n\n"
        f"{version}. Licence: MIT; its text is in the file LICENSE.\n\n{character}: {credits}"
    )
