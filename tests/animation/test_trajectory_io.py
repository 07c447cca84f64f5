"""Trajectories come from JSON, tables and C3D as they are meant, and bad files are refused in one sentence."""

import contextlib
import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.animation.trajectory_io import (
    read_trajectories,
    trajectories_from_json,
    trajectories_to_json,
)
from faceposer.errors import FacePoserError
from faceposer.geometry.camera import OrbitView
from faceposer.geometry.marker_map import MarkerMap
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.solve.camera_io import camera_from_json, read_camera

NAMES = ("8.3", "8.4", "2.10", "4.1")


@pytest.fixture(scope="module")
def character(model: FaceModel) -> Character:
    return model.character


def places(character: Character) -> np.ndarray:
    return character.vertices[[character.feature_points[name] for name in NAMES]].astype(np.float64)


def moving(character: Character, n_frames: int = 4) -> np.ndarray:
    positions = places(character) + np.linspace(0.0, 0.3, n_frames)[:, None, None]
    positions[1, 2] = np.nan
    return positions


def table(path: Path, names: tuple[str, ...], positions: np.ndarray, first: str = "frame") -> Path:
    axes = "xyz"[: positions.shape[2]]
    lines = [",".join([first, *(f"{name}.{axis}" for name in names for axis in axes)])]
    for i, frame in enumerate(positions):
        at = f"{i / 25.0:.3f}" if first == "time" else str(i)
        lines.append(",".join([at, *("" if np.isnan(x) else f"{x:.6f}" for x in frame.ravel())]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def camera_file(path: Path) -> Path:
    path.write_text(json.dumps({"view": "front", "size": [640, 480]}), encoding="utf-8")
    return path


def test_a_table_of_pixels_with_a_camera(character: Character, tmp_path: Path) -> None:
    camera = read_camera(camera_file(tmp_path / "camera.json"), character)
    vertices = character.vertices
    assert camera == OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera((640, 480))
    pixels = moving(character)[:, :, :2] * 10.0 + 300.0
    path = table(tmp_path / "a.csv", NAMES, pixels, "time")
    read = read_trajectories(path, character, camera=camera)
    assert read.names == NAMES
    assert read.rate == 25.0
    assert read.camera == camera
    np.testing.assert_allclose(read.positions, pixels, atol=1e-6)
    np.testing.assert_array_equal(read.points.faces, [-1 - character.feature_points[name] for name in NAMES])
    few = read_trajectories(path, character, camera=camera, points=("2.10", "8.3"), rate=50.0)
    assert few.names == ("2.10", "8.3")
    assert few.rate == 50.0
    np.testing.assert_allclose(few.positions, pixels[:, [2, 0]], atol=1e-6)
    with pytest.raises(FacePoserError, match="give the camera"):
        read_trajectories(path, character)


def test_a_map_tells_where_the_points_of_a_picture_are(character: Character, tmp_path: Path) -> None:
    camera = read_camera(camera_file(tmp_path / "camera.json"), character)
    pixels = moving(character)[:, :, :2] * 10.0 + 300.0
    path = table(tmp_path / "a.csv", ("a", "b", "c", "d"), pixels)
    spots = MarkerMap({"c": "8.3", "a": 17})
    read = read_trajectories(path, character, camera=camera, marker_map=spots)
    assert read.names == ("c", "a")
    np.testing.assert_array_equal(read.points.faces, [-1 - character.feature_points["8.3"], -18])
    np.testing.assert_allclose(read.positions, pixels[:, [2, 0]], atol=1e-6)
    with pytest.raises(FacePoserError, match="has no point e"):
        read_trajectories(path, character, camera=camera, marker_map=MarkerMap({"e": 3}))
    (tmp_path / "a.json").write_text(json.dumps(document(character)), encoding="utf-8")
    with pytest.raises(FacePoserError, match="leave the marker map out"):
        read_trajectories(tmp_path / "a.json", character, marker_map=spots)


def test_points_are_named_by_number_title_or_vertex(character: Character, tmp_path: Path) -> None:
    names = ("8.3", "Right mouth corner", "vertex 17", "v18")
    vertices = [character.feature_points["8.3"], character.feature_points["8.4"], 17, 18]
    positions = np.tile(character.vertices[vertices].astype(np.float64), (2, 1, 1))
    named = read_trajectories(table(tmp_path / "a.csv", names, positions), character)
    np.testing.assert_array_equal(named.points.faces, -1 - np.array(vertices))
    assert named.camera is None


def test_places_in_the_space_of_the_face_are_taken_as_they_are(character: Character, tmp_path: Path) -> None:
    positions = moving(character)
    read = read_trajectories(table(tmp_path / "a.csv", NAMES, positions), character)
    np.testing.assert_allclose(read.positions, positions, atol=1e-5)
    assert read.rate == 30.0
    with pytest.raises(FacePoserError, match="not in its space; give a marker map"):
        read_trajectories(table(tmp_path / "b.csv", NAMES, positions * 10.0), character)
    path = tmp_path / "c.json"
    path.write_text(json.dumps(trajectories_to_json(replace(read, positions=positions * 10.0))))
    with pytest.raises(FacePoserError, match="not in its space; give the positions in centimetres"):
        read_trajectories(path, character)


def test_the_face_lies_before_the_camera(character: Character, tmp_path: Path) -> None:
    view = read_camera(camera_file(tmp_path / "camera.json"), character)
    path = table(tmp_path / "a.csv", NAMES, np.ones((3, 4, 2)))
    read_trajectories(path, character, camera=view)
    for depth in (0.0, -100.0):
        behind = replace(view, translation=np.array([0.0, 0.0, depth]))
        with pytest.raises(FacePoserError, match="not in front of the camera"):
            read_trajectories(path, character, camera=behind)


def captured(character: Character, n_frames: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Markers of a performer in millimetres whose head turns, three of them on bone, and how the face moves."""
    moved = np.zeros((n_frames, 4, 3))
    moved[:, 2, 1] = -np.linspace(0.0, 1.5, n_frames)
    bone = np.array([[7.0, 8.0, 0.0], [-7.0, 8.0, 0.0], [0.0, 12.0, -3.0]])
    positions = np.concatenate([places(character) + moved, np.tile(bone, (n_frames, 1, 1))], axis=1) * 10.0
    for i, angle in enumerate(np.linspace(0.0, 0.4, n_frames)):
        turn = np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])
        positions[i] = positions[i] @ turn.T + (100.0, 1500.0, 20.0 * angle)
    return positions, moved


def marker_map(fixed: bool) -> MarkerMap:
    spots = dict(zip(("CornerL", "CornerR", "Chin", "Brow"), NAMES, strict=True))
    return MarkerMap(spots, ("A", "B", "C") if fixed else ())


def test_markers_of_a_performer_are_laid_on_the_face_with_its_head_at_rest(
    character: Character, tmp_path: Path
) -> None:
    positions, moved = captured(character)
    path = table(tmp_path / "a.csv", ("CornerL", "CornerR", "Chin", "Brow", "A", "B", "C"), positions)
    read = read_trajectories(path, character, marker_map=marker_map(fixed=True))
    assert read.names == ("CornerL", "CornerR", "Chin", "Brow")
    np.testing.assert_allclose(read.positions, places(character) + moved, atol=1e-3)
    # Nobody says what holds the head, and seven markers are too few to find out: it is taken to be at rest.
    as_given = read_trajectories(path, character, marker_map=marker_map(fixed=False))
    assert np.abs(as_given.positions[-1, 0] - places(character)[0]).max() > 0.5
    with pytest.raises(FacePoserError, match="not in the motion"):
        read_trajectories(path, character, marker_map=MarkerMap({"Nose": "9.3"}))


def test_c3d(character: Character, tmp_path: Path) -> None:
    c3d = pytest.importorskip("c3d", reason="the package c3d is not installed")
    positions, moved = captured(character)
    writer = c3d.Writer(point_rate=120.0, analog_rate=0.0)
    frames = [(np.pad(frame, ((0, 0), (0, 2))).astype(np.float32), np.zeros((0, 0))) for frame in positions]
    writer.add_frames(frames)
    writer.set_point_labels(["CornerL", "CornerR", "Chin", "Brow", "A", "B", "C"])
    path = tmp_path / "a.c3d"
    with path.open("wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writer.write(file)
    read = read_trajectories(path, character, marker_map=marker_map(fixed=True), points=("Chin", "CornerL", "CornerR"))
    assert read.rate == 120.0
    np.testing.assert_allclose(read.positions, (places(character) + moved)[:, [2, 0, 1]], atol=1e-3)


def document(character: Character) -> dict[str, Any]:
    return {
        "format": "faceposer.trajectories",
        "version": 1,
        "rate": 24,
        "camera": {"view": "left", "size": [640, 480]},
        "points": [
            {"name": "8.3", "positions": [[300.5, 200.0], None, [301.0, 202.5]]},
            {
                "name": "mine",
                "anchor": {"feature": "left nostril"},
                "weight": 0.5,
                "positions": [[1, 2], [3, 4], [5, 6]],
            },
            {
                "name": "spot",
                "anchor": {"face": 12, "barycentric": [0.25, 0.25, 0.5]},
                "positions": [None, None, None],
            },
        ],
    }


def test_json_round_trip_is_exact(character: Character) -> None:
    read = trajectories_from_json(document(character), character)
    assert read.names == ("8.3", "mine", "spot")
    np.testing.assert_array_equal(read.seen, [[True, True, False], [False, True, False], [True, True, False]])
    assert read.weights is not None
    np.testing.assert_array_equal(read.weights, [1.0, 0.5, 1.0])
    assert read.camera == camera_from_json({"view": "left", "size": [640, 480]}, "camera", character)
    again = trajectories_from_json(json.loads(json.dumps(trajectories_to_json(read))), character)
    np.testing.assert_array_equal(again.positions, read.positions)
    assert (again.names, again.points, again.rate, again.camera) == (read.names, read.points, 24.0, read.camera)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "else"}, 'no "format"'),
        ({"version": 2}, "version is 2"),
        ({"colour": 1}, "unknown key 'colour'"),
        ({"rate": 0}, "rate must be a number from 0.001"),
        ({"camera": {"view": "above", "size": [640, 480]}}, "camera.view is 'above'"),
        ({"camera": {"view": "left", "size": [640]}}, "camera.size"),
        ({"camera": {"view": "left", "size": [640, 0]}}, "camera.size"),
        ({"points": []}, "points must be a list"),
        ({"points": [{"name": "8.3"}]}, r"points\[0\] lacks the key 'positions'"),
        ({"points": [{"name": "lip", "positions": [[1, 2]]}]}, "no anchor"),
        ({"points": [{"name": "8.3", "positions": [[1, 2, 3]]}]}, r"points\[0\].positions\[0\] must be a list of 2"),
        ({"points": [{"name": "8.3", "positions": [None]}]}, "No point has a position"),
        ({"points": [{"name": "8.3", "positions": [[1, 2]]}] * 2}, r"points\[1\].name is already"),
        (
            {"points": [{"name": "8.3", "positions": [[1, 2]]}, {"name": "8.4", "positions": [[1, 2]] * 2}]},
            "give one or null per",
        ),
        ({"points": [{"name": "a", "anchor": {"feature": "99"}, "positions": [[1, 2]]}]}, "not a feature point of man"),
        ({"points": [{"name": "a", "anchor": {"vertex": 10**6}, "positions": [[1, 2]]}]}, "belongs to no triangle"),
    ],
)
def test_wrong_json_is_refused_with_its_file_and_place(
    character: Character, tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(document(character) | change), encoding="utf-8")
    with pytest.raises(FacePoserError, match=said) as caught:
        read_trajectories(path, character)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.txt", "", "with the suffix .csv, .json, .c3d or .trc"),
        ("a.json", "{", "not valid JSON at line 1"),
        ("a.json", "[" * 100_000, "not valid JSON"),
        ("a.csv", "frame,8.3.x\n0,1\n", "has no column 8.3.y"),
        ("a.csv", "frame,8.3.x,8.3.y\n0,1,abc\n", "'abc' in column 8.3.y"),
        ("a.csv", "frame,8.3.x,8.3.y\n0,,\n", "No point is visible"),
        ("a.csv", "frame,8.3.x,8.3.y\n0,1,2\n1,1e30,2\n", r"has 8.3 at 1e\+30 in frame 2"),
        ("a.csv", "time,8.3.x,8.3.y\n1,1,2\n0,1,2\n", "Line 3 of .* has the time 0 after 1"),
        ("a.csv", "frame,lip.x,lip.y\n0,1,2\n", "lip, which is not a feature point of man"),
        ("a.csv", "frame,8.3.x,8.3.y\n", "no frames? below its header"),
        ("a.csv", "", "no header"),
        ("a.csv", "frame,8.3.x,8.3.y,8.4.x,8.4.y,8.4.z\n", "has no column 8.3.z"),
    ],
)
def test_bad_files_are_refused_in_one_sentence(
    character: Character, tmp_path: Path, name: str, text: str, said: str
) -> None:
    camera = read_camera(camera_file(tmp_path / "camera.json"), character)
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FacePoserError, match=said) as caught:
        read_trajectories(path, character, camera=camera)
    assert str(path) in str(caught.value)
    with pytest.raises(FacePoserError, match=r"No such file|cannot be read"):
        read_trajectories(tmp_path / f"none{path.suffix}", character, camera=camera)


@pytest.mark.parametrize(
    ("table", "rate", "said"),
    [
        ("time,8.3.x,8.3.y\n0,1,2\n40,1,2\n80,1,2\n160,1,2\n", 25.0, "read as milliseconds"),
        ("Time (s);8.3.x;8.3.y\n0;1,5;2\n0,04;1,5;2\n0,08;1,5;2\n0,16;1;2\n", 25.0, "1 of its 5 frames is missing"),
        ("frame,8.3.x,8.3.y\n0,1,2\n1,1,2\n2,1,2\n4,1,2\n", 30.0, "30 frames per second were assumed"),
        ("8.3.x,8.3.y\n1,2\n1,2\n1,2\n,\n1,2\n", 30.0, "30 frames per second were assumed"),
        ("time,8.3.x,8.3.y\n0,1,2\n1e-9,1,2\n2e-9,1,2\n3e-9,1,2\n4e-9,1,2\n", 30.0, "'time' tell no rate"),
    ],
)
def test_frames_are_at_their_times_and_assumptions_are_said(
    character: Character, tmp_path: Path, table: str, rate: float, said: str
) -> None:
    camera = read_camera(camera_file(tmp_path / "camera.json"), character)
    path = tmp_path / "a.csv"
    path.write_text(table, encoding="utf-8")
    read = read_trajectories(path, character, camera=camera)
    assert (len(read), read.rate) == (5, rate)
    assert said in " ".join(read.notes)
    assert ("assumed" in " ".join(read.notes)) == (rate == 30.0)
    stated = read_trajectories(path, character, camera=camera, rate=50.0)
    assert (len(stated), stated.rate) == (5, 50.0)
    assert "assumed" not in " ".join(stated.notes)
    assert stated.without_jumps()[0].notes == stated.notes


def test_json_without_a_rate_says_so(character: Character, tmp_path: Path) -> None:
    data = document(character)
    positions = data["points"][0]["positions"]
    assert len(positions) > 1
    path = tmp_path / "a.json"
    path.write_text(json.dumps({key: value for key, value in data.items() if key != "rate"}), encoding="utf-8")
    assert "assumed" in read_trajectories(path, character).notes[0]
    assert read_trajectories(path, character, rate=50.0).notes == ()


def test_damaged_files_never_end_otherwise(character: Character, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    whole = json.dumps(document(character)).encode()
    path = tmp_path / "a.json"
    for _ in range(60):
        damaged = bytearray(whole)
        for at in rng.integers(0, len(damaged), 3):
            damaged[at] = rng.integers(0, 256)
        path.write_bytes(bytes(damaged))
        with contextlib.suppress(FacePoserError):
            read_trajectories(path, character)
