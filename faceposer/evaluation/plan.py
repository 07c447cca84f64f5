"""What a study asks: which techniques, in which cells of the tables, how often."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from faceposer.errors import FacePoserError
from faceposer.evaluation.methods.method import Method
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.trials import STROKE_LINES, Cell, TrialMaker, region_vertices
from faceposer.model.character import Character

#: The techniques that are compared unless others are asked for, those of them that the program has.
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
#: Trials of a cell, by kind: comparing a stroke with thousands of examples takes long.
TRIALS: dict[str, int] = {"point": 150, "distance": 150, "stroke": 100}
#: Standard deviations of the hand, in pixels: as it is, and exact.
NOISE_PX = (1.5, 0.0)
#: Numbers of constraints that are tried within one region only.
REGION_COUNTS: dict[str, tuple[int, ...]] = {"point": (1, 4), "distance": (2,), "stroke": (450,)}
#: Trials that are done, and noted, at a time.
CHUNK = 25


@dataclass(frozen=True)
class Task:
    """Trials of one cell that one process does at a time.

    Attributes:
        cell: Of the trials.
        seed: Of the trials.
        missing: Numbers of the trials that each method has not done.
    """

    cell: Cell
    seed: int
    missing: dict[str, tuple[int, ...]]


@dataclass(frozen=True)
class Plan:
    """The cells of a study.

    Attributes:
        methods: Names of techniques.
        cells: What they are tested on.
        trials: Number of trials of a cell, by kind of constraint, for each seed.
        seeds: Of frames, places and noise.
    """

    methods: tuple[str, ...]
    cells: tuple[Cell, ...]
    trials: Mapping[str, int]
    seeds: tuple[int, ...]

    def wanted(self, method: str, cell: Cell) -> int:
        """Return the number of trials of ``cell`` that ``method`` is to do for each seed."""
        kind: type[Method] = METHODS[method]
        if cell.constraint not in kind.kinds:
            return 0
        trials = self.trials[cell.constraint]
        return trials if kind.max_trials is None else min(trials, kind.max_trials)

    def tasks(self, done: Mapping[tuple[str, Cell, int], Collection[int]]) -> Iterator[Task]:
        """Yield what is left to do where the trials ``done`` are, by method, cell and seed."""
        for cell in self.cells:
            for seed in self.seeds:
                for first in range(0, self.trials[cell.constraint], CHUNK):
                    missing = {}
                    for method in self.methods:
                        last = min(first + CHUNK, self.wanted(method, cell))
                        known = done.get((method, cell, seed), ())
                        numbers = tuple(number for number in range(first, last) if number not in known)
                        if numbers:
                            missing[method] = numbers
                    if missing:
                        yield Task(cell, seed, missing)


def known_methods(names: Sequence[str] | None) -> tuple[str, ...]:
    """Return the techniques ``names``, or the usual ones if None.

    Raises:
        FacePoserError: If there is no technique of such a name.
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
    """Return the cells of a study on ``character``, and a sentence for each sort of cells that it has no place for.

    Args:
        maker: Of trials on the face.
        character: The face.
        kinds: Of constraints.
        counts: Of constraints anywhere on the face, by kind.
        region_counts: Of constraints in one region only, by kind.
        noises: Standard deviations of the hand, in pixels.
        regions: Regions that are alone to have constraints; None for all that the character has.

    Raises:
        FacePoserError: If the character lacks a region that is asked for, or has no place for any constraint.
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
    """Return those of the ``cells`` that the face of the ``maker`` has places for, and why the others are left out.

    Raises:
        FacePoserError: If it has no place for any.
    """
    lacking = {cell: maker.lacking(cell) for cell in dict.fromkeys(cells)}
    left = tuple(cell for cell, sentence in lacking.items() if sentence is None)
    sentences = tuple(dict.fromkeys(sentence for sentence in lacking.values() if sentence is not None))
    if sentences and not left:
        raise FacePoserError(f"{sentences[0]} Choose other constraints with --kinds and --counts, or another face.")
    return left, sentences
