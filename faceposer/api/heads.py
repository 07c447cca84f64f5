"""Heads for ``Face``: attributes, random heads, mixtures and caricatures of the morphable model (docs/identity.md)."""

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path

import numpy as np

from faceposer.api import checks
from faceposer.api.posing import PathName
from faceposer.errors import FacePoserError
from faceposer.files.atomic import check_output
from faceposer.identity.editing import HeadEditor, head_editor
from faceposer.identity.head_choices import (
    MOST_SEED,
    MOST_TONE,
    MOST_VARIETY,
    RANDOM_SKIN,
    VARIETY,
    changed_head,
    checked_values,
    mixed_heads,
    named_character,
    with_skin,
)
from faceposer.identity.identity import GROTESQUE, Identity
from faceposer.model.character_file import save_character
from faceposer.model.character_names import checked_title
from faceposer.session.opening import open_session
from faceposer.session.session import Session


class HeadsMixin:
    """The head of a face, which changes under its pose; constraints are removed, as the pose is accepted.

    Methods raise FacePoserError if the character's mesh is not that of the built-in man.

    Attributes:
        session: The document with its history.
    """

    session: Session

    @property
    def head(self) -> Identity:
        """The head in terms of the morphable model."""
        return self.session.document.identity or self._head_editor.own

    @property
    def attributes(self) -> dict[str, float]:
        """Values of the head's attributes by name, such as "nose-length"; 0 is average."""
        return self._head_editor.measure(self.head)

    @property
    def distance_from_average(self) -> float:
        """Distance of the head from the average, in standard deviations: 0 for the average, about 1 for people."""
        return self._head_editor.distance(self.head)

    def set_attributes(self, values: Mapping[str, float] | None = None, /, **named: float) -> None:
        """Set attributes of the head: ``set_attributes(age=0.5, nose_length=-0.3)``.

        Those of the person, such as age, leave each other and change the face; those of the face leave all others
        nearly as they are.

        Args:
            values: Values by name of attribute.
            **named: The same, with "_" in place of "-".
        """
        editor, head = self._head_editor, self.head
        given = {} if values is None else values
        wanted = checked_attributes(editor, given)
        twice = wanted.keys() & (more := checked_attributes(editor, named)).keys()
        if twice:
            raise FacePoserError(f"The attribute '{min(twice)}' is given twice; give one value.")
        wanted |= more
        self._set_head(editor.with_attributes(head, wanted), "Set attributes")

    def caricature(self, factor: float) -> None:
        """Multiply the head's deviation from the average by ``factor``, 0 to 2.5: 0 is the average, 1 no change."""
        self._set_head(self.head.scaled(checked_caricature(factor)), "Caricature")

    def mix(self, other: "HeadsMixin | PathName", share: float = 0.5) -> None:
        """Move the head and its skin towards those of ``other``.

        Args:
            other: Another face, or what ``faceposer.load`` takes.
            share: 0 for this head, 1 for the other one.
        """
        checks.number(share, 0.0, 1.0, "The share")
        if not isinstance(other, (HeadsMixin, str, PathLike)):
            raise FacePoserError(f"The other head must be a face, a name or a path, not {other!r:.60}.")
        theirs = other if isinstance(other, HeadsMixin) else _Other(checks.path_name(other, "The other head"))
        mixed = mixed_heads(self._head_editor, self.head, theirs._head_editor, theirs.head, share)
        self._set_head(mixed, "Mix heads")

    def randomise(
        self,
        seed: int = 0,
        variety: float = VARIETY,
        segments: Iterable[str] | str | None = None,
        texture: str | None = RANDOM_SKIN,
    ) -> None:
        """Change to a random head, reproducible by ``seed``.

        Args:
            seed: A whole number, 0 or more.
            variety: Spread relative to people, 0 to 2; 0 gives the average.
            segments: Segments that change: "eyes", "nose", "mouth" and "rest"; all if None.
            texture: The skin, as for ``set_skin``; None keeps it.
        """
        drawn = random_head(self._head_editor, self.head, seed, variety, segments)
        skin, _ = _checked_skin(texture, None)
        self._set_head(with_skin(self._head_editor, drawn, skin, seed=int(seed)), "Random head")

    def set_skin(self, texture: str | None = None, tone: float | None = None, seed: int = 0) -> None:
        """Change the skin.

        Args:
            texture: "random" for one that fits age and gender, "own" for the character's own, or the name of a skin
                of the model, such as "old-dark-male"; None keeps it.
            tone: From -2.5 (light) to 2.5 (dark); None keeps it.
            seed: Seed of a random skin.
        """
        skin, wanted = _checked_skin(texture, tone)
        self._set_head(with_skin(self._head_editor, self.head, skin, wanted, checked_seed(seed)), "Set the skin")

    def restore_head(self) -> None:
        """Return to the head of the character's file."""
        self.session.set_identity(None, "Original head")

    def save_character(self, path: PathName, title: str | None = None) -> Path:
        """Write the character with this head to ``path`` (.npz), and return the path.

        Args:
            path: File to write; its name without the suffix is the short name of the character.
            title: Display name; the short name if None.
        """
        target = checks.file_path(path)
        check_output(target, ".npz")
        shown = checked_title(target.stem if title is None else title, "The title of a character")
        save_character(target, named_character(self._head_editor, self.head, target.stem, shown))
        return target

    @property
    def _head_editor(self) -> HeadEditor:
        return head_editor(self.session.base_model.character)

    def _set_head(self, head: Identity, label: str) -> None:
        self.session.set_identity(head, label)


class _Other(HeadsMixin):
    """The head of a character or session by name or path."""

    def __init__(self, what: str) -> None:
        self.session = open_session(what)


def checked_attributes(editor: HeadEditor, values: Mapping[str, float]) -> dict[str, float]:
    """Return ``values`` by names of attributes.

    Raises:
        FacePoserError: If one does not exist, or is not a number within its limits.
    """
    if not isinstance(values, Mapping):
        raise FacePoserError(f"Values of attributes must be given by name, such as {{'age': 0.5}}, not {values!r:.60}.")
    for name in values:
        if not isinstance(name, str):
            raise FacePoserError(f"The name of an attribute must be a text, not {name!r:.60}.")
    numbers = {name: checks.real(value, f"The attribute '{name}'") for name, value in values.items()}
    return checked_values(editor.attributes, numbers)


def checked_caricature(factor: float) -> float:
    """Return the factor of a caricature.

    Raises:
        FacePoserError: If it is not a number from 0 to where heads become grotesque.
    """
    return checks.number(factor, 0.0, GROTESQUE, "The factor of a caricature")


def checked_seed(seed: int) -> int:
    """Return a seed.

    Raises:
        FacePoserError: If it is not a whole number, or out of range.
    """
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or not 0 <= seed <= MOST_SEED:
        raise FacePoserError(f"A seed must be a whole number from 0 to {MOST_SEED}.")
    return int(seed)


def random_head(
    editor: HeadEditor, present: Identity, seed: int, variety: float, segments: Iterable[str] | str | None = None
) -> Identity:
    """Return a random head as ``HeadsMixin.randomise`` does, with the skin of ``present``.

    Raises:
        FacePoserError: If an argument is invalid.
    """
    spread = checks.number(variety, 0.0, MOST_VARIETY, "The variety")
    free = None if segments is None else checks.some_of(segments, editor.segment_names, "A segment")
    return editor.random(checked_seed(seed), present, free, spread)


def new_identity(
    editor: HeadEditor,
    seed: int,
    attributes: Mapping[str, float] | None,
    variety: float,
    caricature: float,
    texture: str | None,
    tone: float | None,
) -> Identity:
    """Return a new head as ``faceposer.new_head`` makes it.

    Raises:
        FacePoserError: If an argument is invalid.
    """
    factor, values = (
        checked_caricature(caricature),
        checked_attributes(editor, {} if attributes is None else attributes),
    )
    drawn = random_head(editor, editor.own, seed, variety)
    return changed_head(editor, drawn, factor, values, *_checked_skin(texture, tone), int(seed))


def _checked_skin(texture: str | None, tone: float | None) -> tuple[str | None, float | None]:
    """Return the choice of a skin and its tone.

    Raises:
        FacePoserError: If one is invalid.
    """
    if texture is not None and not isinstance(texture, str):
        raise FacePoserError("A skin must be 'random', 'own', the name of a skin, or None.")
    return texture, None if tone is None else checks.number(tone, -MOST_TONE, MOST_TONE, "The tone")
