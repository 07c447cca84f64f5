"""Frames at even times from the samples of a file, which may be uneven, incomplete, or without times."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.sample_rates import USUAL_RATE, apart, decimal_quantum, sequence_of

Array = NDArray[np.float64]

SLOWEST, FASTEST = 0.1, 1000.0
_FEW = 10
# Shares of samples at the time of another one from which times are rounded, not repeated: of coarse and of fine times.
_MANY_EQUAL, _MOST_REPEATED = 0.05, 0.2
_MOST_FRAMES = 1_000_000
# Empty frames per sample, beyond which times cannot be right.
_MOST_EMPTY, _SMALL = 100, 20_000
# Seconds between samples, below which their rate may not be a number.
_CLOSEST = 1e-6
# Frames beyond which numbers of frames and times are not exact.
_FARTHEST = 1e12
# Frames between samples of an irregular camera, and between others, beyond which something is missing.
_MISSING_UNEVEN, _MISSING = 5.0, 1.5


@dataclass(frozen=True, eq=False)
class Frames:
    """Positions of the samples of a file in a sequence of frames.

    Attributes:
        rate: Frames per second.
        places: Frame of each sample, from 0, shape (N,); NaN for samples that are left out. They rise, or fall where
            the times do, and are between frames where the samples are uneven.
        length: Number of frames.
        even: True if all places are whole.
        notes: Assumptions and losses, one sentence each.
        assumed: True if the rate is neither stated nor measured; ``notes`` say so.
        spacing: Frames from a sample to the next one beyond which frames between them are missing.
    """

    rate: float
    places: Array
    length: int
    even: bool
    notes: tuple[str, ...] = ()
    assumed: bool = False
    spacing: float = _MISSING


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
    complete = _complete(seconds)
    if np.diff(complete).max(initial=0.0) <= 0.0 and complete[-1:] < complete[:1]:
        turned = frames_at(complete[::-1], where, rate)
        note = "Its times fall from the first sample to the last; the samples were put in the order of their times."
        return replace(turned, places=turned.places[::-1], notes=(note, *turned.notes))
    times, notes = _rising(complete)
    if not (np.diff(times) > 0.0).any():
        return frames_in_order(count, rate, "Its times do not rise")
    times, spread = _apart(times)
    steps = np.diff(times)
    # Of two steps, the shorter one is rather a frame than their mean.
    usual = float(np.percentile(steps[steps > 0.0], 50.0, method="lower"))
    kept = np.flatnonzero(np.concatenate([steps > 0.0, [True]]))
    notes += (*spread, *_repeated_notes(count - len(kept)))
    seconds_long = times[-1] - times[0]
    if not seconds_long / usual < _FARTHEST:
        if rate is not None:
            return frames_in_order(count, rate)
        raise _mostly_empty(where, count, seconds_long)
    if usual < _CLOSEST:
        return frames_in_order(count, rate, "Its times are less than a microsecond apart, which is not plausible")
    found = sequence_of(times[kept], usual)
    if found.measured < SLOWEST and seconds_long > _SMALL / USUAL_RATE:
        raise _mostly_empty(where, count, seconds_long)
    if found.measured > FASTEST:
        why = f"Its times give {found.measured:,.0f} frames per second, which is not plausible"
        return frames_in_order(count, rate, why)
    places = np.full(count, np.nan)
    places[kept] = found.places
    if found.kind == "keys":
        return _keys(places, found.rate, where, rate, notes)
    length = int(found.places[-1] + 0.5) + 1
    if rate is not None:
        if found.kind == "uneven":
            places[kept] = np.arange(float(len(kept)))
            length = len(kept)
        return frames_in_order(count, rate) if too_empty(length, count) else Frames(rate, places, length, True, notes)
    if too_empty(length, count):
        raise _mostly_empty(where, count, length / found.rate)
    if found.kind == "frames":
        return Frames(found.rate, places, length, True, notes)
    return Frames(
        found.rate, places, length, False, (*notes, _uneven_note(times[kept], found.rate)), False, _MISSING_UNEVEN
    )


def _keys(places: Array, found: float, where: str, rate: float | None, notes: tuple[str, ...]) -> Frames:
    """Return frames between the samples at ``places`` of ``found`` frames per second, or at the same times of ``rate``.

    Keys keep their seconds, unlike frames.
    """
    since = places / found
    if rate is not None and rate != found:
        places = since * rate
    # The last key is a frame of its own, even where it is between two.
    length = int(np.ceil(np.nanmax(places) - 1e-3)) + 1
    if too_empty(length, len(places)):
        raise _mostly_empty(where, len(places), float(np.nanmax(since)))
    whole = bool((np.mod(places[np.isfinite(places)], 1.0) == 0.0).all())
    notes = (*notes, _uneven_note(since[np.isfinite(since)], rate or found))
    return Frames(rate or found, places, length, whole, notes, False, np.inf)


def _uneven_note(times: Array, rate: float) -> str:
    """Return the sentence about samples at ``times`` that were interpolated at ``rate`` frames per second."""
    return f"Its samples are {apart(times)}; they were interpolated at {rate:.5g} frames per second."


def _apart(times: Array) -> tuple[Array, tuple[str, ...]]:
    """Return ``times`` of which many are equal, because they are rounded, as different ones, and a sentence."""
    steps = np.diff(times)
    different = np.count_nonzero(steps > 0.0) / len(steps)
    if different < 0.5:
        # Several samples at each time, as of a clock in whole seconds or a slower timecode.
        return _spread(times), ("Most of its samples share their times; they were spread evenly between these.",)
    quantum = decimal_quantum(times)
    coarse = quantum is not None and float(np.median(steps[steps > 0.0])) <= 2.0 * quantum
    rounded = 1.0 - different > (_MANY_EQUAL if coarse else _MOST_REPEATED)
    return _on_a_line(times) if rounded and len(times) >= _FEW else times, ()


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
        why = "It states no times, and its numbers of frames do not rise"
        return frames_in_order(len(numbers), rate, why if len(steps) else "It does not state times")
    places = numbers - numbers[0]
    length = int(places[-1]) + 1
    if too_empty(length, len(numbers)):
        raise FacePoserError(
            f"'{where}' has {len(numbers)} frames with numbers up to {numbers[-1]:.6g}, most of which are missing; "
            "correct the numbers or split it."
        )
    notes = () if rate is not None else (assumed_rate("It states numbers of frames and no times"),)
    # Takes may have every second frame or fewer.
    common = int(np.gcd.reduce(steps.astype(np.int64)))
    if common > 1:
        notes = (*notes, f"Its numbers of frames rise by {common}; the frames between them were interpolated.")
    return Frames(rate or USUAL_RATE, places, length, True, notes, rate is None, _MISSING * common)


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
    at, known = _in_order(at, known)
    wanted = np.arange(float(frames.length))
    if frames.even and len(at) == frames.length:
        return known, ()
    result = np.stack([np.interp(wanted, at, known[:, column]) for column in range(values.shape[1])], axis=1)
    if frames.even:
        result[at.astype(np.intp)] = known
    # Between samples that are near each other, nothing is missing.
    empty = _far_from(wanted, at, frames)
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
    at, known = _in_order(frames.places[kept], values[kept])
    if frames.even and frames.spacing == _MISSING:
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
        empty = _far_from(wanted, at, frames)
        result[empty] = np.nan
    return result, gap_notes(empty, frames.rate, 0, "they were left blank")


def gap_notes(empty: NDArray[np.bool_], rate: float, lost: int, remedy: str) -> tuple[str, ...]:
    """Return the sentence about the frames that are ``empty``, shape (F,); ``lost`` is how many rows had no values."""
    if not empty.any():
        return ()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], empty.astype(np.int8), [0]])))
    longest = int((edges[1::2] - edges[::2]).max())
    count = int(empty.sum())
    missing, have, they = ("are missing", "have", "they were") if count > 1 else ("is missing", "has", "it was")
    why = missing if not lost else f"{have} no face" if lost >= count else f"{missing} or {have} no face"
    where = f"the first at {edges[0] / rate:.2f} s, at most {longest / rate:.2f} s at once"
    return (f"{count} of its {len(empty)} frames {why} ({where}); {remedy.replace('they were', they)}.",)


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


def too_empty(length: float, count: int) -> bool:
    """Return True if ``length`` frames are too many for ``count`` samples, most of which would be made up."""
    return length > max(min(_MOST_EMPTY * count, _MOST_FRAMES), _SMALL)


def _in_order(at: Array, known: Array) -> tuple[Array, Array]:
    if (np.diff(at) >= 0.0).all():
        return at, known
    order = np.argsort(at, kind="stable")
    return at[order], known[order]


def _far_from(wanted: Array, at: Array, frames: Frames) -> NDArray[np.bool_]:
    """Return True for frames with samples too far apart around them, or on one side only."""
    after = np.searchsorted(at, wanted)
    before = np.clip(after - 1, 0, len(at) - 1)
    after = np.clip(after, 0, len(at) - 1)
    apart = (at[after] - at[before] > frames.spacing) & (at[after] != wanted)
    ends = (wanted < at[0] - 0.5) | (wanted > at[-1] + (0.5 if np.isfinite(frames.spacing) else 1.0))
    return np.asarray(apart | ends)
