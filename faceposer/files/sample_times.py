"""Frames at even times from the samples of a file, which may be uneven, incomplete, or without times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError

Array = NDArray[np.float64]

#: Frames per second where a file does not tell.
USUAL_RATE = 30.0
#: Rates of cameras and programs; a rate that was measured is taken for the nearest of them within its uncertainty.
KNOWN_RATES = (
    *(1.0, 2.0, 5.0, 10.0, 12.0, 15.0, 20.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 72.0, 75.0, 90.0, 100.0, 120.0),
    *(144.0, 150.0, 200.0, 240.0, 250.0, 300.0, 500.0, 1000.0),
    *(24000 / 1001, 30000 / 1001, 60000 / 1001, 120000 / 1001, 12.5),
)
SLOWEST, FASTEST = 0.1, 1000.0
# Relative uncertainty of the clocks of devices, and the largest uncertainty of rounded times.
_CLOCK, _ROUNDED = 4e-4, 0.02
# Frames by which a sample may be off its place in an even sequence: in few samples, in many, and with rounded times.
_EVEN_FEW, _EVEN, _EVEN_ROUNDED = 0.1, 0.25, 0.6
_FEW = 10
# Shares of samples at the time of another one from which times are rounded, not repeated: of coarse and of fine times.
_MANY_EQUAL, _MOST_REPEATED = 0.05, 0.2
# Frames per second below which uneven samples are keys rather than frames.
_SLOWEST_CAMERA = 10.0
# Part of a step by which most steps may be off a whole number of steps.
_NEARLY_EVEN = 0.15
_MOST_FRAMES = 1_000_000
# Empty frames per sample, beyond which times cannot be right.
_MOST_EMPTY, _SMALL = 100, 20_000
# Frames beyond which numbers of frames and times are not exact.
_FARTHEST = 1e12


@dataclass(frozen=True, eq=False)
class Frames:
    """Positions of the samples of a file in a sequence of frames.

    Attributes:
        rate: Frames per second.
        places: Frame of each sample, from 0, rising, shape (N,); NaN for samples that are left out. Between frames
            where the samples are uneven.
        length: Number of frames.
        even: True if all places are whole.
        notes: Assumptions and losses, one sentence each.
        assumed: True if the rate is neither stated nor measured; ``notes`` say so.
    """

    rate: float
    places: Array
    length: int
    even: bool
    notes: tuple[str, ...] = ()
    assumed: bool = False


def frames_in_order(count: int, rate: float | None, why: str = "It does not state times") -> Frames:
    """Return frames without gaps for ``count`` samples, at the assumed ``USUAL_RATE`` if ``rate`` is None."""
    notes = () if rate is not None or count < 2 else (assumed_rate(why),)
    return Frames(rate or USUAL_RATE, np.arange(float(count)), count, True, notes, rate is None)


def assumed_rate(why: str) -> str:
    """Return the sentence about an assumed rate, which begins with ``why``."""
    return f"{why}; {USUAL_RATE:g} frames per second were assumed."


def frames_at(seconds: Array, where: str, rate: float | None = None) -> Frames:
    """Return frames for samples at ``seconds``, shape (N,), NaN where unknown.

    Args:
        seconds: Times; a time that goes back begins anew one step later.
        where: Name of the file for messages.
        rate: Frames per second, in place of that of the times, whose gaps remain; None to measure it.

    Raises:
        FacePoserError: If most of the time is empty.
    """
    count = len(seconds)
    times, notes = _rising(_complete(seconds))
    if not (np.diff(times) > 0.0).any():
        return frames_in_order(count, rate, "Its times do not rise")
    times = _apart(times)
    steps = np.diff(times)
    usual = float(np.median(steps[steps > 0.0]))
    kept = np.flatnonzero(np.concatenate([steps > 0.0, [True]]))
    notes += _repeated_notes(count - len(kept))
    if not (times[-1] - times[0]) / usual < _FARTHEST:
        if rate is not None:
            return frames_in_order(count, rate)
        raise _mostly_empty(where, count, times[-1] - times[0])
    order, measured = _counted(times[kept], usual)
    if not SLOWEST <= measured <= FASTEST:
        why = f"Its times give {measured:.3g} frames per second, which is not plausible"
        return frames_in_order(count, rate, why)
    places = np.full(count, np.nan)
    places[kept] = order
    length = int(order[-1]) + 1
    if rate is not None:
        if too_empty(length, count):
            return frames_in_order(count, rate)
        return Frames(rate, places, length, True, notes)
    since = times[kept] - times[kept][0]
    tolerated = _tolerance(times[kept], measured)
    off = _off(since * measured - order)
    if off > tolerated and len(kept) > 2:
        # The rate that fits all rounded times best.
        slope, start = np.polyfit(since, order, 1).tolist()
        if _off(slope * since + start - order) <= tolerated:
            measured, off = slope, _off(slope * since + start - order)
    apart = np.diff(times[kept]) * measured
    uneven = np.percentile(np.abs(apart - np.rint(apart)), 95.0) if len(apart) else 0.0
    even = bool(off <= tolerated or uneven <= _NEARLY_EVEN)
    if even:
        tolerance = max(_CLOCK, min(2.0 * off / max(float(order[-1]), 1.0), _ROUNDED))
        found = nearest_known(measured, tolerance)
    else:
        found = nearest_known(measured, _ROUNDED) if measured >= _SLOWEST_CAMERA else USUAL_RATE
        places[kept] = (times[kept] - times[kept][0]) * found
        length = int(places[kept][-1] + 0.5) + 1
        shortest, longest = np.percentile(1e3 * np.diff(times[kept]), [5.0, 95.0])
        notes = (
            *notes,
            f"Its samples are {shortest:.0f} to {longest:.0f} ms apart; they were interpolated at {found:.5g} frames "
            "per second.",
        )
    if too_empty(length, count):
        raise _mostly_empty(where, count, length / found)
    return Frames(found, places, length, even, notes)


def _apart(times: Array) -> Array:
    """Return ``times`` of which many are equal, because they are rounded, as different ones."""
    steps = np.diff(times)
    different = np.count_nonzero(steps > 0.0) / len(steps)
    if different < 0.5:
        # Several samples at each time, as of a clock in whole seconds or a slower timecode.
        return _spread(times)
    quantum = _decimal_quantum(times)
    coarse = quantum is not None and float(np.median(steps[steps > 0.0])) <= 2.0 * quantum
    rounded = 1.0 - different > (_MANY_EQUAL if coarse else _MOST_REPEATED)
    return _on_a_line(times) if rounded and len(times) >= _FEW else times


def _repeated_notes(number: int) -> tuple[str, ...]:
    """Return the sentence about samples at the time of another one."""
    if number == 0:
        return ()
    if number == 1:
        return ("1 sample at the time of another one was left out.",)
    return (f"{number} samples at the times of others were left out.",)


def _mostly_empty(where: str, count: int, seconds: float) -> FacePoserError:
    return FacePoserError(
        f"'{where}' has {count} samples in {seconds:.6g} seconds, most of which are empty; correct its times or split "
        "it."
    )


def frames_numbered(numbers: Array, where: str, rate: float | None) -> Frames:
    """Return frames for samples with frame ``numbers``, shape (N,), whose rate is ``rate`` or assumed."""
    if not len(numbers) or np.abs(numbers).max() > _FARTHEST:
        return frames_in_order(len(numbers), rate)
    steps = np.diff(numbers)
    if not len(steps) or (steps <= 0.0).any() or not (np.mod(steps, 1.0) == 0.0).all():
        return frames_in_order(len(numbers), rate)
    # Takes may have every second number or fewer.
    places = (numbers - numbers[0]) / float(np.gcd.reduce(steps.astype(np.int64)))
    length = int(places[-1]) + 1
    if too_empty(length, len(numbers)):
        raise FacePoserError(
            f"'{where}' has {len(numbers)} frames with numbers up to {numbers[-1]:.6g}, most of which are missing; "
            "correct the numbers or split it."
        )
    notes = () if rate is not None else (assumed_rate("It states numbers of frames and no times"),)
    return Frames(rate or USUAL_RATE, places, length, True, notes, rate is None)


def interpolated(frames: Frames, seen: NDArray[np.bool_], values: Array) -> tuple[Array, tuple[str, ...]]:
    """Return values for every frame, shape (length, S), linear between the samples, and sentences about gaps.

    Args:
        frames: Places of the N samples.
        seen: Which samples have values, shape (N,).
        values: Values of the samples that were seen, shape (n, S), in order.
    """
    placed = np.isfinite(frames.places)
    at = frames.places[seen & placed]
    known = values[placed[seen]]
    if not len(at):
        # The only samples with values are at the times of others.
        at, known = np.zeros(1), values[-1:]
    wanted = np.arange(float(frames.length))
    if frames.even and len(at) == frames.length:
        return known, ()
    if frames.even:
        result = np.empty((frames.length, values.shape[1]))
        columns = at.astype(np.intp)
        result[columns] = known
        empty = np.ones(frames.length, dtype=bool)
        empty[columns] = False
        for column in range(values.shape[1]):
            result[empty, column] = np.interp(wanted[empty], at, known[:, column])
    else:
        result = np.stack([np.interp(wanted, at, known[:, column]) for column in range(values.shape[1])], axis=1)
        # Between samples that are at most two steps apart, nothing is missing.
        empty = _far_from(wanted, at) if len(at) * 2 > frames.length else np.zeros(frames.length, dtype=bool)
    outside = (wanted < at[0]) | (wanted > at[-1])
    remedies = []
    if (empty & ~outside).any():
        remedies.append("they were interpolated")
    if (empty & outside).any():
        remedies.append("the nearest pose is held at the ends")
    remedy = ", and ".join(remedies)
    return result, gap_notes(empty, frames.rate, int((~seen).sum()), remedy)


def placed(frames: Frames, values: Array) -> tuple[Array, tuple[str, ...]]:
    """Return values for every frame, shape (length, ...), NaN where no sample is near, and a sentence about gaps.

    Args:
        frames: Places of the N samples.
        values: Values of the samples, shape (N, ...), which may be NaN.
    """
    if frames.even and len(values) == frames.length:
        return values, ()
    kept = np.isfinite(frames.places)
    at, known = frames.places[kept], values[kept]
    if frames.even:
        result = np.full((frames.length, *values.shape[1:]), np.nan)
        result[at.astype(np.intp)] = known
        empty = np.ones(frames.length, dtype=bool)
        empty[at.astype(np.intp)] = False
    else:
        wanted = np.arange(float(frames.length))
        after = np.clip(np.searchsorted(at, wanted), 1, len(at) - 1)
        share = np.clip((wanted - at[after - 1]) / (at[after] - at[after - 1]), 0.0, 1.0)
        share = share.reshape(-1, *[1] * (values.ndim - 1))
        before, later = known[after - 1], known[after]
        # A value that is NaN must not spread to a frame at the time of the other sample.
        result = np.where(share == 0.0, before, np.where(share == 1.0, later, (1.0 - share) * before + share * later))
        empty = _far_from(wanted, at)
        result[empty] = np.nan
    return result, gap_notes(empty, frames.rate, 0, "they were left blank")


def gap_notes(empty: NDArray[np.bool_], rate: float, lost: int, remedy: str) -> tuple[str, ...]:
    """Return the sentence about the frames that are ``empty``, shape (F,); ``lost`` is how many rows had no values."""
    if not empty.any():
        return ()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], empty.astype(np.int8), [0]])))
    longest = int((edges[1::2] - edges[::2]).max())
    count = int(empty.sum())
    why = "are missing" if not lost else "have no face" if lost >= count else "are missing or have no face"
    where = f"the first at {edges[0] / rate:.2f} s, at most {longest / rate:.2f} s at once"
    return (f"{count} of its {len(empty)} frames {why} ({where}); {remedy}.",)


def nearest_known(rate: float, tolerance: float) -> float:
    """Return the rate in ``KNOWN_RATES`` within the relative ``tolerance``, whole ones first, or ``rate``."""
    within = [known for known in KNOWN_RATES if abs(known - rate) <= tolerance * known]
    return min(within, key=lambda known: (known % 1.0 != 0.0, abs(known - rate)), default=round(rate, 3))


def _complete(seconds: Array) -> Array:
    """Return ``seconds`` with unknown times between their neighbours, and one step apart at the ends."""
    known = np.flatnonzero(np.isfinite(seconds))
    if len(known) == len(seconds):
        return seconds
    if len(known) < 2:
        return np.zeros(len(seconds))
    rows = np.arange(len(seconds))
    times = np.interp(rows, known, seconds[known])
    steps = np.diff(seconds[known]) / np.diff(known)
    usual = float(np.median(steps))
    times[: known[0]] += usual * (rows[: known[0]] - known[0])
    times[known[-1] + 1 :] += usual * (rows[known[-1] + 1 :] - known[-1])
    return times


def _rising(times: Array) -> tuple[Array, tuple[str, ...]]:
    """Return ``times`` that begin anew one usual step after the last where they go back, and a sentence about it."""
    steps = np.diff(times)
    back = steps < 0.0
    if not back.any():
        return times, ()
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    first = int(np.flatnonzero(back)[0]) + 2
    how_often = "" if back.sum() == 1 else f" {int(back.sum())} times, first"
    note = f"Its times go back{how_often} at sample {first}; samples there were put one frame after the one before."
    return np.concatenate([[times[0]], times[0] + np.cumsum(np.where(back, usual, steps))]), (note,)


def _tolerance(times: Array, rate: float) -> float:
    """Return the frames by which samples at ``times`` may be off their places, by how many and how rounded they are."""
    if len(times) < _FEW:
        return _EVEN_FEW
    quantum = _decimal_quantum(times)
    return _EVEN if quantum is None else float(np.clip(0.55 * quantum * rate, _EVEN, _EVEN_ROUNDED))


def _decimal_quantum(times: Array) -> float | None:
    """Return the unit from 1 to 0.001 seconds to which ``times`` are rounded, or None if they are finer."""
    since = times - times[0]
    for quantum in (1.0, 0.1, 0.01, 0.001):
        if np.abs(since / quantum - np.rint(since / quantum)).max() < 1e-3:
            return quantum
    return None


def _on_a_line(times: Array) -> Array:
    """Return even times for ``times`` that are equal because they are rounded, else ``times``."""
    rows = np.arange(float(len(times)))
    line = np.polyval(np.polyfit(rows, times, 1), rows)
    quantum = float(np.diff(times)[np.diff(times) > 0.0].min())
    return line if np.abs(times - line).max() <= 1.05 * quantum else times


def _spread(times: Array) -> Array:
    """Return ``times`` of which several are equal, spread evenly."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(times) > 0.0) + 1])
    sizes = np.diff(np.concatenate([starts, [len(times)]]))
    gaps = np.diff(times[starts])
    usual = float(np.median(gaps))
    size = int(np.median(sizes[1:-1])) if len(sizes) > 2 else int(sizes.max())
    spread = np.empty(len(times))
    for i, (start, n) in enumerate(zip(starts.tolist(), sizes.tolist(), strict=True)):
        # The first samples of a take may begin within a tick.
        offset = max(size - n, 0) if i == 0 else 0
        spread[start : start + n] = times[start] + usual * (np.arange(n) + offset) / max(size, n)
    return spread


def _counted(times: Array, usual: float) -> tuple[Array, float]:
    """Return the frame of each of the rising ``times``, (n,), and the frames per second, by the step ``usual``."""
    if len(times) < 2:
        return np.zeros(len(times)), USUAL_RATE
    steps = np.diff(times)
    for _ in range(3):
        counts = np.maximum(np.rint(steps / usual), 1.0)
        # Of steps without gaps: a gap need not be a whole number of frames.
        single = counts == 1.0
        usual = float(steps[single].mean()) if single.any() else float((steps / counts).mean())
    rate = 1.0 / usual
    order = np.arange(float(len(times)))
    for after in (np.flatnonzero(np.maximum(np.rint(steps * rate), 1.0) > 1.0) + 1).tolist():
        # Gaps of parts of frames must not add up.
        order[after:] += max(round((times[after] - times[0]) * rate) - order[after], 0.0)
    return order, rate


def _off(difference: Array) -> float:
    """Return the largest of the differences from their middle."""
    return float(np.ptp(difference)) / 2.0


def too_empty(length: float, count: int) -> bool:
    """Return True if ``length`` frames are too many for ``count`` samples, most of which would be made up."""
    return length > max(min(_MOST_EMPTY * count, _MOST_FRAMES), _SMALL)


def _far_from(wanted: Array, at: Array) -> NDArray[np.bool_]:
    """Return True for frames with samples more than two and a half frames apart around them, or on one side only."""
    after = np.searchsorted(at, wanted)
    before = np.clip(after - 1, 0, len(at) - 1)
    after = np.clip(after, 0, len(at) - 1)
    apart = at[after] - at[before]
    ends = (wanted < at[0] - 0.5) | (wanted > at[-1] + 0.5)
    return np.asarray((apart > 2.5) | ends)
