"""Times of samples are understood in their many forms, and frames lie at them."""

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.files.sample_times import (
    USUAL_RATE,
    Frames,
    frames_at,
    frames_in_order,
    frames_numbered,
    interpolated,
    placed,
)
from faceposer.files.time_columns import is_frame_number, is_time, times_of

NTSC = 1000.0 / 1001.0


def timecode(frame: int, base: int, mark: str = ":", drop: bool = False) -> str:
    """Return the timecode of ``frame``; drop-frame skips the first numbers of nine of ten minutes."""
    if drop:
        skipped = base // 15
        ten, one = base * 600 - 9 * skipped, base * 60 - skipped
        tens, rest = divmod(frame, ten)
        frame += 9 * skipped * tens + (skipped * ((rest - skipped) // one) if rest >= skipped else 0)
    seconds, count = divmod(frame, base)
    return f"{seconds // 3600 % 24:02}:{seconds // 60 % 60:02}:{seconds % 60:02}{mark}{count:02}"


def frames_of(heading: str, cells: list[str], rate: float | None = None) -> Frames:
    times = times_of(heading, cells)
    assert times is not None
    return frames_at(times.seconds, "a.csv", rate)


@pytest.mark.parametrize("base", [12, 15, 24, 25, 30, 48, 50, 60, 100, 120])
@pytest.mark.parametrize("step", [1, 2])
def test_the_base_of_timecodes_is_inferred(base: int, step: int) -> None:
    frames = frames_of("Timecode", [timecode(i, base) for i in range(0, 4 * base, step)])
    assert frames.rate == pytest.approx(base / step)
    assert frames.length / frames.rate == pytest.approx(4.0, abs=step / base)
    assert frames.notes == ()
    times = times_of("Timecode", [timecode(i, base) for i in range(0, 4 * base, step)])
    assert times is not None
    assert times.note == ""


@pytest.mark.parametrize("base", [30, 60])
@pytest.mark.parametrize("mark", [":", ";"])
def test_drop_frame_is_inferred(base: int, mark: str) -> None:
    numbers = range(59 * base, 11 * 60 * base)
    dropped = frames_of("Timecode", [timecode(i, base, mark, drop=True) for i in numbers])
    assert dropped.rate == pytest.approx(base * NTSC)
    assert dropped.length == len(numbers)
    assert dropped.notes == ()
    # The numbers tell that nothing is dropped, however they are spelled.
    whole = frames_of("Timecode", [timecode(i, base, mark) for i in numbers])
    assert whole.rate == base
    short = frames_of("Timecode", [timecode(i, base, mark) for i in range(3 * base)])
    assert short.rate == pytest.approx(base * NTSC if mark == ";" else base)


def test_seconds_with_gaps_tell_the_base_too() -> None:
    times = times_of("Timecode", [timecode(i, 60) for i in range(0, 180, 2) if not 60 <= i < 120])
    assert times is not None
    assert times.note == ""
    assert times.seconds[-1] == pytest.approx(2.0 + 58.0 / 60.0)


def test_an_unknown_base_is_assumed_and_said() -> None:
    times = times_of("Timecode", [timecode(i, 24) for i in range(12)])
    assert times is not None
    assert times.note.endswith("60 were assumed.")


def test_times_go_on_past_midnight() -> None:
    frames = frames_of("Timecode", [timecode(i, 25) for i in range(25 * 86_399, 25 * 86_402)])
    assert (frames.rate, frames.length) == (25.0, 75)


@pytest.mark.parametrize("rate", [12.0, 24 * NTSC, 24.0, 25.0, 30 * NTSC, 30.0, 50.0, 60 * NTSC, 60.0, 120.0])
@pytest.mark.parametrize(
    ("heading", "scale", "digits"),
    [
        ("Time (s)", 1.0, 4),
        ("Time (Seconds)", 1.0, 6),
        ("timeCode", 1.0, 4),
        ("time_ms", 1e3, 0),
        ("timestamp", 1e3, 1),
        ("Timestamp [µs]", 1e6, 0),
        ("timestamp_ns", 1e9, 0),
        ("frameTime", 1.0, 5),
    ],
)
def test_seconds_and_their_parts(rate: float, heading: str, scale: float, digits: int) -> None:
    n = round(3.0 * rate)
    frames = frames_of(heading, [f"{scale * (7.0 + i / rate):.{digits}f}" for i in range(n)])
    assert frames.rate == pytest.approx(rate, rel=1e-9)
    assert frames.length == n
    np.testing.assert_array_equal(frames.places, np.arange(n))


def test_a_unit_that_was_inferred_is_said() -> None:
    for heading, note in (("time", "read as milliseconds"), ("Time (s)", "read as milliseconds")):
        times = times_of(heading, [f"{40 * i}" for i in range(50)])
        assert times is not None
        assert note in times.note
        assert times.seconds[-1] == pytest.approx(1.96)
    assert times_of("time", ["0", "1", "2"]) is None


@pytest.mark.parametrize(
    "cells",
    [
        [f"10:00:{i / 25:06.3f}" for i in range(75)],
        [f"10:00:{i / 25:06.3f}".replace(".", ",") for i in range(75)],
        [f"00:{i / 25:06.3f}" for i in range(75)],
        [f"00:00:{i // 25:02}:{40 * (i % 25):03}" for i in range(75)],
        [f"2026-05-01T12:00:{i / 25:06.3f}Z" for i in range(75)],
        [f"2026-05-01 12:00:{i / 25:09.6f}" for i in range(75)],
        [f"10:00:{i // 25:02}" for i in range(75)],
        [timecode(i // 2, 25) for i in range(150)][::2],
    ],
)
def test_clock_times_and_dates(cells: list[str]) -> None:
    frames = frames_of("time", cells)
    assert frames.rate == pytest.approx(25.0)
    assert frames.length == 75


def test_several_samples_at_a_time_are_spread() -> None:
    frames = frames_of("Timecode", [timecode(i // 2, 30) for i in range(180)])
    assert (frames.rate, frames.length) == (60.0, 180)
    assert frames.notes == ("Most of its samples share their times; they were spread evenly between these.",)
    rounded = frames_of("time", [f"{i / 120:.2f}" for i in range(360)])
    assert (rounded.rate, rounded.length, rounded.notes) == (120.0, 360, ())


def test_gaps_are_kept_and_what_is_repeated_is_said() -> None:
    seconds = np.arange(90) / 30.0
    frames = frames_at(np.delete(seconds, slice(30, 60)), "a.csv")
    assert (frames.rate, frames.length) == (30.0, 90)
    np.testing.assert_array_equal(frames.places, np.delete(np.arange(90), slice(30, 60)))
    # A gap that is no whole number of frames.
    odd = frames_at(np.concatenate([seconds[:30], 2.013 + seconds[:30]]), "a.csv")
    assert (odd.rate, odd.length) == (30.0, 90)
    twice = frames_at(np.insert(seconds, 40, seconds[40]), "a.csv")
    assert twice.length == 90
    assert "left out" in twice.notes[0]
    assert np.isnan(twice.places).sum() == 1
    few = frames_at(np.insert(seconds[:19], 7, seconds[7]), "a.csv")
    assert (few.rate, few.length) == (30.0, 19)
    again = frames_at(np.concatenate([seconds[:30], seconds[:30]]), "a.csv")
    assert again.length == 60
    assert "go back at sample 31" in again.notes[0]


def test_uneven_samples_are_interpolated_at_their_times() -> None:
    rng = np.random.default_rng(0)
    seconds = np.cumsum(rng.uniform(0.02, 0.05, 300))
    frames = frames_at(seconds, "a.csv")
    assert not frames.even
    assert "interpolated" in frames.notes[0]
    values, notes = interpolated(frames, np.ones(300, dtype=bool), (3.0 * (seconds - seconds[0]))[:, None])
    assert notes == ()
    at = np.arange(frames.length) / frames.rate
    np.testing.assert_allclose(values[:-1, 0], 3.0 * at[:-1], atol=1e-9)
    # Keys are no frames: the value between them is at its time.
    keys = frames_at(np.array([0.0, 1.0, 3.0]), "a.csv")
    assert keys.rate == USUAL_RATE
    sampled, _ = interpolated(keys, np.ones(3, dtype=bool), np.array([[0.0], [1.0], [0.0]]))
    assert sampled.argmax() == 30
    assert len(sampled) == 91


def test_a_stated_rate_keeps_the_gaps() -> None:
    seconds = np.delete(np.arange(90) / 30.0, slice(30, 60))
    frames = frames_at(seconds, "a.csv", 24.0)
    assert (frames.rate, frames.length) == (24.0, 90)
    assert frames_at(np.array([0.0, 0.03, 0.06, 1e9]), "a.csv", 24.0).length == 4


@pytest.mark.parametrize("last", [1e7, 1e13, 1e19])
def test_times_that_are_mostly_empty_are_refused(last: float) -> None:
    with pytest.raises(FacePoserError, match=r"'a\.csv' has 4 samples in .* most of which are empty"):
        frames_at(np.array([0.0, 0.03, 0.06, last]), "a.csv")
    with pytest.raises(FacePoserError, match="most of which are missing"):
        frames_numbered(np.array([0.0, 1.0, 2.0, 1e9]), "a.csv", None)


def test_times_that_tell_nothing_are_said() -> None:
    assert frames_at(np.zeros(5), "a.csv").notes == ("Its times do not rise; 30 frames per second were assumed.",)
    assert "not plausible" in frames_at(np.arange(5) * 1e-5, "a.csv").notes[0]
    assert "less than a microsecond" in frames_at(np.arange(5) * 1e-310, "a.csv").notes[0]
    assert frames_in_order(1, None).notes == ()
    numbered = frames_numbered(np.array([5.0, 6.0, 9.0]), "a.csv", None)
    np.testing.assert_array_equal(numbered.places, [0.0, 1.0, 4.0])
    assert "assumed" in numbered.notes[0]
    assert frames_numbered(np.array([5.0, 6.0, 9.0]), "a.csv", 24.0).notes == ()


def test_lost_samples_are_interpolated_and_held_at_the_ends() -> None:
    seen = np.array([False, True, False, False, True, False])
    values, notes = interpolated(frames_in_order(6, 30.0), seen, np.array([[1.0], [4.0]]))
    np.testing.assert_allclose(values[:, 0], [1.0, 1.0, 2.0, 3.0, 4.0, 4.0])
    assert "4 of its 6 frames have no face" in notes[0]
    assert "they were interpolated, and the nearest pose is held at the ends" in notes[0]


def test_a_sample_at_the_time_of_a_lost_one_is_not_forgotten() -> None:
    frames = frames_at(np.array([0.0, 0.0, 0.1, 0.2]), "a.csv")
    values, _ = interpolated(frames, np.array([True, False, False, False]), np.array([[0.5]]))
    np.testing.assert_array_equal(values, np.full((3, 1), 0.5))


def test_markers_are_not_seen_where_no_sample_is() -> None:
    values = np.arange(8.0).reshape(4, 2)
    values[1, 1] = np.nan
    frames = frames_at(np.array([0.0, 0.1, 0.2, 0.4]), "a.csv", 10.0)
    whole, notes = placed(frames, values)
    np.testing.assert_array_equal(whole[[0, 1, 2, 4]], values)
    assert np.isnan(whole[3]).all()
    assert "1 of its 5 frames is missing" in notes[0]
    rng = np.random.default_rng(0)
    seconds = np.cumsum(rng.uniform(0.02, 0.05, 100))
    seconds[50:] += 1.0
    uneven = frames_at(seconds, "a.csv")
    spread, notes = placed(uneven, seconds[:, None])
    blank = np.isnan(spread[:, 0])
    assert blank.sum() == pytest.approx(uneven.rate, abs=3)
    np.testing.assert_allclose(
        spread[~blank, 0][:-1], seconds[0] + np.flatnonzero(~blank)[:-1] / uneven.rate, atol=1e-9
    )
    assert "left blank" in notes[0]


def test_headings_of_times_and_frames() -> None:
    for heading in (
        "Time (HH:MM:SS.mmm)",
        "Timestamp [UTC]",
        "Timecode",
        "TIME",
        "Time (s)",
        "time [ms]",
        "timestampMs",
        "t",
        "elapsed_time_s",
        "Milliseconds",
    ):
        assert is_time(heading), heading
    for heading in ("jawOpen", "mouthClose", "timer", "sometimes", "s", "", "x" * 10_000):
        assert not is_time(heading), heading
    for heading in ("Frame", "frame_number", "frameId", "Frame No."):
        assert is_frame_number(heading), heading


def test_few_samples_with_a_gap_of_an_hour_are_refused() -> None:
    times = np.concatenate([np.arange(100) / 60.0, 3600.0 + np.arange(100) / 60.0])
    with pytest.raises(FacePoserError, match="most of which are empty"):
        frames_at(times, "a.csv")
