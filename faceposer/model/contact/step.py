"""The contact step: from the vertices of a pose to those of a face whose surfaces do not lie in each other."""

from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.model.contact.arch_contact import ArchContact
from faceposer.model.contact.arches import find_arches
from faceposer.model.contact.eyeballs import find_eyeballs
from faceposer.model.contact.lid_contact import LidContact, lid_contacts
from faceposer.model.subject import Subject


class ContactStep:
    """Keeps lids on eyeballs and off each other, and the skin before the teeth, for one character.

    Everything that the character's shape settles is worked out once. Parts that a character lacks are left out. A pose
    in which nothing penetrates, such as the neutral face, stays exactly as it is.

    Attributes:
        parts: The corrections, in the order in which they are made.
    """

    def __init__(self, parts: list[LidContact | ArchContact]) -> None:
        """Make a step of ``parts``."""
        self.parts = parts

    @classmethod
    def of(cls, subject: Subject) -> Self:
        """Return the step for ``subject``."""
        return cls(
            [*lid_contacts(subject, find_eyeballs(subject)), *(ArchContact(subject, a) for a in find_arches(subject))]
        )

    def apply(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Correct the pose ``vertices``, shape (N, 3), in place, and return them."""
        for part in self.parts:
            part.apply(vertices)
        return vertices
