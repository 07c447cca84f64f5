"""Caches limited by memory: of their results, and of what their results were computed from.

A limit by the number of results alone admits gigabytes of large ones, and keeps large arguments alive, such as models
of faces that are no longer open.
"""

import threading
import weakref
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, Generic, TypeVar, TypeVarTuple

A = TypeVarTuple("A")
First = TypeVar("First")
R = TypeVar("R")


class SizedCache(Generic[*A, R]):
    """A function of hashable arguments whose results are cached; those that were not used for longest go first.

    Like ``functools.lru_cache``, it may be called from several threads.

    Attributes:
        bytes: Memory of the cached results and of what only they keep alive.
    """

    def __init__(
        self,
        function: Callable[[*A], R],
        size: Callable[[R, *A], int],
        max_bytes: int,
        max_results: int,
        weak: bool = False,
    ) -> None:
        """Cache the results of a function.

        Args:
            function: Computes a result.
            size: Returns the bytes of a result, from the result and the arguments.
            max_bytes: Largest memory of all results together. A larger single result is not cached.
            max_results: Largest number of results.
            weak: The cache does not keep the first argument alive; its results, which must not refer to it, are
                discarded some time after it.
        """
        self._function, self._size, self._weak = function, size, weak
        self._max_bytes, self._max_results = max_bytes, max_results
        self._results: OrderedDict[tuple[Any, ...], tuple[tuple[Any, ...], R, int]] = OrderedDict()
        self._lock = threading.Lock()
        self.bytes = 0

    def __call__(self, *args: *A) -> R:
        """Return the function's result for the arguments."""
        key = self._key(args)
        with self._lock:
            cached = self._results.get(key)
            if cached is not None:
                # The stored key is found by its identity, without comparing large arguments once more.
                self._results.move_to_end(cached[0])
                return cached[1]
        result = self._function(*args)
        size = self._size(result, *args)
        if size <= self._max_bytes:
            with self._lock:
                if self._weak:
                    for dead in [each for each in self._results if each[0]() is None]:
                        self.bytes -= self._results.pop(dead)[2]
                if key not in self._results:
                    self._results[key] = (key, result, size)
                    self.bytes += size
                while self.bytes > self._max_bytes or len(self._results) > self._max_results:
                    self.bytes -= self._results.popitem(last=False)[1][2]
        return result

    def _key(self, args: tuple[Any, ...]) -> tuple[Any, ...]:
        return (weakref.ref(args[0]), *args[1:]) if self._weak else args

    def __len__(self) -> int:
        return len(self._results)

    def cache_clear(self) -> None:
        """Discard all results."""
        with self._lock:
            self._results.clear()
            self.bytes = 0


def sized_cache(
    size: Callable[[R, *A], int], max_bytes: int, max_results: int, weak: bool = False
) -> Callable[[Callable[[*A], R]], SizedCache[*A, R]]:
    """Return a decorator that caches the results of a function; see ``SizedCache``."""
    return lambda function: SizedCache(function, size, max_bytes, max_results, weak)


def weak_cache(max_results: int) -> Callable[[Callable[[First, *A], R]], SizedCache[First, *A, R]]:
    """Return a decorator that caches small results of a function without keeping its first argument alive."""
    return lambda function: SizedCache(function, lambda *_: 0, 1, max_results, weak=True)


def without_owner(method: Callable[[*A], R]) -> Callable[[*A], R]:
    """Return a bound ``method`` without a reference to its object, for a cache that the object itself keeps.

    With the reference, the object and its memory would remain until the garbage collector finds the circle.
    """
    weak = weakref.WeakMethod(method)

    def call(*args: *A) -> R:
        bound = weak()
        assert bound is not None
        return bound(*args)

    return call
