"""The contact step: from the vertices of a pose to those of a face whose surfaces do not lie in each other."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.contact.arch_contact import ArchContact
from faceposer.model.contact.arches import find_arches
from faceposer.model.contact.eyeballs import find_eyeballs
from faceposer.model.contact.lid_contact import LidContact, lid_contacts
from faceposer.model.contact.moved import Moved

# Share of a head's height by which a vertex is moved at most.
_MOST = 0.15


class ContactStep:
    """Keeps lids on eyeballs and off each other, and the skin before the teeth, for one character.

    Everything that the character's shape settles is worked out once. Parts that a character lacks are left out, and so
    are those whose geometry is none of eyes and teeth, such as flat ones. A pose in which nothing penetrates, such as
    the neutral face, stays exactly as it is.

    Attributes:
        parts: The corrections, in the order in which they are made.
        most: No vertex is moved farther than this, in the unit of the character; no surface of a face lies deeper.
    """

    def __init__(self, parts: list[LidContact | ArchContact], most: float = np.inf) -> None:
        """Make a step of ``parts`` that moves no vertex farther than ``most``."""
        self.parts = parts
        self.most = most

    @classmethod
    def of(cls, character: Character) -> Self:
        """Return the step for ``character``."""
        parts: list[LidContact | ArchContact] = []
        with _left_out_if_degenerate():
            parts += lid_contacts(character, find_eyeballs(character))
        with _left_out_if_degenerate():
            parts += [ArchContact(character, arch) for arch in find_arches(character)]
        return cls(parts, _MOST * character.height)

    def apply(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Correct the pose ``vertices``, shape (N, 3), in place, and return them."""
        if not self.parts:
            return vertices
        moves: list[Moved] = []
        with np.errstate(all="ignore"):
            for part in self.parts:
                # Where points lie in a plane, on a line or nowhere at all, the part is left out.
                with suppress(np.linalg.LinAlgError, ValueError, OverflowError, IndexError):
                    moves.extend(part.apply(vertices))
            if not sum(move.farthest for move in moves) <= self.most:
                # Shapes that tear a face apart, or no numbers at all: what is far off stays where the pose has it.
                before = vertices.copy()
                for move in reversed(moves):
                    before[move.ids] = move.before
                moved = vertices - before
                far = ~(np.einsum("nk,nk->n", moved, moved) <= self.most**2)
                vertices[far] = before[far]
        return vertices


@contextmanager
def _left_out_if_degenerate() -> Iterator[None]:
    """Leave out a part whose points lie in a plane, on a line or nowhere at all."""
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError, ValueError, OverflowError):
        yield
