"""Leaving out one performer at a time: each is tested with what the takes of all others teach."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.evaluation.takes import Source, Sparse
from faceposer.training.expressions import Recipe

#: The name of the rows over all performers.
POOLED = "pooled"
# Each name is a folder of the study.
_FORBIDDEN = frozenset('/\\:*?"<>|')


@dataclass(frozen=True)
class Performer:
    """Somebody with takes.

    Attributes:
        name: Of the rows, and of a folder.
        takes: Files, at least one.
    """

    name: str
    takes: tuple[Path, ...]

    @classmethod
    def parse(cls, text: str) -> "Performer":
        """Return the performer that ``text`` describes as NAME=FILE,FILE.

        Raises:
            ValueError: If it does not, or the name is no name for a folder.
        """
        name, equals, files = text.partition("=")
        name = name.strip()
        paths = tuple(dict.fromkeys(Path(file.strip()) for file in files.split(",") if file.strip()))
        if not equals or not name or not paths:
            raise ValueError(f"'{text}' names no performer with takes; write for example anna=one.csv,two.csv")
        if name == POOLED or name.startswith(".") or not _FORBIDDEN.isdisjoint(name) or not name.isprintable():
            raise ValueError(f"'{name}' cannot be the name of a performer; choose letters, digits and hyphens")
        return cls(name, paths)


def leave_one_out(
    performers: Sequence[Performer], subject: str, recipe: Recipe, sparse: Sparse = "auto"
) -> dict[str, Source]:
    """Return by name what each performer is tested with: the takes of all others to learn from.

    Raises:
        FacePoserError: If there are fewer than two performers, or two of one name or with one take.
    """
    names = [performer.name.casefold() for performer in performers]
    if len(names) < 2:
        raise FacePoserError("Leaving out one performer leaves nobody to learn from; give --performer at least twice.")
    for performer in performers:
        if names.count(performer.name.casefold()) > 1:
            raise FacePoserError(
                f"There are two performers called '{performer.name}'; give all takes of one after one --performer."
            )
    owners: dict[Path, str] = {}
    for performer in performers:
        for path in performer.takes:
            other = owners.setdefault(path.resolve(), performer.name)
            if other != performer.name:
                raise FacePoserError(f"'{path}' is given as a take of {other} and of {performer.name}; keep one.")
    sources = {}
    for performer in performers:
        others = [(other.name, path) for other in performers if other is not performer for path in other.takes]
        sources[performer.name] = Source(
            subject,
            tuple(path for _, path in others),
            performer.takes,
            recipe,
            sparse=sparse,
            performers=tuple(name for name, _ in others),
            left_out=performer.name,
        )
    return sources
