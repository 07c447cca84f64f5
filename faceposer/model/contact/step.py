"""The contact step, which corrects the vertices of a pose so that its surfaces do not penetrate each other."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.contact.arch_contact import ArchContact
from faceposer.model.contact.arches import find_arches
from faceposer.model.contact.displacement import Displacement
from faceposer.model.contact.eyeballs import find_eyeballs
from faceposer.model.contact.lid_contact import LidContact, lid_contacts

# Largest displacement of a vertex, as a share of the head's height.
_MOST = 0.15


class ContactStep:
    """Contact step of one character: keeps lids on the eyeballs and apart, and the skin in front of the teeth.

    Everything that depends on the neutral mesh alone is precomputed. Parts that the character lacks are skipped, and so
    are parts with a geometry unlike eyes and teeth, such as flat ones. A pose without penetration, such as the neutral
    face, is not changed at all.

    Attributes:
        parts: The corrections in order of application.
        most: Largest displacement of a vertex, in the unit of the character; no penetration in a face is deeper.
    """

    def __init__(self, parts: list[LidContact | ArchContact], most: float = np.inf) -> None:
        """Create a step of ``parts`` that moves no vertex farther than ``most``."""
        self.parts = parts
        self.most = most

    @classmethod
    def of(cls, character: Character) -> Self:
        """Build the contact step of ``character``."""
        parts: list[LidContact | ArchContact] = []
        with _skip_degenerate():
            parts += lid_contacts(character, find_eyeballs(character))
        with _skip_degenerate():
            parts += [ArchContact(character, arch) for arch in find_arches(character)]
        return cls(parts, _MOST * character.height)

    def apply(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Correct the pose ``vertices``, shape (N, 3), in place, and return them."""
        if not self.parts:
            return vertices
        moves: list[Displacement] = []
        with np.errstate(all="ignore"):
            for part in self.parts:
                # A pose with coplanar, collinear or non-finite points is degenerate: skip the part.
                with suppress(np.linalg.LinAlgError, ValueError, OverflowError, IndexError):
                    moves.extend(part.apply(vertices))
            if not sum(move.farthest for move in moves) <= self.most:
                # Shapes that tear the face apart, or NaN: vertices moved too far are restored.
                before = vertices.copy()
                for move in reversed(moves):
                    before[move.ids] = move.before
                moved = vertices - before
                far = ~(np.einsum("nk,nk->n", moved, moved) <= self.most**2)
                vertices[far] = before[far]
        return vertices


@contextmanager
def _skip_degenerate() -> Iterator[None]:
    """Skip a part with coplanar, collinear or non-finite points."""
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError, ValueError, OverflowError):
        yield
