"""Search for actions by parts of words, initials or keys, ranked by score."""

from collections.abc import Sequence
from dataclasses import dataclass

from faceposer.gui.actions import Action

# Score of a word found in each place; the start of the label counts most.
_WHOLE_LABEL, _LABEL_BEGINS = 60.0, 40.0
_LABEL_START, _LABEL_WORD, _KEY, _LABEL_INSIDE = 100.0, 80.0, 70.0, 60.0
_MENU, _HELP_WORD, _HELP_INSIDE, _LETTERS = 40.0, 30.0, 20.0, 10.0
# Letters in between that a fuzzy match may skip.
_MAX_SKIPPED = 3
_MIN_INSIDE = 2


@dataclass(frozen=True)
class Match:
    """An action found by the search.

    Attributes:
        action: The action.
        score: Score; higher is better.
        letters: Indices of the matching letters of the label.
    """

    action: Action
    score: float
    letters: frozenset[int]


def ranked(query: str, actions: Sequence[Action]) -> list[Match]:
    """Return the ``actions`` with every word of ``query`` in label, menu, help or keys, best first.

    Equal scores, and an empty query, keep the order.
    """
    words = query.lower().split()
    found = [match for action in actions if (match := _match(words, action)) is not None]
    return sorted(found, key=lambda match: -match.score)


def _match(words: list[str], action: Action) -> Match | None:
    score, letters = 0.0, set[int]()
    for word in words:
        value, where = _find(word, action)
        if value == 0.0:
            return None
        score += value
        letters.update(where)
    label, whole = action.label.lower().rstrip("."), " ".join(words)
    if whole and label.startswith(whole):
        score += _WHOLE_LABEL if label == whole else _LABEL_BEGINS
    return Match(action, score, frozenset(letters))


def _find(word: str, action: Action) -> tuple[float, Sequence[int]]:
    """Return the score of ``word`` at its best place, or 0, and the indices of its letters in the label."""
    label = action.label.lower()
    starts = [i for i in range(len(label)) if i == 0 or not label[i - 1].isalnum()]
    at = next((i for i in starts if label.startswith(word, i)), -1)
    if at >= 0:
        return (_LABEL_WORD if at else _LABEL_START), range(at, at + len(word))
    if any(word in (key.lower(), action.shortcut.lower()) for key in action.keys):
        return _KEY, ()
    at = label.find(word) if len(word) >= _MIN_INSIDE else -1
    if at >= 0:
        return _LABEL_INSIDE, range(at, at + len(word))
    if action.menu.lower().startswith(word):
        return _MENU, ()
    text = action.help.lower()
    if any(part.strip(".,:;()").startswith(word) for part in text.split()):
        return _HELP_WORD, ()
    if len(word) > _MIN_INSIDE and (word in text or any(word in key.lower() for key in action.keys)):
        return _HELP_INSIDE, ()
    if len(word) >= _MIN_INSIDE:
        where = _initials(word, label, starts) or _fuzzy_match(word, label, starts)
        return (_LETTERS if where else 0.0), where
    return 0.0, ()


def _initials(word: str, label: str, starts: list[int]) -> list[int]:
    """Return the indices of initials that spell ``word``, as "soa" for "Save OBJ as"; empty if there are none."""
    where: list[int] = []
    for i in starts:
        if len(where) < len(word) and label[i] == word[len(where)]:
            where.append(i)
    return where if len(where) == len(word) else []


def _fuzzy_match(word: str, label: str, starts: list[int]) -> list[int]:
    """Return the indices of letters from the start of a word that spell ``word`` with few skipped; empty if none do."""
    for start in starts:
        where: list[int] = []
        for i in range(start, len(label)):
            if len(where) < len(word) and label[i] == word[len(where)]:
                where.append(i)
            elif not where:
                break
        if len(where) == len(word) and where[-1] - where[0] + 1 - len(word) <= _MAX_SKIPPED:
            return where
    return []
