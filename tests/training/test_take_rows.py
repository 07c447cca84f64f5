"""Rows that are no frames, and columns that are no weights, are left out and told."""

from pathlib import Path

import pytest

from faceposer.interchange.reading import read_performance
from faceposer.model.face_model import FaceModel
from faceposer.training.take_rows import guessed, unread_note
from faceposer.training.takes import read_take


def write(path: Path, header: str, rows: list[str]) -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


ROWS = [f"{i / 25:.3f},{i / 50:.3f},0.1" for i in range(50)]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([*ROWS, "Average,0.9,0.9"], "Its last row has 'Average' in place of a time; it was left out."),
        ([*ROWS, ",0.9,0.9"], "Its last row has no time; it was left out."),
        ([*ROWS, "Mean,0.9,0.9", "Max,0.9,0.9"], "Its last 2 rows have 'Mean' in place of a time; they were left out."),
        ([*ROWS, "end of take,,"], "Its last row has 'end of take' in place of a time; it was left out."),
        ([*ROWS, "# end of take"], ""),
        ([*ROWS[:20], "// cut,,", *ROWS[20:]], ""),
        (["s,-,-", *ROWS], ""),
        ([row for row in ROWS for _ in range(2)], "50 of its rows repeat the row before and were left out."),
    ],
)
def test_rows_that_are_no_frames(rows: list[str], said: str, tmp_path: Path) -> None:
    read = read_take(write(tmp_path / "a.csv", "time,jawOpen,mouthClose", rows))
    assert (len(read.frames), read.rate) == (50, 25.0)
    assert read.frames[-1].tolist() == [0.98, 0.1]
    assert read.notes == ((said,) if said else ())


def test_footers_of_tables_with_frame_numbers(tmp_path: Path) -> None:
    rows = [*(f"{i},0.5" for i in range(30)), "Average,0.9"]
    read = read_take(write(tmp_path / "a.csv", "frame,jawOpen", rows), 24.0)
    assert len(read.frames) == 30
    assert read.notes == ("Its last row has 'Average' in place of a time; it was left out.",)


def test_samples_that_share_times_are_told(tmp_path: Path) -> None:
    rows = [f"{i // 2 / 25:.3f},{i / 100:.3f}" for i in range(100)]
    read = read_take(write(tmp_path / "a.csv", "time,jawOpen", rows))
    assert (len(read.frames), read.rate) == (100, 50.0)
    assert read.notes == ("Most of its samples share their times; they were spread evenly between these.",)


@pytest.mark.parametrize("heading", ["face_id", "FaceId", "person", "subject id", "face"])
def test_the_first_of_several_faces_is_read(heading: str, tmp_path: Path) -> None:
    rows = [f"{40 * (i // 2)},{'ab'[i % 2]},{0.1 + 0.5 * (i % 2)}" for i in range(60)]
    read = read_take(write(tmp_path / "a.csv", f"timestamp_ms,{heading},jawOpen", rows))
    assert (len(read.frames), read.rate) == (30, 25.0)
    assert set(read.frames[:, 0]) == {0.1}
    assert read.notes == ("It has 2 faces ('a', 'b'); that of 'a' was read.",)


def test_unread_columns_are_told_with_a_guess(low: FaceModel, tmp_path: Path) -> None:
    header = "time,JawOpn,mouthClose,HeadYaw,confidence,AU01"
    rows = [f"{i / 25:.3f},0.5,0.1,3,1,2" for i in range(50)]
    read = read_performance(write(tmp_path / "a.csv", header, rows), low)
    assert "2 columns were not read: 'JawOpn' (jawOpen?), 'AU01'." in read.note
    assert "It has no weights of 53 of the 54 shapes of Low-poly head, which stay at 0" in read.note
    assert "jawOpen" in read.note
    assert unread_note(["Timecode", "BlendShapeCount", "HeadRoll", "LeftEyePitch", "frame", ""]) == ""
    assert [guessed(name) for name in ("JawOpn", "eyeBlinkLft", "hat", "x" * 10_000)] == [
        "jawOpen",
        "eyeBlinkLeft",
        None,
        None,
    ]


def test_a_column_without_a_unit_that_counts_is_read_as_numbers(tmp_path: Path) -> None:
    read = read_take(write(tmp_path / "a.csv", "time,jawOpen", [f"{i + 1},0.5" for i in range(40)]))
    assert (len(read.frames), read.rate) == (40, 30.0)
    assert "have no unit and rise like numbers of frames" in read.notes[0]
