"""A cache limited by the memory of its results: a limit by their number alone admits gigabytes of large ones."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar, TypeVarTuple

A = TypeVarTuple("A")
R = TypeVar("R")


class SizedCache(Generic[*A, R]):
    """A function of hashable arguments whose results are cached; those that were not used for longest go first.

    Like ``functools.lru_cache``, it may be called from several threads.

    Attributes:
        bytes: Memory of the cached results and of what only they keep alive.
    """

    def __init__(
        self, function: Callable[[*A], R], size: Callable[[R, *A], int], max_bytes: int, max_results: int
    ) -> None:
        """Cache the results of a function.

        Args:
            function: Computes a result.
            size: Returns the bytes of a result, from the result and the arguments.
            max_bytes: Largest memory of all results together. A larger single result is not cached.
            max_results: Largest number of results.
        """
        self._function, self._size = function, size
        self._max_bytes, self._max_results = max_bytes, max_results
        self._results: OrderedDict[Hashable, tuple[Hashable, R, int]] = OrderedDict()
        self._lock = threading.Lock()
        self.bytes = 0

    def __call__(self, *args: *A) -> R:
        """Return the function's result for the arguments."""
        with self._lock:
            cached = self._results.get(args)
            if cached is not None:
                # The stored key is found by its identity, without comparing large arguments once more.
                self._results.move_to_end(cached[0])
                return cached[1]
        result = self._function(*args)
        size = self._size(result, *args)
        if size <= self._max_bytes:
            with self._lock:
                if args not in self._results:
                    self._results[args] = (args, result, size)
                    self.bytes += size
                while self.bytes > self._max_bytes or len(self._results) > self._max_results:
                    self.bytes -= self._results.popitem(last=False)[1][2]
        return result

    def __len__(self) -> int:
        return len(self._results)

    def cache_clear(self) -> None:
        """Discard all results."""
        with self._lock:
            self._results.clear()
            self.bytes = 0


def sized_cache(
    size: Callable[[R, *A], int], max_bytes: int, max_results: int
) -> Callable[[Callable[[*A], R]], SizedCache[*A, R]]:
    """Return a decorator that caches the results of a function; see ``SizedCache``."""
    return lambda function: SizedCache(function, size, max_bytes, max_results)
