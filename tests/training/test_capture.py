"""Takes of Live Link Face and Face Cap are read by the names of their columns, bad ones refused in one sentence."""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES
from faceposer.training.capture import Capture, missing_shapes, read_capture


def write(path: Path, rows: list[list[object]], names: tuple[str, ...] = ARKIT_SHAPES) -> Path:
    header = ["Timecode", "BlendShapeCount", *(name[0].upper() + name[1:] for name in names), "HeadYaw"]
    path.write_text("\n".join(",".join(map(str, row)) for row in [header, *rows]) + "\n")
    return path


def row(values: np.ndarray | list[float]) -> list[object]:
    return ["00:00:00:01", 61, *values, 0.5]


def write_face_cap(path: Path, names: list[str], frames: list[list[object]]) -> Path:
    lines = [["info", "timestamp", "head position xyz", "and so on"], ["bs", *names]]
    lines += [
        ["k", 17 * i, 0.1, 0.2, -0.3, 5.0, 6.0, 7.0, 8.0, 9.0, 8.5, 9.5, *map(str, w)] for i, w in enumerate(frames)
    ]
    path.write_text("\r\n".join(",".join(map(str, line)) for line in lines) + "\r\n")
    return path


def test_columns_are_found_by_name_in_any_order(tmp_path: Path) -> None:
    values = np.random.default_rng(0).random((3, len(ARKIT_SHAPES))).round(6)
    straight = write(tmp_path / "a.csv", [row(line) for line in values])
    order = np.random.default_rng(1).permutation(len(ARKIT_SHAPES))
    shuffled = write(tmp_path / "b.csv", [row(line[order]) for line in values], tuple(ARKIT_SHAPES[i] for i in order))
    for path in (straight, shuffled):
        capture = read_capture(path)
        assert capture.shape_names == ARKIT_SHAPES
        assert capture.missing == ()
        np.testing.assert_array_equal(capture.weights, values)


def test_shapes_may_be_missing_and_spelled_in_other_ways(tmp_path: Path) -> None:
    names = ("mouthSmile_R", "JAW_OPEN", "eyeblinkleft", "noseShine")
    capture = read_capture(write(tmp_path / "a.csv", [row([0.1, 0.2, 0.3, 7.0])], names))
    assert capture.shape_names == ("eyeBlinkLeft", "jawOpen", "mouthSmileRight")
    np.testing.assert_array_equal(capture.weights, [[0.3, 0.2, 0.1]])
    assert len(capture.missing) == 49
    assert "tongueOut" in capture.missing
    other = Capture(("tongueOut",), np.ones((1, 1)))
    assert missing_shapes([capture, other]) == tuple(name for name in capture.missing if name != "tongueOut")


def test_both_sides_of_a_shape_that_has_none_are_averaged(tmp_path: Path) -> None:
    names = ("browInnerUp_L", "jawOpen", "BrowInnerUpRight", "cheekPuffLeft")
    capture = read_capture(write(tmp_path / "a.csv", [row([0.2, 0.7, 0.4, 0.5])], names))
    assert capture.shape_names == ("jawOpen", "browInnerUp", "cheekPuff")
    np.testing.assert_allclose(capture.weights, [[0.7, 0.3, 0.5]])


def test_frames_without_a_face_are_left_out(tmp_path: Path) -> None:
    lost: list[list[object]] = [["00:00:00:02", 0], ["00:00:00:03", 0, *[""] * 52, ""], []]
    path = write(tmp_path / "a.csv", [row([0.1] * 52), *lost, row([0.2] * 52)])
    np.testing.assert_array_equal(read_capture(path).weights[:, 0], [0.1, 0.2])


def test_face_caps_text_is_read(tmp_path: Path) -> None:
    path = write_face_cap(
        tmp_path / "a.txt", ["browInnerUp", "browDown_L", "jawOpen"], [[0.1, 0.2, 0.3], [0.4, 0.5, 1]]
    )
    capture = read_capture(path)
    assert capture.shape_names == ("jawOpen", "browDownLeft", "browInnerUp")
    np.testing.assert_array_equal(capture.weights, [[0.3, 0.2, 0.1], [1.0, 0.5, 0.4]])


def test_percentages_are_told_from_single_wrong_values(tmp_path: Path) -> None:
    names, jaw = ("jawOpen", "mouthClose"), np.linspace(0.0, 100.0, 20)
    capture = read_capture(write(tmp_path / "a.csv", [row([value, 1.5]) for value in jaw], names))
    np.testing.assert_allclose(capture.weights[:, 0], jaw / 100.0)
    np.testing.assert_allclose(capture.weights[:, 1], 0.015)
    assert capture.notes == ("The weights reach 100 and were read as percentages.",)
    wrong = [row([0.1, 0.5]) for _ in jaw]
    wrong[7] = row([57.5, 0.5])
    with pytest.raises(FacePoserError, match=r"Line 9 of .* '57.5' in column JawOpen"):
        read_capture(write(tmp_path / "b.csv", wrong, names))
    with pytest.raises(FacePoserError, match=r"Line 2 of .* '1000' in column JawOpen"):
        read_capture(write(tmp_path / "c.csv", [row([1000, 0.5])] * 20, names))


def test_bad_takes_are_refused_by_place(tmp_path: Path) -> None:
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00binary")
    (tmp_path / "word.txt").write_text("bs,jawOpen\nk,0,0,0,0,0,0,0,0,0,0,0,0.5\nx,1\n")
    (tmp_path / "before.txt").write_text("info,a\nk,0,0,0,0,0,0,0,0,0,0,0,0.5\n")
    (tmp_path / "twice.txt").write_text("bs,jawOpen\nbs,jawOpen\n")
    (tmp_path / "empty.csv").write_text("")
    jaw = ("jawOpen",)
    cases = {
        "no name of a shape": write(tmp_path / "1.csv", [], ("jaw",)),
        "no frame with a face": write(tmp_path / "2.csv", []),
        "Line 3 of .* has 'high' in column TongueOut": write(
            tmp_path / "3.csv",
            [row([0.0] * 52), row([0.0] * 51 + ["high"])],  # type: ignore[list-item]
        ),
        "Line 2 of .* has 33 values instead of 55": write(tmp_path / "4.csv", [row([0.0] * 30)]),
        "Line 2 of .* has 6 values": write(tmp_path / "5.csv", [[*row([0.5]), 1, 2]], jaw),
        "Line 2 of .* 'nan' in column JawOpen": write(tmp_path / "6.csv", [row([float("nan")])], jaw),
        "Line 2 of .* '57.5' in column JawOpen": write(tmp_path / "7.csv", [row([57.5])], jaw),
        "Line 3 of .* '' in column JawOpen": write(
            tmp_path / "8.csv",
            [row([0.1, 0.2]), row(["", 0.2])],  # type: ignore[list-item]
            ("jawOpen", "tongueOut"),
        ),
        r"2 columns for jawOpen \(JawOpen, JawOpen\)": write(
            tmp_path / "9.csv", [row([0.5, 0.5])], ("jawOpen", "jawOpen")
        ),
        r"2 columns for eyeBlinkLeft \(EyeBlink_L, EyeBlinkLeft\)": write(
            tmp_path / "10.csv", [], ("eyeBlink_L", "eyeBlinkLeft")
        ),
        "cannot be read": tmp_path / "missing.csv",
        "is not a text file": tmp_path / "binary.csv",
        "no name of a shape such": tmp_path / "empty.csv",
        "Line 3 of .* begins with 'x'": tmp_path / "word.txt",
        "Line 2 of .* is a frame before": tmp_path / "before.txt",
        "Line 2 of .* names the shapes again": tmp_path / "twice.txt",
        "Line 4 of .* has 13 values instead of 14": write_face_cap(
            tmp_path / "short.txt", ["jawOpen", "jawLeft"], [[0.1, 0.2], [0.1]]
        ),
        "Line 3 of .* 'a' in column jawLeft": write_face_cap(
            tmp_path / "letters.txt", ["jawOpen", "jawLeft"], [[0.1, "a"]]
        ),
    }
    for what, path in cases.items():
        with pytest.raises(FacePoserError, match=what) as caught:
            read_capture(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_channels_are_chosen_by_name() -> None:
    capture = Capture(("jawOpen", "tongueOut"), np.array([[0.1, 0.2]]))
    chosen = capture.with_shapes(("tongueOut", "cheekPuff", "jawOpen"))
    assert chosen.shape_names == ("tongueOut", "cheekPuff", "jawOpen")
    np.testing.assert_array_equal(chosen.weights, [[0.2, 0.0, 0.1]])


def test_rest_and_jumps_are_taken_out() -> None:
    names = ("jawOpen", "eyeBlinkLeft")
    weights = np.tile([0.15, 0.1], (100, 1))
    weights[40:60, 0] = np.linspace(0.2, 0.9, 20)
    weights[60:65, 0] = 0.9
    weights[80, 1] = 1.0
    capture = Capture(names, weights)
    steady = capture.without_jumps(0.3)
    # The fall from 0.9 back to rest in one frame is a jump, the blink is not.
    assert len(steady.weights) == 99
    rested = steady.relative_to_rest(5.0)
    assert rested.weights.min() == 0.0
    assert rested.weights[:, 0].max() == pytest.approx(0.75)
    assert np.median(rested.weights[:, 1]) == pytest.approx(0.0)


def test_takes_of_the_app_have_all_channels() -> None:
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        pytest.skip("FACEPOSER_CAPTURES is not set")
    for path in sorted(Path(folder).glob("alex_*.csv")):
        capture = read_capture(path)
        assert capture.shape_names == ARKIT_SHAPES
        assert len(capture.weights) > 1000


@pytest.mark.parametrize(
    "form", ["A{n:02d}_{snake}", "{name}_Head_Mesh", "blendShapes.{name}", "bs_{name}", "F.m_{name} (w)"]
)
def test_names_with_affixes_are_read_as_those_of_rigs(form: str, tmp_path: Path) -> None:
    snake = [re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).title() for name in ARKIT_SHAPES]
    names = [form.format(n=i, name=name, snake=snake[i]) for i, name in enumerate(ARKIT_SHAPES)]
    path = tmp_path / "a.csv"
    rows = [[0.01 * ((i + k) % 50) for k in range(52)] for i in range(3)]
    path.write_text(
        "\n".join(",".join(map(str, row)) for row in [["Timecode", *names], *[[i, *r] for i, r in enumerate(rows)]])
    )
    capture = read_capture(path)
    assert capture.shape_names == ARKIT_SHAPES
    np.testing.assert_allclose(capture.weights, rows)
    assert any("are read without their" in note for note in capture.notes) == (not form.startswith("blendShapes"))


def test_of_two_spellings_side_by_side_the_more_frequent_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("jawOpen,mouthClose,browInnerUp,Jaw_Open\n" + "0.5,0.1,0.2,0.9\n" * 3)
    capture = read_capture(path)
    assert capture.weights[0, capture.shape_names.index("jawOpen")] == 0.5
    assert "not used" in capture.notes[0]


def test_lines_of_nan_are_frames_without_a_face(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,jawOpen,mouthClose\n0,0.1,0\n0.1,NaN,nan\n0.2,0.3,0\n")
    capture = read_capture(path)
    assert capture.lost == 1
    np.testing.assert_allclose(capture.weights[:, 0], [0.1, 0.3])
    path.write_text("time,jawOpen,mouthClose\n0,0.1,0\n0.1,NaN,0\n")
    with pytest.raises(FacePoserError, match=r"Line 3 .* has 'NaN' in column jawOpen"):
        read_capture(path)


def test_a_whole_shape_is_used_in_place_of_its_halves(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("browInnerUp,browInnerUp_L,browInnerUp_R,jawOpen\n0.5,0.2,0.2,0\n")
    capture = read_capture(path)
    assert capture.weights[0, capture.shape_names.index("browInnerUp")] == 0.5
    assert capture.notes == ("The halves of browInnerUp are not used, since the whole is in column 'browInnerUp'.",)
