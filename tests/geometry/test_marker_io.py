"""Markers are read from C3D and tables of several programs, gaps are filled, and bad files refused in one sentence."""

import contextlib
import importlib
import warnings
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.marker_io import MarkerMotion, fill_gaps, read_markers

NAMES = ("LipLeft", "LipRight", "Brow")


def write_c3d(path: Path, positions: np.ndarray, labels: tuple[str, ...], rate: float = 120.0) -> Path:
    """Write with the library; a marker that is NaN is marked as not seen, as C3D does: by a residual of -1."""
    c3d = pytest.importorskip("c3d", reason="the package c3d is not installed")
    writer = c3d.Writer(point_rate=rate, analog_rate=0.0)
    frames = []
    for frame in positions:
        points = np.zeros((len(labels), 5), dtype=np.float32)
        seen = np.isfinite(frame).all(axis=1)
        points[seen, :3] = frame[seen]
        points[~seen, :3] = 7.0
        points[~seen, 3] = -1.0
        frames.append((points, np.zeros((0, 0))))
    writer.add_frames(frames)
    writer.set_point_labels(list(labels))
    with path.open("wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writer.write(file)
    return path


def moving(n_frames: int = 5, n_markers: int = 3, seed: int = 0) -> np.ndarray:
    positions = np.random.default_rng(seed).normal(size=(n_frames, n_markers, 3)).round(3) * 100.0
    positions[1, 2] = np.nan
    return positions


def cells(values: np.ndarray) -> str:
    return ",".join("" if np.isnan(x) else f"{x:.6f}" for x in values.ravel())


def test_c3d_keeps_names_rate_unit_and_what_was_not_seen(tmp_path: Path) -> None:
    positions = moving()
    path = write_c3d(tmp_path / "a.c3d", positions, tuple(f"Anna:{name}" for name in NAMES))
    motion = read_markers(path)
    assert motion.names == NAMES
    np.testing.assert_allclose(motion.positions, positions, rtol=1e-5)
    assert motion.rate == 120.0
    assert motion.unit_scale == pytest.approx(0.1)
    np.testing.assert_array_equal(motion.seen, np.isfinite(positions).all(axis=2))


def test_c3d_points_without_a_label_are_left_out(tmp_path: Path) -> None:
    positions = moving(4, 5)
    motion = read_markers(write_c3d(tmp_path / "a.c3d", positions, ("A:x", "*12", "B:x", "", "C")))
    assert motion.names == ("A:x", "B:x", "C")
    np.testing.assert_allclose(motion.positions, positions[:, [0, 2, 4]], rtol=1e-5)


def test_damaged_c3d_is_refused(tmp_path: Path) -> None:
    data = write_c3d(tmp_path / "a.c3d", moving(200, 55, 1), tuple(f"M{i}" for i in range(55))).read_bytes()
    rng = np.random.default_rng(0)
    for size in (0, 10, 512, 1000, 5000, len(data) - 4000):
        path = tmp_path / "cut.c3d"
        path.write_bytes(data[:size])
        with pytest.raises(FacePoserError, match=r"cut\.c3d' (is damaged|ends after frame|has 0 points)") as caught:
            read_markers(path)
        assert "\n" not in str(caught.value)
    for _ in range(40):
        bad = bytearray(data)
        for place in rng.integers(0, 2000, 20):
            bad[place] = rng.integers(0, 256)
        path = tmp_path / "bad.c3d"
        path.write_bytes(bad)
        # It may be read or refused, but nothing else.
        with contextlib.suppress(FacePoserError):
            read_markers(path)


def test_without_the_package_the_sentence_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(name: str) -> ModuleType:
        raise ImportError(name)

    (tmp_path / "a.c3d").write_bytes(b"\0" * 1024)
    monkeypatch.setattr(importlib, "import_module", none)
    with pytest.raises(FacePoserError, match=r"pip install 'faceposer\[markers\]'"):
        read_markers(tmp_path / "a.c3d")


@pytest.mark.parametrize("form", ["{}.x,{}.y,{}.z", "{}_X,{}_Y,{}_Z", "{}:x,{}:y,{}:z", "{} z,{} y,{} x"])
def test_plain_tables(tmp_path: Path, form: str) -> None:
    positions = moving()
    header = ",".join(form.format(name, name, name) for name in NAMES)
    order = positions[:, :, ::-1] if form.startswith("{} z") else positions
    lines = [f"{i},{i / 60:.6f},{cells(frame)}" for i, frame in enumerate(order)]
    path = tmp_path / "a.csv"
    path.write_text("frame,time," + header + "\n" + "\n".join(lines) + "\n")
    motion = read_markers(path)
    assert motion.names == NAMES
    np.testing.assert_allclose(motion.positions, positions)
    assert motion.rate == pytest.approx(60.0, rel=1e-4)
    assert motion.unit_scale is None


def test_tables_need_neither_frame_nor_time_and_the_origin_is_not_seen(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("A.x,A.y,A.z,B.x,B.y,B.z\n1,2,3,0,0,0\n1,2,3,0,0,4\n")
    motion = read_markers(path)
    assert motion.rate is None
    np.testing.assert_array_equal(motion.positions[:, 0], [[1, 2, 3], [1, 2, 3]])
    np.testing.assert_array_equal(motion.seen, [[True, False], [True, True]])


def test_export_of_vicon_nexus(tmp_path: Path) -> None:
    positions = moving()
    lines = ["Trajectories", "100", ",,Anna:LipLeft,,,Anna:LipRight,,,Anna:Brow,,", "Frame,Sub Frame" + ",X,Y,Z" * 3]
    lines += [",," + ",".join(["mm"] * 9)]
    lines += [f"{i},0,{cells(frame)}" for i, frame in enumerate(positions, start=1)]
    path = tmp_path / "a.csv"
    path.write_text("\r\n".join([*lines, "", "Model Outputs", "100"]) + "\r\n")
    motion = read_markers(path)
    assert motion.names == NAMES
    np.testing.assert_allclose(motion.positions, positions)
    assert motion.rate == 100.0
    assert motion.unit_scale == pytest.approx(0.1)


def test_export_of_optitrack_motive(tmp_path: Path) -> None:
    positions = moving()
    lines = [
        "Format Version,1.23,Take Name,smile x,Capture Frame Rate,240.0,Export Frame Rate,120.0,Length Units,Meters",
        "",
        ",Type" + ",Rigid Body" * 3 + ",Marker" * 12,
        ",Name" + ",Head" * 3 + "".join(3 * f",Face:{name}" for name in (*NAMES[:2], "Unlabeled 8", NAMES[2])),
        ",ID" + ',"A1"' * 15,
        "," + ",Position" * 15,
        "Frame,Time (Seconds)" + ",X,Y,Z" * 5,
    ]
    other = np.ones(3)
    for i, frame in enumerate(positions):
        lines.append(f"{i},{i / 120:.6f},{cells(other)},{cells(frame[:2])},{cells(other)},{cells(frame[2])}")
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    motion = read_markers(path)
    assert motion.names == NAMES
    np.testing.assert_allclose(motion.positions, positions)
    assert motion.rate == 120.0
    assert motion.unit_scale == 100.0


def test_bad_tables_are_refused_by_place(tmp_path: Path) -> None:
    texts = {
        "no header of markers": "time,value\n1,2\n",
        "no header of markers ": "",
        r"no column A\.z": "A.x,A.y\n1,2\n",
        r"Line 1 of .* has two columns named A\.x": "A.x,A.y,A.z,A.x\n1,2,3,4\n",
        "Line 3 of .* has 2 values instead of 3": "A.x,A.y,A.z\n1,2,3\n1,2\n",
        "Line 2 of .* has 4 values instead of 3": "A.x,A.y,A.z\n1,2,3,4\n",
        r"Line 2 of .* has 'up' in column A\.y": "A.x,A.y,A.z\n1,up,3\n",
        r"Line 2 of .* has 'inf' in column A\.y": "A.x,A.y,A.z\n1,inf,3\n",
        "has no frames below its header": "A.x,A.y,A.z\n\n",
        "has no position of any marker": "A.x,A.y,A.z\n,,\n0,0,0\n",
        "two markers named A": "Trajectories\n9\n,,A,,,A,,\nFrame,,X,Y,Z,X,Y,Z\n,,mm\n1,0,1,2,3,4,5,6\n",
        "no named markers": "Trajectories\n100\n,,,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n1,0,1,2,3\n",
    }
    for i, (what, text) in enumerate(texts.items()):
        path = tmp_path / f"{i}.csv"
        path.write_text(text)
        with pytest.raises(FacePoserError, match=what) as caught:
            read_markers(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "a.txt").write_text("x")
    for name, what in (
        ("gone.csv", "cannot be read"),
        ("binary.csv", "cannot be read"),
        ("a.txt", ".csv or .trc file"),
    ):
        with pytest.raises(FacePoserError, match=what):
            read_markers(tmp_path / name)


def test_short_gaps_are_filled_and_long_ones_stay() -> None:
    times = np.arange(40.0)
    positions = np.stack([np.stack([times, 2.0 * times, -times], axis=1), np.full((40, 3), 5.0)], axis=1)
    whole = positions.copy()
    positions[3:6, 0] = np.nan
    positions[10:20, 1] = np.nan
    positions[:2, 1] = np.nan
    positions[38:, 0] = np.nan
    motion, n_filled = fill_gaps(MarkerMotion(("A", "B"), positions, 60.0), longest=3)
    assert n_filled == 3
    np.testing.assert_allclose(motion.positions[3:6], whole[3:6])
    assert np.isnan(motion.positions[10:20, 1]).all()
    assert np.isnan(motion.positions[38:, 0]).all()
    assert np.isnan(positions[3:6, 0]).all()
    # Across a step the filled values stay between both sides.
    step = np.zeros((20, 1, 3))
    step[10:] = 1.0
    step[8:12] = np.nan
    filled = fill_gaps(MarkerMotion(("A",), step), longest=4)[0].positions
    assert filled.min() == 0.0
    assert filled.max() == 1.0
    assert (np.diff(filled[:, 0, 0]) >= 0.0).all()


def test_motion_checks_its_shape() -> None:
    with pytest.raises(ValueError, match="cannot have shape"):
        MarkerMotion(("A",), np.zeros((3, 2, 3)))
    with pytest.raises(ValueError, match="same name"):
        MarkerMotion(("A", "A"), np.zeros((3, 2, 3)))


def without_trial(path: Path, first: int, last: int, count: int | None = None) -> Path:
    """Let the header of a C3D file state the frames ``first`` to ``last``, POINT:FRAMES ``count``, and nothing else."""
    data = bytearray(path.read_bytes().replace(b"TRIAL", b"TRIAX"))
    data[6:10] = first.to_bytes(2, "little") + last.to_bytes(2, "little")
    if count is not None:
        # Name, offset, kind of two bytes, no dimensions, value.
        place = data.index(b"FRAMES") + 6 + 4
        data[place : place + 2] = count.to_bytes(2, "little")
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("n_markers", [3, 40])
@pytest.mark.parametrize("first", [0, 1, 7])
def test_c3d_headers_may_count_from_any_frame(tmp_path: Path, first: int, n_markers: int) -> None:
    n = 67
    positions = moving(n, n_markers)
    path = write_c3d(tmp_path / "a.c3d", positions, tuple(f"M{i}" for i in range(n_markers)))
    motion = read_markers(without_trial(path, first, first + n - 1))
    assert len(motion.positions) == n
    np.testing.assert_allclose(motion.positions, positions, rtol=1e-5)
    assert motion.notes == ()
    # Cut within the last frame.
    data = path.read_bytes()
    path.write_bytes(data[: len(data) - 512 * (1 + n_markers * 16 // 512)])
    with pytest.raises(FacePoserError, match=rf"ends after frame \d+ of {n}"):
        read_markers(path)


def test_a_c3d_that_was_cut_is_not_taken_for_a_short_one(tmp_path: Path) -> None:
    path = without_trial(
        write_c3d(tmp_path / "a.c3d", moving(67, 40), tuple(f"M{i}" for i in range(40))), 1, 67, count=2
    )
    data = path.read_bytes()
    path.write_bytes(data[: len(data) - 30 * 640])
    with pytest.raises(FacePoserError, match=r"ends after frame 3[5-9] of 67"):
        read_markers(path)


def test_c3d_counts_that_differ_are_said(tmp_path: Path) -> None:
    path = write_c3d(tmp_path / "a.c3d", moving(67, 40), tuple(f"M{i}" for i in range(40)))
    motion = read_markers(without_trial(path, 1, 67, 60))
    assert len(motion.positions) == 67
    assert motion.notes == ("Its header and its parameters state 67 and 60 frames; 67 were read.",)
    assert read_markers(path, 50.0).rate == 50.0


@pytest.mark.parametrize("heading", ["Time (s)", "time", "Time [ms]", "timestamp_ms", "Timecode"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_rows_of_tables_are_at_their_times(tmp_path: Path, heading: str, separator: str) -> None:
    positions = moving(90, 3)[:, :2]
    frames = [i for i in range(90) if not 30 <= i < 60]

    def time(i: int) -> str:
        if heading == "Timecode":
            return f"00:00:{i // 25:02}:{i % 25:02}"
        return f"{40 * i}" if "ms" in heading else f"{i / 25:.3f}"

    lines = [separator.join([heading, "A.x", "A.y", "A.z", "B.x", "B.y", "B.z"])]
    for i in frames:
        values = ["" if np.isnan(x) else f"{x:.6f}" for x in positions[i].ravel()]
        row = separator.join([time(i), *values])
        lines.append(row.replace(".", ",") if separator != "," else row)
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines), encoding="utf-16")
    motion = read_markers(path)
    assert motion.rate == 25.0
    assert motion.positions.shape == (90, 2, 3)
    np.testing.assert_allclose(motion.positions[frames], positions[frames])
    assert not motion.seen[30:60].any()
    assert motion.notes == (
        "30 of its 90 frames are missing (the first at 1.20 s, at most 1.20 s at once); they were left blank.",
    )


def test_empty_rows_are_frames_and_empty_lines_are_not(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("A.x,A.y,A.z\n1,2,3\n\n,,\n1,2,4\n,,\n,,\n")
    assert read_markers(path).seen[:, 0].tolist() == [True, False, True]


def test_frame_numbers_of_programs_keep_gaps(tmp_path: Path) -> None:
    lines = ["Trajectories", "100", ",,A,,", "Frame,Sub Frame,X,Y,Z", ",,mm,mm,mm"]
    lines += [f"{i},0,1,2,{i}" for i in (11, 12, 13, 16)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    motion = read_markers(path)
    assert motion.rate == 100.0
    assert motion.seen[:, 0].tolist() == [True, True, True, False, False, True]
    assert "2 of its 6 frames are missing" in motion.notes[0]


@pytest.mark.parametrize("separator", ["\t", ","])
def test_trc_files_are_read(separator: str, tmp_path: Path) -> None:
    lines = [
        ["PathFileType", "4", "(X/Y/Z)", "a.trc"],
        ["DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units", "OrigDataRate"],
        ["120.00", "120.00", "3", "2", "mm", "120.00"],
        ["Frame#", "Time", "Anna:Chin", "", "", "Anna:Nose", "", ""],
        ["", "", "X1", "Y1", "Z1", "X2", "Y2", "Z2"],
        [""],
        ["1", "0.00000", "1", "2", "3", "4", "5", "6"],
        ["2", "0.00833", "1", "2", "3.5", "", "", ""],
        ["4", "0.02500", "1", "2", "4", "4", "5", "6"],
    ]
    (tmp_path / "a.trc").write_text("\n".join(separator.join(line) for line in lines) + "\n")
    motion = read_markers(tmp_path / "a.trc")
    assert motion.names == ("Chin", "Nose")
    assert (motion.rate, motion.unit_scale) == (120.0, 0.1)
    np.testing.assert_array_equal(motion.positions[[0, 1, 3], 0, 2], [3.0, 3.5, 4.0])
    assert np.isnan(motion.positions[1, 1]).all()
    assert np.isnan(motion.positions[2]).all()
    assert motion.notes[-1].startswith("1 of its 4 frames is missing")
