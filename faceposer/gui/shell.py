"""The window as its own frame sees it: what lays out, routes and lists the features, beyond what features may know."""

from typing import Protocol

import moderngl

from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Features
from faceposer.gui.imgui_frame import Gui
from faceposer.gui.panels.constraints import ConstraintsPanel
from faceposer.gui.panels.palette import Palette
from faceposer.gui.panels.pose import PosePanel
from faceposer.gui.panels.shapes import ShapesPanel
from faceposer.gui.session_files import SessionFiles
from faceposer.gui.window import Window


class Shell(EditorContext, Protocol):
    """The editor with its frame.

    Attributes:
        window: The system's window.
        gui: Dear ImGui over it.
        features: All features.
        files: Opening, saving and leaving.
        palette: The command palette.
        pose_panel: The first part of the panel, likewise the others.
    """

    window: Window
    gui: Gui
    features: Features
    files: SessionFiles
    palette: Palette
    pose_panel: PosePanel
    constraints_panel: ConstraintsPanel
    shapes_panel: ShapesPanel

    def picture(self, size: tuple[int, int]) -> moderngl.Texture:
        """Return the picture of the face for the view, of about ``size`` pixels."""
        ...

    def viewport_placed(self) -> None:
        """Frame the face once the size of the view is known."""

    def before_press(self) -> None:
        """Prepare for a press on the view."""
