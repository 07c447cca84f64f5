"""Undo and redo with snapshots of immutable documents."""

from dataclasses import dataclass

from faceposer.session.document import Document

_LIMIT = 1000


@dataclass(frozen=True)
class Entry:
    """A document and the label of the step that led to it."""

    label: str
    document: Document


class History:
    """The undo history. Snapshots are cheap: documents are small and share their data."""

    def __init__(self, document: Document) -> None:
        """Start with ``document``, which cannot be undone."""
        self._entries = [Entry("", document)]
        self._head = 0

    def commit(self, label: str, document: Document, merges: bool = False) -> None:
        """Add ``document`` after the head and discard the undone steps; ``label`` names the step.

        With ``merges``, it replaces a head with the same label, unless a step has been undone since.
        """
        if merges and 0 < self._head == len(self._entries) - 1 and self._entries[self._head].label == label:
            self._entries[self._head] = Entry(label, document)
            return
        self._entries = [*self._entries[: self._head + 1], Entry(label, document)][-_LIMIT:]
        self._head = len(self._entries) - 1

    def replace_head(self, document: Document) -> None:
        """Replace the document of the head: the same step with a better solution."""
        self._entries[self._head] = Entry(self._entries[self._head].label, document)

    @property
    def head(self) -> Document:
        """The current document of the history."""
        return self._entries[self._head].document

    @property
    def depth(self) -> int:
        """Number of steps that lead to the head."""
        return self._head

    @property
    def undo_label(self) -> str | None:
        """Label of the step that undo reverts, or None."""
        return self._entries[self._head].label if self._head > 0 else None

    @property
    def redo_label(self) -> str | None:
        """Label of the step that redo repeats, or None."""
        return self._entries[self._head + 1].label if self._head + 1 < len(self._entries) else None

    def undo(self) -> Document:
        """Step back and return the new head; the first document remains."""
        self._head = max(self._head - 1, 0)
        return self.head

    def redo(self) -> Document:
        """Step forward and return the new head; the last document remains."""
        self._head = min(self._head + 1, len(self._entries) - 1)
        return self.head
