"""Features with a dialog whose work is done in the background."""

from typing import Any

from faceposer.gui.feature import Feature
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.session.jobs import Job


class WorkFeature(Feature):
    """Base class of features with a dialog that works in the background.

    Attributes:
        open: True while the dialog is shown.
    """

    open: bool

    @property
    def working(self) -> str:
        """What is being done in the background, as a sentence, or ""."""
        raise NotImplementedError

    def ended(self, job: Job[Any]) -> bool:
        """Return True once ``job`` has ended; until then, its progress is drawn."""
        done = job.done
        # One frame only before, unlike after an event: the progress advances many times per second.
        self.context.redraw(3 if done else 1)
        return done

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return 0.1 if self.working else super().patience

    @property
    def is_modal(self) -> bool:
        """True while the dialog is shown."""
        return self.open

    @property
    def blocks_files(self) -> bool:
        """True if dropped files are ignored: while work is in progress."""
        return bool(self.working)

    @property
    def quit_question(self) -> Question | None:
        """Question before the window closes while work is in progress."""
        if not self.working:
            return None
        return Question("Cancel the work and quit?", self.working, (Choice("Quit"), Choice("Continue")), default=1)
