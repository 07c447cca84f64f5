"""The worker solves the newest job, drops outdated ones and never loses an exception."""

import threading

import numpy as np
import pytest

from faceposer.geometry.camera import OrbitView
from faceposer.model.face_model import FaceModel
from faceposer.session import solver_worker
from faceposer.session.document import Document
from faceposer.session.solver_worker import InlineWorker, SolveRequest, SolveResult, SolverWorker
from faceposer.solve.constraints.point import PointConstraint


def job(model: FaceModel, revision: int, epoch: int = 0) -> SolveRequest:
    return SolveRequest(epoch, revision, model, Document("man"), model.neutral())


@pytest.mark.parametrize("make", [InlineWorker, SolverWorker])
def test_a_job_is_solved_and_taken_once(model: FaceModel, make: type) -> None:
    worker = make()
    worker.submit(job(model, 3))
    assert worker.wait_idle(10)
    result = worker.poll()
    assert result is not None
    assert result.job.revision == 3
    assert result.solution is not None
    np.testing.assert_allclose(result.solution.coefficients, 0, atol=1e-6)
    assert worker.poll() is None
    worker.close()


def test_the_newest_job_wins(model: FaceModel, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go_on, solved = threading.Event(), threading.Event(), []

    def slow(job: SolveRequest, should_stop: object = None) -> SolveResult:
        solved.append(job.revision)
        begun.set()
        assert go_on.wait(10)
        return SolveResult(job, None, None)

    monkeypatch.setattr(solver_worker, "run_job", slow)
    worker = SolverWorker()
    worker.submit(job(model, 0))
    assert begun.wait(10)
    for revision in range(1, 6):
        worker.submit(job(model, revision))
    assert worker.busy
    go_on.set()
    assert worker.wait_idle(10)
    assert solved == [0, 5], "jobs that were overtaken while waiting are never solved"
    result = worker.poll()
    assert result is not None
    assert result.job.revision == 5
    worker.close()


def test_a_new_epoch_stops_the_running_solve(model: FaceModel, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, stopped = threading.Event(), []

    def until_told(job: SolveRequest, should_stop: object = None) -> SolveResult:
        begun.set()
        if job.epoch == 0:
            while not should_stop():  # type: ignore[operator]
                pass
            stopped.append(job.epoch)
        return SolveResult(job, None, None)

    monkeypatch.setattr(solver_worker, "run_job", until_told)
    worker = SolverWorker()
    worker.submit(job(model, 0))
    assert begun.wait(10)
    worker.submit(job(model, 1, epoch=1))
    assert worker.wait_idle(10)
    assert stopped == [0]
    result = worker.poll()
    assert result is not None
    assert result.job.epoch == 1
    worker.close()


def test_exceptions_reach_the_one_who_polls(model: FaceModel) -> None:
    worker = SolverWorker()
    impossible = PointConstraint(10**8, (0.0, 0.0), OrbitView((0.0, 0.0, 0.0)).camera((10, 10)))
    worker.submit(SolveRequest(0, 0, model, Document("man", (impossible,)), None))
    assert worker.wait_idle(10)
    result = worker.poll()
    assert result is not None
    assert isinstance(result.error, ValueError)
    worker.submit(job(model, 1))
    assert worker.wait_idle(10), "the thread survives"
    worker.close()


def test_the_sleeping_frame_loop_is_woken(model: FaceModel) -> None:
    woken = threading.Event()
    worker = SolverWorker(woken.set)
    worker.submit(job(model, 0))
    assert woken.wait(10)
    worker.close()
