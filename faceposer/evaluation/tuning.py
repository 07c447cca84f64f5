"""Finds the parameters of each technique on two folds of the takes to learn from; the test take is never looked at."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.evaluation.methods.method import Method, Parameters
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.processes import processes
from faceposer.evaluation.running import unavailable
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.takes import FOLDS, Source
from faceposer.evaluation.trials import Cell, Trial, TrialMaker
from faceposer.files.atomic import write_text

#: The file of the result.
TUNED = "tuned.json"
#: Few and many constraints of each kind, given as a hand gives them.
CELLS = (
    Cell("point", 2, 1.5),
    Cell("point", 8, 1.5),
    Cell("point", 32, 1.5),
    Cell("distance", 2, 1.5),
    Cell("distance", 8, 1.5),
    Cell("stroke", 450, 1.5),
)
TRIALS = 30
# Times that all parameters are gone through, at most; the last brings no change.
_ROUNDS = 2
# What is better by a smaller share is not: more steps of a search that has converged.
_BETTER = 1e-4

Say = Callable[[str], None]
Tuned = dict[str, Any]


@dataclass
class Fold:
    """One fold of the takes to learn from, with the trials that are made of it once.

    Attributes:
        setting: What is learned from.
        trials: By cell.
    """

    setting: StudyContext
    trials: dict[Cell, list[Trial]]

    @classmethod
    def of(cls, source: Source, number: int, cells: Sequence[Cell], trials: int, seed: int) -> "Fold":
        """Return the fold of this ``number``, with so many ``trials`` of each of the ``cells``."""
        setting, frames = replace(source, fold=number).load()
        maker = TrialMaker(setting)
        return cls(setting, {cell: list(maker.trials(cell, frames, trials, seed)) for cell in cells})

    def relative_errors(self, method: Method) -> list[float]:
        """Return the relative 3D error of ``method`` in each cell that it can do."""
        errors = []
        for cell, all_of_cell in self.trials.items():
            trials = all_of_cell[: method.max_trials]
            if cell.constraint in method.kinds and trials:
                found = [method.vertices(method.solve(trial.constraints)) for trial in trials]
                neutral = [self.setting.character.vertices] * len(trials)
                errors.append(self._sum(trials, found) / self._sum(trials, neutral))
        return errors

    def _sum(self, trials: Sequence[Trial], found: Sequence[Any]) -> float:
        return sum(
            float(np.linalg.norm(np.asarray(vertices) - self.setting.vertices_of(trial.weights), axis=1).mean())
            for trial, vertices in zip(trials, found, strict=True)
        )


def search(kind: type[Method], score: Callable[[Parameters], float]) -> Tuned:
    """Return the parameters of ``kind`` with the lowest ``score``, found one parameter after another.

    The search begins at the class's own parameters, changes one at a time to the best value of its grid, and goes
    through all of them again until nothing changes, twice at most. Nothing is tried twice.
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
                changed = {**best, name: value}
                found = scored(changed)
                if found < (1.0 - _BETTER) * lowest:
                    best, lowest = changed, found
        if best == before:
            break
    # A best value at an end of its grid says that the grid should be wider, unless there is nothing beyond.
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
    """Return the sentence that says which values ``found`` for the technique ``name`` want a wider grid, if any."""
    ends = [f"{key}={found['parameters'][key]:g}" for key in found["at_end_of_grid"]]
    if not ends:
        return None
    return f"{name}: {' and '.join(ends)} at the end of the grid, beyond which there may be better; offer wider ones."


# What a process keeps from one technique to the next.
_folds: list[Fold] = []


def _prepare(source: Source, cells: Sequence[Cell], trials: int, seed: int) -> None:
    _folds[:] = [Fold.of(source, number, cells, trials, seed) for number in FOLDS]


def _tune_one(name: str) -> Tuned | str:
    """Return what was found for the technique ``name``, or the sentence that says why it is left out."""
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
        source: Its ``captures`` are what is learned from; its tests are not looked at.
        methods: Names of techniques.
        kinds: Of constraints.
        trials: Of each cell and fold; None for the usual number.
        seed: Of the trials.
        jobs: Number of processes, each with techniques of its own.
        say: Is told of each technique that is done or left out.

    Raises:
        FacePoserError: If a take cannot be read or is too short for folds.
    """
    cells = tuple(cell for cell in CELLS if cell.constraint in kinds)
    given = (source, cells, trials or TRIALS, seed)
    tuned: dict[str, Tuned] = {}
    if jobs == 1 or len(methods) == 1:
        _prepare(*given)
        results = map(_tune_one, methods)
        _gather(methods, results, tuned, say)
        return tuned
    # One technique at a time: some take minutes, others seconds.
    with processes(min(jobs, len(methods)), _prepare, *given) as executor:
        _gather(methods, executor.map(_tune_one, methods), tuned, say)
    return tuned


def _gather(methods: Sequence[str], results: Any, tuned: dict[str, Tuned], say: Say) -> None:
    for name, result in zip(methods, results, strict=True):
        if isinstance(result, str):
            say(result)
        else:
            tuned[name] = result
            say(f"{name}: {len(result['tried'])} settings tried")


def write_tuned(folder: Path, tuned: dict[str, Tuned], command: str) -> None:
    """Write what was found into ``folder``, made if it is missing.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FacePoserError(
            f"The folder '{folder}' cannot be made ({error.strerror}); choose another with --output."
        ) from error
    about = {
        "format": "faceposer.evaluation.tuned",
        "version": 1,
        "command": command,
        "cells": [{"constraint": cell.constraint, "count": cell.count, "noise_px": cell.noise_px} for cell in CELLS],
        "methods": tuned,
    }
    write_text(folder / TUNED, json.dumps(about, indent=1) + "\n", "result")
