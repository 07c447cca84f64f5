"""Sessions with extreme values are solved within bounds or refused in one sentence; only finite numbers are written."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.cli.program import main
from faceposer.errors import FacePoserError
from faceposer.session import document, solver_worker
from faceposer.session.document import Document, read_document, write_document
from faceposer.session.opening import load_model, open_session
from faceposer.session.session import Session
from faceposer.solve.constraints.stroke import StrokeConstraint
from faceposer.solve.map_solver import SolveError

CAMERA = {
    "rotation": [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
    "translation": [0.0, -2.25, 104.5],
    "focal": 1814.8,
    "size": [640, 640],
}
SOURCE = [[357.1, 372.1], [367.1, 372.1]]


def stroke(**changes: Any) -> dict[str, Any]:
    return {"type": "stroke", "source": SOURCE, "target": SOURCE, "width": 5, "camera": CAMERA} | changes


def point(**changes: Any) -> dict[str, Any]:
    return {"type": "point", "anchor": {"vertex": 0}, "target": [300, 300], "camera": CAMERA} | changes


def session_file(folder: Path, *constraints: dict[str, Any], **changes: Any) -> Path:
    path = folder / "a.json"
    data = {"format": "faceposer.session", "version": 1, "subject": "low", "constraints": constraints} | changes
    path.write_text(json.dumps(data))
    return path


def solved(path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Solve the session ``path`` on the command line; return what was said, after checking the mesh."""
    output = path.with_suffix(".obj")
    with pytest.raises(SystemExit) as end:
        main(["solve", str(path), "-o", str(output), "--report", str(path.with_name("r.json"))])
    said = "".join(capsys.readouterr())
    if end.value.code:
        assert not output.exists()
        assert said.isprintable() or said.count("\n") <= 2
        return said
    rows = [line.split()[1:] for line in output.read_text().splitlines() if line.startswith("v ")]
    assert np.isfinite(np.array(rows, dtype=np.float64)).all()
    assert "NaN" not in path.with_name("r.json").read_text()
    return ""


@pytest.mark.parametrize("energy", ["distance", "image"])
@pytest.mark.parametrize(
    "target",
    [
        [[300.0, 300.0]],
        [[-1e6, 1e6]],
        [[0, 0], [30_000, 30_000]],
    ],
)
def test_strokes_anywhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], energy: str, target: list[list[float]]
) -> None:
    path = session_file(tmp_path, stroke(target=target, width=1, shape="filled", energy=energy))
    assert solved(path, capsys) == ""


def test_strokes_that_cover_too_much(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    far = [[0, 0], [999_999, 999_999]]
    for constraint, place in (
        (stroke(target=far), "constraints[0].target must not cover more than 4000000 pixels"),
        (stroke(source=far), "constraints[0].source must not cover more than 4000000 pixels"),
        (stroke(target=[[0, 0], [2500, 0], [2500, 2500], [0, 2500]], shape="filled"), "constraints[0]: it covers 62"),
    ):
        said = solved(session_file(tmp_path, constraint), capsys)
        assert place in said
        assert str(tmp_path) in said
    long = stroke(target=[[0, 0], [60_000, 0]])
    with pytest.raises(FacePoserError, match="must not cover more than 4000000 pixels together"):
        read_document(session_file(tmp_path, *[long] * 20))
    read_document(session_file(tmp_path, *[long] * 10))


def test_a_large_source_is_thinned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    close = CAMERA | {"focal": 40_000.0, "size": [4000, 4000]}
    square = [[1500, 1800], [1900, 1800], [1900, 2000], [1500, 2000]]
    path = session_file(tmp_path, stroke(source=square, target=square, shape="filled", camera=close))
    source = open_session(str(path)).document.constraints[0].points
    assert 0 < len(source) <= 20_000
    monkeypatch.setattr(document, "_MOST_PICKED_TOGETHER", 2000)
    strokes = [stroke(source=square, target=square, shape="filled", camera=close)] * 4
    (tmp_path / "many").mkdir()
    many = open_session(str(session_file(tmp_path / "many", *strokes))).document.constraints
    assert all(isinstance(one, StrokeConstraint) and 0 < len(one.placed) <= 500 for one in many)


def test_images_of_strokes_are_limited(tmp_path: Path) -> None:
    line = [[100.0, 100.0], [400.0, 400.0]]
    read_document(session_file(tmp_path, stroke(target=line, source=line, width=9, energy="image")))
    many = session_file(tmp_path, *[stroke(target=line, source=line, width=9, energy="image")] * 40)
    with pytest.raises(FacePoserError, match='energy "image" must not cover more than 100000 pixels together; use the'):
        read_document(many)


def test_counts_are_limited(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match="constraints must be a list of at most 2000"):
        read_document(session_file(tmp_path, *[point()] * 2001))
    with pytest.raises(FacePoserError, match="constraints has 201 strokes, curves and sketches; there may be 200"):
        read_document(session_file(tmp_path, *[stroke()] * 201))


@pytest.mark.parametrize("depth", [-8.0, 8.0, 1e6])
def test_close_cameras_and_large_weights(tmp_path: Path, capsys: pytest.CaptureFixture[str], depth: float) -> None:
    camera = CAMERA | {"focal": 1e6, "translation": [0, 0, depth]}
    constraints = [
        point(target=[1e6, -1e6], weight=1e6, camera=camera),
        {"type": "distance", "anchors": [{"vertex": 0}, {"vertex": 9}], "target": 1e6, "camera": camera, "weight": 1e6},
    ]
    for constraint in constraints:
        said = solved(session_file(tmp_path, constraint, prior_weight=0), capsys)
        assert said == "" or "cannot be solved" in said or "behind its camera" in said


def test_what_has_no_finite_solution_is_said_and_the_pose_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    path = session_file(tmp_path, point())
    monkeypatch.setattr(solver_worker, "pose_problem", fails)
    assert "The constraints cannot be solved, since their numbers are too large" in solved(path, capsys)
    session = Session(load_model("low"), read_document(path))
    assert not session.poll()
    assert np.isfinite(session.vertices).all()
    with pytest.raises(SolveError):
        session.wait()


def test_texts_that_cannot_be_encoded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for changes in ({"prior": "a\ud800"}, {"\ud800": 1}, {"subject": "a\ud800.npz"}, {"subject": "\ud800"}):
        said = solved(session_file(tmp_path, **changes), capsys)
        assert r"\ud800" in said


def test_names_of_characters(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("~nobodyx/x.npz", "n" * 300 + ".npz", "a\0b.npz", "x/" * 3000 + ".npz", "a\x1b[31mb.npz", "n" * 10**6):
        said = solved(session_file(tmp_path, subject=name), capsys)
        assert "character" in said
        assert len(said) < 1500


def test_numbers_that_are_not_finite_are_not_written(tmp_path: Path) -> None:
    model = load_model("low")
    path = tmp_path / "a.json"
    with pytest.raises(FacePoserError, match="not finite"):
        write_document(path, Document("low").posed(np.full(model.n_coefficients, np.nan)))
    assert not path.exists()


def test_keys_that_occur_twice_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = session_file(tmp_path, point())
    path.write_text(path.read_text().replace('"weight"', '"weight"')[:-1] + ', "constraints": []}')
    assert 'the key "constraints" occurs twice' in solved(path, capsys)
    path = session_file(tmp_path, point())
    path.write_text(path.read_text().replace('"focal": ', '"focal": 1.0, "focal": '))
    assert 'the key "focal" occurs twice' in solved(path, capsys)


@pytest.mark.parametrize("translation", [[0, 0, -110], [0, 0, -1e6], [0, -2.25, 0]])
@pytest.mark.parametrize("kind", ["point", "stroke"])
def test_points_behind_their_camera_are_said(
    translation: list[float], kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    camera = CAMERA | {"translation": translation}
    constraint = point(camera=camera) if kind == "point" else stroke(camera=camera, source={"anchors": [{"vertex": 0}]})
    said = solved(session_file(tmp_path, constraint), capsys)
    assert "constraints[0]: its point lies behind its camera; correct the camera's rotation and translation" in said


@pytest.mark.parametrize("direction", [[31.1, 0], [-90, 0], [0, 23.5], [0, -1e5]])
def test_gaze_beyond_the_range_of_the_eyes_is_said(
    direction: list[float], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = session_file(tmp_path, {"type": "gaze", "direction": direction})
    assert "constraints[0].direction is beyond the range of the eyes, 31 degrees to a side and 23 up or down" in solved(
        path, capsys
    )
    assert not solved(session_file(tmp_path, {"type": "gaze", "direction": [-31, 23]}), capsys)


def test_a_pose_of_another_length_names_its_key(tmp_path: Path) -> None:
    for key in ("coefficients", "start"):
        path = session_file(tmp_path, **{key: [1.0]})
        with pytest.raises(FacePoserError, match=f"{key} has 1 number, but the character 'low' has"):
            open_session(str(path))


@pytest.mark.parametrize("subject", ["/dev/zero", "../low", "nobody", "low.blend"])
def test_what_is_no_character_was_not_moved(subject: str, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=r"which is neither one that is installed .* nor the path of a character"):
        open_session(str(session_file(tmp_path, subject=subject)))
    with pytest.raises(FacePoserError, match="was removed or moved"):
        open_session(str(session_file(tmp_path, subject="gone.npz")))
