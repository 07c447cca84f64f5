"""Leave-one-performer-out studies: each performer is tested with what is learned from all others.

Each has a separate study, in a folder with the performer's name; the parent folder has the files over all.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.evaluation.plan import Plan
from faceposer.evaluation.rows import Row, csv_of, pooled_rows_of
from faceposer.evaluation.study import FORMAT, RESULTS, TABLE, TABLES, VERSION, Outcome, Study, machine
from faceposer.evaluation.tables import error_tables, share_tables, time_table
from faceposer.evaluation.takes import Source, Sparse
from faceposer.files.atomic import write_text
from faceposer.files.writing import write_json
from faceposer.model.character import Character
from faceposer.progress import Progress
from faceposer.training.expressions import Recipe

#: The name of the rows over all performers.
POOLED = "pooled"
# Each name is a folder of the study.
_FORBIDDEN = frozenset('/\\:*?"<>|')


@dataclass(frozen=True)
class Performer:
    """A performer with their takes.

    Attributes:
        name: Name in rows, and of the folder.
        takes: Files, at least one.

    Raises:
        FacePoserError: If the name is not valid for a folder.
    """

    name: str
    takes: tuple[Path, ...]

    def __post_init__(self) -> None:
        name = self.name
        if not name or name[0] in ".-" or name == POOLED or not name.isprintable() or not _FORBIDDEN.isdisjoint(name):
            raise FacePoserError(f"'{name}' cannot be the name of a performer; choose letters, digits and hyphens.")


def leave_one_out(
    performers: Sequence[Performer], character: str, recipe: Recipe, sparse: Sparse = "auto"
) -> dict[str, Source]:
    """Return the data for each performer by name: their takes to test on, and those of all others to learn from.

    Raises:
        FacePoserError: If there are fewer than two performers, or two with the same name or a common take.
    """
    names = [performer.name.casefold() for performer in performers]
    if len(names) < 2:
        raise FacePoserError("With one performer, there is nobody to learn from; give --performer at least twice.")
    for performer in performers:
        if names.count(performer.name.casefold()) > 1:
            raise FacePoserError(
                f"There are two performers called '{performer.name}'; give all takes of a performer with one "
                "--performer."
            )
    owners: dict[Path, str] = {}
    for performer in performers:
        for path in performer.takes:
            other = owners.setdefault(path.resolve(), performer.name)
            if other != performer.name:
                raise FacePoserError(f"'{path}' is given as a take of {other} and of {performer.name}; remove one.")
    sources = {}
    for performer in performers:
        others = [(other.name, path) for other in performers if other is not performer for path in other.takes]
        sources[performer.name] = Source(
            character,
            tuple(path for _, path in others),
            performer.takes,
            recipe,
            sparse=sparse,
            performers=tuple(name for name, _ in others),
            left_out=performer.name,
        )
    return sources


@dataclass(frozen=True)
class PerformersOutcome:
    """Results of leaving out each performer.

    Attributes:
        pooled: Rows over the trials of all performers.
        outcomes: Results of each performer's study, by name.
        left_out: Techniques that cannot be run on this machine, each with the reason as a sentence.
    """

    pooled: list[Row]
    outcomes: dict[str, Outcome]
    left_out: dict[str, str]

    @property
    def rows(self) -> list[Row]:
        """All rows with the performer's name, those over all performers first."""
        named = {POOLED: self.pooled} | {name: outcome.rows for name, outcome in self.outcomes.items()}
        return [{"performer": name, **row} for name, rows in named.items() for row in rows]

    def tables(self) -> str:
        """Return the tables of errors as Markdown, over all performers and for each."""
        parts = ["## All performers, each left out once", error_tables(self.pooled), share_tables(self.pooled)]
        parts.append(time_table(self.pooled))
        for name, outcome in self.outcomes.items():
            parts.append(f"## {name}, learned from the others")
            parts += [error_tables(outcome.rows, legend=False), share_tables(outcome.rows)]
        return "\n".join(part.rstrip("\n") + "\n" for part in parts if part)


@dataclass(frozen=True)
class PerformersStudy:
    """A study for each performer, and the results over all.

    Attributes:
        sources: Training and test data for each performer, by name.
        plan: The plan, the same for all.
        folder: Folder of the files.
        command: Command line that repeats it.
    """

    sources: Mapping[str, Source]
    plan: Plan
    folder: Path
    command: str

    def study(self, name: str) -> Study:
        """Return the study in which the performer ``name`` is left out."""
        return Study(self.sources[name], self.plan, self.folder / name, self.command)

    def run(
        self, character: Character, jobs: int, progress_of: Callable[[str], Progress], restart: bool = False
    ) -> PerformersOutcome:
        """Run the remaining trials and write the results.

        Args:
            character: The face.
            jobs: Number of processes.
            progress_of: Returns the progress of the study in which a performer is left out.
            restart: Discard all trials.

        Raises:
            FacePoserError: If a folder has trials of another study, a file cannot be used, a process was killed, or no
                trial can be made from a performer's takes.
        """
        outcomes = {}
        for name in self.sources:
            outcomes[name] = self.study(name).run(character, jobs, progress_of(name), restart)
            if not outcomes[name].rows:
                raise FacePoserError(
                    f"The takes of the performer '{name}' have too few frames in which the face moves; give longer "
                    "takes with --performer."
                )
        pooled = pooled_rows_of([outcome.scores for outcome in outcomes.values()], self.plan)
        skipped: dict[str, str] = {}
        for outcome in outcomes.values():
            skipped |= outcome.left_out
        result = PerformersOutcome(pooled, outcomes, skipped)
        about = {
            "format": FORMAT,
            "version": VERSION,
            "command": self.command,
            "machine": machine(jobs),
            "settings": {name: self.study(name).settings(character) for name in self.sources},
            "left_out": skipped,
            "rows": result.rows,
        }
        write_json(self.folder / RESULTS, about, "result", ascii_only=False)
        write_text(self.folder / TABLE, csv_of(result.rows), "table")
        head = f"# {character.name}\n\n    {self.command}\n\n"
        write_text(self.folder / TABLES, head + result.tables(), "table")
        return result
