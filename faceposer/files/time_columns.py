"""Columns of times in text tables: which column it is, and the seconds in its cells."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from faceposer.files.tables import decimal_number

Array = NDArray[np.float64]

_UNITS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "millisec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "micros", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanosecond", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "minute", "minutes"), 60.0),
}
_UNIT_WORDS = "|".join(sorted(_UNITS, key=len, reverse=True))
_TIME = re.compile(
    r"(?:(?:sample|frame|capture|media|video|local|system|device|unix|start|elapsed|rel|relative|abs|absolute)?"
    r"(?:time|timecode|timestamp|t|tc|elapsed|clock|datetime|pts|zeit|zeitstempel|zeitcode|temps|tiempo|tempo|tid|tijd)"
    rf"|(?=(?:{_UNIT_WORDS})$)(?!(?:s|min)$))(?:in)?({_UNIT_WORDS})?"
)
_STEP = re.compile(rf"(?:dt|delta|deltat|deltatime|timedelta|timestep|framedelta)(?:in)?({_UNIT_WORDS})?")
_FRAME = re.compile(r"(?:frames?|frameid|frameno|framenr|framenum|framenumber|frameindex|frameidx|fieldno|index)")
_TIMECODE = re.compile(r"(\d{1,2})[:;](\d{1,2})[:;](\d{1,2})([:;])(\d{1,3}(?:[.,]\d*)?)")
_CLOCK = re.compile(r"(?:(\d{1,2}):)?(\d{1,3}):(\d{1,2}(?:[.,]\d+)?)(?:\s*([AaPp])\.?[Mm]\.?)?")
# HH:MM:SS.FF, which may be a clock time in hundredths of a second.
_DOTTED = re.compile(r"(\d{1,2}):(\d{1,2}):(\d{1,2})[.,](\d\d)")
# Days before clock times in orders other than that of ISO 8601.
_DAY_BEFORE = re.compile(r"\d{1,4}[./-]\d{1,2}[./-]\d{1,4}[T ,]+(?=\d)")

# Bases of timecodes; 1000 counts milliseconds.
_BASES = (24, 25, 30, 48, 50, 60, 90, 100, 120, 240, 1000)
_BASE_OF_APPS = 60
_DROPPING = (30, 60)
# Deviation of steps from each other, as a part of a step, from which timecodes are read without parts of frames.
_UNEVEN = 0.05
_DAY = 86_400.0
# Steps of samples in seconds, from 240 to 5 a second.
_PLAUSIBLE = (1.0 / 260.0, 0.21)
# Steps of keys without a unit, of keys with one, and the samples below which they are keys rather than a mistaken unit.
_KEYS, _LONGEST_STEP, _LONGEST_KEYS, _FEW = 5.0, 10.0, 120.0, 10
# Nanoseconds since 1970 in the year 5138.
_LATEST = 1e20
_SCALES = (1.0, 1e-3, 1e-6, 1e-9)
_SCALE_NAMES = {1.0: "seconds", 1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}


@dataclass(frozen=True, eq=False)
class ColumnTimes:
    """Times of the rows of a table.

    Attributes:
        seconds: Shape (N,); NaN where a cell has no time.
        note: An assumption that was needed, one sentence, or "".
        lost: A sentence about cells that are not understood, or "".
    """

    seconds: Array
    note: str = ""
    lost: str = ""


def is_time(heading: str) -> bool:
    """Return True if a column with this ``heading`` has times, or the time since the row before."""
    return _time_heading(heading) is not None or _is_step(heading)


def _is_step(heading: str) -> bool:
    return len(heading) <= 64 and _STEP.fullmatch(_letters(heading)) is not None


def _step_unit(heading: str) -> float | None:
    match = _STEP.fullmatch(_letters(heading))
    return None if match is None or match[1] is None else _UNITS[match[1]]


def is_frame_number(heading: str) -> bool:
    """Return True if a column with this ``heading`` has the numbers of frames."""
    return _FRAME.fullmatch(_letters(heading)) is not None


def is_timecode(cell: str) -> bool:
    """Return True if ``cell`` is a timecode, such as 13:13:04:31.652."""
    return _TIMECODE.fullmatch(cell.strip()) is not None


def times_of(heading: str, cells: Sequence[str]) -> ColumnTimes | None:
    """Return the times in the ``cells`` of a column, or None if they are none.

    Timecodes (HH:MM:SS:FF), clock times (HH:MM:SS.fff), dates with times, and numbers are understood. The base of
    timecodes is inferred from where a second ends, the unit of numbers from the heading or from their steps.
    """
    cells = [cell.strip() for cell in cells]
    times = _times_of(heading, cells)
    if times is None:
        return None
    lost = [i for i in np.flatnonzero(np.isnan(times.seconds)).tolist() if cells[i]]
    if not lost:
        return times
    number = "A time" if len(lost) == 1 else f"{len(lost)} times"
    said = (
        f"{number} in its column '{shown_heading(heading)}' cannot be read ('{shown_heading(cells[lost[0]])}' of "
        f"sample {lost[0] + 1}); samples without a time were put between their neighbours."
    )
    return replace(times, lost=said)


def _times_of(heading: str, cells: Sequence[str]) -> ColumnTimes | None:
    first = next((cell for cell in cells if cell), "")
    if _TIMECODE.fullmatch(first):
        return _of_timecodes([_TIMECODE.fullmatch(cell) for cell in cells])
    if _DOTTED.fullmatch(first) and _counts_frames(cells):
        return _of_timecodes([_TIMECODE.fullmatch(re.sub("[.,]", ":", cell, count=1)) for cell in cells])
    if decimal_number(first) is not None:
        values = np.array([np.nan if (value := decimal_number(cell)) is None else value for cell in cells])
        return _of_steps(values, _step_unit(heading)) if _is_step(heading) else _of_numbers(heading, values)
    if _date_seconds(first) is not None:
        dates = [_date_seconds(cell) for cell in cells]
        return ColumnTimes(np.array([np.nan if date is None else date for date in dates]))
    if _CLOCK.fullmatch(_without_day(first)):
        return ColumnTimes(_past_midnight(np.array([_clock_seconds(_without_day(cell)) for cell in cells])))
    return None


def _without_day(text: str) -> str:
    return _DAY_BEFORE.sub("", text[:40], count=1)


def _counts_frames(cells: Sequence[str]) -> bool:
    """Return True if what follows the seconds in HH:MM:SS.FF counts frames, not hundredths of a second."""
    parts = [match.groups() for cell in cells if (match := _DOTTED.fullmatch(cell))]
    values = np.array(parts, dtype=np.float64)
    if len(values) < 3 or len(values) < sum(map(bool, cells)) // 2 or values[:, 3].max() >= _BASE_OF_APPS:
        return False
    seconds = values[:, :3] @ [3600.0, 60.0, 1.0]
    within = (np.diff(values[:, 3]) > 0.0) & (np.diff(seconds) == 0.0)
    over = np.diff(seconds) == 1.0
    if not within.any():
        return False
    step = float(np.median(np.diff(values[:, 3])[within]))
    if not over.any():
        # Within a second: no camera takes a hundred samples a second that end in hundredths.
        return step == 1.0
    base, certain = _base(seconds, values[:, 3])
    return (
        certain and base < 100 and float(np.median(np.diff(seconds + values[:, 3] / 100.0)[over])) > 2.0 * step / 100.0
    )


def shown_heading(heading: str) -> str:
    """Return ``heading`` for display: at most 40 characters, those that do not print escaped."""
    text = heading[:40]
    return text if text.isprintable() else text.encode("unicode_escape").decode("ascii")


def numbers_of(cells: Sequence[str]) -> Array | None:
    """Return the numbers in the ``cells`` of a column of frame numbers, or None if some are none."""
    values = [decimal_number(cell) for cell in cells]
    known = [value for value in values if value is not None]
    return np.array(known) if len(known) == len(values) else None


def _letters(heading: str) -> str:
    return re.sub(r"[^a-z]", "", heading.lower().replace("µ", "u").replace("μ", "u"))


def _time_heading(heading: str) -> tuple[float | None] | None:
    """Return the unit in the ``heading`` of a column of times, in seconds, as a tuple; None if it has none."""
    if len(heading) > 64:
        return None
    # What stands in brackets may be a unit, or a format such as HH:MM:SS.
    match = _TIME.fullmatch(_letters(heading)) or _TIME.fullmatch(_letters(re.sub(r"[(\[].*", "", heading)))
    if match is None:
        return None
    unit = match[1]
    # "Times" and "timestamps" are plurals; the unit stands apart.
    if unit == "s" and not re.search(r"[^a-z]s[^a-z]*$", heading.strip().lower()):
        unit = None
    return (None if unit is None else _UNITS[unit],)


def _of_numbers(heading: str, values: Array) -> ColumnTimes | None:
    values = np.where(np.abs(values) <= _LATEST, values, np.nan)
    steps = np.diff(values[np.isfinite(values)])
    steps = steps[steps > 0.0]
    stated = _time_heading(heading)
    unit = stated[0] if stated is not None else None
    if not len(steps):
        return ColumnTimes(values * (unit or 1.0))
    # Of few steps, the middle of two says nothing about either.
    usual = float(np.percentile(steps, 50.0, method="lower"))
    # A stated unit is believed unless it gives a rate that no recording has.
    longest = _LONGEST_STEP if len(values) >= _FEW else _LONGEST_KEYS
    if unit is not None and 1e-3 <= usual * unit <= longest:
        return ColumnTimes(values * unit)
    fitting = [scale for scale in _SCALES if _PLAUSIBLE[0] <= usual * scale <= _PLAUSIBLE[1]]
    if not fitting and (unit is not None or _are_numbers(values, steps)):
        return None
    # Poses at times seconds apart.
    keys = [scale for scale in _SCALES if _PLAUSIBLE[1] < usual * scale <= _KEYS]
    if not fitting and keys:
        said = f"The times in its column '{shown_heading(heading)}' were read as {_SCALE_NAMES[keys[0]]}."
        return ColumnTimes(values * keys[0], said)
    if not fitting:
        return None
    note = ""
    if unit is not None or fitting[0] != 1.0:
        note = f"The times in its column '{shown_heading(heading)}' were read as {_SCALE_NAMES[fitting[0]]}."
    return ColumnTimes(values * fitting[0], note)


def _are_numbers(values: Array, steps: Array) -> bool:
    """Return True for equal whole ``steps`` of 1, or of many ``values``, which rather number frames."""
    whole = bool((np.mod(values[np.isfinite(values)], 1.0) == 0.0).all() and np.ptp(steps) == 0.0)
    return whole and (steps[0] == 1.0 or len(values) >= _FEW)


def _of_steps(values: Array, unit: float | None) -> ColumnTimes | None:
    """Return times for ``values`` that are the time since the row before, in seconds or the ``unit``."""
    known = values[np.isfinite(values) & (values > 0.0)]
    if not len(known):
        return None
    usual = float(np.median(known))
    fitting = [scale for scale in ([unit] if unit else _SCALES) if _PLAUSIBLE[0] <= usual * scale <= _KEYS]
    if not fitting:
        return None
    # The first row has the time since a row that is not in the file.
    steps = np.where(np.isfinite(values), values, usual)
    return ColumnTimes(fitting[0] * (np.cumsum(steps) - steps[0]))


def _date_seconds(text: str) -> float | None:
    if len(text) > 40 or not re.match(r"\d{4}-?\d\d-?\d\d[T ]", text):
        return None
    try:
        return datetime.fromisoformat(text).timestamp()
    except (ValueError, OverflowError):
        return None


def _clock_seconds(text: str) -> float:
    match = _CLOCK.fullmatch(text)
    if match is None:
        return np.nan
    hours = float(match[1] or 0)
    if match[4]:
        hours = hours % 12.0 + (12.0 if match[4] in "Pp" else 0.0)
    return 3600.0 * hours + 60.0 * float(match[2]) + float(match[3].replace(",", "."))


def _past_midnight(seconds: Array) -> Array:
    """Return ``seconds`` of the day as rising across midnight."""
    known = np.flatnonzero(np.isfinite(seconds))
    days = np.cumsum(np.diff(seconds[known], prepend=seconds[known][:1]) < -0.5 * _DAY)
    result = seconds.copy()
    result[known] += _DAY * days
    return result


def _of_timecodes(found: Sequence[re.Match[str] | None]) -> ColumnTimes:
    parts = np.full((len(found), 4), np.nan)
    marked = False
    for row, match in enumerate(found):
        if match is not None and float(match[2]) < 60 and float(match[3]) < 60:
            parts[row] = [float(match[1]), float(match[2]), float(match[3]), float(match[5].replace(",", "."))]
            marked = marked or match[4] == ";"
    seconds = _past_midnight(parts[:, :3] @ [3600.0, 60.0, 1.0])
    frames = parts[:, 3]
    known = np.isfinite(seconds)
    base, certain = _base(seconds[known], frames[known])
    if _counts_are_even(base * seconds[known], frames[known]):
        frames = np.floor(frames)
    note = ""
    if not certain:
        note = f"Its timecodes do not tell how many frames they count per second; {base} were assumed."
    if base in _DROPPING and _drops(seconds[known], frames[known], base, marked):
        # Timecode of 29.97 frames per second leaves two numbers out at the start of nine of ten minutes.
        minutes = np.floor(seconds / 60.0)
        number = base * seconds + frames - base / 15.0 * (minutes - np.floor(minutes / 10.0))
        return ColumnTimes(number * 1001.0 / (1000.0 * base), note)
    return ColumnTimes(seconds + frames / base, note)


def _counts_are_even(whole: Array, frames: Array) -> bool:
    """Return True if whole ``frames`` follow each other more evenly than with their parts, which are of no moment."""
    fine, coarse = np.diff(whole + frames), np.diff(whole + np.floor(frames))
    if len(coarse) < 2 or (coarse <= 0.0).any():
        return False
    usual = float(np.median(coarse))
    # Gaps count no more than other steps.
    spread_fine, spread = (float(np.minimum(np.abs(steps - usual), usual).mean()) for steps in (fine, coarse))
    return spread_fine > _UNEVEN * usual and spread < 0.5 * spread_fine


def _base(seconds: Array, frames: Array) -> tuple[int, bool]:
    """Return the frames per second that timecodes count, and True if it is certain; ``seconds`` are whole."""
    most = float(np.floor(frames).max(initial=0.0))
    above = [base for base in _BASES if base > most]
    least = above[0] if above else int(most) + 1
    later = np.diff(seconds)
    steps = np.diff(frames)[(later == 0.0) & (np.diff(frames) > 0.0)]
    over = later == 1.0
    if not len(steps) or not (later > 0.0).any():
        # A take of less than a second; the apps count 60.
        return max(least, _BASE_OF_APPS) if least <= _BASE_OF_APPS else least, False
    step = float(np.median(steps))
    found = frames[:-1][over] + step - frames[1:][over]
    if len(found):
        middle = float(np.median(found))
        nearest = min(above, key=lambda base: abs(base - middle), default=least)
        if abs(nearest - middle) <= max(1.0, 0.25 * step):
            return nearest, True
        if len(found) > 1 and np.abs(found - middle).max() < 0.5 and round(middle) > most:
            return round(middle), True
    # Where each second is followed by a gap, its last count is still less than a step below the base.
    possible = [base for base in above if base <= most + 1.01 * step]
    if len(possible) == 1 and np.count_nonzero(_last_counts(seconds, frames) + 1.01 * step >= possible[0]) > 1:
        return possible[0], True
    return least, False


def _last_counts(seconds: Array, frames: Array) -> Array:
    """Return the largest count of frames in each second."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(seconds) != 0.0) + 1])
    return np.asarray(np.maximum.reduceat(frames, starts))


def _drops(seconds: Array, frames: Array, base: int, marked: bool) -> bool:
    """Return True for drop-frame timecodes: by their numbers where a minute begins, else as their spelling marks it."""
    minutes = np.floor(seconds / 60.0)
    begins = (np.diff(minutes) == 1.0) & (minutes[1:] % 10.0 != 0.0) & (np.diff(seconds) == 1.0)
    if not begins.any():
        return marked
    steps = np.diff(frames)[(np.diff(seconds) == 0.0) & (np.diff(frames) > 0.0)]
    step = float(np.median(steps)) if len(steps) else 1.0
    skipped = frames[1:][begins] - (frames[:-1][begins] + step - base)
    return float(np.median(skipped)) > 0.5 * base / 15.0
