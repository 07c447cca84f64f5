"""``faceposer evaluate``: compares the prior with other techniques on unseen expressions."""

import argparse
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from faceposer.cli import evaluate_values as values
from faceposer.cli.arguments import output_path
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.atomic import check_new_folder
from faceposer.progress import Progress

NAME = "evaluate"

_TRAIN, _TEST = "alex_rom_3.csv", "alex_rom_4.csv"
_CAPTURES = "FACEPOSER_CAPTURES"


def add_parser(commands: Any) -> None:
    """Add the parser of ``evaluate`` to ``commands``."""
    parser: argparse.ArgumentParser = commands.add_parser(
        NAME,
        help="compare the prior with other techniques on unseen expressions",
        description="Learn from performances, pose the face by constraints sampled from frames of another performance, "
        "and measure the error of each technique (docs/evaluation.md). Repeat the command to continue a study that was "
        "stopped.",
    )
    parser.add_argument(
        "-o", "--output", type=output_path, metavar="DIR", required=True, help="folder for the files of the study"
    )
    parser.add_argument("--character", default="man", metavar="NAME|FILE", help="character to pose (default: man)")
    parser.add_argument("--subject", dest="character", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
    takes = parser.add_argument_group("performances")
    takes.add_argument(
        "--capture",
        type=Path,
        metavar="CSV",
        nargs="+",
        action="extend",
        help=f"takes to learn from (default: {_TRAIN} in the folder of ${_CAPTURES})",
    )
    takes.add_argument(
        "--capture-test",
        type=Path,
        metavar="CSV",
        nargs="+",
        action="extend",
        help=f"takes to test on, of any performer (default: {_TEST} in the same folder)",
    )
    takes.add_argument(
        "--performer",
        type=values.performer,
        metavar="NAME=CSV,CSV",
        action="append",
        help="leave-one-performer-out instead: a performer and all of their takes; give at least two. Each is tested "
        "once with techniques that have learned from the others",
    )
    takes.add_argument(
        "--fold",
        type=int,
        choices=(1, 2),
        nargs="?",
        const=1,
        help="test within the takes to learn from: 1 learns from the first 60 %% and tests on the last 38 %%, 2 the "
        "reverse",
    )
    takes.add_argument(
        "--sparse",
        choices=("auto", "yes", "no"),
        default="auto",
        help="frames are far apart in time, so that jumps between them are valid (default: from the takes' timestamps)",
    )
    takes.add_argument(
        "--examples",
        type=values.examples,
        metavar="N",
        help="number of augmented examples to learn from, at least 200",
    )
    cells = parser.add_argument_group("conditions")
    cells.add_argument(
        "--methods", type=values.names, metavar="A,B", help="techniques (default: all of the comparison)"
    )
    cells.add_argument(
        "--kinds",
        type=values.kinds,
        metavar="A,B",
        default=values.KINDS,
        help="kinds of constraints (default: point,distance,stroke)",
    )
    for option, where in (("--counts", ""), ("--region-counts", " within one region")):
        cells.add_argument(
            option,
            type=values.counts,
            metavar="KIND=N,N",
            nargs="+",
            action="extend",
            default=[],
            help=f"numbers of constraints, or pixels of a stroke{where}; for example point=1,4",
        )
    cells.add_argument(
        "--trials",
        type=values.trials,
        metavar="N|KIND=N",
        nargs="+",
        action="extend",
        default=[],
        help="number of trials per condition and seed",
    )
    cells.add_argument(
        "--seed", "--seeds", type=values.seeds, metavar="N,N", default=(0,), help="seeds of the trials (default: 0)"
    )
    cells.add_argument(
        "--noise", type=values.noises, metavar="PX,PX", help="noise of the targets, in pixels (default: 1.5,0)"
    )
    cells.add_argument(
        "--regions",
        type=values.names,
        metavar="all|none|A,B",
        default=("all",),
        help="regions with conditions in which only they have constraints (default: all)",
    )
    work = parser.add_argument_group("execution and output")
    work.add_argument(
        "--contact",
        action="store_true",
        help="measure posed and true faces after the contact step (docs/contact.md)",
    )
    work.add_argument("--jobs", type=values.count, metavar="N", help="processes (default: one per core)")
    work.add_argument("--restart", action="store_true", help="discard the trials in the folder")
    work.add_argument(
        "--figures", action=argparse.BooleanOptionalAction, default=True, help="draw figures (default: yes)"
    )
    work.add_argument("--pictures", action="store_true", help="also render faces side by side")
    work.add_argument(
        "--tune",
        action="store_true",
        help="tune the parameters of each technique on two folds of the takes to learn from, instead of the study",
    )


def run(options: argparse.Namespace) -> int:
    """Run the study and return the exit status."""
    # Before NumPy is imported: one thread per process, so that times are comparable.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    from faceposer.evaluation.plan import NOISE_PX, REGION_COUNTS, TRIALS, Plan, cells_of, known_methods, possible
    from faceposer.evaluation.study import Study
    from faceposer.evaluation.trials import COUNTS, TrialMaker
    from faceposer.evaluation.tuning import CELLS
    from faceposer.training.expressions import Recipe

    if paths.exists(options.output) and not paths.is_dir(options.output):
        raise FacePoserError(f"'{options.output}' is a file; give a folder for the study with --output.")
    check_new_folder(options.output)
    methods = known_methods(options.methods)
    if options.figures and not options.tune:
        from faceposer.evaluation.figures import require_matplotlib

        # Checked first, since the study takes minutes.
        require_matplotlib()
    recipe = Recipe() if options.examples is None else Recipe(n_examples=options.examples)
    sources = {name: replace(source, contact=options.contact) for name, source in _sources(options, recipe).items()}
    # Read all files first, so that a defect of any is reported before anything is learned.
    settings = [source.load()[0] for source in sources.values()]
    setting = settings[0]
    jobs = options.jobs or os.cpu_count() or 1
    trials = TRIALS | {kind: n for which, n in options.trials for kind in (values.KINDS if which is None else (which,))}
    command = shlex.join(["faceposer", *options.words])
    if options.tune:
        # Raises an error if the face has no place for any of the conditions.
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
    line = ProgressLine(log=True)
    try:
        if options.performer:
            from faceposer.evaluation.performers import PerformersStudy

            def begin_performer(name: str) -> Progress:
                line.restart(f"{name} left out: ")
                return line.progress

            performers_study = PerformersStudy(sources, plan, options.output, command)
            result = performers_study.run(setting.character, jobs, begin_performer, options.restart)
        else:
            study = Study(sources[""], plan, options.output, command)
            outcome = study.run(setting.character, jobs, line.progress, options.restart)
    except KeyboardInterrupt:
        line.clear()
        print(f"Stopped; repeat the command to continue the study in '{options.output}'.", file=sys.stderr)
        raise
    finally:
        line.clear()
    if not options.performer:
        return _report([study], [outcome], outcome.rows, _tables(outcome.rows), outcome.left_out, options)
    studies = [performers_study.study(name) for name in result.outcomes]
    outcomes = list(result.outcomes.values())
    return _report(studies, outcomes, result.pooled, result.tables(), result.left_out, options)


def _sources(options: argparse.Namespace, recipe: Any) -> dict[str, Any]:
    """Return the data of each study, keyed by the performer who is left out, or by "" if none is."""
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
    """Print ``tables`` and the cells without ``rows``, and draw the figures and images that ``options`` request."""
    from faceposer.evaluation.study import RESULTS, TABLE, TABLES

    for sentence in left_out.values():
        print(sentence, file=sys.stderr)
    if not rows:
        raise FacePoserError(
            "No trial could be made: the takes to test on have too few frames in which the face moves; give longer "
            "takes with --capture-test."
        )
    done = {(row["constraint"], row["count"], row["noise_px"], row.get("region")) for row in rows}
    plan = studies[0].plan
    tried = [
        cell for cell in plan.cells if any(plan.n_trials(name, cell) for name in plan.methods if name not in left_out)
    ]
    without = [cell for cell in tried if (cell.constraint, cell.count, cell.noise_px, cell.region) not in done]
    if without:
        names = ", ".join(dict.fromkeys(cell.words for cell in without))
        print(f"No frame of the takes to test on moves enough for: {names}.", file=sys.stderr)
    print(tables)
    written = [options.output / name for name in (RESULTS, TABLE, TABLES)]
    if options.figures:
        from faceposer.evaluation.figures import write_figures

        written += write_figures(options.output, rows)
    if options.pictures:
        from faceposer.evaluation.side_by_side import write_pictures

        for study, outcome in zip(studies, outcomes, strict=True):
            written += write_pictures(study, outcome)
    files = ", ".join(path.relative_to(options.output).as_posix() for path in written)
    print(f"{options.output}: {files} written")
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
        print(f"{name}: {parameters} (score {found['score']:.4f}; with defaults {found['score_as_is']:.4f})")
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
            raise FacePoserError(f"{option} cannot be combined with --performer; leave out one of them.")


def _tests(options: argparse.Namespace) -> tuple[Path, ...]:
    if options.capture_test and options.fold is not None:
        raise FacePoserError("--fold tests within the takes to learn from; leave out --capture-test.")
    if options.fold is not None or options.tune:
        return _captures(options, _TRAIN)
    return tuple(options.capture_test) if options.capture_test else (_known_take(_TEST, "--capture-test"),)


def _known_take(name: str, option: str) -> Path:
    folder = os.environ.get(_CAPTURES)
    if not folder:
        raise FacePoserError(f"No take is given: use {option}, or set {_CAPTURES} to the folder that contains {name}.")
    return Path(folder) / name
