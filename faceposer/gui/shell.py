"""The editor's interface for layout, menus and the router, which extends that for features."""

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
    """The editor with its window.

    Attributes:
        window: The operating system's window.
        gui: Dear ImGui in the window.
        features: All features.
        files: Commands that open, save and close.
        palette: The command palette.
        pose_panel: Panel of solver settings.
        constraints_panel: Panel of constraints.
        shapes_panel: Panel of shapes.
        wanted_tab: Title of the tab to be shown in the next frame, or "".
    """

    window: Window
    gui: Gui
    features: Features
    files: SessionFiles
    palette: Palette
    pose_panel: PosePanel
    constraints_panel: ConstraintsPanel
    shapes_panel: ShapesPanel
    wanted_tab: str

    def face_image(self, size: tuple[int, int]) -> moderngl.Texture:
        """Return the image of the face for the view, of at most ``size`` pixels."""
        ...

    def viewport_placed(self) -> None:
        """Frame the face once the size of the view is known."""

    def before_press(self) -> None:
        """Prepare for a press on the view."""
