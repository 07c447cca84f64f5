"""The command that compares the prior with other techniques: ``evaluate``."""

import argparse
import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError
from faceposer.files import paths

NAME = "evaluate"

_KINDS = ("point", "distance", "stroke")
_TRAIN, _TEST = "alex_rom_3.csv", "alex_rom_4.csv"
_CAPTURES = "FACEPOSER_CAPTURES"
_MOST = 100_000

Counts = tuple[str, tuple[int, ...]]


def add_parser(commands: Any) -> None:
    """Add the parser of ``evaluate`` to ``commands``."""
    parser: argparse.ArgumentParser = commands.add_parser(
        NAME,
        help="compare the prior with other techniques on unseen expressions",
        description="Learn from performances, pose the face by constraints taken from frames of another one, and "
        "measure how near each technique comes to the frame (docs/evaluation.md). A study that was stopped goes on "
        "when the same command is given again.",
    )
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="folder of the study's files")
    parser.add_argument("--character", default="man", metavar="NAME|FILE", help="character to pose (default: man)")
    parser.add_argument("--subject", dest="character", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
    takes = parser.add_argument_group("performances")
    takes.add_argument(
        "--capture",
        type=Path,
        metavar="CSV",
        nargs="+",
        action="extend",
        help=f"takes to learn from (default: {_TRAIN} in the folder {_CAPTURES})",
    )
    takes.add_argument(
        "--capture-test",
        type=Path,
        metavar="CSV",
        nargs="+",
        action="extend",
        help=f"takes to test on, of any performer (default: {_TEST} there)",
    )
    takes.add_argument(
        "--performer",
        type=_performer,
        metavar="NAME=CSV,CSV",
        action="append",
        help="instead, a performer and all takes of theirs, at least twice: each is left out once, and tested on with "
        "what the others teach",
    )
    takes.add_argument(
        "--fold",
        type=int,
        choices=(1, 2),
        nargs="?",
        const=1,
        help="test within the takes to learn from: 1 learns from their first 60 %% and tests on the last 38 %%, 2 the "
        "other way round",
    )
    takes.add_argument(
        "--sparse",
        choices=("auto", "yes", "no"),
        default="auto",
        help="whether frames are far apart, so that jumps between them are no errors (default: by the takes' times)",
    )
    takes.add_argument("--examples", type=_count, metavar="N", help="augmented examples to learn from")
    cells = parser.add_argument_group("what is tried")
    cells.add_argument("--methods", type=_names, metavar="A,B", help="techniques (default: all of the comparison)")
    cells.add_argument("--kinds", type=_kinds, metavar="A,B", default=_KINDS, help="point,distance,stroke (default)")
    for option, where in (("--counts", ""), ("--region-counts", " within one region")):
        cells.add_argument(
            option,
            type=_counts,
            metavar="KIND=N,N",
            nargs="+",
            action="extend",
            default=[],
            help=f"numbers of constraints, or pixels of a stroke,{where} for example point=1,4",
        )
    cells.add_argument(
        "--trials",
        type=_trials,
        metavar="N|KIND=N",
        nargs="+",
        action="extend",
        default=[],
        help="trials of each cell and seed",
    )
    cells.add_argument("--seed", "--seeds", type=_seeds, metavar="N,N", default=(0,), help="of the trials (default: 0)")
    cells.add_argument(
        "--noise", type=_noises, metavar="PX,PX", help="by how much targets are off, pixels (default: 1.5,0)"
    )
    cells.add_argument(
        "--regions",
        type=_names,
        metavar="all|none|A,B",
        default=("all",),
        help="regions that are alone to have constraints in some cells (default: all)",
    )
    work = parser.add_argument_group("how")
    work.add_argument(
        "--contact", action="store_true", help="measure faces, and true ones, after the contact step (docs/contact.md)"
    )
    work.add_argument("--jobs", type=_count, metavar="N", help="processes (default: one a core)")
    work.add_argument("--restart", action="store_true", help="throw away the trials in the folder")
    work.add_argument(
        "--figures", action=argparse.BooleanOptionalAction, default=True, help="draw figures (default: yes)"
    )
    work.add_argument("--pictures", action="store_true", help="also draw faces side by side")
    work.add_argument(
        "--tune",
        action="store_true",
        help="instead, find the best parameters of each technique on two folds of the takes to learn from",
    )


def run(options: argparse.Namespace) -> int:
    """Run the study that ``options`` ask for and return the exit status."""
    # Before NumPy is loaded: each process has a core, and times are to be compared.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    from faceposer.evaluation.plan import NOISE_PX, REGION_COUNTS, TRIALS, Plan, cells_of, known_methods, possible
    from faceposer.evaluation.study import Study
    from faceposer.evaluation.trials import COUNTS, TrialMaker
    from faceposer.evaluation.tuning import CELLS
    from faceposer.training.expressions import Recipe

    if paths.exists(options.output) and not paths.is_dir(options.output):
        raise FacePoserError(f"'{options.output}' is a file; give a folder for the study with --output.")
    methods = known_methods(options.methods)
    if options.figures and not options.tune:
        from faceposer.evaluation.figures import require_matplotlib

        # Before the minutes of work, not after them.
        require_matplotlib()
    recipe = Recipe() if options.examples is None else Recipe(n_examples=options.examples)
    sources = {name: replace(source, contact=options.contact) for name, source in _sources(options, recipe).items()}
    # All files are read before anything is learned.
    settings = [source.load()[0] for source in sources.values()]
    setting = settings[0]
    jobs = options.jobs or os.cpu_count() or 1
    trials = TRIALS | {kind: n for which, n in options.trials for kind in (_KINDS if which is None else (which,))}
    command = shlex.join(["faceposer", *options.words])
    if options.tune:
        # Raises if the face has no place for any.
        possible(TrialMaker(setting), [cell for cell in CELLS if cell.constraint in options.kinds])
        return _tune(sources[""], methods, options, jobs, command)
    region_names = () if options.regions == ("none",) else None if options.regions == ("all",) else options.regions
    cells, lacking = cells_of(
        TrialMaker(setting),
        setting.character,
        options.kinds,
        COUNTS | dict(options.counts),
        REGION_COUNTS | dict(options.region_counts),
        NOISE_PX if options.noise is None else options.noise,
        region_names,
    )
    for sentence in lacking:
        print(sentence, file=sys.stderr)
    plan = Plan(methods, cells, trials, options.seed)
    progress = _StudyProgress()
    try:
        if options.performer:
            from faceposer.evaluation.performers import PerformersStudy

            of_performers = PerformersStudy(sources, plan, options.output, command)
            found = of_performers.run(setting.character, jobs, progress.of, options.restart)
        else:
            study = Study(sources[""], plan, options.output, command)
            outcome = study.run(setting.character, jobs, progress.show, options.restart)
    except KeyboardInterrupt:
        progress.clear()
        print(f"Stopped; the same command goes on from '{options.output}'.", file=sys.stderr)
        raise
    finally:
        progress.clear()
    if not options.performer:
        return _report([study], [outcome], outcome.rows, _tables(outcome.rows), outcome.left_out, options)
    studies = [of_performers.study(name) for name in found.outcomes]
    outcomes = list(found.outcomes.values())
    return _report(studies, outcomes, found.pooled, found.tables(), found.left_out, options)


def _sources(options: argparse.Namespace, recipe: Any) -> dict[str, Any]:
    """Return what is learned from and tested on, by the performer who is left out, or by "" where none is."""
    from faceposer.evaluation.performers import Performer, leave_one_out
    from faceposer.evaluation.takes import Source

    if options.performer:
        _check_performers(options)
        performers = [Performer(name, paths) for name, paths in options.performer]
        return dict(leave_one_out(performers, options.character, recipe, options.sparse))
    captures, tests = _captures(options, _TRAIN), _tests(options)
    return {"": Source(options.character, captures, tests, recipe, options.fold, options.sparse)}


def _tables(rows: Any) -> str:
    from faceposer.evaluation.tables import error_tables, time_table

    return f"{error_tables(rows)}\n{time_table(rows)}"


def _report(
    studies: Sequence[Any],
    outcomes: Sequence[Any],
    rows: Sequence[Any],
    tables: str,
    left_out: Mapping[str, str],
    options: argparse.Namespace,
) -> int:
    """Print ``tables`` and which cells have none of the ``rows``, and draw what was asked for."""
    from faceposer.evaluation.study import RESULTS, TABLE, TABLES

    for sentence in left_out.values():
        print(sentence, file=sys.stderr)
    if not rows:
        raise FacePoserError(
            "No trial could be made: the takes to test on have too few frames in which the face moves; give longer "
            "ones with --capture-test."
        )
    done = {(row["constraint"], row["count"], row["noise_px"], row.get("region")) for row in rows}
    plan = studies[0].plan
    tried = [
        cell for cell in plan.cells if any(plan.wanted(name, cell) for name in plan.methods if name not in left_out)
    ]
    without = [cell for cell in tried if (cell.constraint, cell.count, cell.noise_px, cell.region) not in done]
    if without:
        words = ", ".join(dict.fromkeys(cell.words for cell in without))
        print(f"No frame to test on moves enough for: {words}.", file=sys.stderr)
    print(tables)
    written = [options.output / name for name in (RESULTS, TABLE, TABLES)]
    if options.figures:
        from faceposer.evaluation.figures import write_figures

        written += write_figures(options.output, rows)
    if options.pictures:
        from faceposer.evaluation.side_by_side import write_pictures

        for study, outcome in zip(studies, outcomes, strict=True):
            written += write_pictures(study, outcome)
    names = ", ".join(path.relative_to(options.output).as_posix() for path in written)
    print(f"{options.output}: {names} written")
    return 0


def _tune(source: Any, methods: Sequence[str], options: argparse.Namespace, jobs: int, command: str) -> int:
    from faceposer.evaluation.tuning import TUNED, end_warning, tune, write_tuned

    trials = next((n for which, n in options.trials if which is None), None)

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    tuned = tune(source, methods, options.kinds, trials, options.seed[0], jobs, say)
    write_tuned(options.output, tuned, command)
    for name, found in tuned.items():
        parameters = ", ".join(f"{key}={value}" for key, value in found["parameters"].items())
        print(f"{name}: {parameters} ({found['score']:.4f}; as it is: {found['score_as_is']:.4f})")
        if warning := end_warning(name, found):
            print(warning)
    print(f"{options.output / TUNED} written")
    return 0


def _captures(options: argparse.Namespace, name: str) -> tuple[Path, ...]:
    return tuple(options.capture) if options.capture else (_known_take(name, "--capture"),)


def _check_performers(options: argparse.Namespace) -> None:
    given = {"--capture": options.capture, "--capture-test": options.capture_test, "--fold": options.fold}
    for option, value in {**given, "--tune": options.tune or None}.items():
        if value is not None:
            raise FacePoserError(f"{option} and --performer are two ways to say what is learned from; leave out one.")


def _tests(options: argparse.Namespace) -> tuple[Path, ...]:
    if options.capture_test and options.fold is not None:
        raise FacePoserError("--fold tests within the takes to learn from; leave out --capture-test.")
    if options.fold is not None or options.tune:
        return _captures(options, _TRAIN)
    return tuple(options.capture_test) if options.capture_test else (_known_take(_TEST, "--capture-test"),)


def _known_take(name: str, option: str) -> Path:
    folder = os.environ.get(_CAPTURES)
    if not folder:
        raise FacePoserError(
            f"There is no take to work with: give one with {option}, or set {_CAPTURES} to the folder with {name}."
        )
    return Path(folder) / name


class _StudyProgress:
    """The progress of the studies, one for each performer that is left out."""

    def __init__(self) -> None:
        self._line = ProgressLine(log=True)
        self.clear = self._line.clear

    def of(self, performer: str) -> Callable[[int, int], None]:
        """Begin the study in which ``performer`` is left out, and return what shows its progress."""
        self._line.restart(f"{performer} left out: ")
        return self.show

    def show(self, done: int, of: int) -> None:
        if of in (0, done):
            text = "all trials are done"
        elif done == 0:
            text = "the techniques learn, about a minute"
        else:
            text = f"{100 * done // of} % of the trials that were left"
        self._line.count(done, of, text)


def _performer(text: str) -> tuple[str, tuple[Path, ...]]:
    name, equals, files = text.partition("=")
    paths = tuple(dict.fromkeys(Path(file.strip()) for file in files.split(",") if file.strip()))
    if not equals or not name.strip() or not paths:
        raise argparse.ArgumentTypeError(
            f"'{text}' does not say who and which takes; write for example anna=one.csv,two.csv"
        )
    return name.strip(), paths


def _names(text: str) -> tuple[str, ...]:
    names = tuple(name for name in (part.strip() for part in text.split(",")) if name)
    if not names:
        raise argparse.ArgumentTypeError("give at least one name, several with commas between them")
    return names


def _kinds(text: str) -> tuple[str, ...]:
    for name in _names(text):
        _kind(name)
    return tuple(dict.fromkeys(_names(text)))


def _kind(name: str) -> str:
    if name not in _KINDS:
        raise argparse.ArgumentTypeError(f"'{name}' is no kind of constraint; choose from {', '.join(_KINDS)}")
    return name


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit()) or not 1 <= int(text) <= _MOST:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 1 to {_MOST}")
    return int(text)


def _counts(text: str) -> Counts:
    kind, equals, numbers = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"'{text}' does not say of which kind; write for example point=1,4")
    return _kind(kind.strip()), tuple(
        dict.fromkeys(_count(part.strip()) for part in numbers.split(",") if part.strip())
    )


def _trials(text: str) -> tuple[str | None, int]:
    kind, equals, number = text.rpartition("=")
    return (_kind(kind.strip()) if equals else None, _count(number.strip()))


def _seeds(text: str) -> tuple[int, ...]:
    seeds = _names(text)
    for seed in seeds:
        if not (seed.isascii() and seed.isdigit()) or int(seed) > _MOST:
            raise argparse.ArgumentTypeError(f"'{seed}' is not a seed, a number from 0 to {_MOST}")
    return tuple(dict.fromkeys(int(seed) for seed in seeds))


def _noises(text: str) -> tuple[float, ...]:
    noises = []
    for part in _names(text):
        try:
            noise = float(part)
        except ValueError:
            noise = -1.0
        if not 0.0 <= noise <= 100.0:
            raise argparse.ArgumentTypeError(f"'{part}' is not a number of pixels from 0 to 100")
        noises.append(noise)
    return tuple(dict.fromkeys(noises))
