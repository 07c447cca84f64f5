"""Steps of the landmarks page that can be undone and redone."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")

# Most steps that are kept.
_MOST = 200


@dataclass(frozen=True)
class Step(Generic[T]):
    """A state that can be returned to.

    Attributes:
        label: What changed it, such as "Move the tip of the nose".
        shown: Index of the picture in which it was changed.
        items: All items of the state.
    """

    label: str
    shown: int
    items: tuple[T, ...]


class Steps(Generic[T]):
    """Earlier and undone states."""

    def __init__(self) -> None:
        self._done: list[Step[T]] = []
        self._undone: list[Step[T]] = []

    @property
    def undo_label(self) -> str:
        """What would be undone, or ""."""
        return self._done[-1].label if self._done else ""

    @property
    def redo_label(self) -> str:
        """What would be redone, or ""."""
        return self._undone[-1].label if self._undone else ""

    def clear(self) -> None:
        """Forget all states."""
        self._done.clear()
        self._undone.clear()

    def record(self, label: str, shown: int, before: Sequence[T]) -> None:
        """Add a change named ``label`` of picture ``shown``, before which the items were ``before``."""
        self._done = [*self._done, Step(label, shown, tuple(before))][-_MOST:]
        self._undone.clear()

    def undo(self, now: Sequence[T]) -> Step[T] | None:
        """Return the state before the last change of ``now``, or None."""
        return self._exchanged(self._done, self._undone, now)

    def redo(self, now: Sequence[T]) -> Step[T] | None:
        """Return the state after the change of ``now`` that was undone last, or None."""
        return self._exchanged(self._undone, self._done, now)

    @staticmethod
    def _exchanged(source: list[Step[T]], target: list[Step[T]], now: Sequence[T]) -> Step[T] | None:
        if not source:
            return None
        step = source.pop()
        target.append(Step(step.label, step.shown, tuple(now)))
        return step
