"""Frame store in the memory of a Dask cluster, an optional extra.

Each worker reads, aligns and keeps some chunks of frames. A pass sends the bases to every worker once, and only the sum
of the chunks' results is returned.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.progress import Progress
from faceposer.training.frames import AlignedReader, Frames, chunk_ranges, sum_of

Array = NDArray[np.float64]
Result = TypeVar("Result")

_PATIENCE_S = 10
_LAST_PORT = 65535
# Number of sums that are added at a time.
_FAN_IN = 8
_POLL_S = 0.5


class ClusteredFrames:
    """Displacements in the memory of a cluster's workers, in chunks.

    Chunks of a lost worker are read again by another.
    """

    def __init__(self, client: Any, reader: AlignedReader, address: str, progress: Progress) -> None:
        self.n_frames, self.n_vertices = len(reader.sequence), len(reader.sequence.neutral.vertices)
        self._client, self._progress, self._address = client, progress, address
        chunks = chunk_ranges(self.n_frames, self.n_vertices)
        # Workers have different working folders.
        absolute = replace(reader, sequence=reader.sequence.absolute())
        (shared,) = client.scatter([absolute], broadcast=True, hash=False)
        self._chunks = [client.submit(_read, shared, first, stop, pure=False) for first, stop in chunks]
        # Reading errors are raised here, before the first pass.
        for i, future in enumerate(self._chunks):
            self._wait_for(future)
            progress.at("Reading and aligning", (i + 1) / len(chunks))

    def run(self, function: Callable[..., Result], *arguments: Any) -> Iterator[Result]:
        """Yield ``function(chunk, *arguments)`` of each chunk, (n, N, 3), in order."""
        futures = self._submit(function, arguments)
        try:
            for i, future in enumerate(futures):
                self._wait_for(future)
                self._progress.at("Principal components", (i + 1) / len(futures))
                yield future.result()
        finally:
            self._client.cancel(futures)

    def total(self, function: Callable[..., list[Array]], *arguments: Any) -> list[Array]:
        """Return the sum over all chunks of the arrays ``function(chunk, *arguments)``, computed on the cluster."""
        # Only references to sums are kept, so that the workers free each chunk's result as soon as it is added.
        level = self._sum_groups(self._submit(function, arguments))
        sums = list(level)
        try:
            while len(level) > 1:
                level = self._sum_groups(level)
                sums += level
            for i, future in enumerate(sums):
                self._wait_for(future)
                self._progress.at("Principal components", (i + 1) / len(sums))
            result: list[Array] = level[0].result()
            return result
        finally:
            self._client.cancel(sums)

    def _sum_groups(self, level: list[Any]) -> list[Any]:
        groups = [level[i : i + _FAN_IN] for i in range(0, len(level), _FAN_IN)]
        return [self._client.submit(sum_of, group, pure=False) for group in groups]

    def _submit(self, function: Callable[..., Any], arguments: Sequence[Any]) -> list[Any]:
        sent = self._client.scatter(list(arguments), broadcast=True, hash=False) if arguments else []
        return [self._client.submit(function, chunk, *sent, pure=False) for chunk in self._chunks]

    def _wait_for(self, future: Any) -> None:
        _wait_for(self._client, future, self._address, self._progress)


def _wait_for(client: Any, future: Any, address: str, progress: Progress) -> None:
    """Wait until ``future`` is done, reporting progress so that the user can cancel.

    Raises:
        FacePoserError: If the task failed.
    """
    while not future.done():
        try:
            future.exception(timeout=_POLL_S)
        except TimeoutError:
            progress.at("Waiting for the cluster")
            if client.status != "running" or not client.scheduler_info(n_workers=1)["workers"]:
                raise FacePoserError(
                    f"The workers of the Dask scheduler at {address} are gone; start them again."
                ) from None
    if future.status != "finished":
        error = future.exception() if future.status == "error" else None
        if isinstance(error, FacePoserError):
            raise error
        reason = f"{type(error).__name__}: {error}" if error else "it was cancelled"
        raise FacePoserError(
            f"The Dask cluster at {address} failed ({reason}); see the logs of its workers."
        ) from error


@contextmanager
def cluster_frames(reader: AlignedReader, scheduler: str, progress: Progress) -> Iterator[ClusteredFrames]:
    """Read all frames of ``reader`` into the memory of a Dask cluster's workers, yield them, and free the workers.

    Args:
        reader: Reader of files that have the same paths on every worker.
        scheduler: Address of the scheduler, such as "tcp://host:8786".
        progress: Progress to update.

    Raises:
        FacePoserError: If Dask is not installed, no scheduler or no worker answers, a worker lacks Face Poser, or a
            worker cannot read a frame.
    """
    with _client(scheduler, progress) as client:
        yield ClusteredFrames(client, reader, scheduler, progress)


@contextmanager
def cluster_map(scheduler: str, progress: Progress) -> Iterator[Callable[..., Iterator[Any]]]:
    """Yield a function like `map` that computes on the workers of a Dask cluster.

    Args:
        scheduler: Address of the scheduler, such as "tcp://host:8786".
        progress: Progress to update.

    Raises:
        FacePoserError: If Dask is not installed, no scheduler or no worker answers, or a worker lacks Face Poser.
    """
    with _client(scheduler, progress) as client:

        def mapped(function: Callable[..., Result], items: Sequence[Any]) -> Iterator[Result]:
            futures = [client.submit(function, item, pure=False) for item in items]
            try:
                for future in futures:
                    _wait_for(client, future, scheduler, progress)
                    yield future.result()
            finally:
                client.cancel(futures)

        yield mapped


@contextmanager
def _client(scheduler: str, progress: Progress) -> Iterator[Any]:
    """Connect to a Dask cluster with workers that have Face Poser."""
    try:
        from distributed import Client
    except ImportError as error:
        raise FacePoserError(
            "Training on a cluster needs Dask; install it with: pip install 'faceposer[cluster]'"
        ) from error
    _check_address(scheduler)
    progress.at("Connecting to the cluster")
    try:
        client: Any = Client(scheduler, timeout=_PATIENCE_S, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, ImportError) as error:
        raise _no_scheduler(scheduler) from error
    try:
        _check_workers(client, scheduler)
        yield client
    finally:
        client.close()


def _check_address(scheduler: str) -> None:
    """Raise ``FacePoserError`` for an address at which no scheduler can be.

    A client that was given one is never connected, and its thread would wait for that when it is removed.
    """
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    try:
        kind, place = parse_address(scheduler)
        get_backend(kind)
        host, port = parse_host_port(place)
        if not (host and 0 < port <= _LAST_PORT):
            raise ValueError(scheduler)
    except (ValueError, ImportError) as error:
        raise _no_scheduler(scheduler) from error


def _no_scheduler(scheduler: str) -> FacePoserError:
    return FacePoserError(
        f"No Dask scheduler answers at '{scheduler}'; start one with 'dask scheduler', and use the address that it "
        "prints, such as tcp://host:8786."
    )


def _check_workers(client: Any, scheduler: str) -> None:
    """Raise ``FacePoserError`` if the cluster has no workers, or a worker lacks Face Poser."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE_S)
    except TimeoutError:
        raise FacePoserError(
            f"The Dask scheduler at '{scheduler}' has no workers; start some with: dask worker {scheduler}"
        ) from None
    for worker, installed in client.run(_probe()).items():
        if not installed:
            raise FacePoserError(f"The Dask worker {worker} does not have Face Poser; install the same version on it.")


def _probe() -> Callable[[], bool]:
    # A nested function is pickled by value, so that it also runs on workers without Face Poser.
    def has_program() -> bool:
        try:
            import faceposer.training.frames  # noqa: F401
        except ImportError:
            return False
        return True

    return has_program


def _read(reader: AlignedReader, first: int, stop: int) -> Frames:
    """Read a chunk of frames on a worker; a file missing there is reported with the worker's address."""
    for source in reader.sequence.sources_of(range(first, stop)):
        if not os.access(source.path, os.R_OK):
            raise FacePoserError(
                f"'{source.path}' cannot be read on the Dask worker {_worker_address()}; all workers need the files "
                "under the same path as on this machine, such as on a shared disk."
            )
    return reader.read(first, stop)


def _worker_address() -> str:
    from distributed import get_worker

    return str(get_worker().address)
