"""What the dialogs that make heads show: marked files, the head that was made, and texts."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character


class Marked(Protocol):
    """A scan or photo with a picture of the face, and its landmarks in it."""

    @property
    def name(self) -> str:
        """Name of its file."""
        ...

    @property
    def image(self) -> NDArray[np.uint8]:
        """The picture, shape (h, w, 3)."""
        ...

    @property
    def pixels(self) -> Mapping[str, tuple[float, float]]:
        """Pixels of the feature points that can be moved, by name."""
        ...

    @property
    def found_pixels(self) -> Mapping[str, tuple[float, float]]:
        """Pixels at which they were found."""
        ...

    @property
    def moved(self) -> frozenset[str]:
        """Names of those that the user has moved."""
        ...

    @property
    def note(self) -> str:
        """A sentence on what was found, such as other faces, or ""."""
        ...

    def with_moved(self, name: str, pixel: tuple[float, float]) -> Self:
        """Return it with feature point ``name`` at ``pixel`` of the picture, or as it is if that is not possible."""
        ...

    def with_reset(self, names: Collection[str]) -> Self:
        """Return it with the feature points ``names`` where they were found."""
        ...


@dataclass(frozen=True, eq=False)
class MadeHead:
    """The character that was made.

    Attributes:
        character: The character.
        text: Sentences on how well it fits.
        picture: Pictures of it beside what it was made of, shape (h, w, 3).
        doubt: A sentence on what should be checked, or "".
    """

    character: Character
    text: str
    picture: NDArray[np.uint8]
    doubt: str = field(default="", kw_only=True)

    @property
    def views(self) -> "Sequence[Compared]":
        """What it is compared with; one of them is shown."""
        return (Compared("", self.picture),)


@dataclass(frozen=True, eq=False)
class Compared:
    """A picture of the head beside or over what it was made of.

    Attributes:
        name: Name of the file.
        picture: The picture, shape (h, w, 3).
        over: A picture of the same size that covers it on the right of a line that can be dragged, or None.
    """

    name: str
    picture: NDArray[np.uint8]
    over: NDArray[np.uint8] | None = None


@dataclass(frozen=True)
class Words:
    """Texts of the dialog.

    Attributes:
        action: Name and label of the entry of the File menu, and its help.
        noun: One of the files, such as "scan".
        files: Title of the dialog that asks for one.
        form: Explanation of the form.
        landmarks: Explanation of the page of landmarks.
        options: Options of the fit: name, label and tooltip.
    """

    action: tuple[str, str, str]
    noun: str
    files: str
    form: str
    landmarks: str
    options: tuple[tuple[str, str, str], ...]


M = TypeVar("M", bound=Marked)
H = TypeVar("H", bound=MadeHead)
