"""The editor's interface for features, panels and overlays."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeVar

import moderngl

from faceposer.gui.actions import Actions
from faceposer.gui.events import Modifiers
from faceposer.gui.overlays.drawn_constraints import DrawnConstraints
from faceposer.gui.settings import Settings
from faceposer.gui.viewport import Viewport
from faceposer.gui.widgets.dialogs import Dialogs
from faceposer.gui.widgets.file_dialogs import FileDialogs
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.slider_edit import SliderEdit
from faceposer.gui.widgets.theme import Fonts
from faceposer.gui.widgets.widget_rects import WidgetRects
from faceposer.render.options import Shading
from faceposer.render.scene import Scene
from faceposer.session.character_library import CharacterLibrary
from faceposer.session.session import Mode, Session
from faceposer.session.solver_worker import Worker
from faceposer.tools.toolbox import Toolbox

F = TypeVar("F")


class EditorContext(Protocol):
    """The editor as seen by its parts.

    Attributes:
        session: The edited session.
        scene: The drawn face.
        viewport: The view of the face.
        toolbox: The tools.
        drawn_constraints: Marks, names and conflicts of the session's constraints.
        actions: The actions of menus and keys.
        settings: Settings kept between runs.
        characters: The characters to choose from.
        dialogs: Messages and questions.
        file_dialogs: File dialogs.
        widget_rects: Rectangles of the widgets of the last frame.
        slider_edit: The edit during the drag of a slider.
        comparing: True if the neutral face is shown instead of the pose.
        wireframe: True if the edges of the mesh are drawn.
        points_shown: True if constraints are drawn.
        panel_shown: True if the side panel is shown.
        shading: Shading of the face.
        highlighted: Index of the constraint under the pointer in a panel, or None.
        notice: Text over the view, or "".
        messages: The last notices.
        remembers: True if settings are written for the next run.
        keeps_journal: True if a journal of unsaved work is kept on disk.
        debug: True if figures for developers are shown.
        frame_seconds: Duration of the last frame.
        meshes_saved: Number of meshes saved since the start.
    """

    session: Session
    scene: Scene
    viewport: Viewport
    toolbox: Toolbox
    drawn_constraints: DrawnConstraints
    actions: Actions
    settings: Settings
    characters: CharacterLibrary
    dialogs: Dialogs
    file_dialogs: FileDialogs
    widget_rects: WidgetRects
    slider_edit: SliderEdit
    comparing: bool
    wireframe: bool
    points_shown: bool
    panel_shown: bool
    shading: Shading
    highlighted: int | None
    remembers: bool
    keeps_journal: bool
    debug: bool
    frame_seconds: float

    @property
    def notice(self) -> str:
        """Text over the view, or ""."""
        ...

    @property
    def messages(self) -> list[str]:
        """The last notices, the latest one at the end."""
        ...

    @property
    def meshes_saved(self) -> int:
        """Number of meshes saved since the start."""
        ...

    @property
    def pixel_ratio(self) -> float:
        """Pixels of the framebuffer per unit of the window."""
        ...

    @property
    def fonts(self) -> Fonts:
        """The fonts of the window."""
        ...

    @property
    def gl(self) -> moderngl.Context:
        """The OpenGL context."""
        ...

    @property
    def busy(self) -> bool:
        """True if a gesture, a slider or a feature is changing the document; nothing else may then change it."""
        ...

    @property
    def edited_instead(self) -> str:
        """What is edited in place of the session, such as a key pose, for the status bar; otherwise ""."""
        ...

    @property
    def is_modal(self) -> bool:
        """True if a menu or a dialog blocks the view."""
        ...

    def feature(self, kind: type[F]) -> F:
        """Return the feature of class ``kind``.

        Raises:
            KeyError: If there is none.
        """
        ...

    @property
    def modifiers(self) -> Modifiers:
        """The modifier keys held down."""
        ...

    @property
    def playing(self) -> bool:
        """True if a feature moves the face or changes the document, for example during playback."""
        ...

    def clock(self) -> float:
        """Return the time in seconds, by the clock of the window's events."""
        ...

    def redraw(self, frames: int = 3) -> None:
        """Draw at least ``frames`` more frames."""

    def wake(self) -> None:
        """Wake the loop; may be called from any thread."""

    def notify(self, text: str) -> None:
        """Show ``text`` over the view for a few seconds."""

    def ask_for_file(self, request: FileRequest) -> None:
        """Open a file dialog."""

    def hint(self) -> str:
        """Return the hint for the mouse, from the feature or the tool in use."""
        ...

    def point_name(self, index: int) -> str:
        """Return the name of the location of constraint ``index``."""
        ...

    def set_mode(self, mode: Mode) -> None:
        """Solve after every change, or only when the user applies."""

    def set_ui_scale(self, scale: float) -> None:
        """Scale text and panels by ``scale``."""

    def show_tab(self, title: str) -> None:
        """Show the tab ``title`` of the side panel."""

    def dismiss_guide(self) -> None:
        """Close the guided pose, if it is open."""

    def open_file(self, path: str | Path) -> None:
        """Open a session or a character, after asking about unsaved changes."""

    def show_session(self, opening: Callable[[Worker], Session], failure: str, remedy: str = "") -> bool:
        """Edit the session that ``opening`` returns; return True on success.

        Args:
            opening: Called with the solver for the session; its FacePoserError is reported, and nothing changes.
            failure: Title of that report.
            remedy: Text appended to the error.
        """
        ...

    def save_settings(self) -> None:
        """Write the settings for the next run, unless they are not kept; the first failure is reported."""

    def guard_changes(self, proceed: Callable[[], None]) -> None:
        """Ask about unsaved changes, then call ``proceed`` unless the user cancels."""
