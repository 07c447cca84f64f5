"""Keeps the user's work on the disk as it is made, and offers at the start what an earlier run could not save."""

import math
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.session.autosave import Journal, Orphan, autosave_dir, find_orphans


class RecoveryFeature(Feature):
    """The window's journal, and the journals that wait to be offered.

    Attributes:
        keeps: Whether unsaved work stays on the disk when the window closes, to be offered at the next start.
    """

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``; unless it keeps a journal, nothing is written and nothing is offered."""
        super().__init__(context)
        self.keeps = True
        self._journal: Journal | None = None
        self._waiting: list[Orphan] = []
        self._claimed: list[Orphan] = []
        self._told = False
        if not context.keeps_journal:
            return
        chosen = context.settings.autosave_folder
        folder = Path(chosen) if chosen else autosave_dir()
        self._journal = Journal(folder, self._clock)
        found = find_orphans(folder)
        if folder != autosave_dir():
            # What was kept before another folder was chosen is not forgotten.
            usual = find_orphans(autosave_dir())
            found = replace(found, orphans=(*found.orphans, *usual.orphans), damaged=(*found.damaged, *usual.damaged))
        self._waiting = list(found.orphans)
        self._claimed = list(found.orphans)
        for path in found.damaged:
            context.dialogs.report(
                "Earlier work cannot be recovered", f"What the program kept of it is damaged; it now lies in '{path}'."
            )

    def _clock(self) -> float:
        # Who plays events brings a clock later.
        return self.context.clock()

    @property
    def patience(self) -> float:
        """For how many seconds there is nothing to do."""
        return math.inf if self._journal is None else self._journal.patience

    def update(self) -> None:
        """Keep what was done, and offer the next orphan once nothing else is asked."""
        context = self.context
        if self._journal is None:
            return
        if self._waiting and not (
            context.dialogs.open or context.file_dialogs.open or context.is_modal or context.busy
        ):
            self._offer(self._waiting.pop(0))
        try:
            self._journal.follow(context.session, context.viewport.camera)
        except FacePoserError as error:
            # Once is enough: it is tried again and again.
            if not self._told:
                self._told = True
                context.dialogs.report("Unsaved work would not survive a crash", f"{error} Save often.")

    def rescue(self) -> str:
        """Bring the disk up to date, and say where unsaved work is."""
        session = self.context.session
        if not session.dirty:
            return "nothing is lost."
        if self._journal is None:
            return "what was not saved is lost."
        try:
            self._journal.flush(session, self.context.viewport.camera)
        except FacePoserError as error:
            return f"your work could not be saved either: {error}"
        return "your work is kept, and will be offered when you start Face Poser again."

    def close(self) -> None:
        """End, and leave unsaved work to be offered at the next start if it ``keeps`` it."""
        for orphan in self._claimed:
            orphan.release()
        if self._journal is None:
            return
        if self.keeps:
            with suppress(FacePoserError):
                self._journal.flush(self.context.session, self.context.viewport.camera)
        self._journal.close(self.keeps)

    def _offer(self, orphan: Orphan) -> None:
        text = (
            f"Face Poser ended before it was saved. What was done until {orphan.saved_at.astimezone():%Y-%m-%d %H:%M} "
            "was kept."
        )
        if orphan.outdated:
            text += f" {orphan.name} has been saved again since then, with something else."
        name = orphan.name if orphan.path is not None else f"the unsaved pose of '{orphan.name}'"
        self.context.dialogs.ask(
            Question(
                f"Recover {name}?",
                text,
                (
                    Choice("Recover", lambda: self.context.guard_changes(lambda: self._recover(orphan))),
                    Choice("Discard", orphan.remove),
                    Choice("Later", orphan.release),
                ),
            )
        )
        self.context.redraw()

    def _recover(self, orphan: Orphan) -> None:
        """Edit what ``orphan`` holds; it is deleted once the work is in our own journal."""
        context = self.context
        if not context.show_session(orphan.open, "This cannot be recovered", " It is kept for the next start."):
            orphan.release()
            return
        if self._journal is not None:
            self._journal.flush(context.session, context.viewport.camera)
        orphan.remove()
