"""A cache by memory keeps what was used last, as much of it as was allowed."""

import weakref

import numpy as np

from faceposer.sized_cache import SizedCache, sized_cache, weak_cache


def numbers(count: int) -> SizedCache[int, np.ndarray]:
    return SizedCache(lambda n: np.full(n, float(n)), lambda array, _: array.nbytes, 8 * count, 4)


def test_results_are_computed_once() -> None:
    calls = []

    @sized_cache(lambda _, text, times: len(text) * times, 100, 10)
    def repeated(text: str, times: int) -> str:
        calls.append((text, times))
        return text * times

    assert [repeated("ab", 2), repeated("ab", 2), repeated("ab", 3)] == ["abab", "abab", "ababab"]
    assert calls == [("ab", 2), ("ab", 3)]
    assert repeated.bytes == 4 + 6
    repeated.cache_clear()
    assert (len(repeated), repeated.bytes) == (0, 0)
    assert repeated("ab", 2) == "abab"
    assert len(calls) == 3


def test_the_memory_is_limited_and_what_was_used_last_stays() -> None:
    cached = numbers(100)
    first = cached(40)
    cached(50)
    assert cached(40) is first
    cached(45)
    assert cached.bytes == 8 * (40 + 45)
    assert cached(40) is first


def test_the_number_of_results_is_limited() -> None:
    cached = numbers(100)
    for n in range(10):
        cached(n)
    assert len(cached) == 4
    assert cached.bytes == 8 * (6 + 7 + 8 + 9)


def test_a_result_that_is_too_large_discards_no_other() -> None:
    cached = numbers(100)
    first = cached(60)
    assert len(cached(101)) == 101
    assert cached(60) is first
    assert cached.bytes == 8 * 60


class _Large:
    """Something that takes much memory."""


def test_a_weak_cache_keeps_no_argument_alive() -> None:
    calls = []

    @weak_cache(8)
    def numbered(large: _Large, number: int) -> int:
        calls.append(number)
        return number + 1

    one, other = _Large(), _Large()
    assert [numbered(one, 1), numbered(one, 1), numbered(other, 1), numbered(one, 2)] == [2, 2, 2, 3]
    assert calls == [1, 1, 2]
    gone = weakref.ref(one)
    del one
    assert gone() is None
    assert numbered(other, 3) == 4
    assert len(numbered) == 2, "results of what is gone are discarded"


def test_a_weak_cache_does_not_confuse_arguments() -> None:
    cached = SizedCache(lambda large, n: (id(large), n), lambda *_: 1, 100, 100, weak=True)
    kept = [_Large() for _ in range(50)]
    assert all(cached(large, 0) == (id(large), 0) for _ in range(2) for large in kept)
    assert cached.bytes == 50
    del kept[10:]
    cached(_Large(), 1)
    assert (len(cached), cached.bytes) == (11, 11)
