"""Table rows of trial scores, with bootstrap intervals."""

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

#: Number of bootstrap resamples of the trials of a cell.
RESAMPLES = 2000
_INTERVAL = (2.5, 97.5)


# Key of a trial: the index of its group (the performer left out, if there are several), its seed and its number.
_Key = tuple[int, int, int]


def rows_of(scores: Scores, plan: Plan) -> list[Row]:
    """Return a row for each method and cell of ``plan`` with ``scores``, in the order of the plan."""
    return pooled_rows_of([scores], plan)


def pooled_rows_of(groups: Sequence[Scores], plan: Plan) -> list[Row]:
    """Return the same for several ``groups`` of trials together; the bootstrap is stratified by group."""
    rows = []
    for cell in plan.cells:
        by_method = {method: scores for method in plan.methods if (scores := _scores(groups, plan, method, cell))}
        of_cell = [_row(method, cell, scores, plan.seeds) for method, scores in by_method.items()]
        if of_cell:
            lowest = min(of_cell, key=lambda row: row["error_3d_relative"])["method"]
            for row in of_cell:
                row.update(_difference(cell, by_method[row["method"]], by_method[lowest], row["method"] == lowest))
        rows += of_cell
    return rows


def _scores(groups: Sequence[Scores], plan: Plan, method: str, cell: Cell) -> dict[_Key, Score]:
    """Return the scores of ``method`` in ``cell`` that the plan includes."""
    count = plan.n_trials(method, cell)
    return {
        (group, seed, number): score
        for group, scores in enumerate(groups)
        for seed in plan.seeds
        for number, score in sorted(scores.get((method, cell, seed), {}).items())
        if number < count
    }


def _row(method: str, cell: Cell, by_trial: Mapping[_Key, Score], seeds: Sequence[int]) -> Row:
    scores = list(by_trial.values())
    errors, neutral = _errors(scores)
    n = len(scores)
    draws = _resamples(cell, _sizes(by_trial))
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


def _regional(pairs: Sequence[tuple[float, float]]) -> Row:
    errors, neutral = np.array(pairs).T
    return {
        "error_3d": _rounded(errors.mean(), 5),
        "error_3d_relative": _rounded(errors.mean() / max(float(neutral.mean()), 1e-12), 4),
    }


def _difference(cell: Cell, scores: Mapping[_Key, Score], best: Mapping[_Key, Score], is_best: bool) -> Row:
    """Return the difference between a method's relative error and that of the ``best``, over their common trials."""
    common = [key for key in scores if key in best]
    if is_best or not common:
        return {"lowest": is_best, "behind": 0.0 if is_best else None, "behind_ci95": None, "within": is_best}
    errors, neutral = _errors([scores[key] for key in common])
    lowest, _ = _errors([best[key] for key in common])
    draws = _resamples(cell, _sizes(common))
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
    """Return the number of trials of each group that has any, in the order of the groups."""
    return tuple(Counter(group for group, _, _ in keys).values())


@lru_cache(maxsize=4)
def _resamples(cell: Cell, sizes: tuple[int, ...]) -> Array:
    """Return the multiplicity of each trial in each resample, shape (RESAMPLES, n), equal for all methods of ``cell``.

    Each group is resampled to its size, one of ``sizes``, n being their sum.
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
    """Return the interval of the median between two of the ``ordered`` values, by binomial ranks."""
    n = len(ordered)
    half_width = 1.96 * np.sqrt(n) / 2.0
    low, high = int(max(np.floor(n / 2.0 - half_width), 0)), int(min(np.ceil(n / 2.0 + half_width), n - 1))
    return [_rounded(ordered[low], 3), _rounded(ordered[high], 3)]


def _rounded(value: float | np.floating[Any], digits: int) -> float:
    return round(float(value), digits)


def csv_of(rows: Sequence[Row]) -> str:
    """Return ``rows`` as CSV, with one number per column: bounds of intervals and regions have separate columns."""
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
