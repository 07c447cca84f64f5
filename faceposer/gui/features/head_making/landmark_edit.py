"""Landmarks of the files of a dialog, which can be moved, with undo, redo and the way back to what was found."""

from collections.abc import Collection, Sequence
from typing import Generic

from faceposer.gui.features.head_making.contents import M
from faceposer.gui.features.head_making.steps import Step, Steps


class LandmarkEdit(Generic[M]):
    """The files with their landmarks.

    Attributes:
        marked: The files with their landmarks.
        shown: Index of the one whose picture is shown.
        selected: Name of the selected landmark, or "".
        steps: Changes that can be undone.
    """

    def __init__(self) -> None:
        self.marked: list[M] = []
        self.shown = 0
        self.selected = ""
        self.steps: Steps[M] = Steps()
        self._before: tuple[M, ...] | None = None

    def show(self, marked: Sequence[M]) -> None:
        """Edit ``marked`` from now on."""
        self.marked, self.shown, self.selected, self._before = list(marked), 0, "", None
        self.steps.clear()

    @property
    def current(self) -> M:
        """The one whose picture is shown."""
        return self.marked[self.shown]

    @property
    def moving(self) -> bool:
        """True between `move` and the end of the move."""
        return self._before is not None

    @property
    def n_moved(self) -> int:
        """Number of landmarks of all files that are not where they were found."""
        return sum(len(one.moved) for one in self.marked)

    def move(self, name: str, pixel: tuple[float, float]) -> None:
        """Move landmark ``name`` of the picture shown to ``pixel``, until `end_move` or `cancel_move`."""
        if self._before is None:
            self._before = tuple(self.marked)
        self.marked[self.shown] = self.current.with_moved(name, pixel)

    def end_move(self, label: str) -> None:
        """Make the moves since the last step one step of undo, named ``label``."""
        before, self._before = self._before, None
        if before is not None:
            self._record(label, before)

    def cancel_move(self) -> None:
        """Return to the state before the move."""
        if self._before is not None:
            self.marked, self._before = list(self._before), None

    def reset(self, names: Collection[str] | None = None) -> None:
        """Move the landmarks ``names`` of the picture shown, or all of all files, back to where they were found."""
        self.cancel_move()
        before = tuple(self.marked)
        for number, one in enumerate(before):
            if names is None or number == self.shown:
                moved = one.moved if names is None else one.moved & frozenset(names)
                self.marked[number] = one.with_reset(moved) if moved else one
        self._record("Reset all landmarks" if names is None else "Reset a landmark", before)

    def undo(self) -> bool:
        """Undo the last change; return True if there was one."""
        self.cancel_move()
        return self._return_to(self.steps.undo(self.marked))

    def redo(self) -> bool:
        """Redo the change that was undone last; return True if there was one."""
        self.cancel_move()
        return self._return_to(self.steps.redo(self.marked))

    def _record(self, label: str, before: tuple[M, ...]) -> None:
        if any(old is not new for old, new in zip(before, self.marked, strict=True)):
            self.steps.record(label, self.shown, before)

    def _return_to(self, step: Step[M] | None) -> bool:
        if step is None:
            return False
        self.marked, self.shown = list(step.items), step.shown
        return True
