"""Undo and redo as snapshots of immutable documents."""

from dataclasses import dataclass

from faceposer.session.document import Document

_LIMIT = 1000


@dataclass(frozen=True)
class Entry:
    """A document and what the user did to come to it."""

    label: str
    document: Document


class History:
    """The documents that undo and redo walk through; they are small and shared, so that a snapshot costs nothing."""

    def __init__(self, document: Document) -> None:
        """Begin with ``document``, which cannot be undone."""
        self._entries = [Entry("", document)]
        self._head = 0

    def commit(self, label: str, document: Document, merges: bool = False) -> None:
        """Add ``document`` after the head and drop what was undone; ``label`` says what the user did.

        With ``merges`` it takes the place of a head with the same label, if nothing was undone since.
        """
        if merges and 0 < self._head == len(self._entries) - 1 and self._entries[self._head].label == label:
            self._entries[self._head] = Entry(label, document)
            return
        self._entries = [*self._entries[: self._head + 1], Entry(label, document)][-_LIMIT:]
        self._head = len(self._entries) - 1

    def amend_head(self, document: Document) -> None:
        """Exchange the head's document: the same edit, better solved."""
        self._entries[self._head] = Entry(self._entries[self._head].label, document)

    @property
    def head(self) -> Document:
        """The current document of the history."""
        return self._entries[self._head].document

    @property
    def depth(self) -> int:
        """How many steps lead to the head."""
        return self._head

    @property
    def undo_label(self) -> str | None:
        """What undo would take back, or None."""
        return self._entries[self._head].label if self._head > 0 else None

    @property
    def redo_label(self) -> str | None:
        """What redo would do again, or None."""
        return self._entries[self._head + 1].label if self._head + 1 < len(self._entries) else None

    def undo(self) -> Document:
        """Step back and return the document there; the first one stays."""
        self._head = max(self._head - 1, 0)
        return self.head

    def redo(self) -> Document:
        """Step forward and return the document there; the last one stays."""
        self._head = min(self._head + 1, len(self._entries) - 1)
        return self.head
