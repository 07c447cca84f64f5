#!/usr/bin/env python3
"""Compare priors quickly, on folds of the training take and on held-out performers.

    FACEPOSER_CAPTURES=FOLDER python scripts/study_performers.py -o DIR                        # the default
    FACEPOSER_CAPTURES=FOLDER python scripts/study_performers.py -o DIR --variants FILE.py     # custom variants
    ... --only default lwr "prior weight 2" --data fold1 jmtechart --trials 20 --base default

Each line is a variant on one data set: the sum of its 3D errors relative to the neutral face and, in brackets, the
share of trials that end worse than the neutral face. The target noise is 1.5 px. The data sets are

    fold1, fold2       parts of take 3, learned from the rest of it (with --others also from the other performers)
    alex, jmtechart, llv_dao   each performer, learned from the two others; for alex, take 3 only
    take4              only with --look: take 4, learned from take 3 (with --others also from the other performers)

followed by all folds together and all performers together. Relative to the variant --base, * marks a cell as lower and
! as higher, by the 95 % interval of the difference over the same trials.

A file of variants defines a dictionary VARIANTS: name → function from a StudyContext to a model, the weight of its
prior, and further keyword arguments of PoseProblem as a dictionary:

    VARIANTS = {"twice as strong": lambda setting: (setting.model, 2.0, {})}

Learning from the performances of a data set takes a minute; the statistics are cached in DIR while the relevant sources
remain unchanged (LEARNS below). The trials are regenerated in a second. The errors of all trials of a run are written
to DIR/performers.json.
"""

import argparse
import hashlib
import importlib.util
import json
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import faceposer
from faceposer.errors import FacePoserError
from faceposer.evaluation.methods.method import posed, prepared
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.performers import Performer, leave_one_out
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.takes import FOLDS, Source
from faceposer.evaluation.trials import Cell, Trial, TrialMaker
from faceposer.model.expression_statistics import load_expression_statistics
from faceposer.model.face_model import FaceModel
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.training.expressions import Recipe

Array = NDArray[np.float64]
#: A model, the weight of its prior, and further arguments of ``PoseProblem``.
Made = tuple[FaceModel, float, dict[str, Any]]
Variant = Callable[[StudyContext], Made]
#: By cell: error, error of the neutral face and milliseconds of each trial, shape (n, 3).
Errors = dict[Cell, Array]

KINDS = ("point", "distance", "stroke")
RESAMPLES = 1000

CELLS = (
    *(Cell("point", count, 1.5) for count in (1, 2, 4, 8, 32)),
    *(Cell("distance", count, 1.5) for count in (1, 4, 8)),
    *(Cell("stroke", count, 1.5) for count in (150, 450, 900)),
)
SEED = 5
PERFORMERS = (
    ("alex", "alex_rom_3.csv"),
    ("jmtechart", "jmtechart_myslate_3.csv"),
    ("llv_dao", "llv_dao.csv"),
)
LOOKED_AT = "alex_rom_4.csv"
TAKE_4 = "take4"
POOLS = {"folds": ("fold1", "fold2"), "performers": tuple(name for name, _ in PERFORMERS)}

VARIANTS: dict[str, Variant] = {
    "default": lambda setting: (setting.model, 1.0, {}),
    "prior weight 2": lambda setting: (setting.model, 2.0, {}),
    "no damping": lambda setting: (setting.model, 1.0, {"prior": "whole"}),
}
#: Sources that affect the learned statistics, in addition to the captures.
LEARNS = (
    "evaluation/setting.py",
    "evaluation/takes.py",
    "model/coupling.py",
    "training/capture.py",
    "training/expressions.py",
    "training/mfa.py",
)


class DataSet:
    """Study context with trials from frames that it was not learned from."""

    def __init__(self, name: str, source: Source, trials: int, folder: Path) -> None:
        self.name = name
        self.setting, frames = source.load()
        self._learn(folder, json.dumps(source.identity(self.setting.character), sort_keys=True))
        maker = TrialMaker(self.setting)
        self._trials = {cell: list(maker.trials(cell, frames, trials, SEED)) for cell in CELLS}
        self._truths = {
            cell: [self.setting.vertices_of(trial.weights) for trial in of_cell]
            for cell, of_cell in self._trials.items()
        }
        neutral = self.setting.character.vertices
        self._neutral = {cell: [_distance(neutral, of) for of in truths] for cell, truths in self._truths.items()}

    def _learn(self, folder: Path, identity: str) -> None:
        """Learn the statistics of the context, or load them from the cache in ``folder``."""
        digest = hashlib.sha256(identity.encode())
        for name in LEARNS:
            digest.update((Path(faceposer.__file__).parent / name).read_bytes())
        path = folder / f"statistics-{self.name}-{digest.hexdigest()[:12]}.npz"
        if not path.exists():
            began = time.perf_counter()
            self.setting.statistics.save(path)
            print(f"{self.name}: learned in {time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True)
        # Always loaded from the file, which has single precision, so that every run has the same numbers.
        self.setting.__dict__["statistics"] = load_expression_statistics(path)

    def run(self, variant: Variant | str) -> Errors:
        """Return the errors of a ``variant``, or of the technique with this name, on all trials."""
        solver = self._solver(variant)
        found: Errors = {}
        for cell, trials in self._trials.items():
            errors, times = [], []
            for trial, truth in zip(trials, self._truths[cell], strict=True):
                began = time.perf_counter()
                pose = solver(trial)
                times.append(1e3 * (time.perf_counter() - began))
                errors.append(_distance(pose(), truth))
            found[cell] = np.column_stack([errors, self._neutral[cell], times]).reshape(-1, 3)
        return found

    def _solver(self, variant: Variant | str) -> Callable[[Trial], Callable[[], Any]]:
        """Return a solver of trials that returns a function for the vertices, which is not timed."""
        if isinstance(variant, str):
            method = prepared(METHODS[variant], self.setting)

            def by_method(trial: Trial) -> Callable[[], Any]:
                found = method.solve(trial.constraints)
                return lambda: method.vertices(found)

            return by_method
        model, weight, arguments = variant(self.setting)

        def by_problem(trial: Trial) -> Callable[[], Any]:
            problem = PoseProblem(model, trial.constraints, prior_weight=weight, **arguments)
            coefficients = solve(problem).coefficients
            return lambda: posed(model, coefficients)

        return by_problem


def _distance(vertices: Any, truth: Any) -> float:
    return float(np.linalg.norm(np.asarray(vertices) - truth, axis=1).mean())


def sources(folder: Path, character: str, recipe: Recipe, others: bool, look: bool) -> dict[str, Source]:
    """Return the data sets by name."""
    found = {}
    files = {name: folder / file for name, file in PERFORMERS}
    learned = tuple(files.values()) if others else (files["alex"],)
    names = tuple(files) if others else ("alex",)
    for number in FOLDS:
        found[f"fold{number}"] = Source(
            character, learned, (), recipe, fold=number, performers=names, within="alex" if others else None
        )
    found |= leave_one_out([Performer(name, (path,)) for name, path in files.items()], character, recipe)
    if look:
        found[TAKE_4] = Source(character, learned, (folder / LOOKED_AT,), recipe, performers=names)
    return found


def pooled(results: Mapping[str, Errors], names: Sequence[str]) -> Errors:
    """Return the errors of all data sets ``names`` together."""
    return {cell: np.concatenate([results[name][cell] for name in names]) for cell in CELLS}


def line(name: str, of: str, errors: Errors, base: Errors) -> str:
    """Return a row of the table."""
    words = []
    for cell, rows in errors.items():
        error, neutral, _ = rows.T
        sign = " " if rows is base[cell] or not len(rows) else _sign(rows, base[cell])
        words.append(f"{error.sum() / max(neutral.sum(), 1e-12):5.3f}{sign}({(error > neutral).mean():.2f})")
    times = [
        np.median(np.concatenate([errors[cell][:, 2] for cell in CELLS if cell.constraint == kind])) for kind in KINDS
    ]
    return f"{name:28.28s} {of:10s} {' '.join(words)}  {' '.join(f'{ms:.1f}' for ms in times)} ms"


def _sign(rows: Array, base: Array) -> str:
    """Return "*" if ``rows`` are significantly lower than ``base``, "!" if higher, by bootstrap over the trials."""
    n = len(rows)
    draws = np.random.default_rng(n).multinomial(n, np.full(n, 1.0 / n), size=RESAMPLES)
    low, high = np.percentile((draws @ (rows[:, 0] - base[:, 0])) / (draws @ base[:, 1]), (2.5, 97.5))
    return "*" if high < 0.0 else "!" if low > 0.0 else " "


def read_variants(path: Path) -> dict[str, Variant]:
    """Return the dictionary VARIANTS of the Python file ``path``."""
    spec = importlib.util.spec_from_file_location("variants", path)
    if spec is None or spec.loader is None:
        sys.exit(f"'{path}' is not a Python file.")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return dict(module.VARIANTS)


def chosen_variants(
    file: Path | None, only: Sequence[str] | None, base: str | None
) -> tuple[dict[str, Variant | str], list[str]]:
    """Return all variants and techniques by name, and the names of those to run, the base first."""
    variants: dict[str, Variant | str] = dict(VARIANTS)
    if file is not None:
        variants |= read_variants(file)
    names = list(only or variants)
    variants |= {name: name for name in METHODS if name not in variants}
    names = [base or names[0], *(name for name in names if name != (base or names[0]))]
    if unknown := [name for name in names if name not in variants]:
        sys.exit(f"Unknown variant '{unknown[0]}'; choose from {', '.join(variants)}.")
    return variants, names


def main() -> None:
    """Run the variants on the data sets, and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder of the cache and the results"
    )
    parser.add_argument("--variants", type=Path, metavar="FILE.py", help="Python file with further variants")
    parser.add_argument(
        "--only", nargs="+", metavar="NAME", help="variants or techniques to run (default: all variants)"
    )
    parser.add_argument("--data", nargs="+", metavar="NAME", help="data sets to use (default: all)")
    parser.add_argument("--character", default="man", help="character to pose (default: man)")
    parser.add_argument("--trials", type=int, default=40, help="trials per cell (default: 40)")
    parser.add_argument(
        "--examples", type=int, default=Recipe().n_examples, help="number of augmented examples to learn from"
    )
    parser.add_argument("--base", metavar="NAME", help="variant to compare with (default: the first)")
    parser.add_argument(
        "--others", action="store_true", help="also learn from the other performers for folds and take 4"
    )
    parser.add_argument("--look", action="store_true", help="also test on take 4, which must not be used for choices")
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if folder is None:
        parser.error("set FACEPOSER_CAPTURES to the folder with the captures")
    recipe = Recipe(n_examples=options.examples)
    data = sources(Path(folder), options.character, recipe, options.others, options.look)
    keys = options.data or list(data)
    variants, names = chosen_variants(options.variants, options.only, options.base)
    if unknown := [key for key in keys if key not in data]:
        parser.error(f"unknown data set '{unknown[0]}'; choose from {', '.join(data)}")
    options.output.mkdir(parents=True, exist_ok=True)
    if TAKE_4 in keys:
        print(f"Take 4 ({LOOKED_AT}) is used as test data.")
    heads = " ".join(f"{cell.constraint[:6]} {cell.count}".ljust(12) for cell in CELLS)
    print(f"{'':39s} {heads} points, distances, strokes", flush=True)
    results: dict[str, dict[str, Errors]] = {name: {} for name in names}
    try:
        for key in keys:
            of = DataSet(key, data[key], options.trials, options.output)
            for name in names:
                results[name][key] = of.run(variants[name])
                print(line(name, key, results[name][key], results[names[0]][key]), flush=True)
    except FacePoserError as error:
        sys.exit(str(error))
    for pool, parts in POOLS.items():
        if set(parts) <= set(keys):
            rows = {name: pooled(results[name], parts) for name in names}
            print("\n".join(line(name, pool, rows[name], rows[names[0]]) for name in names))
    (options.output / "performers.json").write_text(_as_json(results, options.trials), encoding="utf-8")


def _as_json(results: Mapping[str, Mapping[str, Errors]], trials: int) -> str:
    rows = [
        {
            "variant": name,
            "data": key,
            "constraint": cell.constraint,
            "count": cell.count,
            "noise_px": cell.noise_px,
            "error_3d": [round(float(error), 6) for error in rows[:, 0]],
            "neutral_error_3d": [round(float(error), 6) for error in rows[:, 1]],
            "ms": round(float(np.median(rows[:, 2])), 3) if len(rows) else None,
        }
        for name, of_variant in results.items()
        for key, errors in of_variant.items()
        for cell, rows in errors.items()
    ]
    return json.dumps({"trials": trials, "seed": SEED, "rows": rows}, indent=1) + "\n"


if __name__ == "__main__":
    main()
