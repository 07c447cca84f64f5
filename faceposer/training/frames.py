"""Example meshes as displacements from the neutral face, without head motion, in out-of-core stores.

Training needs only sums over frames. A store applies a function to all chunks of frames; the chunks may be in a local
file or in the memory of several machines.
"""

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import rigid_alignment
from faceposer.geometry.mesh_sequence import MeshSequence
from faceposer.progress import Progress

Array = NDArray[np.float64]
Frames = NDArray[np.float32]
Result = TypeVar("Result")

#: Share of the vertices used for alignment: those that move least.
STEADY_SHARE = 0.3
#: Largest number of frames in the sample that determines motion and regions, small enough for any memory.
SAMPLE_FRAMES = 192
_SAMPLE_BYTES = 64 * 2**20
# Largest number of these frames that determine the vertices that move least.
_STEADY_FRAMES = 48
_CHUNK_BYTES = 24 * 2**20
_ROUNDS = 12
# Amount of numbers below which starting processes takes longer than reading the files.
_WORTH_PROCESSES = 6_000_000


@dataclass(frozen=True, eq=False)
class AlignedReader:
    """Reader of a sequence's frames as displacements, which can be pickled for other processes and machines.

    Attributes:
        sequence: The sequence of frames.
        steady: Ids of the vertices by which frames are aligned with the neutral.
    """

    sequence: MeshSequence
    steady: NDArray[np.intp]

    def read(self, first: int, stop: int) -> Frames:
        """Return the displacements of all vertices in the frames from ``first`` to before ``stop``, (n, N, 3).

        Raises:
            FacePoserError: If a frame cannot be read or aligned.
        """
        frames = np.empty((stop - first, len(self.sequence.neutral.vertices), 3), dtype=np.float32)
        for i, frame in enumerate(self.each(range(first, stop))):
            frames[i] = frame
        return frames

    def each(self, numbers: Sequence[int]) -> Iterator[Frames]:
        """Yield the displacements of all vertices, (N, 3), in the frames ``numbers``, given in ascending order.

        Each frame is aligned with the neutral face by the vertices that move least (Lau et al. 2009, section 3.1).

        Raises:
            FacePoserError: If a frame cannot be read or aligned.
        """
        neutral = self.sequence.neutral.vertices
        for number, vertices in zip(numbers, self.sequence.pick(numbers), strict=True):
            try:
                alignment = rigid_alignment(vertices[self.steady], neutral[self.steady])
            except ValueError as error:
                name = self.sequence.name_of(number)
                raise FacePoserError(f"The neutral face and {name} cannot be aligned: {error}.") from error
            yield (alignment.apply(vertices) - neutral).astype(np.float32)


class FrameStore(Protocol):
    """Displacements of all examples, in chunks of frames."""

    n_frames: int
    n_vertices: int

    def run(self, function: Callable[..., Result], *arguments: Any) -> Iterator[Result]:
        """Yield ``function(chunk, *arguments)`` of each chunk, (n, N, 3), in order; both must be picklable."""
        ...

    def total(self, function: Callable[..., list[Array]], *arguments: Any) -> list[Array]:
        """Return the sum over all chunks of the arrays ``function(chunk, *arguments)``."""
        ...


class SpooledFrames:
    """Displacements in a temporary file of single precision, read in chunks by two threads."""

    def __init__(self, path: Path, n_frames: int, n_vertices: int, progress: Progress) -> None:
        self.n_frames, self.n_vertices = n_frames, n_vertices
        self._path, self._progress = path, progress

    def run(self, function: Callable[..., Result], *arguments: Any) -> Iterator[Result]:
        """Yield ``function(chunk, *arguments)`` of each chunk, (n, N, 3), in order."""
        chunks = chunk_ranges(self.n_frames, self.n_vertices)

        def work(bounds: tuple[int, int]) -> Result:
            return function(self.read(*bounds), *arguments)

        # Two chunks at a time: NumPy releases the interpreter lock during multiplications.
        with ThreadPoolExecutor(2) as pool:
            for i, result in enumerate(_in_order(pool, work, chunks)):
                self._progress.at("Principal components", (i + 1) / len(chunks))
                yield result

    def total(self, function: Callable[..., list[Array]], *arguments: Any) -> list[Array]:
        """Return the sum over all chunks of the arrays ``function(chunk, *arguments)``."""
        return sum_of(self.run(function, *arguments))

    def read(self, first: int, stop: int) -> Frames:
        """Return the frames from ``first`` to before ``stop``, shape (n, N, 3)."""
        width = 3 * self.n_vertices
        data = np.fromfile(self._path, dtype=np.float32, count=(stop - first) * width, offset=4 * first * width)
        return data.reshape(-1, self.n_vertices, 3)


def chunk_ranges(n_frames: int, n_vertices: int) -> list[tuple[int, int]]:
    """Return the first frame and the one after the last of each chunk."""
    size = max(1, _CHUNK_BYTES // (12 * n_vertices))
    return [(first, min(first + size, n_frames)) for first in range(0, n_frames, size)]


def sum_of(results: Iterable[list[Array]]) -> list[Array]:
    """Return the elementwise sums of lists of arrays; the iterable is consumed."""
    total: list[Array] = []
    for arrays in results:
        if not total:
            total = [np.array(array, dtype=np.float64) for array in arrays]
        else:
            for i, array in enumerate(arrays):
                total[i] += array
    return total


def sample_of(sequence: MeshSequence, progress: Progress, most: int = SAMPLE_FRAMES) -> tuple[list[int], Frames]:
    """Return the numbers of evenly spaced frames, and their unaligned vertices, shape (n, N, 3).

    There are at most ``most``, and fewer for a large mesh. Each frame is centred at the origin, to preserve accuracy in
    single precision.
    """
    n_vertices = len(sequence.neutral.vertices)
    count = min(most, len(sequence), max(2, _SAMPLE_BYTES // (12 * n_vertices)))
    chosen = np.unique(np.linspace(0, len(sequence) - 1, count).round().astype(int)).tolist()
    frames = np.empty((len(chosen), n_vertices, 3), dtype=np.float32)
    for i, frame in enumerate(sequence.pick(chosen)):
        progress.at("Reading a sample of the meshes", i / len(chosen))
        frames[i] = frame - frame.mean(axis=0)
    return chosen, frames


def steady_vertices(sample: Frames, neutral: Array) -> NDArray[np.intp]:
    """Return the ids of the vertices that move least after head motion is removed.

    Frames are aligned with the neutral by all vertices, then repeatedly by those that moved least.

    Args:
        sample: Frames, shape (n, N, 3).
        neutral: Neutral vertices, shape (N, 3).

    Raises:
        ValueError: If the vertices do not determine an alignment.
    """
    sample = sample[:: max(1, len(sample) // _STEADY_FRAMES)]
    count = max(3, round(STEADY_SHARE * len(neutral)))
    steady = np.arange(len(neutral))
    for _ in range(_ROUNDS):
        residual = np.zeros(len(neutral))
        for frame in sample:
            moved = rigid_alignment(frame[steady], neutral[steady]).apply(frame) - neutral
            residual += np.einsum("nd,nd->n", moved, moved)
        calmest = np.sort(np.argsort(residual, kind="stable")[:count])
        if np.array_equal(calmest, steady):
            break
        steady = calmest
    return steady


@contextmanager
def spool_frames(reader: AlignedReader, progress: Progress) -> Iterator[SpooledFrames]:
    """Write all frames of ``reader`` to a temporary file, yield them, and delete the file afterwards.

    Raises:
        FacePoserError: If a frame cannot be read, or the disk is full.
    """
    count, width = len(reader.sequence), len(reader.sequence.neutral.vertices)
    try:
        with tempfile.TemporaryDirectory(prefix="faceposer-") as folder:
            # A sparse file is created even on a full disk: check the space before the work begins.
            if shutil.disk_usage(folder).free < 12 * count * width:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            path = Path(folder) / "frames"
            with path.open("wb") as file:
                file.truncate(12 * count * width)
            # Compressed data must be unpacked from the beginning: split it between two workers only.
            chunks = _halves(count) if reader.sequence.compressed else chunk_ranges(count, width)
            with _workers(3 * count * width) as pool:
                jobs = ((reader, path, first, stop) for first, stop in chunks)
                for i, _ in enumerate(_in_order(pool, _spool_chunk, jobs)):
                    progress.at("Reading and aligning", (i + 1) / len(chunks))
            yield SpooledFrames(path, count, width, progress)
    except BrokenExecutor as error:
        raise FacePoserError(
            "A process that read the meshes was terminated by the system, probably for lack of memory; close other "
            "programs, or train on a cluster with --scheduler."
        ) from error
    except OSError as error:
        raise FacePoserError(
            f"The meshes cannot be copied to '{tempfile.gettempdir()}' ({error.strerror}); make "
            f"{12 * count * width / 1e9:.1f} GB free there, or set TMPDIR to another folder."
        ) from error


def _spool_chunk(job: tuple[AlignedReader, Path, int, int]) -> None:
    reader, path, first, stop = job
    with path.open("r+b") as file:
        file.seek(first * 12 * len(reader.sequence.neutral.vertices))
        for frame in reader.each(range(first, stop)):
            file.write(frame.tobytes())


def _halves(count: int) -> list[tuple[int, int]]:
    return [(first, stop) for first, stop in ((0, count // 2), (count // 2, count)) if first < stop]


def _workers(numbers: int) -> Executor:
    if numbers < _WORTH_PROCESSES or (os.cpu_count() or 1) < 2:
        return ThreadPoolExecutor(1)
    return ProcessPoolExecutor(min(os.cpu_count() or 1, 8), mp_context=get_context("spawn"))


def _in_order(pool: Executor, function: Callable[[Any], Result], jobs: Any) -> Iterator[Result]:
    """Yield results in order, with only a few jobs submitted ahead to limit memory."""
    waiting = []
    try:
        for job in jobs:
            waiting.append(pool.submit(function, job))
            if len(waiting) > 3:
                yield waiting.pop(0).result()
        while waiting:
            yield waiting.pop(0).result()
    finally:
        for future in waiting:
            future.cancel()
