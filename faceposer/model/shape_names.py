"""Names of shapes: recognition of ARKit's 52 names in their many spellings."""

import re
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import ARKIT_SHAPES

#: Halves of two of ARKit's shapes, which rigs of 53 or 54 shapes have in place of the whole.
SPLIT_SHAPES: tuple[str, ...] = (
    *("browInnerUpLeft", "browInnerUpRight"),
    *("cheekPuffLeft", "cheekPuffRight"),
)
#: Shapes that move the face to a side; for all other names, a side at the end is the side of the face.
_SIDEWAYS = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
#: Short forms of the sides.
_SHORT_SIDES = {"left": ("l", "lf", "lft", "lt"), "right": ("r", "rt", "rgt")}
_SEPARATORS = re.compile(r"[\W_]+")
_SCOPES = re.compile(r"[.:|/]")
#: Longest name of a shape in characters, with its separators but without the name of a mesh before it.
LONGEST_NAME = 64


def _spellings(shape: str) -> list[str]:
    """Return the spellings of ``shape`` in lower case without separators."""
    side = re.search("(Left|Right)$", shape)
    if side is None:
        return [shape.lower()]
    stem, side_name = shape[: side.start()].lower(), side[0].lower()
    if shape in _SIDEWAYS:
        return [stem + side_name, stem + side_name[0]]
    sides = (side_name, *_SHORT_SIDES[side_name])
    return [spelling for short in sides for spelling in (stem + short, short + stem)]


_SHAPES = {spelling: shape for shape in (*ARKIT_SHAPES, *SPLIT_SHAPES) for spelling in _spellings(shape)}
_BEGINNINGS = frozenset(spelling[:end] for spelling in _SHAPES for end in range(len(spelling) + 1))
# Names of shapes without their sides.
_STEMS = re.compile("|".join(sorted({re.sub("(Left|Right)$", "", shape).lower() for shape in ARKIT_SHAPES})))


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

    Case and separators are ignored, the side may be ``L``, ``Lf``, ``Left`` and so on at either end, and text before
    a dot, colon, bar or slash, such as the mesh's name, is skipped. Names, without that text, have at most
    ``LONGEST_NAME`` characters.
    """
    start = max(0, len(name) - LONGEST_NAME)
    cuts = [] if start else [0]
    cuts += [cut.end() for cut in _SCOPES.finditer(name, max(0, start - 1))]
    for cut in cuts:
        shape = _SHAPES.get(_SEPARATORS.sub("", name[cut:]).lower())
        if shape is not None:
            return shape
    return None


def spelled_shape(letters: str) -> str | None:
    """Return the shape spelled by ``letters``, in lower case without separators and scope, or None."""
    return _SHAPES.get(letters)


def begins_shape(letters: str) -> bool:
    """Return True if a spelling of a shape, in lower case without separators, begins with ``letters``."""
    return letters in _BEGINNINGS


def names_shape(text: str) -> bool:
    """Return True if ``text`` contains the stem of a shape's name, a fast test."""
    return _STEMS.search(_SEPARATORS.sub("", text).lower()) is not None


def scope_of(name: str) -> tuple[str, str]:
    """Return the text before the name of the shape that ``canonical_shape`` skips, and the name."""
    shape = canonical_shape(name)
    for cut in reversed([0, *(found.end() for found in _SCOPES.finditer(name, max(0, len(name) - LONGEST_NAME - 1)))]):
        if canonical_shape(name[cut:]) == shape:
            return name[:cut], name[cut:]
    return "", name
