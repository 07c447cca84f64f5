"""Lookup of feature points and regions of a character by name."""

import difflib
import re

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.character import Character

_SIDES = frozenset(("left", "right"))
_SMALL_WORDS = frozenset(("the", "of", "a"))


def feature_vertex(character: Character, name: str) -> int:
    """Return the vertex of the feature point ``name``.

    The name is MPEG-4's ("8.3"), the title of a feature point ("left mouth corner"), or words of a title in any order
    ("mouth corner left", "upper lip"). If several titles match, the one with the fewest other words is chosen, then the
    first in MPEG-4's order. A side is never guessed.

    Raises:
        FacePoserError: If no feature point matches, or only points of both sides do.
    """
    if name in character.feature_points:
        return character.feature_points[name]
    query = _words(name)
    titles = {key: _words(title) for key, title in character.feature_titles.items() if key in character.feature_points}
    matches = {key: words - query for key, words in titles.items() if query and query <= words}
    one_sided = {key: others for key, others in matches.items() if not others & _SIDES}
    if one_sided:
        key = min(one_sided, key=lambda key: (len(one_sided[key]), _order(key)))
        return character.feature_points[key]
    if matches:
        least = min(len(others) for others in matches.values())
        shown = " or ".join(
            f"'{character.feature_titles[key]}'" for key, others in matches.items() if len(others) == least
        )
        raise FacePoserError(f"'{name}' is ambiguous; choose {shown}.")
    close = difflib.get_close_matches(name, list(character.feature_titles.values()), 1, 0.4)
    guess = f" Did you mean '{close[0]}'?" if close else ""
    raise FacePoserError(f"'{character.title}' has no feature point '{name}'.{guess}")


def region_vertices(character: Character, name: str) -> NDArray[np.int32]:
    """Return the vertices of the region ``name``, such as "mouth", "left brow", or "brow" for both sides.

    Raises:
        FacePoserError: If no region matches.
    """
    query = _words(name)
    found = [
        ids
        for key, ids in character.regions.items()
        if query and _words(key) - query <= _SIDES - query and query <= _words(key)
    ]
    if not found:
        available = ", ".join(sorted(character.regions)) or "none"
        raise FacePoserError(f"'{character.title}' has no region '{name}'; its regions are: {available}.")
    return np.unique(np.concatenate(found)).astype(np.int32)


def _words(name: str) -> frozenset[str]:
    return frozenset(re.findall(r"[a-z0-9]+", name.lower())) - _SMALL_WORDS


def _order(key: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", key))
