"""Names of shapes: recognition of ARKit's 52 names in their many spellings."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES

#: Halves of two of ARKit's shapes, which rigs of 53 or 54 shapes have in place of the whole.
SPLIT_SHAPES: tuple[str, ...] = (
    *("browInnerUpLeft", "browInnerUpRight"),
    *("cheekPuffLeft", "cheekPuffRight"),
)
#: Shapes that move the face to a side; for all other names, a side at the end is the side of the face.
_SIDEWAYS = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
#: Maximum length of a name that is compared with ARKit's.
_LONGEST_NAME = 256
_SEPARATORS = re.compile(r"[\W_]+")
#: Boundaries between a prefix and a name: separators, or changes from lower to upper case or from digit to letter.
_PREFIX_ENDS = re.compile(r"[\W_]+(?=[^\W_])|(?<=[a-z])(?=[A-Z])|(?<=[0-9])(?=[A-Za-z])")


def _spellings(shape: str) -> list[str]:
    """Return the spellings of ``shape`` in lower case without separators."""
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
    """The result of matching the names of a file with ARKit's.

    Attributes:
        shapes: Canonical name, from ``ARKIT_SHAPES`` or ``SPLIT_SHAPES``, by name in the file.
        missing: ARKit's shapes that the file has neither whole nor in halves.
        others: Names in the file that are not ARKit's.
    """

    shapes: dict[str, str]
    missing: tuple[str, ...]
    others: tuple[str, ...]


def whole_shape_of(name: str) -> str:
    """Return the whole shape of a half in ``SPLIT_SHAPES``; any other ``name`` is returned unchanged."""
    return re.sub("(Left|Right)$", "", name) if name in SPLIT_SHAPES else name


def half_shapes_of(name: str) -> tuple[str, ...]:
    """Return the left and right half of the shape ``name``, or an empty tuple if it is never split."""
    return tuple(half for half in SPLIT_SHAPES if whole_shape_of(half) == name)


def makers(name: str, have: Collection[str]) -> tuple[str, ...]:
    """Return the shapes in ``have`` with a mean weight equal to that of the shape ``name``.

    This is the shape itself, else the whole of which it is a half, else those of its halves in ``have``.
    """
    if name in have:
        return (name,)
    whole = whole_shape_of(name)
    if whole != name:
        return (whole,) if whole in have else ()
    return tuple(half for half in half_shapes_of(name) if half in have)


def weight_map(names: Sequence[str], given: Sequence[str]) -> NDArray[np.float64]:
    """Return the matrix that maps weights of the shapes ``given`` to those of ``names``, shape (S', S).

    Both may contain ``SPLIT_SHAPES`` or the wholes. Shapes without a source have weight 0.
    """
    matrix = np.zeros((len(names), len(given)))
    index = {name: column for column, name in enumerate(given)}
    for row, name in enumerate(names):
        sources = makers(name, index)
        for source in sources:
            matrix[row, index[source]] = 1.0 / len(sources)
    return matrix


def canonical_shape(name: str) -> str | None:
    """Return the shape of ``ARKIT_SHAPES`` or ``SPLIT_SHAPES`` that ``name`` denotes, or None.

    Case and separators are ignored, the side may be ``L``, ``R``, ``Left`` or ``Right`` at either end, and text before
    a dot, colon, bar or slash, such as the mesh's name, is skipped.
    """
    if len(name) > _LONGEST_NAME:
        return None
    parts = [name, *(name[cut.end() :] for cut in re.finditer(r"[.:|/]", name))]
    for part in parts:
        shape = _SHAPES.get(_SEPARATORS.sub("", part).lower())
        if shape is not None:
            return shape
    return None


def match_arkit(names: Iterable[str], where: str) -> NameMatch:
    """Match ``names`` with ARKit's shapes, ignoring a prefix that all or most of them share.

    Args:
        names: Names of shapes or columns in the file.
        where: Source of the names as the beginning of a sentence, such as "The rig 'a.glb'".

    Raises:
        FacePoserError: If two names denote the same shape.
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
                f"{where} has both '{owners[shape]}' and '{name}', which denote the same shape, {shape}; rename or "
                "remove one of them."
            )
        owners[shape] = name
    have = {whole_shape_of(shape) for shape in owners}
    return NameMatch(
        {name: shape for name, shape in found.items() if shape is not None},
        tuple(shape for shape in ARKIT_SHAPES if shape not in have),
        tuple(name for name, shape in found.items() if shape is None),
    )


def _prefixes(names: list[str]) -> list[str]:
    """Return the common prefix of all ``names``, and the prefix of shape names in at least half of them."""
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
    # In names of corrective shapes, such as jawOpen_mouthClose, the first shape is not a prefix.
    return [prefix for prefix in prefixes if canonical_shape(prefix) is None]
