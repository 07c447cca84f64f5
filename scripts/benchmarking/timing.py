"""Times of calls, as rows of a table."""

import time
from collections.abc import Callable

import numpy as np

Row = dict[str, object]


def elapsed(action: Callable[[], object]) -> float:
    """Return the time of ``action`` in milliseconds."""
    began = time.perf_counter()
    action()
    return (time.perf_counter() - began) * 1e3


def milliseconds(action: Callable[[], object], repeats: int) -> list[float]:
    """Return the time of each of ``repeats`` calls, after a warm-up call."""
    action()
    return [elapsed(action) for _ in range(repeats)]


def row(name: str, times: list[float], evaluations: list[int] | None = None) -> Row:
    """Return one row of the result, with the median of ``evaluations`` (of the energy, one count per time) if given."""
    data: Row = {
        "name": name,
        "count": len(times),
        "median_ms": round(float(np.median(times)), 4),
        "p99_ms": round(float(np.percentile(times, 99)), 4),
    }
    return data | {"evaluations": float(np.median(evaluations))} if evaluations else data
