#!/usr/bin/env python3
"""Compare the default prior with variants on folds of the training take.

    FACEPOSER_CAPTURES=FOLDER python scripts/study_priors.py -o FOLDER             # about an hour; resumes
    FACEPOSER_CAPTURES=FOLDER python scripts/study_priors.py -o FOLDER --only default lwr "mean moved by half"

All variants use the program's own solve on the same trials, with a target noise of 1.5 px; they differ in the density
or in its conditioning on the start pose. Each number is the sum of the errors relative to the neutral face.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.evaluation.measures import Evaluator
from faceposer.evaluation.methods.method import posed, prepared
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.takes import Source
from faceposer.evaluation.trials import Cell, Trial, TrialMaker
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.local_moments import LocalMoments, RigDensity
from faceposer.model.mixture import GaussianMixture
from faceposer.model.shape_names import makers
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.training.expressions import Recipe, fit_statistics

Array = NDArray[np.float64]
#: Returns the model and its coefficients for a trial.
Solve = Callable[[Trial], tuple[FaceModel, Array]]

CELLS = (
    *(Cell("point", count, 1.5) for count in (1, 4, 8, 32)),
    *(Cell("distance", count, 1.5) for count in (1, 4, 8)),
    *(Cell("stroke", count, 1.5) for count in (150, 450, 900)),
)
SEED = 5


class MovedMean(LocalMoments):
    """The default prior with its mode moved from the start towards the mean of the nearest samples.

    Attributes:
        part: Share of the path to that mean.
        near_only: True if only regions coupled to those with constraints move.
    """

    part = 0.5
    near_only = False

    def __init__(self, density: RigDensity, start: Array, whole: bool = False) -> None:
        super().__init__(density, start, whole)
        self._projection = density.projection
        self._scales = np.mean((density.draws - density.directions @ start) ** 2, axis=0)
        self._coupling = density.coupling

    def near(self, rows: Array, residual: Array, covered: float = 0.0) -> GaussianMixture:
        """Return one Gaussian about a pose between the start and the mean of the nearest samples."""
        offsets, shares = self.nearest(rows, residual)
        shift = self.part * (shares @ offsets) if len(rows) else np.zeros(offsets.shape[1])
        if self.near_only and len(rows):
            relevance = np.sum((rows @ self._projection) ** 2, axis=0) * self._scales
            shift *= np.max(self._coupling * np.sqrt(relevance / relevance.max()), axis=1)
        weighted = (offsets - shift) * np.sqrt(shares)[:, None]
        return self.gaussian(weighted.T @ weighted, shift, covered)


class NearRegions(MovedMean):
    """The moved mean for coupled regions only."""

    near_only = True


class FullyMovedMean(MovedMean):
    """The mode moved to the mean, as in a regression from the nearest examples."""

    part = 1.0


class NearestTwelfth(LocalMoments):
    """The nearest twelfth of the samples."""

    share = 1.0 / 12.0


class NearestThird(LocalMoments):
    """The nearest third of the samples."""

    share = 1.0 / 3.0


@dataclass(frozen=True, eq=False)
class StudiedDensity(RigDensity):
    """Density with exchangeable samples and conditioning.

    Attributes:
        look: Class of the moments conditioned on a start.
        given: Samples to use, shape (n, W); if None, they are drawn from the mixture.
        n_draws: Number of samples to draw.
    """

    look: type[LocalMoments] = LocalMoments
    given: Array | None = None
    n_draws: int = 4000

    @cached_property
    def draws(self) -> Array:
        """Expressions within the limits, shape (n, W)."""
        drawn = self.mixture.draws(self.n_draws, np.random.default_rng(0)) if self.given is None else self.given.copy()
        lower, upper = self.limits.T
        bounded = upper > lower
        drawn[:, bounded] = drawn[:, bounded].clip(lower[bounded], upper[bounded])
        return drawn

    def conditioned_on(self, start: Array, whole: bool = False) -> LocalMoments:
        """Return the moments of the density conditioned on ``start``, shape (r,)."""
        return self.look(self, start, whole)


class Fold:
    """Study context with held-out frames of the same take, and all variants on it."""

    def __init__(self, source: Source) -> None:
        self.setting, self.frames = source.load()
        self.evaluator = Evaluator(self.setting, self.frames)
        self._maker = TrialMaker(self.setting)

    def trials(self, cell: Cell, number: int) -> list[Trial]:
        """Return the first trials of a ``cell``."""
        return list(self._maker.trials(cell, self.frames, number, SEED))

    def solve(self, name: str) -> Solve:
        """Return the solver of trials of the variant ``name``."""
        if name in METHODS:
            method = prepared(METHODS[name], self.setting)
            assert hasattr(method, "model")
            return lambda trial: (method.model, method.solve(trial.constraints))
        model, weight = VARIANTS[name](self.setting)
        return lambda trial: (model, solve(PoseProblem(model, trial.constraints, prior_weight=weight)).coefficients)


def _model(setting: StudyContext, **changes: object) -> FaceModel:
    density = setting.model.rig_density
    plain = {name: getattr(density, name) for name in RigDensity.__dataclass_fields__}
    return replace(setting.model, rig_density=StudiedDensity(**(plain | changes)))  # type: ignore[arg-type]


def _coupled(setting: StudyContext, part: float) -> FaceModel:
    """Return the model with the share ``part`` of the damping: 0 for none, 1 for the default."""
    coupling = setting.model.rig_density.coupling
    return _model(setting, coupling=part * coupling + (1.0 - part))


def _apart(setting: StudyContext) -> FaceModel:
    density = setting.model.rig_density
    names = np.array(density.regions)
    return _model(setting, coupling=(names[:, None] == names).astype(float))


def _examples(setting: StudyContext, number: int) -> FaceModel:
    """Return the model with examples of the take in place of samples of the mixture."""
    character = setting.character
    moving = [i for i, name in enumerate(character.shape_names) if makers(name, ARKIT_SHAPES)]
    chosen = np.random.default_rng(0).choice(len(setting.examples), number, replace=False)
    examples = setting.rig_weights(setting.examples[chosen])[:, moving]
    width = len(setting.model.rig_density.regions)
    if examples.shape[1] != width:
        raise SystemExit("The character must have all of ARKit's shapes.")
    return _model(setting, given=examples)


def _analyzers(setting: StudyContext, number: int, factors: int) -> FaceModel:
    recipe = replace(setting.recipe, n_components=number, n_factors=factors)
    statistics = setting.statistics
    fitted = fit_statistics(setting.examples, ARKIT_SHAPES, recipe, "", statistics.coupling)
    return build_face_model(setting.character, fitted)


#: Functions that return a model and the weight of its prior.
VARIANTS: dict[str, Callable[[StudyContext], tuple[FaceModel, float]]] = {
    "default": lambda s: (s.model, 1.0),
    "prior weight 0.5": lambda s: (s.model, 0.5),
    "prior weight 1.5": lambda s: (s.model, 1.5),
    "prior weight 2": lambda s: (s.model, 2.0),
    "no damping": lambda s: (_coupled(s, 0.0), 1.0),
    "half the damping": lambda s: (_coupled(s, 0.5), 1.0),
    "regions independent": lambda s: (_apart(s), 1.0),
    "1,000 samples": lambda s: (_model(s, n_draws=1000), 1.0),
    "12,000 samples": lambda s: (_model(s, n_draws=12000), 1.0),
    "nearest twelfth": lambda s: (_model(s, look=NearestTwelfth), 1.0),
    "nearest third": lambda s: (_model(s, look=NearestThird), 1.0),
    "mean moved by half": lambda s: (_model(s, look=MovedMean), 1.0),
    "mean moved fully": lambda s: (_model(s, look=FullyMovedMean), 1.0),
    "mean moved by half, coupled regions": lambda s: (_model(s, look=NearRegions), 1.0),
    "4,000 examples instead of samples": lambda s: (_examples(s, 4000), 1.0),
    "24 analyzers of 10 factors": lambda s: (_analyzers(s, 24, 10), 1.0),
    "120 analyzers of 20 factors": lambda s: (_analyzers(s, 120, 20), 1.0),
}
REFERENCES = ("mfa-plain", "ppca", "lwr")


def main() -> None:
    """Run the trials missing from the log and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the log and the table")
    parser.add_argument("--trials", type=int, default=40, help="trials per cell and fold (default: 40)")
    parser.add_argument("--only", nargs="+", choices=[*VARIANTS, *REFERENCES], help="variants to run (default: all)")
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if folder is None:
        parser.error("set FACEPOSER_CAPTURES to the folder with alex_rom_3.csv")
    names = options.only or [*VARIANTS, *REFERENCES]
    options.output.mkdir(parents=True, exist_ok=True)
    log = options.output / "priors.jsonl"
    done = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    known = {(row["fold"], row["variant"], row["trials"]) for row in done}
    take = Path(folder) / "alex_rom_3.csv"
    for number in (1, 2):
        missing = [name for name in names if (number, name, options.trials) not in known]
        if not missing:
            continue
        fold = Fold(Source("man", (take,), (), Recipe(), fold=number))
        trials = {cell: fold.trials(cell, options.trials) for cell in CELLS}
        for name in missing:
            row = {"fold": number, "variant": name, "trials": options.trials, "cells": _evaluated(fold, name, trials)}
            with log.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            done.append(row)
            print(f"fold {number}: {name}", file=sys.stderr)
    text = table([row for row in done if row["trials"] == options.trials], names)
    (options.output / "priors.md").write_text(text, encoding="utf-8")
    print(text)


def _evaluated(fold: Fold, name: str, trials: dict[Cell, list[Trial]]) -> list[tuple[float, float]]:
    """Return, for each cell, the sums of the errors and of those of the neutral face."""
    solver = fold.solve(name)
    sums = []
    for chosen in trials.values():
        error = neutral = 0.0
        for trial in chosen:
            model, coefficients = solver(trial)
            score = fold.evaluator.score(trial, posed(model, coefficients), 0.0)
            error += score.error
            neutral += score.neutral_error
        sums.append((error, neutral))
    return sums


def table(rows: list[dict[str, object]], names: list[str]) -> str:
    """Return the table in Markdown over all folds in ``rows``."""
    heads = [f"{cell.constraint} {cell.count}" for cell in CELLS]
    lines = [f"| | {' | '.join(heads)} |", "| --- " * (len(heads) + 1) + "|"]
    for name in names:
        sums = np.sum([row["cells"] for row in rows if row["variant"] == name], axis=0)
        if np.ndim(sums) == 2:
            cells = [f"{error / neutral:.3f}".lstrip("0") for error, neutral in sums]
            lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
