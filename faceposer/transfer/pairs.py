"""Pairs of feature points whose distances describe an expression, and their JSON file.

Feature points have the names of MPEG-4, which all characters share independently of their meshes, so that a pair has
the same meaning on each of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from msgspec import UNSET, Meta, UnsetType

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import (
    JsonDocument,
    JsonError,
    JsonObject,
    check_header,
    convert,
    given,
    read_json,
    shown,
)
from faceposer.files.writing import write_json
from faceposer.model.character import Character

FORMAT = "faceposer.pairs"
VERSION = 1
_MAX_PAIRS = 1000
_MAX_WEIGHT = 1000.0
_MAX_NAME = 200
_TWO_NAMES = 'the names of two feature points, such as ["8.3", "8.4"]'
_Point = Annotated[str, Meta(min_length=1)]
#: The centres of the left and of the right pupil.
PUPILS = ("3.5", "3.6")


@dataclass(frozen=True)
class Pair:
    """The distance in space between two feature points of a face.

    Attributes:
        name: Displayed name.
        first: Name of a feature point, such as "8.3".
        second: Name of another feature point.
        weight: Factor on its energy, at least 0.
        enabled: True if it is used.
    """

    name: str
    first: str
    second: str
    weight: float = 1.0
    enabled: bool = True

    @property
    def of_gaze(self) -> bool:
        """True if it contains a pupil, and therefore depends on the gaze."""
        return self.first in PUPILS or self.second in PUPILS

    def measurable(self, character: Character) -> bool:
        """Return True if the ``character`` has both points."""
        return self.first in character.feature_points and self.second in character.feature_points


def _both(name: str, left: tuple[str, str], right: tuple[str, str]) -> tuple[Pair, Pair]:
    """Return the pairs with this name on the left and on the right side."""
    return Pair(f"left {name}", *left), Pair(f"right {name}", *right)


#: The pairs of the paper's figure 8(b): heights of the mouth and of both eyes.
PAPER_PAIRS: tuple[Pair, ...] = (
    Pair("mouth height", "2.2", "2.3"),
    *_both("eye height", ("3.1", "3.3"), ("3.2", "3.4")),
)

#: Distances that distinguish ordinary expressions, on both sides.
DEFAULT_PAIRS: tuple[Pair, ...] = (
    *PAPER_PAIRS,
    *_both("upper lid to nose bridge", ("3.1", "9.12"), ("3.2", "9.12")),
    *_both("lower lid to nose bridge", ("3.3", "9.12"), ("3.4", "9.12")),
    *_both("inner brow to nose bridge", ("4.1", "9.12"), ("4.2", "9.12")),
    *_both("outer brow to nose bridge", ("4.5", "9.12"), ("4.6", "9.12")),
    *_both("brow to eye", ("4.3", "3.11"), ("4.4", "3.8")),
    *_both("outer brow to eye", ("4.5", "3.7"), ("4.6", "3.12")),
    Pair("inner brows apart", "4.1", "4.2"),
    *_both("nostril to eye", ("9.1", "3.11"), ("9.2", "3.8")),
    Pair("cheeks apart", "5.1", "5.2"),
    Pair("mouth width", "8.3", "8.4"),
    *_both("mouth half height", ("2.6", "2.8"), ("2.7", "2.9")),
    *_both("mouth corner to eye", ("8.3", "3.7"), ("8.4", "3.12")),
    *_both("mouth corner to nose", ("8.3", "9.15"), ("8.4", "9.15")),
    *_both("mouth corner to chin", ("8.3", "2.10"), ("8.4", "2.10")),
    *_both("mouth corner to jaw", ("8.3", "2.13"), ("8.4", "2.14")),
    *_both("mouth corner to cheek", ("8.3", "5.1"), ("8.4", "5.2")),
    *_both("upper lip to jaw", ("8.1", "2.13"), ("8.1", "2.14")),
    Pair("upper lip to nose tip", "8.1", "9.3"),
    Pair("upper lip to nose", "8.1", "9.15"),
    *_both("upper lip to nose", ("8.5", "9.5"), ("8.6", "9.4")),
    *_both("lower lip to jaw", ("8.2", "2.13"), ("8.2", "2.14")),
    Pair("lower lip to nose", "8.2", "9.15"),
    Pair("chin to nose", "2.1", "9.15"),
    *_both("chin to eye", ("2.10", "3.11"), ("2.10", "3.8")),
    *_both("pupil to inner corner", ("3.5", "3.11"), ("3.6", "3.8")),
    *_both("pupil to outer corner", ("3.5", "3.7"), ("3.6", "3.12")),
    *_both("pupil to nose bridge", ("3.5", "9.12"), ("3.6", "9.12")),
)

#: Lists of pairs by name.
PRESETS: dict[str, tuple[Pair, ...]] = {"full": DEFAULT_PAIRS, "paper": PAPER_PAIRS}


def shared_pairs(pairs: Sequence[Pair], source: Character, target: Character) -> tuple[Pair, ...]:
    """Return the enabled ``pairs`` that can be measured on both characters.

    Raises:
        FacePoserError: If there are none.
    """
    for character in (source, target):
        if not character.feature_points:
            raise FacePoserError(
                f"The character {character.label} has no feature points to measure distances between; transfer by "
                "weights, or train it again with ARKit's shape names, from which feature points are found."
            )
    shared = tuple(
        pair
        for pair in pairs
        if pair.enabled and pair.weight > 0 and pair.measurable(source) and pair.measurable(target)
    )
    if not shared:
        raise FacePoserError(
            f"None of the pairs can be measured on both {source.label} and {target.label}; choose pairs of feature "
            "points that both characters have."
        )
    return shared


def pairs_to_json(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Return ``pairs`` as written in their file."""
    entries = []
    for pair in pairs:
        entry: dict[str, Any] = {"name": pair.name, "points": [pair.first, pair.second]}
        if pair.weight != 1.0:
            entry["weight"] = pair.weight
        if not pair.enabled:
            entry["enabled"] = False
        entries.append(entry)
    return {"format": FORMAT, "version": VERSION, "pairs": entries}


def write_pairs(path: Path, pairs: Sequence[Pair]) -> None:
    """Write ``pairs`` to the file ``path``.

    Raises:
        FacePoserError: If a weight is not finite, or the file cannot be written.
    """
    write_json(path, pairs_to_json(pairs), "list of pairs")


class _PairJson(JsonObject, kw_only=True):
    points: Annotated[tuple[_Point, _Point], Meta(description=_TWO_NAMES)]
    name: Annotated[str, Meta(min_length=1, max_length=_MAX_NAME)] | UnsetType = UNSET
    weight: Annotated[float, Meta(ge=0.0, le=_MAX_WEIGHT)] = 1.0
    enabled: bool = True

    def __post_init__(self) -> None:
        if self.points[0] == self.points[1]:
            raise JsonError(f"contains the point {shown(self.points[0])} twice", "points")


class _PairsFile(JsonDocument):
    pairs: Annotated[list[Annotated[_PairJson, Meta(title="pairs")]], Meta(min_length=1, max_length=_MAX_PAIRS)]


def pairs_from_json(data: Any) -> tuple[Pair, ...]:
    """Return the pairs described by ``data``.

    Raises:
        FacePoserError: If a key is unknown, missing or of the wrong type; the message names it.
    """
    check_header(data, FORMAT, VERSION)
    return tuple(
        Pair(given(pair.name) or " to ".join(pair.points), *pair.points, pair.weight, pair.enabled)
        for pair in convert(data, _PairsFile).pairs
    )


def read_pairs(path: Path) -> tuple[Pair, ...]:
    """Return the pairs in the file ``path`` (docs/transfer.md).

    Raises:
        FacePoserError: If the file cannot be read or is not a pairs file; the message names the place.
    """
    return read_json(path, "pairs", pairs_from_json)
