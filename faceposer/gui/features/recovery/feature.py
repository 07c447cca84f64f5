"""Autosave of unsaved work, and recovery of the work of an earlier run that was not saved."""

import math
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.keys.feature import KeysFeature
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.session.autosave import Journal, Orphan, autosave_dir, find_orphans, unusable
from faceposer.session.session import Session


class RecoveryFeature(Feature):
    """Journal of the current session, and recovery of the journals of earlier runs.

    Attributes:
        keeps: True to keep unsaved work when the window closes, and to offer it at the next start.
    """

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``; if it keeps no journal, nothing is written and no recovery is offered."""
        super().__init__(context)
        self.keeps = True
        self._journal: Journal | None = None
        # Journal of the session that is put aside while a key pose is edited.
        self._aside: Journal | None = None
        self._offers: list[Orphan] = []
        self._claimed: list[Orphan] = []
        self._failure_reported = False
        if not context.keeps_journal:
            return
        folder = self._folder()
        self._journal = Journal(folder, self._clock)
        found = find_orphans(folder)
        if folder != autosave_dir():
            # The default folder may hold journals from before another folder was chosen.
            default = find_orphans(autosave_dir())
            orphans, damaged = (*found.orphans, *default.orphans), (*found.damaged, *default.damaged)
            found = replace(found, orphans=orphans, damaged=damaged)
        self._offers = list(found.orphans)
        self._claimed = list(found.orphans)
        for path in found.damaged:
            context.dialogs.report(
                "Earlier work cannot be recovered", f"The autosaved file is damaged. It was moved to '{path}'."
            )

    def _folder(self) -> Path:
        """Return the chosen folder for unsaved work, or the default one if it cannot be used, which is reported."""
        chosen = self.context.settings.autosave_folder
        if not chosen:
            return autosave_dir()
        if reason := unusable(Path(chosen)):
            self.context.dialogs.report(
                "The autosave folder cannot be used",
                f"Unsaved work cannot be kept in '{chosen}' ({reason}). It is kept in '{autosave_dir()}' until another "
                "folder is chosen in the preferences.",
            )
            return autosave_dir()
        return Path(chosen)

    def _clock(self) -> float:
        # The clock may be replaced later, when recorded events are played.
        return self.context.clock()

    @property
    def patience(self) -> float:
        """Seconds until the journal has to be written."""
        return math.inf if self._journal is None else self._journal.patience

    def update(self) -> None:
        """Write the journal, and offer to recover the next orphan when no dialog is open."""
        context = self.context
        if self._journal is None:
            return
        if self._offers and not (context.dialogs.open or context.file_dialogs.open or context.is_modal or context.busy):
            self._offer(self._offers.pop(0))
        try:
            self._keep_aside()
            self._journal.update(context.session, context.viewport.camera)
        except FacePoserError as error:
            # Writing is attempted again and again; the first failure is reported.
            if not self._failure_reported:
                self._failure_reported = True
                context.dialogs.report("Unsaved work cannot be recovered after a crash", f"{error} Save often.")

    @property
    def _put_aside(self) -> Session | None:
        """The session that is put aside while a key pose is edited, if it has unsaved changes."""
        before = self.context.feature(KeysFeature).editing.before
        return before if before is not None and before.dirty else None

    def _keep_aside(self, at_once: bool = False) -> None:
        """Write the journal of the session that is put aside, or remove it once that session has returned."""
        session = self._put_aside
        if session is None:
            if self._aside is not None:
                self._aside.close(keep=False)
                self._aside = None
            return
        if self._aside is None:
            assert self._journal is not None
            self._aside = Journal(self._journal.folder, self._clock)
        if at_once:
            self._aside.flush(session)
        else:
            self._aside.update(session)

    def rescue(self) -> str:
        """Write the journal after a fatal error, and return what becomes of unsaved work, for its message."""
        session = self.context.session
        if not session.dirty and self._put_aside is None:
            return "no changes are lost."
        if self._journal is None:
            return "unsaved changes are lost."
        try:
            self._keep_aside(at_once=True)
            self._journal.flush(session, self.context.viewport.camera)
        except FacePoserError as error:
            return f"your work could not be saved either: {error}"
        return "your work is kept and can be recovered when you start Face Poser again."

    def close(self) -> None:
        """Close the journal, and keep unsaved work for the next start if ``keeps`` is True."""
        for orphan in self._claimed:
            orphan.release()
        if self._journal is None:
            return
        if self.keeps:
            with suppress(FacePoserError):
                self._keep_aside(at_once=True)
            with suppress(FacePoserError):
                self._journal.flush(self.context.session, self.context.viewport.camera)
        self._journal.close(self.keeps)
        if self._aside is not None:
            self._aside.close(self.keeps)

    def _offer(self, orphan: Orphan) -> None:
        saved_at = f"{orphan.saved_at.astimezone():%Y-%m-%d %H:%M}"
        text = f"Face Poser ended before this work was saved. It was autosaved on {saved_at}."
        if orphan.outdated:
            text += f" {orphan.name} has been saved since then, with other content."
        name = orphan.name if orphan.path is not None else f"the unsaved session with '{orphan.name}'"
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
        """Open the work of ``orphan``, which is deleted as soon as the journal of this run holds the work."""
        context = self.context
        if not context.show_session(orphan.open, "The work cannot be recovered", " It will be offered again."):
            orphan.release()
            return
        if self._journal is not None:
            self._journal.flush(context.session, context.viewport.camera)
        orphan.remove()
