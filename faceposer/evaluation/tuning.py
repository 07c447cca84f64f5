"""Tuning of each technique's parameters on two folds of the training takes, without the test take."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from faceposer.errors import FacePoserError, counted
from faceposer.evaluation.methods.method import Method, Parameters
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.processes import processes
from faceposer.evaluation.running import unavailable
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.takes import FOLDS, Source
from faceposer.evaluation.trials import Cell, Trial, TrialMaker
from faceposer.files.writing import write_json

#: File name of the result.
TUNED = "tuned.json"
#: Few and many constraints of each kind, with the noise of a hand.
CELLS = (
    Cell("point", 2, 1.5),
    Cell("point", 8, 1.5),
    Cell("point", 32, 1.5),
    Cell("distance", 2, 1.5),
    Cell("distance", 8, 1.5),
    Cell("stroke", 450, 1.5),
)
TRIALS = 30
# Largest number of passes over all parameters.
_ROUNDS = 2
# Smallest relative improvement of the score that counts.
_MIN_IMPROVEMENT = 1e-4

Say = Callable[[str], None]
Tuned = dict[str, Any]


@dataclass
class Fold:
    """One fold of the training takes, with trials made once.

    Attributes:
        setting: The face and the training data.
        trials: Trials by cell.
    """

    setting: StudyContext
    trials: dict[Cell, list[Trial]]

    @classmethod
    def of(cls, source: Source, number: int, cells: Sequence[Cell], trials: int, seed: int) -> "Fold":
        """Return the fold ``number`` with the given number of ``trials`` of each of the ``cells``."""
        setting, frames = replace(source, fold=number).load()
        maker = TrialMaker(setting)
        return cls(setting, {cell: list(maker.trials(cell, frames, trials, seed)) for cell in cells})

    def relative_errors(self, method: Method) -> list[float]:
        """Return the relative 3D error of ``method`` in each cell that it supports."""
        errors = []
        for cell, all_of_cell in self.trials.items():
            trials = all_of_cell[: method.max_trials]
            if cell.constraint in method.kinds and trials:
                results = [method.vertices(method.solve(trial.constraints)) for trial in trials]
                neutral = [self.setting.character.vertices] * len(trials)
                errors.append(self._total_error(trials, results) / self._total_error(trials, neutral))
        return errors

    def _total_error(self, trials: Sequence[Trial], results: Sequence[Any]) -> float:
        return sum(
            float(np.linalg.norm(np.asarray(vertices) - self.setting.vertices_of(trial.weights), axis=1).mean())
            for trial, vertices in zip(trials, results, strict=True)
        )


def search(kind: type[Method], score: Callable[[Parameters], float]) -> Tuned:
    """Minimise the ``score`` of ``kind`` over its parameters by coordinate descent.

    The search starts at the parameters of the class, sets one at a time to the best value of its grid, and repeats the
    pass until nothing changes, at most twice. Scores are cached.
    """
    tried: dict[str, tuple[Parameters, float]] = {}

    def scored(parameters: Parameters) -> float:
        key = json.dumps(parameters, sort_keys=True)
        if key not in tried:
            tried[key] = (parameters, score(parameters))
        return tried[key][1]

    best = dict(kind.parameters)
    as_is = lowest = scored(best)
    for _ in range(_ROUNDS):
        before = dict(best)
        for name, values in kind.grid.items():
            for value in values:
                candidate = {**best, name: value}
                candidate_score = scored(candidate)
                if candidate_score < (1.0 - _MIN_IMPROVEMENT) * lowest:
                    best, lowest = candidate, candidate_score
        if best == before:
            break
    # A best value at an end of its grid indicates that the grid is too narrow, unless the end is natural.
    ends = [name for name, values in kind.grid.items() if _at_end(best[name], values)]
    natural = [name for name in ends if best[name] in kind.natural_ends.get(name, ())]
    return {
        "parameters": best,
        "at_end_of_grid": [name for name in ends if name not in natural],
        "at_natural_end": natural,
        "score": round(lowest, 5),
        "score_as_is": round(as_is, 5),
        "tried": [{"parameters": parameters, "score": round(value, 5)} for parameters, value in tried.values()],
    }


def _at_end(value: Any, values: Sequence[Any]) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value in (min(values), max(values))


def end_warning(name: str, found: Tuned) -> str | None:
    """Return a warning about the values ``found`` for the technique ``name`` at ends of their grids, or None."""
    ends = [f"{key}={found['parameters'][key]:g}" for key in found["at_end_of_grid"]]
    if not ends:
        return None
    return f"{name}: {' and '.join(ends)} at the end of the grid; better values may be beyond it, so widen the grid."


# State of a process between techniques.
_folds: list[Fold] = []


def _prepare(source: Source, cells: Sequence[Cell], trials: int, seed: int) -> None:
    _folds[:] = [Fold.of(source, number, cells, trials, seed) for number in FOLDS]


def _tune_one(name: str) -> Tuned | str:
    """Return the result for the technique ``name``, or a sentence with the reason why it is left out."""
    kind = METHODS[name]
    if sentence := unavailable(name):
        return sentence

    def score(parameters: Parameters) -> float:
        errors = [error for fold in _folds for error in fold.relative_errors(kind(fold.setting, parameters))]
        return float(np.exp(np.mean(np.log(errors))))

    try:
        return search(kind, score)
    except (FacePoserError, ImportError) as error:
        return f"'{name}' is left out: {error}"


def tune(
    source: Source, methods: Sequence[str], kinds: Sequence[str], trials: int | None, seed: int, jobs: int, say: Say
) -> dict[str, Tuned]:
    """Return the best parameters of the ``methods``, by the geometric mean of the relative 3D error.

    Args:
        source: Data, of which only the ``captures`` are used.
        methods: Names of techniques.
        kinds: Kinds of constraints.
        trials: Trials of each cell and fold; None for the default number.
        seed: Seed of the trials.
        jobs: Number of processes, among which the techniques are distributed.
        say: Callback for a line about each technique that is finished or left out.

    Raises:
        FacePoserError: If a take cannot be read or is too short for folds.
    """
    cells = tuple(cell for cell in CELLS if cell.constraint in kinds)
    arguments = (source, cells, trials or TRIALS, seed)
    tuned: dict[str, Tuned] = {}
    if jobs == 1 or len(methods) == 1:
        _prepare(*arguments)
        results = map(_tune_one, methods)
        _gather(methods, results, tuned, say)
        return tuned
    # One technique per call: some take minutes, others seconds.
    with processes(min(jobs, len(methods)), _prepare, *arguments) as executor:
        _gather(methods, executor.map(_tune_one, methods), tuned, say)
    return tuned


def _gather(methods: Sequence[str], results: Any, tuned: dict[str, Tuned], say: Say) -> None:
    for name, result in zip(methods, results, strict=True):
        if isinstance(result, str):
            say(result)
        else:
            tuned[name] = result
            say(f"{name}: {counted(len(result['tried']), 'setting')} tried")


def write_tuned(folder: Path, tuned: dict[str, Tuned], command: str) -> None:
    """Write the results to ``folder``, which is created if it does not exist.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FacePoserError(
            f"The folder '{folder}' cannot be created ({error.strerror}); choose another with --output."
        ) from error
    about = {
        "format": "faceposer.evaluation.tuned",
        "version": 1,
        "command": command,
        "cells": [{"constraint": cell.constraint, "count": cell.count, "noise_px": cell.noise_px} for cell in CELLS],
        "methods": tuned,
    }
    write_json(folder / TUNED, about, "result")
