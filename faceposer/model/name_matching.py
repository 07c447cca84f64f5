"""Matching of a file's names with ARKit's: numbering, common prefixes and suffixes, several spellings side by side."""

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

from faceposer.errors import FacePoserError, counted
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.shape_names import (
    begins_shape,
    canonical_shape,
    names_shape,
    scope_of,
    spelled_shape,
    whole_shape_of,
)

#: Boundaries between words: separators, and changes of case, to or from digits, or between scripts.
_WORDS = (
    r"[\W_]+|(?<=[a-z])(?=[A-Z])|(?<=[0-9])(?=[A-Za-z])|(?<=[A-Za-z])(?=[0-9])|(?<=[A-Z])(?=[A-Z][a-z])"
    r"|(?<=[^\x00-\x7f])(?=[A-Za-z])|(?<=[A-Za-z])(?=[^\x00-\x7f])"
)
_WORD_ENDS = re.compile(_WORDS)
# The same, and after a letter for the side to which a suffix is glued, as in eyeBlink_LShape, but not in words that
# begin with such a letter.
_REST_OF_WORD = "(?i:eft|ight|od|ow|ayer|ink|ig|oot|est|ef|ender|ip|id|ash)"
_NO_SIDE = f"(?!{_REST_OF_WORD})"
_CUTS = re.compile(rf"{_WORDS}|(?<=[\W_][LRlr])(?={_NO_SIDE}[A-Za-z])|(?<=[a-z][LR])(?={_NO_SIDE}[A-Za-z])")
# Number of words in the longest name of a shape, with its side.
_MOST_WORDS = 6
# Number of shapes from which names with a prefix or suffix are a reading of their own.
_FEWEST = 5
# Affixes that make another shape of a name: a part of the face, or a correction.
_MEANINGFUL = frozenset(
    {"l", "r", "left", "right", "up", "down", "upper", "lower", "inner", "outer", "in", "out", "top", "bottom"}
    | {"front", "back", "half", "fix", "corr", "corrective", "correction", "combo", "inbetween"}
)
# Limits on the length of a name with an affix, and on the number of readings that are compared.
_LONGEST_READ = 256
_LONGEST_SPELLING = 24
_MOST_READINGS = 20
_MOST_NOTED = 4
_SIDES = ("l", "r", "left", "right", "lf", "rt", "lft", "rgt", "lt")


@dataclass(frozen=True)
class Affix:
    """The text around the name of a shape.

    Attributes:
        prefix: Text before it; "#" stands for a number if ``numbered``.
        suffix: Text after it, likewise.
        before_side: True if the side of the shape follows the suffix.
        numbered: True if numbers may differ between names.
    """

    prefix: str = ""
    suffix: str = ""
    before_side: bool = False
    numbered: bool = False

    @property
    def numberless(self) -> "Affix":
        """The affix with "#" for all numbers, or itself if it has none."""
        prefix, suffix = (re.sub(r"\d+", "#", text) for text in (self.prefix, self.suffix))
        same = (prefix, suffix) == (self.prefix, self.suffix)
        return self if same else Affix(prefix, suffix, self.before_side, numbered=True)

    @property
    def cost(self) -> tuple[bool, int]:
        """Order among affixes of names that denote the same number of shapes."""
        return self.numbered, len(self.prefix) + len(self.suffix)

    @property
    def is_meaningful(self) -> bool:
        """True for an affix that makes another shape of a name: a shape, as in names of corrections, or a side."""
        return any(
            canonical_shape(text) is not None or not _MEANINGFUL.isdisjoint(_WORD_ENDS.sub(" ", text).lower().split())
            for text in (self.prefix, self.suffix)
            if text
        )

    def fits(self, name: str) -> bool:
        """Return True if ``name`` has the affix."""
        parts = [re.escape(text) for text in (self.prefix, self.suffix)]
        if self.numbered:
            parts = [re.sub(r"\\?#", r"\\d+", part) for part in parts]
        side = rf"[\W_]*({'|'.join(_SIDES)})" if self.before_side else ""
        return re.fullmatch(f"{parts[0]}.*{parts[1]}{side}", name, re.DOTALL | re.IGNORECASE) is not None

    def resembles(self, other: "Affix") -> bool:
        """Return True if the affix differs from ``other`` in at most one word."""
        mine, others = (
            [word for word in _WORD_ENDS.sub(" ", f"{a.prefix} * {a.suffix}").split(" ") if word] for a in (self, other)
        )
        return len(mine) == len(others) and sum(a != b for a, b in zip(mine, others, strict=True)) <= 1

    def __str__(self) -> str:
        parts = (("prefix", self.prefix), ("suffix", self.suffix))
        words = [f"{kind} '{text[:40]}'" for kind, text in parts if text]
        return " and ".join(words) + (" (numbers differ)" if self.numbered else "")


_BARE = Affix()


@dataclass(frozen=True)
class NameMatch:
    """The result of matching the names of a file with ARKit's.

    Attributes:
        shapes: Canonical name, from ``ARKIT_SHAPES`` or ``SPLIT_SHAPES``, by name in the file.
        missing: ARKit's shapes that the file has neither whole nor in halves.
        others: Names in the file that are not ARKit's.
        alternates: Canonical name by further names of shapes in ``shapes``, which are not used.
        ties: Names of a shape between which nothing decides, by shape; the first is in ``shapes``.
        note: Sentence about names that are not read to the letter or not used; "" if there are none.
    """

    shapes: dict[str, str]
    missing: tuple[str, ...]
    others: tuple[str, ...]
    alternates: dict[str, str]
    ties: dict[str, tuple[str, ...]]
    note: str

    @property
    def with_ties(self) -> dict[str, str]:
        """``shapes`` with all names of the ``ties``."""
        return self.shapes | {name: shape for shape, names in self.ties.items() for name in names}


def match_arkit(names: Iterable[str], where: str) -> NameMatch:
    """Match ``names`` with ARKit's shapes by the reading that finds most of them.

    A reading takes names to the letter, or without a prefix and suffix that many of them share, in which numbers may
    differ. Names of other readings add shapes that it does not find. Of several spellings of a shape, the one of most
    names is used.

    Args:
        names: Names of shapes or columns in the file.
        where: Source of the names as the beginning of a sentence, such as "The rig 'a.glb'".

    Raises:
        FacePoserError: If two names denote the same shape and nothing decides between them.
    """
    match = match_with_ties(names)
    for shape, tied in match.ties.items():
        raise tie_error(where, shape, tied)
    return match


def tie_error(where: str, shape: str, tied: Sequence[str]) -> FacePoserError:
    """Return the error for the names ``tied`` of one ``shape``."""
    return FacePoserError(
        f"{where} has both '{tied[0][:60]}' and '{tied[1][:60]}', which denote the same shape, {shape}; rename or "
        "remove one of them."
    )


def match_with_ties(names: Iterable[str]) -> NameMatch:
    """Match ``names`` like ``match_arkit``, but return the ties instead of raising an error."""
    given = list(dict.fromkeys(names))
    bare = {name: shape for name in given if (shape := canonical_shape(name)) is not None}
    readings = {_BARE: bare, **_accepted(given, bare)}
    order = sorted(readings, key=lambda affix: (-len(set(readings[affix].values())), affix != _BARE, affix.cost))
    chosen: dict[str, str] = {}
    used: dict[Affix, dict[str, str]] = {}
    for affix in order:
        reading = readings[affix]
        found = set(chosen.values())
        # Names with another affix that repeat shapes are variants, such as corrections; names to the letter are not.
        if affix == _BARE or not found.intersection(reading.values()):
            added = {name: shape for name, shape in reading.items() if shape not in found and name not in chosen}
            chosen |= added
            if added and affix != _BARE:
                used[affix] = added
    alternates = {name: shape for affix in order for name, shape in readings[affix].items() if name not in chosen}
    alternates = {name: shape for name, shape in alternates.items() if shape in set(chosen.values())}
    ties, dropped = _decide(chosen)
    for name in dropped:
        alternates[name] = chosen.pop(name)
    tied = {name for names_of_shape in ties.values() for name in names_of_shape}
    note = _note(used, chosen, {name: shape for name, shape in alternates.items() if name not in tied})
    have = {whole_shape_of(shape) for shape in chosen.values()}
    return NameMatch(
        {name: chosen[name] for name in given if name in chosen},
        tuple(shape for shape in ARKIT_SHAPES if shape not in have),
        tuple(name for name in given if name not in chosen and name not in alternates),
        alternates,
        ties,
        note,
    )


def _accepted(given: list[str], bare: dict[str, str]) -> dict[Affix, dict[str, str]]:
    """Return the readings of the names ``given`` without an affix that many of them share, by the affix."""
    if len(given) < 2:
        return {}
    readings: defaultdict[Affix, dict[str, str]] = defaultdict(dict)
    for name in given:
        if name not in bare:
            for affix, shape in _inner_shapes(name):
                readings[affix].setdefault(name, shape)
    counts = {affix: len(set(reading.values())) for affix, reading in readings.items()}
    likely = sorted(counts, key=lambda affix: (-counts[affix], affix.cost))[:_MOST_READINGS]
    shared = [
        affix
        for affix in likely
        if counts[affix] >= _FEWEST
        or (counts[affix] > 1 and 2 * counts[affix] >= len(given))
        or all(affix.fits(name) for name in given)
    ]
    # Names of another mesh, such as the tongue, have an affix with another word.
    similar = [affix for affix in readings if affix not in shared and any(map(affix.resembles, shared[:1]))]
    return {affix: readings[affix] for affix in (*shared, *similar[:_MOST_READINGS])}


def _inner_shapes(name: str) -> Iterator[tuple[Affix, str]]:
    """Yield the shapes that runs of words in ``name`` denote, with the text around them as an affix.

    The side of a shape may follow the suffix, as in eyeBlink_Mesh_L. Affixes with numbers are given twice: as they are,
    and with any number.
    """
    if len(name) > _LONGEST_READ or not names_shape(name):
        return
    gaps = [(found.start(), found.end()) for found in _CUTS.finditer(name)]
    begins = [0, *(end for _, end in gaps)]
    stops = [*(start for start, _ in gaps), len(name)]
    words = [name[begin:stop].lower() for begin, stop in zip(begins, stops, strict=True)]
    last = len(words) - 1
    side = words[last] if words[last] in _SIDES else ""
    for first, begin in enumerate(begins):
        run = ""
        for end in range(first, min(first + _MOST_WORDS, len(words))):
            before, run = len(run), run + words[end]
            found: list[tuple[str, Affix]] = []
            if not begins_shape(run):
                # A suffix may be glued to the name, as in jawOpenshape.
                for length in range(min(len(run) - 1, _LONGEST_SPELLING), before, -1):
                    if re.match(_REST_OF_WORD, run[length:]):
                        continue
                    if (shape := spelled_shape(run[:length])) is not None:
                        found.append((shape, Affix(name[:begin], name[stops[end] - len(run) + length :])))
                yield from _readings(found)
                break
            if (shape := spelled_shape(run)) is not None:
                found.append((shape, Affix(name[:begin], name[stops[end] :])))
            if side and end + 1 < last and (shape := spelled_shape(run + side)) is not None:
                found.append((shape, Affix(name[:begin], name[stops[end] : begins[last]], True)))
            yield from _readings(found)


def _readings(found: list[tuple[str, Affix]]) -> Iterator[tuple[Affix, str]]:
    """Yield the affixes of the shapes ``found``, those with numbers twice: as they are, and with any number."""
    for shape, affix in found:
        if not affix.is_meaningful:
            yield affix, shape
            if (numberless := affix.numberless) != affix:
                yield numberless, shape


def _decide(chosen: dict[str, str]) -> tuple[dict[str, tuple[str, ...]], list[str]]:
    """Return the ties between names of one shape, and the names that are not used."""
    owners: defaultdict[str, list[str]] = defaultdict(list)
    for name, shape in chosen.items():
        owners[shape].append(name)
    styles = Counter(_style(name) for name in chosen)
    ties, dropped = {}, []
    for shape, names in owners.items():
        # ARKit's own spelling precedes others that are as frequent.
        rank = {name: (styles[_style(name)], name == shape) for name in names}
        ranked = sorted(names, key=lambda name: rank[name], reverse=True)
        tied = [name for name in ranked if rank[name] == rank[ranked[0]]]
        if len(tied) > 1:
            ties[shape] = tuple(tied)
        dropped += ranked[1:]
    return ties, dropped


def _style(name: str) -> tuple[str, ...]:
    """Return the features that spellings of one exporter share: the scope, the case, the separators and the sides."""
    scope, plain = scope_of(name)
    side = re.search(r"([\W_]*)(left|right|[lr])$", plain, re.IGNORECASE) or re.match(
        r"([lr]|left|right)(?=[A-Z_])", plain
    )
    length = "" if side is None else "word" if len(side[0].strip("_-. ")) > 1 else "letter"
    separators = "".join(sorted(set(re.findall(r"[\W_]", plain))))
    case = "upper" if plain.isupper() else "title" if plain[:1].isupper() else "lower"
    return re.sub(r"\d+", "#", scope), case, separators, length


def _note(used: dict[Affix, dict[str, str]], chosen: dict[str, str], alternates: dict[str, str]) -> str:
    """Return the sentence about names that are not read to the letter, by their affix, or are not used."""
    parts = []
    for affix, names in islice(used.items(), _MOST_NOTED):
        own = [name for name in names if name in chosen]
        if own:
            parts.append(
                f"names such as '{own[0][:60]}' are read without their {affix}, which finds "
                f"{counted(len({chosen[name] for name in own}), 'shape', 'shapes')} of ARKit"
            )
    if len(used) > _MOST_NOTED:
        parts.append(f"{counted(len(used) - _MOST_NOTED, 'further affix is', 'further affixes are')} left out likewise")
    if alternates:
        name, shape = next(iter(alternates.items()))
        plural = len(alternates) > 1
        parts.append(
            f"{len(alternates)} further name{'s' if plural else ''} of the same shapes, such as '{name[:60]}' for "
            f"{shape}, {'are' if plural else 'is'} not used"
        )
    text = "; ".join(parts)
    return text[:1].upper() + text[1:] + "." if text else ""
