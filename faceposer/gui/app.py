"""The program with its window: the frame loop, which connects events, the session, the image and the panels."""

import sys
import threading
import time
import traceback
from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.gui.editor import Editor
from faceposer.gui.heap import return_free_memory
from faceposer.gui.layout import draw_window
from faceposer.gui.settings import Settings
from faceposer.gui.signals import interrupted_by_signals
from faceposer.gui.widgets.text import displayed
from faceposer.model.face_model import FaceModel
from faceposer.render.images import drawn_pixels
from faceposer.session.session import Session

# Seconds that a frame waits for the solve of a drag, so that the face follows the pointer in the same frame.
_SOLVE_PATIENCE = 0.005
# Frames in a row that may fail before the program ends.
_MAX_FAILURES = 10
_FRAMES_BETWEEN_TRIMS = 250
# Frames after which a session that was opened has drawn everything, and what the one before it held is free.
_FRAMES_AFTER_OPENING = 8


class App(Editor):
    """The running program.

    Attributes:
        frames_drawn: Number of frames drawn since the start.
        interrupted: Number of the signal that ended the program, or 0.
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
            hidden: Open an invisible window, which needs no display.
            threaded: Solve in a background thread; if False, in the frame itself, where results do not depend on time.
            settings: Settings of the window, not written back; those of the last run if None.
            journal: Keep a journal of unsaved work on disk, and offer that of an earlier run; if None, only if
                settings are remembered.

        Raises:
            FacePoserError: If ``what`` or the window cannot be opened.
        """
        self.frames_drawn = 0
        self._trim_at = _FRAMES_BETWEEN_TRIMS
        self._last_session: Session | None = None
        self.interrupted = 0
        self._failures = 0
        self._prepared: FaceModel | None = None
        try:
            super().__init__(what, hidden, threaded, settings, journal)
        except BaseException:
            self._release_unfinished()
            raise

    # The loop

    def run(self) -> None:
        """Show the window until the user closes it or a signal arrives."""
        self.window.show()
        self.step(force=True)
        self.session.worker.prepare()
        self.scene.prepare()
        with interrupted_by_signals(self._interrupt):
            while not (self.closing or self.interrupted):
                self.window.wait(self._patience())
                self.step()
                self.scene.prepare()

    def _interrupt(self, number: int) -> None:
        self.interrupted = number

    def _patience(self) -> float:
        """Return the seconds for which the loop may sleep without an event."""
        if self.pacing.due:
            return 0.0
        patience = min(0.5, self.features.patience)
        if self._lingers:
            patience = min(patience, 0.05)
        if self.file_dialogs.polling or self.gui.io.want_text_input:
            patience = min(patience, 0.1)
        if self.notice:
            patience = min(patience, max(self._notice_until - time.perf_counter(), 0.01))
        return patience

    @property
    def _lingers(self) -> bool:
        """True if a tooltip may still appear under a pointer at rest."""
        return self.router.over_widget and self.pacing.lingers

    def step(self, force: bool = False) -> None:
        """Handle events and draw a frame if anything has changed, or in any case with ``force``.

        Raises:
            FacePoserError: If many frames in a row fail; the work is then kept for the next start.
        """
        for part in (
            self._take_events,
            *(feature.update for feature in self.features),
            self._update_face,
            *(feature.late_update for feature in self.features),
        ):
            try:
                part()
            except Exception as error:  # the window must survive any error
                self._report(error)
        if not (self.pacing.due or force or self._lingers or self.gui.io.want_text_input):
            return
        self.pacing.take_frame()
        if self.window.drawable:
            self._draw()
        if self._threaded and self.frames_drawn > 1 and self._prepared is not self.session.model:
            # Computed in the background after the first frame; otherwise the first drag would wait for it.
            model = self._prepared = self.session.model
            # Not a daemon: one that is in native code when the program ends would abort it.
            threading.Thread(target=lambda: model.contact, name="contact").start()

    def _take_events(self) -> None:
        events = self.window.take_events()
        if events:
            self.pacing.record_event()
        self.router.route(events)
        self.file_dialogs.poll()
        if self.notice and time.perf_counter() > self._notice_until:
            self.notice = ""
            self.redraw()

    def _update_face(self) -> None:
        """Show the session's pose."""
        session = self.session
        if self.toolbox.posing and session.mode == "live":
            session.worker.wait_idle(_SOLVE_PATIENCE)
        if session.poll():
            self.redraw()
        if session.model is not self.scene.model:
            self.model_changed()
        pose = session.model.neutral() if self.comparing else session.coefficients
        self.scene.set_pose(pose, session.document.contact)
        self.scene.set_preview(None if session.preview is None else session.preview.vertices)
        self.router.update()

    def _draw(self) -> None:
        start = time.perf_counter()
        self.gui.set_scale(self.window.ui_scale)
        self.window.set_title(displayed(self.files.title, label=False))
        failure = self.gui.frame(lambda: draw_window(self))
        self.gui.cursors.update(self.toolbox)
        if self.gui.has_queued_input:
            self.redraw(1)
        ctx, (width, height) = self.window.ctx, self.window.pixels
        ctx.screen.use()
        ctx.viewport = (0, 0, width, height)
        ctx.clear(0.0, 0.0, 0.0, 1.0)
        self.gui.draw()
        self.window.swap()
        self.frames_drawn += 1
        if self.session is not self._last_session:
            self._last_session = self.session
            self._trim_at = min(self._trim_at, self.frames_drawn + _FRAMES_AFTER_OPENING)
        if self.frames_drawn >= self._trim_at and not self.toolbox.active:
            self._trim_at = self.frames_drawn + _FRAMES_BETWEEN_TRIMS
            return_free_memory()
        self.frame_seconds = time.perf_counter() - start
        if self.toolbox.active:
            self.resolution.update(self.frame_seconds)
        if failure is None:
            self._failures = 0
            return
        self._failures += 1
        self._report(failure)
        if self._failures >= _MAX_FAILURES:
            raise FacePoserError(f"The window cannot be drawn ({failure}); {self.recovery.rescue()}") from failure

    def screenshot(self) -> NDArray[np.uint8]:
        """Return the last frame of the window, top row first, shape (height, width, 3)."""
        return drawn_pixels(self.window.ctx, self.window.pixels, self.gui.draw)

    # Errors and the end

    def _report(self, error: Exception) -> None:
        self.redraw()
        if isinstance(error, FacePoserError):
            self.dialogs.report("That did not work", str(error))
            return
        details = "".join(traceback.format_exception(error))
        sys.stderr.write(details)
        text = f"{type(error).__name__}: {error}. Your work is not lost; please save it now."
        self.dialogs.report("Internal error", text, details)

    def close(self) -> None:
        """Save the settings and release everything; unsaved work is kept unless the user closed the window.

        Everything is released whatever fails; the error is then raised.
        """
        self.recovery.keeps = not self.closing
        with ExitStack() as stack:
            # In reverse, each even if an earlier one raises: the features keep unsaved work.
            for part in (
                self.features.join,
                self.window.close,
                self.gui.close,
                self.scene.release,
                self.session.close,
                self.files.close,
                self.features.close,
                self._save_settings_at_end,
            ):
                stack.callback(part)

    def _release_unfinished(self) -> None:
        """Release what exists of an editor that could not be set up, so that another window can open."""
        with ExitStack() as stack:
            for name, method in (("window", "close"), ("gui", "close"), ("scene", "release"), ("session", "close")):
                if hasattr(self, name):
                    stack.callback(getattr(getattr(self, name), method))

    def _save_settings_at_end(self) -> None:
        if self._window is None:
            return
        self.settings.window_size = self.window.normal_size
        self.settings.window_position = self.window.normal_position
        self.settings.window_maximized = self.window.maximized
        self._window = None
        told = self._settings_failed
        self.save_settings()
        if self._settings_failed and not told:
            # There is no window any more to show it.
            sys.stderr.write(f"{self.dialogs.waiting[-1].text}\n")


def run(what: str, exit_after_first_frame: bool = False) -> int:
    """Open ``what``, a character or a session, in a window and return the exit status once the user has closed it.

    Args:
        what: Name or path.
        exit_after_first_frame: End once the face is on the screen, to measure the start.

    Raises:
        FacePoserError: If ``what`` or the window cannot be opened.
    """
    # The solver's thread and the frames share the interpreter, which switches every 5 ms by default: too late for both.
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
