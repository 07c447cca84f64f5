"""What shapes are called: the many spellings of ARKit's 52 names."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES

#: Halves of two of ARKit's shapes, as rigs of 53 or 54 shapes have them in place of the whole.
SPLIT_SHAPES: tuple[str, ...] = (
    *("browInnerUpLeft", "browInnerUpRight"),
    *("cheekPuffLeft", "cheekPuffRight"),
)
#: Shapes that move to a side; the others that end in one belong to it.
_SIDEWAYS = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
_SEPARATORS = re.compile(r"[\W_]+")
#: What may stand between a prefix and a name: a separator, or a capital or a digit's end.
_PREFIX_ENDS = re.compile(r"[\W_]+(?=[^\W_])|(?<=[a-z])(?=[A-Z])|(?<=[0-9])(?=[A-Za-z])")


def _spellings(shape: str) -> list[str]:
    """Return how ``shape`` is written, without case and separators."""
    side = re.search("(Left|Right)$", shape)
    if side is None:
        return [shape.lower()]
    stem, side_name = shape[: side.start()].lower(), side[0].lower()
    if shape in _SIDEWAYS:
        return [stem + side_name, stem + side_name[0]]
    return [stem + side_name, stem + side_name[0], side_name + stem, side_name[0] + stem]


_SHAPES = {spelling: shape for shape in (*ARKIT_SHAPES, *SPLIT_SHAPES) for spelling in _spellings(shape)}


@dataclass(frozen=True)
class NameMatch:
    """Which names of a file are ARKit's.

    Attributes:
        shapes: Our name, one of ``ARKIT_SHAPES`` and ``SPLIT_SHAPES``, by the file's.
        missing: Shapes of ARKit that the file has neither whole nor in halves.
        others: Names in the file that are not ARKit's.
    """

    shapes: dict[str, str]
    missing: tuple[str, ...]
    others: tuple[str, ...]


def whole_of(name: str) -> str:
    """Return the shape that ``name``, one of ``SPLIT_SHAPES``, is half of; any other name is itself."""
    return re.sub("(Left|Right)$", "", name) if name in SPLIT_SHAPES else name


def halves_of(name: str) -> tuple[str, ...]:
    """Return left and right half of the shape ``name``; none where no rig has it in halves."""
    return tuple(half for half in SPLIT_SHAPES if whole_of(half) == name)


def makers(name: str, have: Collection[str]) -> tuple[str, ...]:
    """Return those of the shapes ``have`` whose mean weight is that of the shape ``name``.

    They are the shape itself, or the whole that it is half of, or its halves as far as they are there, or none.
    """
    if name in have:
        return (name,)
    whole = whole_of(name)
    if whole != name:
        return (whole,) if whole in have else ()
    return tuple(half for half in halves_of(name) if half in have)


def weight_map(names: Sequence[str], given: Sequence[str]) -> NDArray[np.float64]:
    """Return the matrix that makes weights of the shapes ``names`` from those of ``given``, shape (S', S).

    Both may have ``SPLIT_SHAPES`` or the wholes. A shape that cannot be made is 0.
    """
    matrix = np.zeros((len(names), len(given)))
    index = {name: column for column, name in enumerate(given)}
    for row, name in enumerate(names):
        sources = makers(name, index)
        for source in sources:
            matrix[row, index[source]] = 1.0 / len(sources)
    return matrix


def canonical_shape(name: str) -> str | None:
    """Return which of ``ARKIT_SHAPES`` and ``SPLIT_SHAPES`` is meant by ``name``, None if it is none of them.

    Case and separators do not matter, the side is ``L``, ``R``, ``Left`` or ``Right`` at either end, and all up to a
    dot, colon, bar or slash may be something else, such as the mesh's name.
    """
    parts = [name, *(name[cut.end() :] for cut in re.finditer(r"[.:|/]", name))]
    for part in parts:
        shape = _SHAPES.get(_SEPARATORS.sub("", part).lower())
        if shape is not None:
            return shape
    return None


def match_arkit(names: Iterable[str], where: str) -> NameMatch:
    """Return which of ``names`` mean shapes of ARKit, understanding also a prefix that all or most of them have.

    Args:
        names: Of shapes or columns, as the file has them.
        where: What the names are in, such as "The rig 'a.glb'", to begin a sentence with.

    Raises:
        FacePoserError: If two names mean the same shape, naming both.
    """
    given = list(dict.fromkeys(names))
    found = {name: canonical_shape(name) for name in given}
    for prefix in _prefixes(given):
        for name, shape in found.items():
            if shape is None and name.startswith(prefix):
                found[name] = canonical_shape(name[len(prefix) :])
    owners: dict[str, str] = {}
    for name, shape in found.items():
        if shape is None:
            continue
        if shape in owners:
            raise FacePoserError(
                f"{where} has both '{owners[shape]}' and '{name}', which mean the same shape, {shape}; rename or "
                "remove one of them."
            )
        owners[shape] = name
    have = {whole_of(shape) for shape in owners}
    return NameMatch(
        {name: shape for name, shape in found.items() if shape is not None},
        tuple(shape for shape in ARKIT_SHAPES if shape not in have),
        tuple(name for name, shape in found.items() if shape is None),
    )


def _prefixes(names: list[str]) -> list[str]:
    """Return the prefix that all names share, and the one before shapes' names that at least half of them have."""
    if len(names) < 2:
        return []
    starts = (names[0][: end.end()] for end in _PREFIX_ENDS.finditer(names[0]))
    prefixes = [start for start in starts if all(name.startswith(start) for name in names)][-1:]
    before: Counter[str] = Counter()
    for name in names:
        if canonical_shape(name) is None:
            cuts = (end.end() for end in _PREFIX_ENDS.finditer(name))
            cut = next((cut for cut in cuts if canonical_shape(name[cut:]) is not None), None)
            if cut is not None:
                before[name[:cut]] += 1
    prefixes += [prefix for prefix, count in before.most_common(1) if 2 * count >= len(names) and count > 1]
    # Shapes that correct others in combination, such as jawOpen_mouthClose, are not the last of them.
    return [prefix for prefix in prefixes if canonical_shape(prefix) is None]
