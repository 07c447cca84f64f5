"""What features, panels and overlays may know of the window they are part of."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeVar

import moderngl

from faceposer.gui.actions import Actions
from faceposer.gui.events import Modifiers
from faceposer.gui.overlays.drawn_constraints import DrawnConstraints
from faceposer.gui.settings import Settings
from faceposer.gui.viewport import Viewport
from faceposer.gui.widgets.basic import WidgetRects
from faceposer.gui.widgets.dialogs import Dialogs
from faceposer.gui.widgets.file_dialogs import FileDialogs, FileRequest
from faceposer.gui.widgets.slider_edit import SliderEdit
from faceposer.gui.widgets.theme import Fonts
from faceposer.render.options import Shading
from faceposer.render.scene import Scene
from faceposer.session.character_library import CharacterLibrary
from faceposer.session.session import Mode, Session
from faceposer.session.solver_worker import Worker
from faceposer.tools.toolbox import Toolbox

F = TypeVar("F")


class EditorContext(Protocol):
    """The editor as its parts see it.

    Attributes:
        session: What the user edits.
        scene: The face as it is drawn.
        viewport: The view of it.
        toolbox: The tools.
        drawn_constraints: How the session's constraints appear.
        actions: Everything a menu or a key does.
        settings: What is remembered between runs.
        characters: The characters that can be chosen.
        dialogs: Messages and questions.
        file_dialogs: Questions for files.
        widget_rects: Where the widgets of the last frame are.
        slider_edit: The slider that is being dragged, if any.
        comparing: Whether the neutral face is shown in place of the pose.
        wireframe: Whether the edges of the mesh are drawn.
        points_shown: Whether constraints are drawn.
        panel_shown: Whether the side panel is shown.
        shading: How the face is drawn.
        highlighted: Index of the constraint that a panel points at, or None.
        notice: Text over the view, or "".
        remembers: Whether settings are written, for the next run.
        keeps_journal: Whether unsaved work is kept on the disk.
        debug: Whether figures for developers are shown.
        frame_seconds: How long the last frame took.
        meshes_saved: How many meshes were saved since the start.
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
    def meshes_saved(self) -> int:
        """How many meshes were saved since the start."""
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
        """What draws."""
        ...

    @property
    def busy(self) -> bool:
        """Whether a gesture, a slider or a feature holds the document, so that nothing else may change it."""
        ...

    @property
    def is_modal(self) -> bool:
        """Whether a menu or a dialog keeps the pointer from the view."""
        ...

    def feature(self, kind: type[F]) -> F:
        """Return the feature of class ``kind``.

        Raises:
            KeyError: If there is none.
        """
        ...

    @property
    def modifiers(self) -> Modifiers:
        """The modifier keys that are held now."""
        ...

    @property
    def playing(self) -> bool:
        """Whether a feature moves the face or holds the document, as while an animation plays."""
        ...

    def clock(self) -> float:
        """Return the time in seconds, by the clock of the window's events."""
        ...

    def redraw(self, frames: int = 3) -> None:
        """Draw what has changed."""

    def wake(self) -> None:
        """End the sleep of the loop; may be called from any thread."""

    def notify(self, text: str) -> None:
        """Show ``text`` over the view for a few seconds."""

    def ask_for_file(self, request: FileRequest) -> None:
        """Ask the user for a file."""

    def hint(self) -> str:
        """Return what the mouse will do now, by the feature or the tool that has it."""
        ...

    def point_name(self, index: int) -> str:
        """Return the name of the place of constraint ``index``."""
        ...

    def set_mode(self, mode: Mode) -> None:
        """Let the face follow at once, or when the user applies."""

    def set_ui_scale(self, scale: float) -> None:
        """Make text and panels ``scale`` times as large as usual."""

    def dismiss_guide(self) -> None:
        """Close the guided pose, if it is open."""

    def open_file(self, path: str | Path) -> None:
        """Open a session or a character, after asking about unsaved changes."""

    def show_session(self, opening: Callable[[Worker], Session], failure: str, comfort: str = "") -> bool:
        """Edit the session that ``opening`` returns; return whether there was one.

        Args:
            opening: Called with what solves for the session; its FacePoserError is reported, and nothing changes.
            failure: Title of that report.
            comfort: Added to the error.
        """
        ...

    def guard_changes(self, proceed: Callable[[], None]) -> None:
        """Ask what to do with unsaved changes, then call ``proceed`` unless the user cancels."""
