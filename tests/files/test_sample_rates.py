"""Rates are found in times that are jittered, sparse, doubled or irregular; keys keep their seconds."""

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.files.sample_rates import key_rate
from faceposer.files.sample_times import Frames, frames_at, frames_numbered, interpolated, placed
from faceposer.files.time_columns import times_of


def frames_of(heading: str, cells: list[str], rate: float | None = None) -> Frames:
    times = times_of(heading, cells)
    assert times is not None
    return frames_at(times.seconds, "a.csv", rate)


@pytest.mark.parametrize("base", [24, 25, 30, 48, 50, 60, 120])
def test_parts_of_frames_in_timecodes_are_of_no_moment(base: int) -> None:
    rng = np.random.default_rng(base)
    cells = [f"10:00:{i // base:02}:{i % base:02}.{rng.integers(1000):03}" for i in range(180)]
    frames = frames_of("Timecode", cells)
    assert (frames.rate, frames.length, frames.notes) == (base, 180, ())
    frames = frames_of("Timecode", cells[:60] + cells[80:])
    assert (frames.rate, frames.length) == (base, 180)


@pytest.mark.parametrize("rate", [24.0, 25.0, 30.0, 60.0])
def test_jitter_of_parts_of_a_frame_is_no_gap(rate: float) -> None:
    rng = np.random.default_rng(1)
    seconds = (np.arange(180) + rng.uniform(0.0, 1.0, 180)) / rate
    frames = frames_at(seconds, "a.csv")
    assert (frames.rate, frames.length, frames.even) == (rate, 180, True)


@pytest.mark.parametrize(
    "steps",
    [
        0.02 + np.random.default_rng(0).exponential(0.02, 179),
        np.random.default_rng(1).uniform(0.02, 0.06, 179),
        np.clip(np.random.default_rng(2).normal(0.04, 0.008, 179), 0.005, None),
    ],
)
def test_irregular_samples_are_put_at_their_mean_rate(steps: np.ndarray) -> None:
    seconds = np.concatenate([[0.0], np.cumsum(steps)])
    frames = frames_at(seconds, "a.csv")
    assert frames.rate == pytest.approx(1.0 / steps.mean(), rel=0.06)
    assert frames.rate in (24.0, 25.0)
    assert (frames.length - 1) / frames.rate == pytest.approx(seconds[-1], abs=0.05)
    _, gaps = interpolated(frames, np.ones(180, dtype=bool), seconds[:, None])
    assert gaps == ()


def test_steps_of_one_and_two_frames_are_on_the_grid_of_a_known_rate() -> None:
    for choices in ([33, 67], [33, 33, 33, 67], [67, 67, 33]):
        steps = np.random.default_rng(0).choice(choices, 179)
        frames = frames_at(np.concatenate([[0.0], np.cumsum(steps)]) / 1e3, "a.csv")
        assert (frames.rate, frames.length) == (30.0, 1 + np.rint(steps / 33.3).sum())


@pytest.mark.parametrize("heading", ["time", "Time", "t", "timestamp", "timecode", "Time (s)", "seconds"])
def test_keys_keep_their_seconds(heading: str) -> None:
    cells = ["0", "2", "2.5", "6", "10"]
    frames = frames_of(heading, cells)
    assert (frames.rate, frames.length) == (30.0, 301)
    np.testing.assert_array_equal(frames.places, [0, 60, 75, 180, 300])
    assert frames.notes == ("Its samples are 0.5 to 4 s apart; they were interpolated at 30 frames per second.",)
    values, gaps = interpolated(frames, np.ones(5, dtype=bool), np.arange(5.0)[:, None])
    assert gaps == ()
    np.testing.assert_allclose(values[[0, 60, 75, 180, 300], 0], np.arange(5.0))
    # Another rate changes the frames, not the seconds.
    other = frames_of(heading, cells, 25.0)
    assert (other.rate, other.length) == (25.0, 251)
    positions, gaps = placed(frames, np.arange(5.0)[:, None])
    assert np.isfinite(positions).all()
    assert gaps == ()


@pytest.mark.parametrize(
    ("heading", "cells", "length"),
    [
        ("Time (s)", [str(i) for i in range(6)], 151),
        ("Timecode", [f"00:00:{i:02}.000" for i in range(20)], 571),
        ("Timecode", [f"00:00:{i:02}:00" for i in range(20)], 571),
        ("time", [f"{0.5 * i:.1f}" for i in range(20)], 286),
        ("time_ms", ["0", "2000", "2500", "6000"], 181),
        ("Time (s)", ["0", "20", "60"], 1801),
        ("time (min)", ["0", "0.1", "0.5"], 901),
    ],
)
def test_even_keys_are_no_frames(heading: str, cells: list[str], length: int) -> None:
    frames = frames_of(heading, cells)
    assert (frames.rate, frames.length) == (30.0, length)


def test_the_rate_of_keys_is_one_at_which_all_are_frames() -> None:
    for rate in (24.0, 25.0, 30.0, 50.0, 60.0):
        assert key_rate(np.array([0.0, 7.0, 31.0, 48.0]) / rate) == rate
    assert key_rate(np.array([0.0, 1.2345, 3.777])) == 30.0
    odd = frames_at(np.array([0.0, 1.2345, 3.777]), "a.csv")
    assert odd.length == 115
    values, _ = interpolated(odd, np.ones(3, dtype=bool), np.array([[0.0], [0.0], [1.0]]))
    assert values[-1, 0] == 1.0


@pytest.mark.parametrize(
    ("heading", "cells", "rate"),
    [
        ("Timecode", [f"10:00:{i // 25:02}.{i % 25:02}" for i in range(180)], 25.0),
        ("Timecode", [f"10:00:{i // 30:02}.{i % 30:02}" for i in range(180)], 30.0),
        ("Timecode", [f"10:00:{i // 24:02},{i % 24:02}" for i in range(180)], 24.0),
        ("Timecode", [f"10:00:00.{i:02}" for i in range(20)], 60.0),
        # Hundredths of a second.
        ("Time", [f"10:00:{i / 25:05.2f}" for i in range(180)], 25.0),
        ("Time", [f"10:00:{i / 50:05.2f}" for i in range(180)], 50.0),
        ("Time", [f"11:59:{50 + i / 25:06.3f} PM" for i in range(100)], 25.0),
        ("Time", [f"01.03.2024 10:00:{i / 25:06.3f}" for i in range(100)], 25.0),
        ("Time", [f"3/1/2024 10:00:{i / 25:06.3f} am" for i in range(100)], 25.0),
        ("Zeit", [f"{i / 25:.3f}".replace(".", ",") for i in range(100)], 25.0),
        ("delta_time", ["0.04"] * 100, 25.0),
        ("dt (ms)", ["40"] * 100, 25.0),
    ],
)
def test_more_spellings_of_times(heading: str, cells: list[str], rate: float) -> None:
    frames = frames_of(heading, cells)
    assert (frames.rate, frames.length) == (rate, len(cells))


def test_samples_at_almost_the_same_time_give_no_rate() -> None:
    frames = frames_at(np.array([0.0, 1e-310, 2e-310, 1.0, 2.0, 3.0]), "a.csv")
    assert 0.1 <= frames.rate <= 1000.0


def test_times_that_fall_are_sorted() -> None:
    frames = frames_at(np.arange(50)[::-1] / 25.0, "a.csv")
    assert (frames.rate, frames.length) == (25.0, 50)
    values, _ = interpolated(frames, np.ones(50, dtype=bool), np.arange(50.0)[:, None])
    np.testing.assert_array_equal(values[:, 0], np.arange(50.0)[::-1])
    assert "fall from the first sample to the last" in frames.notes[0]


def test_numbers_of_frames_keep_their_distances() -> None:
    frames = frames_numbered(2.0 * np.arange(10), "a.csv", None)
    np.testing.assert_array_equal(frames.places, 2.0 * np.arange(10))
    assert frames.notes[-1] == "Its numbers of frames rise by 2; the frames between them were interpolated."
    values, gaps = interpolated(frames, np.ones(10, dtype=bool), np.arange(10.0)[:, None])
    np.testing.assert_allclose(values[:, 0], np.arange(19.0) / 2.0)
    assert gaps == ()
    dropped = frames_numbered(2.0 * np.delete(np.arange(20), slice(5, 10)), "a.csv", 30.0)
    _, gaps = interpolated(dropped, np.ones(15, dtype=bool), np.zeros((15, 1)))
    assert "are missing" in gaps[0]


def test_times_that_cannot_be_read_are_told() -> None:
    cells = [f"{i / 25:.3f}" for i in range(50)]
    cells[20] = "?"
    times = times_of("time", cells)
    assert times is not None
    assert times.lost.startswith("A time in its column 'time' cannot be read ('?' of sample 21)")
    codes = [f"10:00:{i // 25:02}:{i % 25:02}" for i in range(50)]
    codes[20] = codes[30] = "??"
    times = times_of("Timecode", codes)
    assert times is not None
    assert times.lost.startswith("2 times in its column 'Timecode' cannot be read")


@pytest.mark.parametrize("heading", ["time", "Time (s)"])
def test_few_samples_with_a_long_gap_are_refused(heading: str) -> None:
    with pytest.raises(FacePoserError, match=r"3 samples in 100000 seconds, most of which are empty"):
        frames_of(heading, ["0", "0.04", "100000"])
