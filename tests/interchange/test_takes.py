"""Takes of many programs become performances that last as long as they were recorded; what is missing is reported."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.animation.keyframes import Keyframes
from faceposer.errors import FacePoserError
from faceposer.interchange.formats import write
from faceposer.interchange.reading import read_performance, read_pose
from faceposer.model.face_model import FaceModel
from faceposer.model.sampling import resampled
from faceposer.render.options import OutputOptions
from faceposer.training.takes import read_take
from tests.files.test_sample_times import timecode

CASES = Path(os.environ.get("FACEPOSER_CASES", ""))
needs_cases = pytest.mark.skipif("FACEPOSER_CASES" not in os.environ, reason="needs the inputs in FACEPOSER_CASES")


def take(path: Path, times: Sequence[object], weights: Sequence[float | None], heading: str = "Timecode") -> Path:
    """Write a table in which ``weights`` of jawOpen are at ``times``; None stands for a frame without a face."""
    lines = [f"{heading},BlendShapeCount,JawOpen,HeadYaw"]
    for time, weight in zip(times, weights, strict=True):
        lines.append(f"{time},0" if weight is None else f"{time},61,{weight:.6f},0.1")
    path.write_text("\n".join(lines) + "\n")
    return path


def yawn(n: int) -> list[float]:
    return [0.5 - 0.5 * float(np.cos(2.0 * np.pi * i / n)) for i in range(n)]


def test_lost_faces_and_missing_rows_keep_their_time(low: FaceModel, tmp_path: Path) -> None:
    codes, ramp = [timecode(2 * i, 60) for i in range(90)], [i / 90 for i in range(90)]
    lost = take(tmp_path / "a.csv", codes, [*ramp[:30], *[None] * 30, *ramp[60:]])
    missing = take(tmp_path / "b.csv", codes[:30] + codes[60:], ramp[:30] + ramp[60:])
    for path, said in ((lost, "have no face"), (missing, "are missing")):
        read = read_performance(path, low)
        assert (len(read.performance), read.performance.rate) == (90, 30.0)
        assert f"30 of its 90 frames {said} (the first at 1.00 s, at most 1.00 s at once)" in read.note
        jaw = read.performance.weights(low)[:, low.character.shape_names.index("jawOpen")]
        np.testing.assert_allclose(jaw, ramp, atol=1e-3)
    assert read_pose(lost, low, 45).coefficients == pytest.approx(
        read_performance(lost, low).performance.coefficients[45]
    )


def test_a_stated_rate_overrides_the_times(low: FaceModel, tmp_path: Path) -> None:
    path = take(tmp_path / "a.csv", [timecode(i, 24) for i in range(12)], yawn(12))
    assert read_performance(path, low).performance.rate == 60.0
    read = read_performance(path, low, 24.0)
    assert read.performance.rate == 24.0
    assert "assumed" not in read.note


def test_rates_stated_above_the_header(low: FaceModel, tmp_path: Path) -> None:
    for facts in ("# fps: 25\n", "Take,x\nFrame Rate,25\n\n", "frame_rate=25\n"):
        (tmp_path / "a.csv").write_text(facts + "jawOpen\n" + "\n".join(["0.5"] * 50))
        read = read_take(tmp_path / "a.csv")
        assert (read.rate, read.notes) == (25.0, ())
    (tmp_path / "a.csv").write_text("frame,FPS,jawOpen\n" + "\n".join(f"{i},25,0.5" for i in range(50)))
    assert (read_take(tmp_path / "a.csv").rate, read_take(tmp_path / "a.csv").notes) == (25.0, ())
    (tmp_path / "a.csv").write_text("jawOpen\n" + "\n".join(["0.5"] * 50))
    assert read_take(tmp_path / "a.csv").notes == ("It does not state times; 30 frames per second were assumed.",)


@pytest.mark.parametrize("rate", [24.0, 30000 / 1001, 50.0])
def test_three_seconds_stay_three_seconds(rate: float, low: FaceModel, tmp_path: Path) -> None:
    n = round(3.0 * rate)
    path = take(tmp_path / "a.csv", [f"{i / rate:.4f}" for i in range(n)], yawn(n), "Time (s)")
    performance = read_performance(path, low).performance
    assert performance.seconds == pytest.approx(3.0, abs=0.01)
    for suffix in (".csv", ".json", ".glb"):
        write(tmp_path / f"b{suffix}", low, performance)
        again = read_performance(tmp_path / f"b{suffix}", low).performance
        assert len(again) == n
        assert again.seconds == pytest.approx(performance.seconds, rel=5e-4)
    keyframes = Keyframes.of_performance(performance)
    assert keyframes.length / keyframes.rate == pytest.approx(performance.seconds)
    for other in (24.0, 25.0, 30.0, 60.0, 120.0):
        assert resampled(performance, other).seconds == pytest.approx(performance.seconds, abs=0.6 / other)


@pytest.mark.gl
def test_a_video_lasts_as_long_as_the_take(low: FaceModel, tmp_path: Path) -> None:
    codes = [timecode(i, 30) for i in range(90) if not 30 <= i < 60]
    performance = read_performance(take(tmp_path / "a.csv", codes, yawn(60)), low).performance
    write(tmp_path / "a.gif", low, performance, OutputOptions(size=(32, 32)))
    with Image.open(tmp_path / "a.gif") as video:
        durations = []
        for frame in range(video.n_frames):
            video.seek(frame)
            durations.append(video.info["duration"])
    assert sum(durations) == pytest.approx(3000.0, abs=20.0)


def test_keys_of_gltf_stay_at_their_seconds(low: FaceModel, tmp_path: Path) -> None:
    path = take(tmp_path / "a.csv", [f"{i / 30:.4f}" for i in range(90)], yawn(90), "Time (s)")
    write(tmp_path / "a.glb", low, read_performance(path, low).performance)
    read = read_performance(tmp_path / "a.glb", low, 60.0).performance
    assert (read.rate, read.seconds) == (60.0, pytest.approx(3.0))


def test_long_names_in_headers_take_no_time(low: FaceModel, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Timecode," + "a:" * 12_000 + ",jawOpen\n0,1,0.5\n")
    assert read_performance(tmp_path / "a.csv", low).performance.seconds > 0.0


def test_takes_without_end_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,jawOpen\n" + "0,0\n" * 250_001)
    with pytest.raises(FacePoserError, match="more than 250,000 frames"):
        read_take(tmp_path / "a.csv")


@needs_cases
@pytest.mark.parametrize(
    ("name", "count", "rate", "said"),
    [
        ("tc30.csv", 90, 30.0, ""),
        ("tc24.csv", 72, 24.0, ""),
        ("lost.csv", 90, 30.0, "30 of its 90 frames have no face"),
        ("drop.csv", 90, 30.0, "30 of its 90 frames are missing"),
        ("cap.txt", 90, 30.0, "30 of its 90 frames are missing"),
        ("a2f.csv", 90, 60.0, ""),
        ("mp.csv", 90, 25.0, ""),
        ("semi_comma.csv", 90, 30.0, ""),
        ("sep.csv", 90, 30.0, ""),
    ],
)
def test_the_cases_are_right(name: str, count: int, rate: float, said: str) -> None:
    read = read_take(CASES / "takes" / name)
    assert (len(read.frames), read.rate) == (count, rate)
    assert " ".join(read.notes).startswith(said)
    assert bool(said) == bool(read.notes)
    assert read.frames.max() > 0.5
