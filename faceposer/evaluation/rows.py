"""From scores of trials to rows of a table, with intervals by bootstrap."""

import csv
import io
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.measures import Score
from faceposer.evaluation.plan import Plan
from faceposer.evaluation.trial_log import Scores
from faceposer.evaluation.trials import FACE_REGIONS, Cell

Array = NDArray[np.float64]
Row = dict[str, Any]

#: Times that the trials of a cell are drawn anew, with replacement.
RESAMPLES = 2000
_INTERVAL = (2.5, 97.5)


# A trial: the number of its group (the performer left out, where there are several), its seed and its number.
_Key = tuple[int, int, int]


def rows_of(scores: Scores, plan: Plan) -> list[Row]:
    """Return a row for each method and cell of ``plan`` that has ``scores``, in the order of the plan."""
    return pooled_rows_of([scores], plan)


def pooled_rows_of(groups: Sequence[Scores], plan: Plan) -> list[Row]:
    """Return the same over several ``groups`` of trials together, each drawn anew by itself for the intervals."""
    rows = []
    for cell in plan.cells:
        of_cell = {method: taken for method in plan.methods if (taken := _of(groups, plan, method, cell))}
        found = [_row(method, cell, taken, plan.seeds) for method, taken in of_cell.items()]
        if found:
            lowest = min(found, key=lambda row: row["error_3d_relative"])["method"]
            for row in found:
                row.update(_behind(cell, of_cell[row["method"]], of_cell[lowest], row["method"] == lowest))
        rows += found
    return rows


def _of(groups: Sequence[Scores], plan: Plan, method: str, cell: Cell) -> dict[_Key, Score]:
    """Return the scores of ``method`` by group, seed and number of the trial, those that the plan asks for."""
    wanted = plan.wanted(method, cell)
    return {
        (group, seed, number): score
        for group, scores in enumerate(groups)
        for seed in plan.seeds
        for number, score in sorted(scores.get((method, cell, seed), {}).items())
        if number < wanted
    }


def _row(method: str, cell: Cell, taken: Mapping[_Key, Score], seeds: Sequence[int]) -> Row:
    scores = list(taken.values())
    errors, neutral = _errors(scores)
    n = len(scores)
    draws = _draws(cell, _sizes(taken))
    row: Row = {"method": method, "constraint": cell.constraint, "count": cell.count, "noise_px": cell.noise_px}
    if cell.region is not None:
        row["region"] = cell.region
    times = np.sort([score.ms for score in scores])
    pixels = np.array([score.error_2d_px for score in scores])
    row |= {
        "poses": n,
        "seeds": list(seeds),
        "error_3d": _rounded(errors.mean(), 5),
        "error_3d_relative": _rounded(errors.mean() / neutral.mean(), 4),
        "ci95": _interval((draws @ errors) / (draws @ neutral)),
        "worse_than_neutral": _rounded(float((errors > neutral).mean()), 4),
        "error_2d_px": _rounded(pixels.mean(), 4),
        "error_2d_ci95": _interval(draws @ pixels / n),
        "to_real": _rounded(np.mean([score.to_real for score in scores]), 5),
        "log_likelihood": _rounded(np.mean([score.log_likelihood for score in scores]), 4),
        "ms": _rounded(float(np.median(times)), 3),
        "ms_ci95": _median_interval(times),
        "error_3d_by_region": {
            name: _regional([score.by_region[name] for score in scores]) for name in scores[0].by_region
        },
    }
    return row


def _regional(both: Sequence[tuple[float, float]]) -> Row:
    errors, neutral = np.array(both).T
    return {
        "error_3d": _rounded(errors.mean(), 5),
        "error_3d_relative": _rounded(errors.mean() / max(float(neutral.mean()), 1e-12), 4),
    }


def _behind(cell: Cell, of: Mapping[_Key, Score], best: Mapping[_Key, Score], is_best: bool) -> Row:
    """Return how far a method's relative error is behind that of the ``best``, over the trials that both have done."""
    common = [key for key in of if key in best]
    if is_best or not common:
        return {"lowest": is_best, "behind": 0.0 if is_best else None, "behind_ci95": None, "within": is_best}
    errors, neutral = _errors([of[key] for key in common])
    lowest, _ = _errors([best[key] for key in common])
    draws = _draws(cell, _sizes(common))
    differences = (draws @ (errors - lowest)) / (draws @ neutral)
    interval = _interval(differences)
    return {
        "lowest": False,
        "behind": _rounded((errors - lowest).mean() / neutral.mean(), 4),
        "behind_ci95": interval,
        "within": interval[0] <= 0.0,
    }


def _errors(scores: Sequence[Score]) -> tuple[Array, Array]:
    return np.array([score.error for score in scores]), np.array([score.neutral_error for score in scores])


def _sizes(keys: Iterable[_Key]) -> tuple[int, ...]:
    """Return the number of trials of each group that has some, in the order of the groups."""
    return tuple(Counter(group for group, _, _ in keys).values())


@lru_cache(maxsize=4)
def _draws(cell: Cell, sizes: tuple[int, ...]) -> Array:
    """Return how often each trial is drawn, shape (RESAMPLES, n): the same for all methods of a ``cell``.

    Of each group as many trials are drawn as it has: ``sizes``, n of them together.
    """
    parts = []
    for group, n in enumerate(sizes):
        seed = [zlib.crc32(repr(cell).encode()), n] + [group] * (group > 0)
        parts.append(np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), size=RESAMPLES))
    return np.hstack(parts).astype(np.float64)


def _interval(values: Array) -> list[float]:
    low, high = np.percentile(values, _INTERVAL)
    return [_rounded(low, 4), _rounded(high, 4)]


def _median_interval(ordered: Array) -> list[float]:
    """Return the interval of the median between two of the ``ordered`` values, by their binomial ranks."""
    n = len(ordered)
    reach = 1.96 * np.sqrt(n) / 2.0
    low, high = int(max(np.floor(n / 2.0 - reach), 0)), int(min(np.ceil(n / 2.0 + reach), n - 1))
    return [_rounded(ordered[low], 3), _rounded(ordered[high], 3)]


def _rounded(value: float | np.floating[Any], digits: int) -> float:
    return round(float(value), digits)


def csv_of(rows: Sequence[Row]) -> str:
    """Return ``rows`` as CSV, one column a number: ends of intervals and regions have columns of their own."""
    regions = [name for name in FACE_REGIONS if any(name in row["error_3d_by_region"] for row in rows)]
    flat = [_flat(row, regions) for row in rows]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(flat[0]) if flat else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue()


def _flat(row: Row, regions: Sequence[str]) -> Row:
    flat: Row = {}
    for name in (
        *("performer",) * ("performer" in row),
        "method",
        "constraint",
        "count",
        "noise_px",
        "region",
        "poses",
    ):
        flat[name] = row.get(name, "")
    for name, value in row.items():
        if name.endswith("ci95"):
            flat[f"{name}_low"], flat[f"{name}_high"] = value or ("", "")
        elif name == "seeds":
            flat[name] = " ".join(map(str, value))
        elif name != "error_3d_by_region":
            flat[name] = "" if value is None else value
    for region in regions:
        of_region = row["error_3d_by_region"].get(region, {})
        for name in ("error_3d", "error_3d_relative"):
            flat[f"{name}_{region}"] = of_region.get(name, "")
    return flat
