"""Execution of the trials of a plan in one or several processes, logging each finished task."""

import importlib.util
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.evaluation.measures import Evaluator, Score
from faceposer.evaluation.methods.method import Method, prepared
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.plan import Plan, Task
from faceposer.evaluation.processes import processes
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.takes import Source
from faceposer.evaluation.trial_log import TrialLog
from faceposer.evaluation.trials import Cell, Trial, TrialMaker
from faceposer.progress import Progress

Array = NDArray[np.float64]
#: Callback for the progress, with the number of finished tasks and the number of all tasks.


@dataclass(frozen=True)
class TaskResult:
    """Results of a task.

    Attributes:
        task: The task.
        scores: Scores by method and number of the trial, without trials for which the take has no frames.
        skipped: Methods that cannot be run on this machine, each with the reason as a sentence.
    """

    task: Task
    scores: dict[str, dict[int, Score]]
    skipped: dict[str, str]


@dataclass
class TrialRunner:
    """Runner of trials on one face, with prepared methods; each process has one.

    Attributes:
        setting: The face and the training data.
        frames: Test frames as weights of the character's shapes, shape (F, S).
    """

    setting: StudyContext
    frames: Array
    _methods: dict[str, Method] = field(default_factory=dict)
    _skipped: dict[str, str] = field(default_factory=dict)
    _warm: set[tuple[str, str]] = field(default_factory=set)
    _trials: tuple[object, list[Trial]] = (None, [])

    def __post_init__(self) -> None:
        """Initialise the maker and the evaluator of trials."""
        self._maker = TrialMaker(self.setting)
        self._evaluator = Evaluator(self.setting, self.frames)

    def method(self, name: str) -> Method | None:
        """Return the technique ``name``, prepared on first use, or None if it cannot be run on this machine."""
        if name not in self._methods and name not in self._skipped:
            sentence = unavailable(name)
            if sentence is None:
                try:
                    self._methods[name] = prepared(METHODS[name], self.setting)
                except (FacePoserError, ImportError) as error:
                    sentence = f"'{name}' is left out: {error}"
            if sentence is not None:
                self._skipped[name] = sentence
        return self._methods.get(name)

    def trials(self, cell: Cell, seed: int, least: int) -> list[Trial]:
        """Return the first trials of ``cell``, at least ``least`` if the take has enough frames."""
        key, trials = self._trials
        if key != (cell, seed) or len(trials) < least:
            trials = list(self._maker.trials(cell, self.frames, least, seed))
            self._trials = ((cell, seed), trials)
        return trials

    def run(self, task: Task) -> TaskResult:
        """Run ``task``; all methods run each trial in turn, so that they share the same machine load."""
        methods = {name: method for name in task.missing if (method := self.method(name)) is not None}
        numbers = sorted({number for name in methods for number in task.missing[name]})
        trials = self.trials(task.cell, task.seed, numbers[-1] + 1) if numbers else []
        scores: dict[str, dict[int, Score]] = {name: {} for name in methods}
        for number in numbers:
            if number >= len(trials):
                break
            for name, method in methods.items():
                if number in task.missing[name]:
                    scores[name][number] = self._score(name, method, task.cell, trials[number])
        return TaskResult(task, scores, {name: self._skipped[name] for name in task.missing if name in self._skipped})

    def _score(self, name: str, method: Method, cell: Cell, trial: Trial) -> Score:
        if (name, cell.constraint) not in self._warm:
            # Loading and caching during the first solve are excluded from the time.
            method.solve(trial.constraints)
            self._warm.add((name, cell.constraint))
        began = time.perf_counter()
        found = method.solve(trial.constraints)
        ms = (time.perf_counter() - began) * 1e3
        return self._evaluator.score(trial, method.vertices(found), ms)


def unavailable(name: str) -> str | None:
    """Return a sentence if the technique ``name`` needs a package that is not installed, else None."""
    package = METHODS[name].requires
    if package is None or importlib.util.find_spec(package) is not None:
        return None
    return f"'{name}' is left out, because it needs the package '{package}': pip install 'faceposer[bench]'."


def run_plan(source: Source, plan: Plan, log: TrialLog, jobs: int, progress: Progress) -> dict[str, str]:
    """Run the trials of ``plan`` that ``log`` lacks, and return the methods that were left out, with the reasons.

    Args:
        source: Training and test data.
        plan: The plan.
        log: Log of finished trials, to which new ones are added.
        jobs: Number of processes; results do not depend on it.
        progress: Progress; a cancelled study keeps its finished trials.

    Raises:
        CancelledError: If the user has cancelled the work.
        FacePoserError: If a file cannot be used, or a process was killed.
    """
    skipped = {name: sentence for name in plan.methods if (sentence := unavailable(name)) is not None}
    available = Plan(tuple(name for name in plan.methods if name not in skipped), plan.cells, plan.trials, plan.seeds)
    tasks = list(available.tasks(log.scores))
    if not tasks:
        return skipped
    progress.at("Training the techniques, about a minute")
    done = _run_serially(source, tasks) if jobs == 1 or len(tasks) == 1 else _run_in_pool(source, tasks, jobs)
    for number, result in enumerate(done, start=1):
        for method, scores in result.scores.items():
            log.add(method, result.task.cell, result.task.seed, scores)
        skipped |= result.skipped
        if number < len(tasks):
            progress.at("Trials", number / len(tasks))
    progress.at("All trials are done.", 1.0)
    return skipped


def _run_serially(source: Source, tasks: list[Task]) -> Iterator[TaskResult]:
    runner = TrialRunner(*source.load())
    for task in tasks:
        yield runner.run(task)


_runner: TrialRunner | None = None


def _prepare(source: Source) -> None:
    global _runner  # noqa: PLW0603 - state of a pool process between tasks
    _runner = TrialRunner(*source.load())


def _run(task: Task) -> TaskResult:
    assert _runner is not None
    return _runner.run(task)


def _run_in_pool(source: Source, tasks: list[Task], jobs: int) -> Iterator[TaskResult]:
    remaining = iter(tasks)
    with processes(min(jobs, len(tasks)), _prepare, source) as executor:
        # Few tasks are submitted at a time, in order, so that a stopped study has complete cells.
        pending = {executor.submit(_run, task) for task in islice(remaining, 2 * jobs)}
        while pending:
            finished, pending = wait(pending, return_when=FIRST_COMPLETED)
            pending |= {executor.submit(_run, task) for task in islice(remaining, len(finished))}
            for future in finished:
                yield future.result()
