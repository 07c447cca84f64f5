"""Finds actions by what somebody types: parts of words, first letters, a key; the best first."""

from collections.abc import Sequence
from dataclasses import dataclass

from faceposer.gui.actions import Action

# What finding a word in each place is worth; the label's beginning tells most.
_WHOLE_LABEL, _LABEL_BEGINS = 60.0, 40.0
_LABEL_START, _LABEL_WORD, _KEY, _LABEL_INSIDE = 100.0, 80.0, 70.0, 60.0
_MENU, _HELP_WORD, _HELP_INSIDE, _LETTERS = 40.0, 30.0, 20.0, 10.0
# Letters in between that may be left out before a likeness is chance.
_MOST_SKIPPED = 3
_SHORTEST_INSIDE = 2


@dataclass(frozen=True)
class Match:
    """An action that was found.

    Attributes:
        action: The action.
        score: The higher the better.
        letters: Indices of the label's letters that were typed.
    """

    action: Action
    score: float
    letters: frozenset[int]


def ranked(query: str, actions: Sequence[Action]) -> list[Match]:
    """Return the ``actions`` that have every word of ``query`` in label, menu, help or keys, the best first.

    Among equals, and for an empty query, they stay in their order.
    """
    words = query.lower().split()
    found = [match for action in actions if (match := _match(words, action)) is not None]
    return sorted(found, key=lambda match: -match.score)


def _match(words: list[str], action: Action) -> Match | None:
    score, letters = 0.0, set[int]()
    for word in words:
        worth, where = _find(word, action)
        if worth == 0.0:
            return None
        score += worth
        letters.update(where)
    label, whole = action.label.lower().rstrip("."), " ".join(words)
    if whole and label.startswith(whole):
        score += _WHOLE_LABEL if label == whole else _LABEL_BEGINS
    return Match(action, score, frozenset(letters))


def _find(word: str, action: Action) -> tuple[float, Sequence[int]]:
    """Return what ``word`` is worth at its best place, or 0, and the letters of the label that it covers."""
    label = action.label.lower()
    starts = [i for i in range(len(label)) if i == 0 or not label[i - 1].isalnum()]
    at = next((i for i in starts if label.startswith(word, i)), -1)
    if at >= 0:
        return (_LABEL_WORD if at else _LABEL_START), range(at, at + len(word))
    if any(word in (key.lower(), action.shortcut.lower()) for key in action.keys):
        return _KEY, ()
    at = label.find(word) if len(word) >= _SHORTEST_INSIDE else -1
    if at >= 0:
        return _LABEL_INSIDE, range(at, at + len(word))
    if action.menu.lower().startswith(word):
        return _MENU, ()
    text = action.help.lower()
    if any(part.strip(".,:;()").startswith(word) for part in text.split()):
        return _HELP_WORD, ()
    if len(word) > _SHORTEST_INSIDE and (word in text or any(word in key.lower() for key in action.keys)):
        return _HELP_INSIDE, ()
    if len(word) >= _SHORTEST_INSIDE:
        where = _initials(word, label, starts) or _nearly(word, label, starts)
        return (_LETTERS if where else 0.0), where
    return 0.0, ()


def _initials(word: str, label: str, starts: list[int]) -> list[int]:
    """Return the first letters of words, in order, that spell ``word``, as "soa" does for "Save OBJ as"; or none."""
    where: list[int] = []
    for i in starts:
        if len(where) < len(word) and label[i] == word[len(where)]:
            where.append(i)
    return where if len(where) == len(word) else []


def _nearly(word: str, label: str, starts: list[int]) -> list[int]:
    """Return letters from the beginning of a word on that spell ``word`` with few left out in between; or none."""
    for start in starts:
        where: list[int] = []
        for i in range(start, len(label)):
            if len(where) < len(word) and label[i] == word[len(where)]:
                where.append(i)
            elif not where:
                break
        if len(where) == len(word) and where[-1] - where[0] + 1 - len(word) <= _MOST_SKIPPED:
            return where
    return []
