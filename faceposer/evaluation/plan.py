"""Plan of a study: techniques, cells of the tables, and numbers of trials."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from faceposer.errors import FacePoserError
from faceposer.evaluation.methods.method import Method
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.trials import STROKE_LINES, Cell, TrialMaker, region_vertices
from faceposer.model.character import Character

#: Techniques that are compared by default.
DEFAULT_METHODS = (
    "mfa",
    "mfa-whole",
    "mfa-plain",
    "ppca",
    "pca",
    "lwr",
    "opt-blend",
    "interp-all",
    "bounded-weights",
    "eos",
    "arap",
)
#: Trials of a cell, by kind; fewer for strokes, which are slow to compare with thousands of examples.
TRIALS: dict[str, int] = {"point": 150, "distance": 150, "stroke": 100}
#: Standard deviations of the target noise, in pixels: that of a hand, and none.
NOISE_PX = (1.5, 0.0)
#: Numbers of constraints within one region only.
REGION_COUNTS: dict[str, tuple[int, ...]] = {"point": (1, 4), "distance": (2,), "stroke": (450,)}
#: Number of trials in a task.
CHUNK = 25


@dataclass(frozen=True)
class Task:
    """Trials of one cell that one process runs at a time.

    Attributes:
        cell: Cell of the trials.
        seed: Seed of the trials.
        missing: Numbers of the missing trials of each method.
    """

    cell: Cell
    seed: int
    missing: dict[str, tuple[int, ...]]


@dataclass(frozen=True)
class Plan:
    """Methods, cells and trials of a study.

    Attributes:
        methods: Names of techniques.
        cells: Conditions under which they are tested.
        trials: Number of trials of a cell for each seed, by kind of constraint.
        seeds: Seeds of frames, places and noise.
    """

    methods: tuple[str, ...]
    cells: tuple[Cell, ...]
    trials: Mapping[str, int]
    seeds: tuple[int, ...]

    def n_trials(self, method: str, cell: Cell) -> int:
        """Return the number of trials of ``cell`` for ``method`` and each seed."""
        kind: type[Method] = METHODS[method]
        if cell.constraint not in kind.kinds:
            return 0
        trials = self.trials[cell.constraint]
        return trials if kind.max_trials is None else min(trials, kind.max_trials)

    def tasks(self, done: Mapping[tuple[str, Cell, int], Collection[int]]) -> Iterator[Task]:
        """Yield the remaining tasks, given the trials ``done`` by method, cell and seed."""
        for cell in self.cells:
            for seed in self.seeds:
                for first in range(0, self.trials[cell.constraint], CHUNK):
                    missing = {}
                    for method in self.methods:
                        last = min(first + CHUNK, self.n_trials(method, cell))
                        finished = done.get((method, cell, seed), ())
                        numbers = tuple(number for number in range(first, last) if number not in finished)
                        if numbers:
                            missing[method] = numbers
                    if missing:
                        yield Task(cell, seed, missing)


def known_methods(names: Sequence[str] | None) -> tuple[str, ...]:
    """Return the techniques ``names`` without duplicates, or the default ones if None.

    Raises:
        FacePoserError: If a name is unknown.
    """
    if names is None:
        return tuple(name for name in DEFAULT_METHODS if name in METHODS)
    for name in names:
        if name not in METHODS:
            raise FacePoserError(f"There is no technique '{name}'; choose from {', '.join(METHODS)}.")
    return tuple(dict.fromkeys(names))


def cells_of(
    maker: TrialMaker,
    character: Character,
    kinds: Sequence[str],
    counts: Mapping[str, Sequence[int]],
    region_counts: Mapping[str, Sequence[int]],
    noises: Sequence[float],
    regions: Sequence[str] | None,
) -> tuple[tuple[Cell, ...], tuple[str, ...]]:
    """Return the cells of a study on ``character``, and a sentence for each group of cells that it has no places for.

    Args:
        maker: Maker of trials on the face.
        character: The face.
        kinds: Kinds of constraints.
        counts: Numbers of constraints anywhere on the face, by kind.
        region_counts: Numbers of constraints within one region, by kind.
        noises: Standard deviations of the target noise, in pixels.
        regions: Regions with cells in which only they have constraints; None for all regions of the character.

    Raises:
        FacePoserError: If the character lacks one of the ``regions``, or has no place for any constraint.
    """
    present = region_vertices(character)
    for region in regions or ():
        if region not in present:
            raise FacePoserError(
                f"The character '{character.name}' has no region '{region}'; choose from "
                f"{', '.join(present) or '(none)'}, or leave out --regions."
            )
    cells = [Cell(kind, count, noise) for noise in noises for kind in kinds for count in counts[kind]]
    cells += [
        Cell(kind, count, noise, region)
        for noise in noises
        for kind in kinds
        for region in (present if regions is None else regions)
        if kind != "stroke" or region in STROKE_LINES
        for count in region_counts[kind]
    ]
    return possible(maker, cells)


def possible(maker: TrialMaker, cells: Sequence[Cell]) -> tuple[tuple[Cell, ...], tuple[str, ...]]:
    """Return the ``cells`` that the face of ``maker`` has places for, and the reasons why others are left out.

    Raises:
        FacePoserError: If it has no place for any.
    """
    reasons = {cell: maker.lacking(cell) for cell in dict.fromkeys(cells)}
    remaining = tuple(cell for cell, sentence in reasons.items() if sentence is None)
    sentences = tuple(dict.fromkeys(sentence for sentence in reasons.values() if sentence is not None))
    if sentences and not remaining:
        raise FacePoserError(
            f"{sentences[0]} Choose other constraints with --kinds and --counts, or another character."
        )
    return remaining, sentences
