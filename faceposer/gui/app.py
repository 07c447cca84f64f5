"""The window's program: one frame loop that connects events, the session, the picture and the panels."""

import os
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.gui.context import F
from faceposer.gui.events import Modifiers
from faceposer.gui.features import build_features
from faceposer.gui.features.guide.feature import GuideFeature
from faceposer.gui.features.recovery.feature import RecoveryFeature
from faceposer.gui.heap import return_free_memory
from faceposer.gui.imgui_frame import Gui
from faceposer.gui.input_router import Router
from faceposer.gui.layout import draw_window
from faceposer.gui.menus import build_actions
from faceposer.gui.overlays.drawn_constraints import DrawnConstraints
from faceposer.gui.panels.constraints import ConstraintsPanel
from faceposer.gui.panels.palette import Palette
from faceposer.gui.panels.pose import PosePanel
from faceposer.gui.panels.shapes import ShapesPanel
from faceposer.gui.session_files import SessionFiles
from faceposer.gui.settings import Settings, load_settings, save_settings
from faceposer.gui.signals import interrupted_by_signals
from faceposer.gui.viewport import Viewport
from faceposer.gui.widgets.basic import WidgetRects
from faceposer.gui.widgets.dialogs import Dialogs, Question
from faceposer.gui.widgets.file_dialogs import FileDialogs, FileRequest
from faceposer.gui.widgets.slider_edit import SliderEdit
from faceposer.gui.widgets.theme import Fonts
from faceposer.gui.window import Window
from faceposer.model.face_model import FaceModel
from faceposer.render.images import drawn_pixels
from faceposer.render.options import Look, Shading
from faceposer.render.scene import Scene
from faceposer.session.character_library import CharacterLibrary
from faceposer.session.opening import open_session
from faceposer.session.session import Mode, Session
from faceposer.session.solver_worker import InlineWorker, SolverWorker, Worker
from faceposer.tools.toolbox import Toolbox

# Seconds that a frame waits for the solve of a drag, so that the face is where the pointer is in the same frame.
_SOLVE_PATIENCE = 0.005
# Frames drawn after anything happens: Dear ImGui spreads fast clicks over several.
_FRAMES_AFTER_EVENT = 3
# Seconds for which frames go on after the pointer came to rest on a panel, where tooltips and highlights follow late.
_LINGER = 1.0
_NOTICE_SECONDS = 3.5
_SAMPLES = 4
# Seconds: a moving picture is drawn coarser when frames take longer than the one, finer when shorter than the other.
_SLOW_FRAME, _FAST_FRAME = 0.040, 0.010
_MOST_FAILURES = 10
_FRAMES_BETWEEN_TRIMS = 1000


class App:
    """The running program.

    Attributes:
        session: What the user edits.
        comparing: Whether the neutral face is shown in place of the pose.
        highlighted: Index of the pin that a panel points at, or None.
        remembers: Whether settings are written, for the next run.
        interrupted: The signal that asked the program to end, or 0.
        busy: Whether a gesture or a slider holds the document, so that nothing else may change it.
    """

    def __init__(
        self,
        what: str = "man",
        hidden: bool = False,
        threaded: bool = True,
        settings: Settings | None = None,
        journal: bool | None = None,
    ) -> None:
        """Open ``what``, a character or a session, in a window.

        Args:
            what: Name or path.
            hidden: Open the window where nobody sees it and no display is needed.
            threaded: Solve beside the frames; else at once, so that what happens does not depend on time.
            settings: Remembered choices, which are then not written back; those of the last run if None.
            journal: Keep on the disk what is not saved, and offer what an earlier run left there; if None, where the
                settings are remembered too.

        Raises:
            FacePoserError: If that cannot be opened, or no window can.
        """
        self._threaded = threaded
        self._prepared: FaceModel | None = None
        self._window: Window | None = None
        self.remembers = settings is None
        self.settings = load_settings() if settings is None else settings
        session = open_session(what, self.new_worker())
        chosen = self.settings
        self.window = self._window = Window(chosen.window_size, hidden, chosen.window_position, chosen.window_maximized)
        self.window.zoom = chosen.ui_scale
        self.gui = Gui(self.window)
        self.scene = Scene(self.window.ctx)
        self.scene.expression_lines = self.settings.expression_lines
        self.scene.look = Look(chosen.backdrop, chosen.key_light, chosen.ambient_light)
        self.characters = CharacterLibrary()
        self.widget_rects = WidgetRects()
        self.session = session
        self.scene.set_model(session.model)
        self.viewport = Viewport(self.scene, session, self.settings.navigation)
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
            self, self.new_worker, self.set_session, lambda: self.features.quit_question, self.close_soon
        )
        self.actions = build_actions(self)
        self.actions.set_keys(self.settings.keys)
        self.router = Router(self)
        self.pose_panel, self.constraints_panel, self.shapes_panel = PosePanel(), ConstraintsPanel(), ShapesPanel()
        self.slider_edit = SliderEdit()
        self.comparing, self.wireframe, self.points_shown, self.panel_shown = False, False, True, True
        self.shading: Shading = "full"
        self.highlighted: int | None = None
        self.debug = bool(os.environ.get("FACEPOSER_DEBUG"))
        self.frame_seconds, self.frames_drawn = 0.0, 0
        self.closing = False
        self.interrupted = 0
        self.notice = ""
        self._notice_until = 0.0
        self._frames_due = _FRAMES_AFTER_EVENT
        self._last_event = time.perf_counter()
        self._failures, self._trim_at = 0, _FRAMES_BETWEEN_TRIMS
        # Where nobody watches, pictures are for keeping.
        self._may_coarsen = self.window.software and not hidden
        self._coarseness = 1
        self.drawn_constraints = self._constraints_drawn(session)
        self._mode: Mode = "live"
        self.set_session(session)
        self.files.remember(what)

    # The loop

    def run(self) -> None:
        """Show the window until the user closes it, or a signal asks for the end."""
        self.window.show()
        self.step(force=True)
        self.session.worker.prepare()
        self.scene.prepare()
        with interrupted_by_signals(self._interrupt):
            while not (self.closing or self.interrupted):
                self.window.wait(self._patience())
                self.step()
                self.scene.prepare()

    def _patience(self) -> float:
        """Return for how many seconds there is nothing to do unless something happens."""
        if self._frames_due:
            return 0.0
        now = time.perf_counter()
        patience = min(0.5, self.features.patience)
        if self.router.over_widget and now - self._last_event < _LINGER:
            patience = min(patience, 0.05)
        if self.file_dialogs.polling or self.gui.io.want_text_input:
            patience = min(patience, 0.1)
        if self.notice:
            patience = min(patience, max(self._notice_until - now, 0.01))
        return patience

    def step(self, force: bool = False) -> None:
        """Handle what has happened and draw a frame if anything has changed, or with ``force`` in any case.

        Raises:
            FacePoserError: If frame after frame fails; the work is then kept for the next start.
        """
        for part in (
            self._take_events,
            *(feature.update for feature in self.features),
            self._follow_session,
            *(feature.late_update for feature in self.features),
        ):
            try:
                part()
            except Exception as error:  # the window goes on, whatever it was
                self._report(error)
        linger = self.router.over_widget and time.perf_counter() - self._last_event < _LINGER
        if not (self._frames_due or force or linger or self.gui.io.want_text_input):
            return
        self._frames_due = max(self._frames_due - 1, 0)
        if self.window.drawable:
            self._draw()
        if self._threaded and self.frames_drawn > 1 and self._prepared is not self.session.model:
            # Beside the frames and after the first: the first drag would wait for it.
            model = self._prepared = self.session.model
            threading.Thread(target=lambda: model.contact, name="contact", daemon=True).start()

    def _take_events(self) -> None:
        events = self.window.take_events()
        if events:
            self.redraw()
            self._last_event = time.perf_counter()
        self.router.route(events)
        self.file_dialogs.poll()
        if self.notice and time.perf_counter() > self._notice_until:
            self.notice = ""
            self.redraw()

    def _follow_session(self) -> None:
        """Bring the picture's face up to date with the session."""
        session = self.session
        if self.toolbox.posing and session.mode == "live":
            session.worker.wait_idle(_SOLVE_PATIENCE)
        if session.poll():
            self.redraw()
        pose = session.model.neutral() if self.comparing else session.coefficients
        self.scene.set_pose(pose, session.document.contact)
        self.router.update()

    def redraw(self, frames: int = _FRAMES_AFTER_EVENT) -> None:
        """See to it that what has changed is drawn."""
        self._frames_due = max(self._frames_due, frames)

    def _draw(self) -> None:
        begun = time.perf_counter()
        self.gui.set_scale(self.window.ui_scale)
        self.window.set_title(self.files.title)
        failure = self.gui.frame(lambda: draw_window(self))
        self.gui.cursors.follow(self.toolbox)
        ctx, (width, height) = self.window.ctx, self.window.pixels
        ctx.screen.use()
        ctx.viewport = (0, 0, width, height)
        ctx.clear(0.0, 0.0, 0.0, 1.0)
        self.gui.draw()
        self.window.swap()
        self.frames_drawn += 1
        if self.frames_drawn >= self._trim_at and not self.toolbox.active:
            self._trim_at = self.frames_drawn + _FRAMES_BETWEEN_TRIMS
            return_free_memory()
        self.frame_seconds = time.perf_counter() - begun
        self._choose_coarseness()
        if failure is None:
            self._failures = 0
            return
        self._failures += 1
        self._report(failure)
        if self._failures >= _MOST_FAILURES:
            raise FacePoserError(f"The window cannot be drawn ({failure}); {self.recovery.rescue()}") from failure

    def picture(self, size: tuple[int, int]) -> moderngl.Texture:
        """Return the picture of the face for the view, of ``size`` pixels or, while it moves without a GPU, coarser."""
        samples = _SAMPLES
        if self._may_coarsen and self.toolbox.active:
            samples = 0
            size = (max(size[0] // self._coarseness, 1), max(size[1] // self._coarseness, 1))
        camera = self.viewport.camera
        if size != camera.size:
            camera = self.viewport.view.camera(size)
        return self.scene.draw(camera, self.shading, self.wireframe, samples)

    def _choose_coarseness(self) -> None:
        """Let the picture be coarser while it moves if frames take too long to feel immediate."""
        if self.toolbox.active:
            if self.frame_seconds > _SLOW_FRAME:
                self._coarseness = 2
            elif self.frame_seconds < _FAST_FRAME:
                self._coarseness = 1

    def screenshot(self) -> NDArray[np.uint8]:
        """Return the window as it was drawn last, top row first, shape (height, width, 3)."""
        return drawn_pixels(self.window.ctx, self.window.pixels, self.gui.draw)

    # What goes wrong

    def _report(self, error: Exception) -> None:
        self.redraw()
        if isinstance(error, FacePoserError):
            self.dialogs.report("That did not work", str(error))
            return
        details = "".join(traceback.format_exception(error))
        sys.stderr.write(details)
        text = f"{type(error).__name__}: {error}. Your work is still here; it would be wise to save it."
        self.dialogs.report("Something went wrong inside the program", text, details)

    # The session

    def new_worker(self) -> Worker:
        """Return what solves for a session."""
        return SolverWorker(on_result=self.wake) if self._threaded else InlineWorker()

    def wake(self) -> None:
        """End the sleep of the loop; may be called from any thread."""
        if self._window is not None:
            self._window.wake()

    def set_session(self, session: Session) -> None:
        """Edit ``session`` from now on."""
        self.toolbox.cancel()
        if session is not self.session:
            self.session.close()
        self.session = self.viewport.session = session
        session.mode = self._mode
        self.scene.set_model(session.model)
        self.toolbox = Toolbox(self.viewport, self.toolbox.tool_settings)
        self.drawn_constraints = self._constraints_drawn(session)
        self.comparing = False
        camera = session.document.camera
        if camera is None:
            self.viewport.view = self.viewport.framed()
        else:
            self.viewport.look_through(camera)
        self.features.session_changed()
        if session.remark:
            self.dialogs.ask(Question("The character may have changed", session.remark))
        self.redraw()

    def viewport_placed(self) -> None:
        """Frame the face once the size of the view is known."""
        if self.session.document.camera is None:
            self.viewport.view = self.viewport.framed()

    def set_mode(self, mode: Mode) -> None:
        """Let the face follow at once, or when the user applies."""
        self._mode = self.session.mode = mode
        self.redraw()

    @property
    def busy(self) -> bool:
        """Whether a gesture, a slider or a feature holds the document."""
        return self.toolbox.active or self.session.editing or self.features.busy

    @property
    def is_modal(self) -> bool:
        """Whether a menu or a dialog keeps the pointer from the view."""
        asking = self.dialogs.open or self.file_dialogs.browsing or self.features.is_modal
        return asking or self.gui.popup_open or self.palette.open

    def point_name(self, index: int) -> str:
        """Return what people call the place of constraint ``index``."""
        return self.drawn_constraints.names.of(self.session.document.constraints[index])

    def hint(self) -> str:
        """Return what the mouse will do now, by the feature or the tool that has it."""
        if self.features.hint:
            return self.features.hint
        if self.comparing:
            return "This is the neutral face   ·   C: back to the pose"
        if self.session.pending:
            return f"{self.toolbox.hint()}   ·   Enter: apply"
        return self.toolbox.hint()

    def notify(self, text: str) -> None:
        """Show ``text`` over the view for a few seconds."""
        self.notice = text
        self._notice_until = time.perf_counter() + _NOTICE_SECONDS
        self.redraw()

    # What features may know and ask for (context.py)

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
        """What draws."""
        return self.window.ctx

    @property
    def pixel_ratio(self) -> float:
        """Pixels of the framebuffer per unit of the window."""
        return self.window.pixels[0] / max(self.window.size[0], 1)

    @property
    def modifiers(self) -> Modifiers:
        """The modifier keys that are held now."""
        return self.window.modifiers

    @property
    def playing(self) -> bool:
        """Whether a feature moves the face or holds the document, as while an animation plays."""
        return self.features.busy

    @property
    def meshes_saved(self) -> int:
        """How many meshes were saved since the start."""
        return self.files.meshes_saved

    def clock(self) -> float:
        """Return the time in seconds, by the clock of the window's events."""
        return self.window.clock()

    def set_ui_scale(self, scale: float) -> None:
        """Make text and panels ``scale`` times as large as usual."""
        self.settings.ui_scale = self.window.zoom = scale
        self.redraw()

    def dismiss_guide(self) -> None:
        """Close the guided pose, if it is open."""
        self.features[GuideFeature].dismiss()

    def open_file(self, path: str | Path) -> None:
        """Open a session or a character, after asking about unsaved changes."""
        self.files.open(str(path))

    def show_session(self, opening: Callable[[Worker], Session], failure: str, comfort: str = "") -> bool:
        """Edit the session that ``opening`` returns; see ``SessionFiles.show``."""
        return self.files.show(opening, failure, comfort)

    def guard_changes(self, proceed: Callable[[], None]) -> None:
        """Ask what to do with unsaved changes, then call ``proceed`` unless the user cancels."""
        self.files.guard(proceed)

    def _constraints_drawn(self, session: Session) -> DrawnConstraints:
        return DrawnConstraints(session, self.scene, self.viewport, self.toolbox, lambda: self.busy)

    def _interrupt(self, number: int) -> None:
        self.interrupted = number

    # Actions

    def before_press(self) -> None:
        """Prepare for a press on the view: a value being typed is done, and one poses what one sees."""
        self.slider_edit.let_go()
        self.features.before_press()
        if self.comparing:
            self.comparing = False
            self.scene.set_pose(self.session.coefficients, self.session.document.contact)

    def ask_for_file(self, request: FileRequest) -> None:
        """Ask for a file."""
        self.toolbox.finish()
        self.file_dialogs.ask(request)

    def close_soon(self) -> None:
        """Leave the loop after this frame."""
        self.closing = True

    def close(self) -> None:
        """Remember the settings and free everything; unless the user asked for the end, what is not saved is kept."""
        self.recovery.keeps = not self.closing
        if self.remembers:
            self.settings.window_size = self.window.normal_size
            self.settings.window_position = self.window.normal_position
            self.settings.window_maximized = self.window.maximized
            save_settings(self.settings)
        self._window = None
        self.features.close()
        self.session.close()
        self.scene.release()
        self.gui.close()
        self.window.close()
        self.features.join()


def run(what: str, exit_after_first_frame: bool = False) -> int:
    """Open ``what``, a character or a session, in a window and return the exit status once the user has closed it.

    Args:
        what: Name or path.
        exit_after_first_frame: End as soon as the face is on the screen, to time the start.

    Raises:
        FacePoserError: If that cannot be opened, or no window can.
    """
    # The solver's thread shares the interpreter with the frames: hand over sooner than every 5 ms.
    sys.setswitchinterval(5e-4)
    app = App(what)
    try:
        if exit_after_first_frame:
            app.window.show()
            app.window.wait(0.0)
            app.step(force=True)
            app.window.ctx.finish()
        else:
            app.run()
    finally:
        app.close()
    return 128 + app.interrupted if app.interrupted else 0
