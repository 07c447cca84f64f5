"""The CSV is what Live Link Face writes: header, times, weights within their limits, and eyes that turn."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.interchange.formats import write
from faceposer.interchange.live_link import HEADER, timecode, write_live_link
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.performance import Performance
from faceposer.model.shape_names import weight_map
from faceposer.solve.weight_fit import fit_weights_of_frames
from faceposer.training.capture import read_capture
from faceposer.training.takes import read_take

CAPTURES = (
    sorted(Path(os.environ.get("FACEPOSER_CAPTURES", "")).glob("*.csv")) if "FACEPOSER_CAPTURES" in os.environ else []
)
needs_captures = pytest.mark.skipif(not CAPTURES, reason="needs recordings of Live Link Face in FACEPOSER_CAPTURES")


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def smile(low: FaceModel) -> Performance:
    """From rest to a smile with a blink and a look to the left and down, as 0 to 1 at 30 frames a second."""
    full = low.coefficients_of({"mouthSmileLeft": 0.8, "eyeBlinkRight": 1.0})
    return Performance(np.linspace(0.0, 1.0, 61)[:, None] * full, 30.0)


def test_it_is_read_back_as_the_weights_that_fit(low: FaceModel, performance: Performance, tmp_path: Path) -> None:
    write_live_link(tmp_path / "a.csv", low, performance)
    capture = read_capture(tmp_path / "a.csv")
    assert capture.shape_names == ARKIT_SHAPES
    assert not capture.missing
    fitted = fit_weights_of_frames(low, performance.coefficients)
    np.testing.assert_allclose(
        capture.weights, fitted @ weight_map(ARKIT_SHAPES, low.character.shape_names).T, atol=1e-9
    )
    assert capture.weights.min() >= 0
    assert capture.weights.max() <= 1
    assert read_take(tmp_path / "a.csv").rate == pytest.approx(24.0)


def test_other_programs_find_names_counts_and_times(low: FaceModel, smile: Performance, tmp_path: Path) -> None:
    write_live_link(tmp_path / "a.csv", low, smile)
    rows = rows_of(tmp_path / "a.csv")
    assert tuple(rows[0]) == HEADER
    assert len(HEADER) == 63
    assert {row["BlendShapeCount"] for row in rows} == {"61"}
    assert [rows[i]["Timecode"] for i in (0, 1, 29, 30, 60)] == [
        "00:00:00:00.000",
        "00:00:00:02.000",
        "00:00:00:58.000",
        "00:00:01:00.000",
        "00:00:02:00.000",
    ]
    assert float(rows[60]["MouthSmileLeft"]) == pytest.approx(0.8, abs=0.02)
    assert float(rows[30]["EyeBlinkRight"]) == pytest.approx(0.5, abs=0.02)
    assert float(rows[60]["EyeBlinkLeft"]) == pytest.approx(0.0, abs=0.02)
    assert all(float(row[f"Head{turn}"]) == 0 for row in rows for turn in ("Yaw", "Pitch", "Roll"))


def test_a_pose_is_one_frame(low: FaceModel, tmp_path: Path) -> None:
    write(tmp_path / "a.csv", low, low.coefficients_of({"jawOpen": 1.0}))
    (row,) = rows_of(tmp_path / "a.csv")
    assert float(row["JawOpen"]) == pytest.approx(1.0, abs=0.02)
    assert read_take(tmp_path / "a.csv").rate == 30.0


def test_eyes_turn_as_the_weights_of_their_gaze_say(model: FaceModel, tmp_path: Path) -> None:
    looks = {"eyeLookInLeft": 1.0, "eyeLookOutRight": 1.0, "eyeLookDownLeft": 0.5, "eyeLookDownRight": 0.5}
    write(tmp_path / "a.csv", model, model.coefficients_of(looks))
    (row,) = rows_of(tmp_path / "a.csv")
    # To the character's right and down.
    assert float(row["LeftEyeYaw"]) == pytest.approx(0.55, abs=0.06)
    assert float(row["RightEyeYaw"]) == pytest.approx(0.65, abs=0.06)
    assert float(row["LeftEyePitch"]) == pytest.approx(0.305, abs=0.05)
    assert float(row["RightEyePitch"]) == pytest.approx(0.305, abs=0.05)
    assert float(row["LeftEyeRoll"]) == 0


@needs_captures
def test_header_times_and_eyes_are_those_of_real_files(model: FaceModel, tmp_path: Path) -> None:
    with CAPTURES[0].open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file)
        assert tuple(next(reader)) == HEADER
        rows = [row for row in reader if len(row) == len(HEADER) and all(row)][:400]
    assert rows[0][1] == str(len(HEADER) - 2)
    assert read_take(CAPTURES[0]).rate == pytest.approx(30.0, abs=0.1)
    take = np.array([[float(cell) for cell in row[2:]] for row in rows])
    lift = weight_map(model.character.shape_names, ARKIT_SHAPES)
    weights = read_capture(CAPTURES[0]).weights[: len(rows)] @ lift.T
    performance = Performance.from_weights(model, weights, 30.0)
    write_live_link(tmp_path / "a.csv", model, performance)
    ours = np.array([[float(row[name]) for name in HEADER[2:]] for row in rows_of(tmp_path / "a.csv")])
    for name, worst in (("EyePitch", 0.08), ("EyeYaw", 0.25)):
        for side in ("Left", "Right"):
            column = HEADER.index(side + name) - 2
            assert np.abs(ours[:, column] - take[:, column]).mean() < worst / 2


@pytest.mark.parametrize(
    ("seconds", "code"),
    [
        (0.0, "00:00:00:00.000"),
        (1.0 / 24.0, "00:00:00:02.500"),
        (0.9999999, "00:00:01:00.000"),
        (3661.5, "01:01:01:30.000"),
        (86400.0, "00:00:00:00.000"),
    ],
)
def test_timecodes_carry_over(seconds: float, code: str) -> None:
    assert timecode(seconds) == code


@pytest.mark.parametrize("rate", [12.0, 23.98, 25.0, 29.97, 30.0, 60.0, 120.0])
def test_the_rate_is_found_again(rate: float, low: FaceModel, tmp_path: Path) -> None:
    write_live_link(tmp_path / "a.csv", low, Performance(np.zeros((200, low.n_coefficients)), rate))
    assert read_take(tmp_path / "a.csv").rate == pytest.approx(rate, abs=0.011)


def test_the_rate_of_face_cap_and_of_takes_with_gaps(tmp_path: Path) -> None:
    lines = ["info,x", "bs,jawOpen", *(f"k,{1000 * i / 60:.3f}," + "0," * 10 + "0.5" for i in range(50) if i % 9)]
    (tmp_path / "a.txt").write_text("\n".join(lines))
    assert read_take(tmp_path / "a.txt").rate == pytest.approx(60.0, abs=0.01)


def test_halves_are_one_shape_and_missing_ones_rest(low: FaceModel, tmp_path: Path) -> None:
    character = low.character
    without = character.shape_names.index("tongueOut")
    assert without == len(character.shape_names) - 1
    model = build_face_model(
        replace(
            character,
            shape_names=character.shape_names[:without],
            shapes=character.shapes[:without],
            shape_limits=character.shape_limits[:without],
        )
    )
    write(tmp_path / "a.csv", model, model.coefficients_of({"browInnerUpLeft": 1.0}))
    (row,) = rows_of(tmp_path / "a.csv")
    assert float(row["BrowInnerUp"]) == pytest.approx(0.5, abs=0.1)
    assert float(row["TongueOut"]) == 0
    write(tmp_path / "b.csv", model, model.coefficients_of({"browInnerUp": 0.8, "cheekPuff": 0.6}))
    (row,) = rows_of(tmp_path / "b.csv")
    assert float(row["BrowInnerUp"]) == pytest.approx(0.8, abs=0.05)
    assert float(row["CheekPuff"]) == pytest.approx(0.6, abs=0.05)


def test_a_face_without_these_shapes_gets_a_sentence(tmp_path: Path) -> None:
    goblin = build_face_model(load_character("creature"))
    with pytest.raises(FacePoserError, match=r"Goblin has none of ARKit's 52 shapes.*json"):
        write(tmp_path / "a.csv", goblin, goblin.neutral())
    assert not [*tmp_path.iterdir()]
