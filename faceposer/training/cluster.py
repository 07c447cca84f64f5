"""Example meshes in the memory of many machines: a store of frames on a Dask cluster, an optional extra.

Each worker reads and aligns some chunks of frames and keeps them. What is learned goes to the data: a pass sends the
bases to every worker once, and of what the chunks give only one sum comes back.
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
# So many sums are added at a time on the way to one.
_FAN_IN = 8
_POLL_S = 0.5


class ClusteredFrames:
    """Displacements in the memory of a cluster's workers, chunk by chunk.

    What is lost with a worker is read again by another.
    """

    def __init__(self, client: Any, reader: AlignedReader, address: str, progress: Progress) -> None:
        self.n_frames, self.n_vertices = len(reader.sequence), len(reader.sequence.neutral.vertices)
        self._client, self._progress, self._address = client, progress, address
        chunks = chunk_ranges(self.n_frames, self.n_vertices)
        # Workers have working folders of their own.
        absolute = replace(reader, sequence=reader.sequence.absolute())
        (shared,) = client.scatter([absolute], broadcast=True, hash=False)
        self._chunks = [client.submit(_read, shared, first, stop, pure=False) for first, stop in chunks]
        # Errors of reading show here, and no pass begins before all is read.
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
        """Return the sum over all chunks of the arrays that ``function(chunk, *arguments)`` gives, added up there."""
        # Only sums are asked for: the workers drop each chunk's own result as soon as it is added.
        level = self._added(self._submit(function, arguments))
        wanted = list(level)
        try:
            while len(level) > 1:
                level = self._added(level)
                wanted += level
            for i, future in enumerate(wanted):
                self._wait_for(future)
                self._progress.at("Principal components", (i + 1) / len(wanted))
            result: list[Array] = level[0].result()
            return result
        finally:
            self._client.cancel(wanted)

    def _added(self, level: list[Any]) -> list[Any]:
        groups = [level[i : i + _FAN_IN] for i in range(0, len(level), _FAN_IN)]
        return [self._client.submit(sum_of, group, pure=False) for group in groups]

    def _submit(self, function: Callable[..., Any], arguments: Sequence[Any]) -> list[Any]:
        sent = self._client.scatter(list(arguments), broadcast=True, hash=False) if arguments else []
        return [self._client.submit(function, chunk, *sent, pure=False) for chunk in self._chunks]

    def _wait_for(self, future: Any) -> None:
        """Wait until ``future`` is done, and say now and then that it is not, so that the user can stop.

        Raises:
            FacePoserError: If it failed.
        """
        while not future.done():
            try:
                future.exception(timeout=_POLL_S)
            except TimeoutError:
                self._progress.at("Waiting for the cluster")
                if self._client.status != "running" or not self._client.scheduler_info(n_workers=1)["workers"]:
                    raise FacePoserError(
                        f"The workers of the Dask scheduler at {self._address} are gone; start them again."
                    ) from None
        if future.status != "finished":
            error = future.exception() if future.status == "error" else None
            if isinstance(error, FacePoserError):
                raise error
            reason = f"{type(error).__name__}: {error}" if error else "it was cancelled"
            raise FacePoserError(
                f"The Dask cluster at {self._address} could not do its part ({reason}); see its workers' logs."
            ) from error


@contextmanager
def clustered(reader: AlignedReader, scheduler: str, progress: Progress) -> Iterator[ClusteredFrames]:
    """Have the workers of a Dask cluster read all frames of ``reader``, and yield them; free the workers afterwards.

    Args:
        reader: Whose files must lie under the same paths on every worker.
        scheduler: Address, such as "tcp://host:8786".
        progress: Told how far it is.

    Raises:
        FacePoserError: If there is no Dask here, nothing or no worker at the address, no Face Poser on a worker, or a
            frame that a worker cannot read.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise FacePoserError(
            "Learning on a cluster needs Dask; install it with: pip install 'faceposer[cluster]'"
        ) from error
    progress.at("Looking for the cluster")
    try:
        client: Any = Client(scheduler, timeout=_PATIENCE_S, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, ImportError) as error:
        raise FacePoserError(
            f"No Dask scheduler answers at '{scheduler}'; start one with 'dask scheduler', and give the address that "
            "it prints, such as tcp://host:8786."
        ) from error
    try:
        _check_workers(client, scheduler)
        yield ClusteredFrames(client, reader, scheduler, progress)
    finally:
        client.close()


def _check_workers(client: Any, scheduler: str) -> None:
    """Refuse a cluster without workers, or with some that lack this program."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE_S)
    except TimeoutError:
        raise FacePoserError(
            f"The Dask scheduler at '{scheduler}' has no workers; start some with: dask worker {scheduler}"
        ) from None
    for worker, there in client.run(_probe()).items():
        if not there:
            raise FacePoserError(
                f"The Dask worker {worker} lacks Face Poser; install it there in the version that is here."
            )


def _probe() -> Callable[[], bool]:
    # A function inside another is sent as it is; by name it could not even be called where the program is missing.
    def has_program() -> bool:
        try:
            import faceposer.training.frames  # noqa: F401
        except ImportError:
            return False
        return True

    return has_program


def _read(reader: AlignedReader, first: int, stop: int) -> Frames:
    """Return a chunk of frames, on a worker, where a missing file has a meaning of its own."""
    for source in reader.sequence.sources_of(range(first, stop)):
        if not os.access(source.path, os.R_OK):
            raise FacePoserError(
                f"'{source.path}' cannot be read on the Dask worker {_own_address()}; all workers must see the files "
                "under the same path as here, such as on a shared disk."
            )
    return reader.read(first, stop)


def _own_address() -> str:
    from distributed import get_worker

    return str(get_worker().address)
