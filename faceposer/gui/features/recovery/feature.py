"""Keeps the user's work on the disk as it is made, and offers at the start what an earlier run could not save."""

import math
from contextlib import suppress
from typing import TYPE_CHECKING

from faceposer.errors import FacePoserError
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.session.autosave import Journal, Orphan, autosave_dir, find_orphans

if TYPE_CHECKING:
    from faceposer.gui.app import App


class Recovery:
    """The window's journal, and the journals that wait to be offered."""

    def __init__(self, app: "App", on: bool) -> None:
        """Serve ``app``; unless ``on``, nothing is written and nothing is offered."""
        self._app = app
        self._journal: Journal | None = None
        self._waiting: list[Orphan] = []
        self._claimed: list[Orphan] = []
        self._told = False
        if not on:
            return
        self._journal = Journal(autosave_dir(), self._clock)
        found = find_orphans(autosave_dir())
        self._waiting = list(found.orphans)
        self._claimed = list(found.orphans)
        for path in found.damaged:
            app.dialogs.report(
                "Earlier work cannot be recovered", f"What the program kept of it is damaged; it now lies in '{path}'."
            )

    def _clock(self) -> float:
        # Who plays events brings a clock later.
        return self._app.window.clock()

    @property
    def patience(self) -> float:
        """For how many seconds there is nothing to do."""
        return math.inf if self._journal is None else self._journal.patience

    def follow(self) -> None:
        """Keep what was done, and offer the next orphan once nothing else is asked."""
        app = self._app
        if self._journal is None:
            return
        if self._waiting and not (app.dialogs.open or app.file_dialogs.open or app.importing.open or app.busy):
            self._offer(self._waiting.pop(0))
        try:
            self._journal.follow(app.session, app.viewport.camera)
        except FacePoserError as error:
            # Once is enough: it is tried again and again.
            if not self._told:
                self._told = True
                app.dialogs.report("Unsaved work would not survive a crash", f"{error} Save often.")

    def rescue(self) -> str:
        """Bring the disk up to date, and say where unsaved work is."""
        session = self._app.session
        if not session.dirty:
            return "nothing is lost."
        if self._journal is None:
            return "what was not saved is lost."
        try:
            self._journal.flush(session, self._app.viewport.camera)
        except FacePoserError as error:
            return f"your work could not be saved either: {error}"
        return "your work is kept, and will be offered when you start Face Poser again."

    def close(self, keep: bool) -> None:
        """End; with ``keep`` leave unsaved work to be offered at the next start."""
        for orphan in self._claimed:
            orphan.release()
        if self._journal is None:
            return
        if keep:
            with suppress(FacePoserError):
                self._journal.flush(self._app.session, self._app.viewport.camera)
        self._journal.close(keep)

    def _offer(self, orphan: Orphan) -> None:
        text = (
            f"Face Poser ended before it was saved. What was done until {orphan.saved_at.astimezone():%Y-%m-%d %H:%M} "
            "was kept."
        )
        if orphan.outdated:
            text += f" {orphan.name} has been saved again since then, with something else."
        name = orphan.name if orphan.path is not None else f"the unsaved pose of '{orphan.name}'"
        self._app.dialogs.ask(
            Question(
                f"Recover {name}?",
                text,
                (
                    Choice("Recover", lambda: self._app.files.guard(lambda: self._recover(orphan))),
                    Choice("Discard", orphan.remove),
                    Choice("Later", orphan.release),
                ),
            )
        )
        self._app.redraw()

    def _recover(self, orphan: Orphan) -> None:
        """Edit what ``orphan`` holds; it is deleted once the work is in our own journal."""
        app = self._app
        if not app.files.show(orphan.open, "This cannot be recovered", " It is kept for the next start."):
            orphan.release()
            return
        if self._journal is not None:
            self._journal.flush(app.session, app.viewport.camera)
        orphan.remove()
