"""``faceposer sketch``: strokes become features of a face, a session and a report, or one sentence says why not."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.model.character_file import save_character
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document, read_document, write_document
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import as_pixels
from tests.command_line import run, run_captured
from tests.sketch.drawings import drawn, scribble

Capture = pytest.CaptureFixture[str]
EXPRESSION = {"browInnerUp": 0.7, "browOuterUpLeft": 0.5, "browOuterUpRight": 0.5, "mouthSmileLeft": 0.6}


@pytest.fixture(scope="module")
def camera(man: FaceModel) -> Camera:
    vertices = man.character.vertices
    return OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera((900, 800))


@pytest.fixture
def strokes(man: FaceModel, camera: Camera, tmp_path: Path) -> Path:
    """Two brows and a lip of an expression, with a scribble between them."""
    truth = man.coefficients_of(EXPRESSION)
    pixels = [
        drawn(man, "left brow", truth, camera),
        scribble(camera),
        drawn(man, "right brow", truth, camera)[::-1],
        drawn(man, "outer upper lip", truth, camera),
    ]
    return written(tmp_path / "strokes.json", camera, [{"pixels": line, "feature": None} for line in pixels])


def written(path: Path, camera: Camera, strokes: list[Any], **others: Any) -> Path:
    data = {"format": "faceposer.strokes", "version": 1, "camera": codec.camera_to_json(camera), "strokes": strokes}
    path.write_text(json.dumps(data | others))
    return path


def test_strokes_pose_the_face_and_are_reported(
    man: FaceModel, camera: Camera, strokes: Path, tmp_path: Path, capsys: Capture
) -> None:
    out, report = tmp_path / "out.json", tmp_path / "r.json"
    status, said, err = run_captured(capsys, "sketch", "man", strokes, "-o", out, "--report", report)
    assert (status, err) == (0, "")
    assert "stroke 1: no feature recognised" in said
    assert "3 of 4 strokes recognised" in said
    found = json.loads(report.read_text())
    assert set(found) == {"strokes", "seconds"}
    features = [stroke["feature"] for stroke in found["strokes"]]
    assert features == ["left brow", None, "right brow", "outer upper lip"]
    for stroke in found["strokes"]:
        assert set(stroke) == {"named", "feature", "probability", "runner_up", "reason", "points"}
        assert 0.0 <= stroke["probability"] <= 1.0
        assert bool(stroke["points"]) == (stroke["feature"] is not None)
    (first, *_) = found["strokes"][0]["points"]
    assert set(first) == {"feature_point", "pixel", "probability"}
    document = read_document(out)
    sketches = document.constraints
    assert [sketch.feature for sketch in sketches if isinstance(sketch, SketchConstraint)] == [
        "left brow",
        "right brow",
        "outer upper lip",
    ]
    assert document.camera == camera
    truth = man.coefficients_of(EXPRESSION)
    ids = np.concatenate([man.character.regions[name] for name in ("brow_left", "brow_right")])
    error, moved = (
        np.linalg.norm((man.instance(pose) - man.instance(truth))[ids], axis=1).mean()
        for pose in (document.coefficients, man.neutral())
    )
    assert error < 0.4 * moved


def test_more_strokes_are_added_to_a_session_and_replace_what_they_cover(
    man: FaceModel, camera: Camera, strokes: Path, tmp_path: Path, capsys: Capture
) -> None:
    out = tmp_path / "out.json"
    assert run("sketch", "man", strokes, "-o", out) == 0
    lower = man.coefficients_of({"browDownLeft": 0.8})
    entry = {"pixels": drawn(man, "left brow", lower, camera), "feature": "left brow"}
    more = written(tmp_path / "more.json", camera, [entry])
    assert run("sketch", out, more, "-o", out, "--method", "map") == 0
    sketches = [one for one in read_document(out).constraints if isinstance(one, SketchConstraint)]
    assert [one.feature for one in sketches] == ["right brow", "outer upper lip", "left brow"]
    assert sketches[-1].stroke == tuple(map(tuple, entry["pixels"]))


def test_the_papers_face_is_another_one(
    man: FaceModel, camera: Camera, strokes: Path, tmp_path: Path, capsys: Capture
) -> None:
    out, paper = tmp_path / "map.json", tmp_path / "paper.json"
    assert run("sketch", "man", strokes, "-o", out) == 0
    assert run("sketch", "man", strokes, "-o", paper, "--method", "paper") == 0
    first, second = read_document(out), read_document(paper)
    assert (first.sketch_method, second.sketch_method) == ("map", "paper")
    truth = man.coefficients_of(EXPRESSION)
    brows = np.concatenate([man.character.regions[name] for name in ("brow_left", "brow_right")])

    def error(pose: Any) -> float:
        return float(np.linalg.norm((man.instance(pose) - man.instance(truth))[brows], axis=1).mean())

    neutral = error(man.neutral())
    assert error(first.coefficients) < error(second.coefficients) < 0.9 * neutral
    # A session with the method opens with the same face, and solving it again changes nothing.
    assert run("solve", paper, "-o", tmp_path / "paper.obj", "--report", tmp_path / "r.json") == 0
    again = json.loads((tmp_path / "r.json").read_text())["coefficients"]
    np.testing.assert_allclose(again, second.coefficients, atol=1e-6)


def test_the_methods_of_recognition_can_be_chosen(
    man: FaceModel, camera: Camera, tmp_path: Path, capsys: Capture
) -> None:
    entry = {"pixels": drawn(man, "left brow", man.neutral(), camera)}
    path, reports = written(tmp_path / "s.json", camera, [entry]), []
    for method in ("ours", "paper"):
        report = tmp_path / f"{method}.json"
        words = ("--recognition", method, "--report", report)
        assert run("sketch", "man", path, "-o", tmp_path / "o.json", *words) == 0
        reports.append(json.loads(report.read_text())["strokes"][0])
    assert [one["feature"] for one in reports] == ["left brow", "left brow"]
    assert reports[0]["points"] != reports[1]["points"]


def test_the_camera_may_be_a_file_of_its_own(
    man: FaceModel, camera: Camera, strokes: Path, tmp_path: Path, capsys: Capture
) -> None:
    data = json.loads(strokes.read_text())
    (tmp_path / "camera.json").write_text(json.dumps(data.pop("camera")))
    strokes.write_text(json.dumps(data))
    out = tmp_path / "out.json"
    status, _, err = run_captured(capsys, "sketch", "man", strokes, "-o", out)
    assert status == 2
    assert "lacks the key 'camera'" in err
    assert not out.exists()
    assert run("sketch", "man", strokes, "--camera", tmp_path / "camera.json", "-o", out) == 0
    assert read_document(out).camera == camera


def test_scribbles_alone_leave_the_face_as_it_is(camera: Camera, tmp_path: Path, capsys: Capture) -> None:
    path = written(tmp_path / "s.json", camera, [{"pixels": scribble(camera)}, {"pixels": [[400, 400], [400, 400]]}])
    out = tmp_path / "out.json"
    status, said, _ = run_captured(capsys, "sketch", "man", path, "-o", out)
    assert status == 0
    assert "0 of 2 strokes recognised" in said
    document = read_document(out)
    assert document.constraints == ()
    assert document.coefficients is None or not np.any(document.coefficients)


def test_wrong_uses_are_refused_in_one_sentence_before_any_work(strokes: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out.json"
    before = strokes.read_bytes()
    for words, said in (
        (("sketch", "man", strokes, "-o", tmp_path / "out.obj"), "must end in '.json'"),
        (("sketch", "man", strokes, "-o", strokes), "is also an input"),
        (("sketch", "man", strokes, "-o", out, "--report", tmp_path / "r.txt"), "must end in '.json'"),
        (("sketch", "man", strokes, "-o", out, "--report", strokes), "is also an input"),
        (("sketch", "man", strokes, "-o", out, "--report", out), "given for two outputs"),
        (("sketch", "man", strokes, "-o", tmp_path / "no" / "out.json"), "does not exist"),
        (("sketch", "nobody", strokes, "-o", out), "neither a character"),
        (("sketch", "man", tmp_path / "none.json", "-o", out), "cannot be read"),
        (("sketch", "man", strokes, "-o", out, "--camera", tmp_path / "none.json"), "cannot be read"),
        (("sketch", "man", strokes, "-o", out, "--method", "lwr"), "invalid choice: 'lwr'"),
        (("sketch", "man", strokes, "-o", out, "--recognition", "hmm"), "invalid choice: 'hmm'"),
        (("sketch", "man", strokes, "-o", out, "--spread", "2"), "not a number from 0 to 1"),
    ):
        status, _, err = run_captured(capsys, *words)
        assert status == 2, words
        assert said in err, (words, err)
        assert err.count("\n") == 1
    assert not out.exists()
    assert strokes.read_bytes() == before


DRAWING = Path(__file__).resolve().parents[2] / "docs" / "drawings" / "sadness.svg"


def test_a_drawing_poses_the_face_and_is_reported(tmp_path: Path, capsys: Capture) -> None:
    out, report = tmp_path / "out.json", tmp_path / "r.json"
    code, said, _ = run_captured(capsys, "sketch", "man", DRAWING, "-o", out, "--report", report)
    assert code == 0
    assert "mouth line" in said
    assert "7 of 14 lines are features" in said
    data = json.loads(report.read_text())
    assert data["relative"] == "assumed"
    lines = [line["feature"] for line in data["strokes"]]
    assert len(lines) == 14
    assert {"left brow", "right brow", "mouth line"} <= set(lines)
    document = read_document(out)
    kinds = {c.feature for c in document.constraints if isinstance(c, SketchConstraint)}
    assert kinds == set(lines) - {None}


def test_a_drawing_relative_to_itself_is_neutral(man: FaceModel, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out.json"
    code, _, _ = run_captured(capsys, "sketch", "man", DRAWING, "-o", out, "--relative", DRAWING)
    assert code == 0
    for sketch in read_document(out).constraints:
        assert isinstance(sketch, SketchConstraint)
        if "brow" in sketch.feature:
            mean = np.mean(sketch.stroke, axis=0)
            line = np.mean(drawn(man, sketch.feature, man.neutral(), sketch.camera), axis=0)
            assert np.linalg.norm(mean - line) < 8.0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--recognition", "ours"), "--recognition is for strokes"),
        (("--relative", "missing.svg"), "missing.svg"),
    ],
)
def test_wrong_options_of_drawings(options: tuple[str, ...], said: str, tmp_path: Path, capsys: Capture) -> None:
    code, _, error = run_captured(capsys, "sketch", "man", DRAWING, "-o", tmp_path / "o.json", *options)
    assert code == 2
    assert said in error
    assert not (tmp_path / "o.json").exists()


def test_a_report_does_not_overwrite_the_session(
    man: FaceModel, camera: Camera, strokes: Path, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.json").symlink_to("out.json")
    out = tmp_path / "out.json"
    out.write_text("{}")
    for report in (out, tmp_path / "folder" / ".." / "out.json", tmp_path / "link.json"):
        status, _, err = run_captured(capsys, "sketch", "man", strokes, "-o", out, "--report", report)
        assert status == 2
        assert "given for two outputs" in err
    assert out.read_text() == "{}"


def test_named_strokes_that_cannot_be_placed_say_why(
    man: FaceModel, camera: Camera, tmp_path: Path, capsys: Capture
) -> None:
    far = [[u + 1e5, v] for u, v in drawn(man, "left brow", man.neutral(), camera)]
    path = written(tmp_path / "far.json", camera, [{"pixels": far, "feature": "outer upper lip"}])
    out, report = tmp_path / "out.json", tmp_path / "r.json"
    status, said, _ = run_captured(capsys, "sketch", "man", path, "-o", out, "--report", report)
    assert status == 0
    assert "stroke 0: cannot be an outer upper lip: its stroke is" in said
    stroke = json.loads(report.read_text())["strokes"][0]
    assert (stroke["named"], stroke["feature"], stroke["probability"]) == ("outer upper lip", None, None)


def test_sessions_without_room_are_refused_before_the_work(
    man: FaceModel, camera: Camera, tmp_path: Path, capsys: Capture
) -> None:
    lines = [{"pixels": [[u, 300], [u + 50, 290]], "feature": None} for u in range(200, 203)]
    path = written(tmp_path / "three.json", camera, lines)
    line = drawn(man, "left brow", man.neutral(), camera)
    sketch = SketchConstraint(as_pixels(line), camera, "left brow", (("4.1", (line[0][0], line[0][1])),))
    document = Document("man", (sketch,) * 198, coefficients=man.neutral())
    full = tmp_path / "full.json"
    write_document(full, document)
    status, _, err = run_captured(capsys, "sketch", full, path, "-o", tmp_path / "out.json")
    assert status == 2
    assert "has 198 strokes, curves and sketches, and 3 would be added" in err
    assert "Undo" not in err


def test_characters_without_features_are_refused(
    man: FaceModel, strokes: Path, tmp_path: Path, capsys: Capture
) -> None:
    character = replace(man.character, feature_points={}, feature_titles={})
    save_character(tmp_path / "blank.npz", character)
    status, _, err = run_captured(capsys, "sketch", tmp_path / "blank.npz", strokes, "-o", tmp_path / "out.json")
    assert status == 2
    assert "No feature can be drawn on" in err
