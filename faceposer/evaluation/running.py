"""Runs the trials of a plan, on one process or some, and notes each chunk that is done."""

import importlib.util
import time
from collections.abc import Callable, Iterator
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

Array = NDArray[np.float64]
#: Is told how many of how many chunks are done.
Show = Callable[[int, int], None]


@dataclass(frozen=True)
class Done:
    """What came of a task.

    Attributes:
        task: What was to be done.
        scores: By method and number of the trial; trials that the take is too poor for are left out.
        skipped: Methods that cannot be run here, each with a sentence that says why.
    """

    task: Task
    scores: dict[str, dict[int, Score]]
    skipped: dict[str, str]


@dataclass
class Bench:
    """A face with everything prepared that trials need; each process has one.

    Attributes:
        setting: The face and what may be learned.
        frames: Frames to test on, as weights of the character's shapes, shape (F, S).
    """

    setting: StudyContext
    frames: Array
    _methods: dict[str, Method] = field(default_factory=dict)
    _skipped: dict[str, str] = field(default_factory=dict)
    _warm: set[tuple[str, str]] = field(default_factory=set)
    _trials: tuple[object, list[Trial]] = (None, [])

    def __post_init__(self) -> None:
        """Get ready to make and judge trials."""
        self._maker = TrialMaker(self.setting)
        self._judge = Evaluator(self.setting, self.frames)

    def method(self, name: str) -> Method | None:
        """Return the technique ``name``, prepared when it is first asked for, or None if it cannot be run here."""
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
        """Return the first trials of ``cell``, at least so many if the take has them."""
        key, known = self._trials
        if key != (cell, seed) or len(known) < least:
            known = list(self._maker.trials(cell, self.frames, least, seed))
            self._trials = ((cell, seed), known)
        return known

    def run(self, task: Task) -> Done:
        """Return what comes of ``task``: all methods do each trial in turn, on the same machine load."""
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
        return Done(task, scores, {name: self._skipped[name] for name in task.missing if name in self._skipped})

    def _score(self, name: str, method: Method, cell: Cell, trial: Trial) -> Score:
        if (name, cell.constraint) not in self._warm:
            # What is loaded and remembered at a first solve is no part of any.
            method.solve(trial.constraints)
            self._warm.add((name, cell.constraint))
        began = time.perf_counter()
        found = method.solve(trial.constraints)
        ms = (time.perf_counter() - began) * 1e3
        return self._judge.score(trial, method.vertices(found), ms)


def unavailable(name: str) -> str | None:
    """Return a sentence if the technique ``name`` needs a package that is not installed, else None."""
    package = METHODS[name].requires
    if package is None or importlib.util.find_spec(package) is not None:
        return None
    return f"'{name}' is left out, for it needs the package '{package}': pip install 'faceposer[bench]'."


def run_plan(source: Source, plan: Plan, log: TrialLog, jobs: int, show: Show) -> dict[str, str]:
    """Do what ``log`` does not have of ``plan``, and return the methods that were left out, with the reasons.

    Args:
        source: What is learned from and tested on.
        plan: What is to be done.
        log: Has what is done, and gets the rest.
        jobs: Number of processes; what they find does not depend on it.
        show: Is told of the progress.

    Raises:
        FacePoserError: If a file cannot be used, or a process was killed.
    """
    skipped = {name: sentence for name in plan.methods if (sentence := unavailable(name)) is not None}
    able = Plan(tuple(name for name in plan.methods if name not in skipped), plan.cells, plan.trials, plan.seeds)
    tasks = list(able.tasks(log.scores))
    show(0, len(tasks))
    if not tasks:
        return skipped
    done = _here(source, tasks) if jobs == 1 or len(tasks) == 1 else _beside(source, tasks, jobs)
    for number, result in enumerate(done, start=1):
        for method, scores in result.scores.items():
            log.add(method, result.task.cell, result.task.seed, scores)
        skipped |= result.skipped
        show(number, len(tasks))
    return skipped


def _here(source: Source, tasks: list[Task]) -> Iterator[Done]:
    bench = Bench(*source.load())
    for task in tasks:
        yield bench.run(task)


_bench: Bench | None = None


def _prepare(source: Source) -> None:
    global _bench  # noqa: PLW0603 - what a process of the pool keeps from task to task
    _bench = Bench(*source.load())


def _run(task: Task) -> Done:
    assert _bench is not None
    return _bench.run(task)


def _beside(source: Source, tasks: list[Task], jobs: int) -> Iterator[Done]:
    left = iter(tasks)
    with processes(min(jobs, len(tasks)), _prepare, source) as executor:
        # Few are handed out at a time, in order, so that what is noted when the study is stopped is whole cells.
        pending = {executor.submit(_run, task) for task in islice(left, 2 * jobs)}
        while pending:
            finished, pending = wait(pending, return_when=FIRST_COMPLETED)
            pending |= {executor.submit(_run, task) for task in islice(left, len(finished))}
            for future in finished:
                yield future.result()
