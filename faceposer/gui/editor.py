"""The editor: session, tools, panels, features and files of the window, without its frame loop."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from weakref import WeakKeyDictionary

import moderngl

from faceposer.errors import FacePoserError
from faceposer.geometry.picture_view import View
from faceposer.gui.context import F
from faceposer.gui.events import Modifiers
from faceposer.gui.features import build_features
from faceposer.gui.features.guide.feature import GuideFeature
from faceposer.gui.features.recovery.feature import RecoveryFeature
from faceposer.gui.frame_pacing import FRAMES_AFTER_EVENT, AdaptiveResolution, FramePacing
from faceposer.gui.imgui_frame import Gui
from faceposer.gui.input_router import Router
from faceposer.gui.menus import build_actions
from faceposer.gui.overlays.drawn_constraints import DrawnConstraints
from faceposer.gui.panels.constraints import ConstraintsPanel
from faceposer.gui.panels.palette import Palette
from faceposer.gui.panels.pose import PosePanel
from faceposer.gui.panels.shapes import ShapesPanel
from faceposer.gui.session_files import SessionFiles
from faceposer.gui.settings import Settings, load_settings, save_settings
from faceposer.gui.viewport import Viewport
from faceposer.gui.widgets.dialogs import Dialogs, Question
from faceposer.gui.widgets.file_dialogs import FileDialogs
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.slider_edit import SliderEdit
from faceposer.gui.widgets.theme import Fonts
from faceposer.gui.widgets.widget_rects import WidgetRects
from faceposer.gui.window import Window
from faceposer.render.options import Look, Shading
from faceposer.render.scene import Scene
from faceposer.session.character_library import CharacterLibrary
from faceposer.session.opening import open_session
from faceposer.session.session import Mode, Session
from faceposer.session.solver_worker import InlineWorker, SolverWorker, Worker
from faceposer.tools.toolbox import Toolbox

# Number of notices that can be read again.
_MESSAGES = 30
# Shortest time of a notice, and the time that reading takes for each letter.
_NOTICE_SECONDS, _SECONDS_PER_LETTER = 3.5, 0.06
_SAMPLES = 4


class Editor:
    """The parts of the window, connected; implements ``Shell`` and with it ``EditorContext``.

    Attributes:
        session: The edited session.
        comparing: True if the neutral face is shown instead of the pose.
        highlighted: Index of the constraint under the pointer in a panel, or None.
        remembers: True if settings are written for the next run.
        closing: True once the user has asked for the end.
    """

    def __init__(
        self, what: str, hidden: bool, threaded: bool, settings: Settings | None = None, journal: bool | None = None
    ) -> None:
        """Open ``what`` in a window; see ``App`` for the arguments."""
        self._threaded = threaded
        self._window: Window | None = None
        self.pacing = FramePacing()
        self.remembers = settings is None
        self._settings_failed = False
        self.settings = load_settings() if settings is None else settings
        session = open_session(what, self.new_worker())
        chosen = self.settings
        self.window = self._window = Window(chosen.window_size, hidden, chosen.window_position, chosen.window_maximized)
        self.window.zoom = chosen.ui_scale
        # Images of a hidden window are kept, and are worth the time.
        self.resolution = AdaptiveResolution(self.window.software and not hidden)
        self.gui = Gui(self.window)
        self.scene = Scene(self.window.ctx)
        self.scene.expression_lines = self.settings.expression_lines
        self.scene.look = Look(chosen.backdrop, chosen.key_light, chosen.ambient_light)
        self.characters = CharacterLibrary()
        self.widget_rects = WidgetRects()
        self.session = session
        self.scene.set_model(session.model)
        self.viewport = Viewport(self.scene, session, self.settings.navigation)
        self.viewport.on_notice = self.notify
        self.dialogs = Dialogs(self.gui.fonts, self.widget_rects)
        self.file_dialogs = FileDialogs(
            self.gui.fonts, self.widget_rects, use_native=False if hidden else None, notify=self.notify
        )
        self.keeps_journal = self.remembers if journal is None else journal
        self.toolbox = Toolbox(self.viewport)
        self.palette = Palette()
        self.features = build_features(self)
        self.recovery = self.features[RecoveryFeature]
        self.files = SessionFiles(
            self,
            self.new_worker,
            self.set_session,
            lambda: self.features.quit_question,
            self.features.leave,
            self.request_close,
        )
        self.actions = build_actions(self)
        self.actions.set_keys(self.settings.keys)
        self.router = Router(self)
        self.pose_panel, self.constraints_panel, self.shapes_panel = PosePanel(), ConstraintsPanel(), ShapesPanel()
        self.slider_edit = SliderEdit()
        self.comparing, self.wireframe, self.points_shown, self.panel_shown = False, False, True, True
        self.shading: Shading = "full"
        self.highlighted: int | None = None
        self.wanted_tab = ""
        self.debug = bool(os.environ.get("FACEPOSER_DEBUG"))
        self.frame_seconds = 0.0
        self.closing = False
        self.notice = ""
        self.messages: list[str] = []
        self._notice_until = 0.0
        self.drawn_constraints = self._new_drawn_constraints(session)
        self._mode: Mode = "live"
        # Views of sessions that were left: those that return, such as after the edit of a key pose, have theirs again.
        self._views: WeakKeyDictionary[Session, View] = WeakKeyDictionary()
        self.set_session(session)
        self.files.remember(what)

    # The session

    def new_worker(self) -> Worker:
        """Return a solver for a session."""
        return SolverWorker(on_result=self.wake) if self._threaded else InlineWorker()

    def wake(self) -> None:
        """Wake the loop; may be called from any thread."""
        if self._window is not None:
            self._window.wake()

    def set_session(self, session: Session) -> None:
        """Edit ``session`` from now on."""
        self.toolbox.cancel()
        if session is not self.session:
            self._views[self.session] = self.viewport.view
            self.session.close()
        self.session = self.viewport.session = session
        session.mode = self._mode
        self.scene.set_model(session.model)
        chosen = self.toolbox.chosen
        self.toolbox = Toolbox(self.viewport, self.toolbox.tool_settings)
        if chosen.name in (tool.name for tool in self.toolbox.usable_tools if not tool.held(session)):
            self.toolbox.choose(chosen.name)
        self.drawn_constraints = self._new_drawn_constraints(session)
        self.comparing = False
        camera, view = session.document.camera, self._views.pop(session, None)
        if view is not None:
            self.viewport.view = view
        elif camera is None:
            self.viewport.view = self.viewport.framed()
        else:
            self.viewport.look_through(camera)
        self.features.session_changed()
        self.files.tell_of_other_window()
        if session.remark:
            self.dialogs.ask(Question("The character may have changed", session.remark))
        self.redraw()

    def model_changed(self) -> None:
        """Show the session's model after an edit of the head, or after it is undone."""
        self.scene.set_model(self.session.model)
        self.drawn_constraints.model_changed()
        self.features.model_changed()
        self.redraw()

    def _new_drawn_constraints(self, session: Session) -> DrawnConstraints:
        drawn = DrawnConstraints(session, self.scene, self.viewport, self.toolbox, lambda: self.busy)
        self.viewport.hidden_among = drawn.hidden.indices
        return drawn

    def set_mode(self, mode: Mode) -> None:
        """Solve after every change, or only when the user applies."""
        self._mode = self.session.mode = mode
        self.redraw()

    @property
    def busy(self) -> bool:
        """True if a gesture, a slider or a feature is changing the document; nothing else may then change it."""
        return self.toolbox.active or self.session.editing or self.features.busy

    # The view

    def face_image(self, size: tuple[int, int]) -> moderngl.Texture:
        """Return the image of the face for the view, of ``size`` pixels, or coarser while it moves without a GPU."""
        samples = _SAMPLES
        if self.resolution.enabled and self.toolbox.active:
            samples = 0
            size = self.resolution.reduced(size)
        camera = self.viewport.camera
        if size != camera.size:
            camera = self.viewport.view.camera(size)
        return self.scene.draw(camera, self.shading, self.wireframe, samples)

    def viewport_placed(self) -> None:
        """Frame the face once the size of the view is known."""
        if self.session.document.camera is None:
            self.viewport.view = self.viewport.framed()

    def before_press(self) -> None:
        """Prepare for a press on the view: end the input of a value, and show the pose, not the neutral face."""
        self.slider_edit.let_go()
        self.features.before_press()
        if self.comparing:
            self.comparing = False
            self.scene.set_pose(self.session.coefficients, self.session.document.contact)

    def redraw(self, frames: int = FRAMES_AFTER_EVENT) -> None:
        """Draw at least ``frames`` more frames."""
        self.pacing.request(frames)

    # Messages and questions

    def save_settings(self) -> None:
        """Write the settings for the next run, unless they are not kept; the first failure is reported."""
        if not self.remembers:
            return
        try:
            save_settings(self.settings)
        except FacePoserError as error:
            if not self._settings_failed:
                self.dialogs.report("The settings cannot be saved", f"{error} Changes are lost when the window closes.")
                self._settings_failed = True
        else:
            self._settings_failed = False

    @property
    def edited_instead(self) -> str:
        """What is edited in place of the session, for the status bar; otherwise ""."""
        return self.features.edited_instead

    @property
    def is_modal(self) -> bool:
        """True if a menu or a dialog blocks the view."""
        asking = self.dialogs.open or self.file_dialogs.browsing or self.features.is_modal
        return asking or self.gui.popup_open or self.palette.open

    def hint(self) -> str:
        """Return the hint for the mouse, from the feature or the tool in use."""
        if self.features.hint:
            return self.features.hint
        if self.comparing:
            hint = "This is the neutral face   ·   C: back to the pose"
        else:
            waits = self.session.pending and self.session.mode == "apply"
            hint = f"{self.toolbox.hint()}{'   ·   Enter: apply' if waits else ''}"
        return self.actions.with_current_keys(hint)

    def notify(self, text: str) -> None:
        """Show ``text`` over the view for a few seconds, longer texts longer."""
        self.notice = text
        self.messages = [*self.messages, text][-_MESSAGES:]
        self._notice_until = time.perf_counter() + max(_NOTICE_SECONDS, _SECONDS_PER_LETTER * len(text))
        self.redraw()

    def ask_for_file(self, request: FileRequest) -> None:
        """Open a file dialog."""
        self.toolbox.finish()
        self.file_dialogs.ask(request)

    def point_name(self, index: int) -> str:
        """Return the name of the location of constraint ``index``."""
        return self.drawn_constraints.titles[index]

    # Access of features to the other parts (context.py)

    def feature(self, kind: type[F]) -> F:
        """Return the feature of class ``kind``.

        Raises:
            KeyError: If there is none.
        """
        return self.features[kind]

    @property
    def fonts(self) -> Fonts:
        """The fonts of the window."""
        return self.gui.fonts

    @property
    def gl(self) -> moderngl.Context:
        """The OpenGL context."""
        return self.window.ctx

    @property
    def pixel_ratio(self) -> float:
        """Pixels of the framebuffer per unit of the window."""
        return self.window.pixels[0] / max(self.window.size[0], 1)

    @property
    def modifiers(self) -> Modifiers:
        """The modifier keys held down."""
        return self.window.modifiers

    @property
    def playing(self) -> bool:
        """True if a feature moves the face or changes the document, for example during playback."""
        return self.features.busy

    @property
    def meshes_saved(self) -> int:
        """Number of meshes saved since the start."""
        return self.files.meshes_saved

    def clock(self) -> float:
        """Return the time in seconds, by the clock of the window's events."""
        return self.window.clock()

    def set_ui_scale(self, scale: float) -> None:
        """Scale text and panels by ``scale``."""
        self.settings.ui_scale = self.window.zoom = scale
        self.redraw()

    def show_tab(self, title: str) -> None:
        """Show the tab ``title`` of the side panel."""
        self.panel_shown, self.wanted_tab = True, title
        self.redraw()

    def dismiss_guide(self) -> None:
        """Close the guided pose, if it is open."""
        self.features[GuideFeature].dismiss()

    def open_file(self, path: str | Path) -> None:
        """Open a session or a character, after asking about unsaved changes."""
        self.files.open(str(path))

    def show_session(self, opening: Callable[[Worker], Session], failure: str, remedy: str = "") -> bool:
        """Edit the session that ``opening`` returns; see ``SessionFiles.show``."""
        return self.files.show(opening, failure, remedy)

    def guard_changes(self, proceed: Callable[[], None]) -> None:
        """Ask about unsaved changes, then call ``proceed`` unless the user cancels."""
        self.files.guard(proceed)

    def request_close(self) -> None:
        """Leave the loop after this frame."""
        self.closing = True
