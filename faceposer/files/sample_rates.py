"""Frame rates from the times of samples, which may be rounded, jittered, incomplete, or keys rather than frames."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Frames per second where a file does not tell.
USUAL_RATE = 30.0
#: Rates of cameras and programs; a rate that was measured is taken for the nearest of them within its uncertainty.
KNOWN_RATES = (
    *(1.0, 2.0, 5.0, 10.0, 12.0, 15.0, 20.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 72.0, 75.0, 90.0, 100.0, 120.0),
    *(144.0, 150.0, 200.0, 240.0, 250.0, 300.0, 500.0, 1000.0),
    *(24000 / 1001, 30000 / 1001, 60000 / 1001, 120000 / 1001, 12.5),
)
#: Samples per second below which even samples are keys of an animation rather than frames.
SLOWEST_TAKE = 3.0
# Rates at which keys are sampled, if all of them are on frames.
_KEY_RATES = (30.0, 24.0, 25.0, 60.0, 50.0, 30000 / 1001, 24000 / 1001, 48.0, 60000 / 1001, 120.0)
# Seconds by which a key may be off a frame, as 32 bit numbers and three decimals are.
_OFF_FRAME = 6e-4
# Relative uncertainty of the clocks of devices, the largest uncertainty of rounded times, and that of mean rates.
_CLOCK, _ROUNDED, _ROUGH = 4e-4, 0.02, 0.05
# Frames by which a sample may be off its place in an even sequence: in few samples, in many, and with rounded times.
_EVEN_FEW, _EVEN, _EVEN_ROUNDED = 0.1, 0.25, 0.6
_FEW = 10
# Frames per second below which uneven samples are keys rather than frames.
_SLOWEST_CAMERA = 10.0
# Part of a step by which most steps may be off a whole number of steps, or of a known rate.
_NEARLY_EVEN, _ON_GRID = 0.15, 0.2
# Part of the usual step below which the mean of single ones is not the step of frames.
_LEAST_STEP = 0.1
# Usual steps beyond which a step is a gap in uneven samples.
_GAP = 5.0


@dataclass(frozen=True, eq=False)
class Sequence:
    """Frames of samples.

    Attributes:
        rate: Frames per second.
        places: Frame of each sample from 0, rising, shape (n,); whole if ``kind`` is "frames".
        kind: "frames" for samples at frames, "uneven" for those of an irregular camera, "keys" for those far apart.
        measured: Frames per second by the times alone.
    """

    rate: float
    places: Array
    kind: str
    measured: float


def sequence_of(times: Array, usual: float) -> Sequence:
    """Return the frames of samples at the rising ``times``, shape (n,), of which ``usual`` is the usual step."""
    order, measured = _counted(times, usual)
    since = times - times[0]
    if len(times) < 2:
        return Sequence(measured, order, "frames", measured)
    if measured < SLOWEST_TAKE:
        return _keys(since, measured)
    found, exact = _even(since, order, measured)
    if not exact and len(times) >= _FEW:
        found = _on_known_rate(since) or found or _without_gaps(since)
    if found is not None:
        return found
    if measured < _SLOWEST_CAMERA:
        return _keys(since, measured)
    steps = np.diff(times)
    measured = 1.0 / float(steps[steps <= _GAP * np.median(steps)].mean())
    rate = nearest_known(measured, _ROUGH)
    return Sequence(rate, since * rate, "uneven", measured)


def key_rate(since: Array) -> float:
    """Return the usual rate at which all keys, at seconds ``since`` the first one, are on frames, or 30."""
    for rate in _KEY_RATES:
        if np.abs(since - np.rint(since * rate) / rate).max(initial=0.0) <= _OFF_FRAME:
            return rate
    return USUAL_RATE


def nearest_known(rate: float, tolerance: float) -> float:
    """Return the rate in ``KNOWN_RATES`` within the relative ``tolerance``, whole ones first, or ``rate``."""
    within = [known for known in KNOWN_RATES if abs(known - rate) <= tolerance * known]
    return min(within, key=lambda known: (known % 1.0 != 0.0, abs(known - rate)), default=round(rate, 3))


def apart(times: Array) -> str:
    """Return the shortest and longest step of rising ``times`` for display, such as "0.5 to 4 s apart"."""
    least, most = float(np.diff(times).min()), float(np.diff(times).max())
    unit, factor = ("s", 1.0) if most >= 1.0 else ("ms", 1e3)
    first, last = f"{factor * least:.3g}", f"{factor * most:.3g}"
    return f"{first if first == last else f'{first} to {last}'} {unit} apart"


def decimal_quantum(times: Array) -> float | None:
    """Return the unit from 1 to 0.001 seconds to which ``times`` are rounded, or None if they are finer."""
    since = times - times[0]
    for quantum in (1.0, 0.1, 0.01, 0.001):
        if np.abs(since / quantum - np.rint(since / quantum)).max() < 1e-3:
            return quantum
    return None


def _keys(since: Array, measured: float) -> Sequence:
    rate = key_rate(since)
    places = since * rate
    whole = np.rint(places)
    on_frames = np.abs(places - whole).max(initial=0.0) <= _OFF_FRAME * rate
    return Sequence(rate, whole if on_frames else places, "keys", measured)


def _even(since: Array, order: Array, measured: float) -> tuple[Sequence | None, bool]:
    """Return frames in this ``order`` if the samples are even, and True if all are near their frames."""
    tolerated = _tolerance(since, measured)
    off = _off(since * measured - order)
    if off > tolerated and len(since) > 2:
        # The rate that fits all rounded times best.
        slope, start = np.polyfit(since, order, 1).tolist()
        if _off(slope * since + start - order) <= tolerated:
            measured, off = slope, _off(slope * since + start - order)
    apart = np.diff(since) * measured
    uneven = np.percentile(np.abs(apart - np.rint(apart)), 95.0)
    if off > tolerated and uneven > _NEARLY_EVEN:
        return None, False
    tolerance = max(_CLOCK, min(2.0 * off / max(float(order[-1]), 1.0), _ROUNDED))
    return Sequence(nearest_known(measured, tolerance), order, "frames", measured), off <= tolerated


def _on_known_rate(since: Array) -> Sequence | None:
    """Return frames of the lowest of ``KNOWN_RATES`` of which most steps are whole numbers of frames."""
    steps = np.diff(since)
    mean = len(steps) / float(since[-1])
    for rate in sorted(rate for rate in KNOWN_RATES if mean <= rate <= 4.0 * mean and rate % 1.0 == 0.0):
        counts = np.rint(steps * rate)
        if counts.min() >= 1.0 and np.percentile(np.abs(steps * rate - counts), 95.0) <= _ON_GRID:
            order = np.concatenate([[0.0], np.cumsum(counts)])
            measured = float(order @ order / (order @ since))
            return Sequence(nearest_known(measured, _ROUNDED), order, "frames", measured)
    return None


def _without_gaps(since: Array) -> Sequence | None:
    """Return frames of samples that are off an even sequence without gaps by parts of a frame."""
    order = np.arange(float(len(since)))
    slope, start = np.polyfit(since, order, 1).tolist()
    if np.abs(slope * since + start - order).max() > _EVEN_ROUNDED:
        return None
    return Sequence(nearest_known(slope, _ROUNDED), order, "frames", slope)


def _tolerance(times: Array, rate: float) -> float:
    """Return the frames by which samples at ``times`` may be off their places, by how many and how rounded they are."""
    if len(times) < _FEW:
        return _EVEN_FEW
    quantum = decimal_quantum(times)
    return _EVEN if quantum is None else float(np.clip(0.55 * quantum * rate, _EVEN, _EVEN_ROUNDED))


def _counted(times: Array, usual: float) -> tuple[Array, float]:
    """Return the frame of each of the rising ``times``, (n,), and the frames per second, by the step ``usual``."""
    if len(times) < 2:
        return np.zeros(len(times)), USUAL_RATE
    steps = np.diff(times)
    for _ in range(3):
        counts = np.maximum(np.rint(steps / usual), 1.0)
        # Of steps without gaps: a gap need not be a whole number of frames.
        single = counts == 1.0
        refined = float(steps[single].mean()) if single.any() else float((steps / counts).mean())
        if refined < _LEAST_STEP * usual:
            # Samples at almost the same time are no frames.
            break
        usual = refined
    rate = 1.0 / usual
    order = np.arange(float(len(times)))
    for after in (np.flatnonzero(np.maximum(np.rint(steps * rate), 1.0) > 1.0) + 1).tolist():
        # Gaps of parts of frames must not add up.
        order[after:] += max(round((times[after] - times[0]) * rate) - order[after], 0.0)
    return order, rate


def _off(difference: Array) -> float:
    """Return the largest of the differences from their middle."""
    return float(np.ptp(difference)) / 2.0
