"""Takes of Live Link Face are read by the names of their columns, and bad ones are refused in one sentence."""

from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.capture import Capture, read_live_link_face
from faceposer.model.subject import ARKIT_SHAPES


def write(path: Path, rows: list[list[object]], names: tuple[str, ...] = ARKIT_SHAPES) -> Path:
    header = ["Timecode", "BlendShapeCount", *(name[0].upper() + name[1:] for name in names), "HeadYaw"]
    path.write_text("\n".join(",".join(map(str, row)) for row in [header, *rows]) + "\n")
    return path


def row(values: np.ndarray | list[float]) -> list[object]:
    return ["00:00:00:01", 61, *values, 0.5]


def test_columns_are_found_by_name_in_any_order(tmp_path: Path) -> None:
    values = np.random.default_rng(0).random((3, len(ARKIT_SHAPES))).round(6)
    straight = write(tmp_path / "a.csv", [row(line) for line in values])
    order = np.random.default_rng(1).permutation(len(ARKIT_SHAPES))
    shuffled = write(tmp_path / "b.csv", [row(line[order]) for line in values], tuple(ARKIT_SHAPES[i] for i in order))
    for path in (straight, shuffled):
        capture = read_live_link_face(path)
        assert capture.shape_names == ARKIT_SHAPES
        np.testing.assert_array_equal(capture.weights, values)


def test_frames_without_a_face_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", [row([0.1] * 52), ["00:00:00:02", 0], row([0.2] * 52)])
    assert len(read_live_link_face(path).weights) == 2


def test_bad_takes_are_refused_by_place(tmp_path: Path) -> None:
    cases = {
        "lacks jawOpen": write(tmp_path / "1.csv", [], tuple(n for n in ARKIT_SHAPES if n != "jawOpen")),
        "no frame with a face": write(tmp_path / "2.csv", []),
        "Line 3": write(tmp_path / "3.csv", [row([0.0] * 52), row([0.0] * 51 + ["high"])]),  # type: ignore[list-item]
        "Line 2": write(tmp_path / "4.csv", [row([0.0] * 30)]),
        "cannot be read": tmp_path / "missing.csv",
    }
    nan = write(tmp_path / "5.csv", [row([float("nan")] * 52)])
    (tmp_path / "6.csv").write_bytes(b"\xff\xfe\x00binary")
    for what, path in [*cases.items(), ("Line 2", nan), ("cannot be read", tmp_path / "6.csv")]:
        with pytest.raises(FacePoserError, match=what) as caught:
            read_live_link_face(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


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
    rested = steady.from_rest(5.0)
    assert rested.weights.min() == 0.0
    assert rested.weights[:, 0].max() == pytest.approx(0.75)
    assert np.median(rested.weights[:, 1]) == pytest.approx(0.0)
