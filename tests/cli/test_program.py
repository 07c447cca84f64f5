"""The commands do what they say, and wrong input gets one sentence and status 2."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.geometry.camera import OrbitView
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.picking import SurfacePoint, surface_positions
from faceposer.model.face_model import FaceModel
from faceposer.session import solver_worker
from faceposer.session.document import Document, write_document
from faceposer.solve.constraints.point import PointConstraint
from tests.command_line import run

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def smile(model: FaceModel, tmp_path: Path) -> Path:
    """A session that pulls both mouth corners."""
    vertices = model.character.vertices
    camera = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera((800, 800))
    constraints = []
    for name, dx in (("8.3", 12.0), ("8.4", -12.0)):
        anchor = SurfacePoint.at_vertex(model.triangles, model.character.feature_points[name])
        u, v = camera.project(surface_positions(vertices, model.triangles, [anchor]))[0].tolist()
        constraints.append(PointConstraint(anchor, (u + dx, v - 12.0), camera))
    path = tmp_path / "smile.json"
    write_document(path, Document("man", tuple(constraints)))
    return path


def test_solve_writes_the_mesh_and_the_report(model: FaceModel, smile: Path, tmp_path: Path, capsys: Capture) -> None:
    mesh_path, report_path = tmp_path / "smile.obj", tmp_path / "report.json"
    assert run("solve", smile, "-o", mesh_path, "--report", report_path) == 0
    report = json.loads(report_path.read_text())
    assert set(report) == {
        "energy",
        "iterations",
        "evaluations",
        "seconds",
        "coefficients",
        "weights",
        "constraints",
    }
    assert [set(entry) for entry in report["constraints"]] == [{"type", "residual_px"}] * 2
    assert max(entry["residual_px"] for entry in report["constraints"]) < 3
    assert len(report["weights"]) == 54
    assert min(report["weights"]["mouthSmileLeft"], report["weights"]["mouthSmileRight"]) > 0.2
    expected = model.surface(np.array(report["coefficients"]))
    height = np.ptp(model.character.vertices[:, 1])
    assert np.abs(read_mesh(mesh_path).vertices - expected).max() < 1e-5 * height
    assert "smile.obj written" in capsys.readouterr().out


@pytest.mark.parametrize("constrained", [True, False])
def test_solve_solves_once(smile: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, constrained: bool) -> None:
    solves = []
    run_job = solver_worker.run_job
    monkeypatch.setattr(solver_worker, "run_job", lambda *given: (solves.append(given), run_job(*given))[1])
    if not constrained:
        write_document(smile, Document("man"))
    assert run("solve", smile, "-o", tmp_path / "smile.obj") == 0
    assert len(solves) == 1


def test_the_spread_can_be_given_and_is_checked(smile: Path, tmp_path: Path, capsys: Capture) -> None:
    meshes = []
    for spread in ("0", "1"):
        assert run("solve", smile, "-o", tmp_path / "a.obj", "--spread", spread) == 0
        meshes.append(read_mesh(tmp_path / "a.obj").vertices)
    assert np.abs(meshes[0] - meshes[1]).max() > 0.02
    assert run("solve", smile, "-o", tmp_path / "a.obj", "--spread", "1.5") == 2
    assert "'1.5' is not a number from 0 to 1" in capsys.readouterr().err


def test_characters_are_listed(capsys: Capture) -> None:
    assert run("characters") == 0
    assert "man " in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.gl
def test_render_draws_characters_sessions_and_meshes(smile: Path, tmp_path: Path) -> None:
    assert run("solve", smile, "-o", tmp_path / "smile.obj") == 0
    pictures = []
    for what in ("man", smile, tmp_path / "smile.obj"):
        for view in ("front", "left"):
            path = tmp_path / "picture.png"
            assert run("render", what, "-o", path, "--view", view, "--size", "120x90") == 0
            with Image.open(path) as image:
                assert image.size == (120, 90)
                pictures.append(np.asarray(image).astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() > 50
    assert np.abs(pictures[0] - pictures[4]).max() > 50
    # A session is drawn solved, although its file holds no pose.
    assert np.abs(pictures[0] - pictures[2]).max() > 50


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("wmoan",), "Did you mean 'woman'"),
        (("nowhere.json",), "'nowhere.json' cannot be read"),
        (("nowhere.npz",), "nowhere.npz"),
        (("solve", "nowhere.json", "-o", "{tmp}/a.obj"), "cannot be read: No such file"),
        (("solve", "man", "-o", "{tmp}/a.obj"), "session"),
        (("solve", "x.json", "-o", "{tmp}/a.ply"), "must end in '.obj'"),
        (("solve", "x.json", "-o", "{tmp}/no/a.obj"), "does not exist"),
        (("solve", "x.json"), "-o/--output"),
        (("render", "man", "-o", "{tmp}/a.png", "--size", "0x5"), "not a size"),
        (("render", "man", "-o", "{tmp}/a.png", "--size", "99999x5"), "not a size"),
        (("render", "man", "-o", "{tmp}/a.png", "--view", "below"), "invalid choice"),
        (("render", "ghost", "-o", "{tmp}/a.png"), "'ghost' is neither a character"),
        (("render", "ghost.obj", "-o", "{tmp}/a.png"), "ghost.obj"),
        (("--bogus",), "--bogus"),
    ],
)
def test_wrong_input_gets_one_sentence(arguments: tuple[str, ...], said: str, tmp_path: Path, capsys: Capture) -> None:
    assert run(*(argument.replace("{tmp}", str(tmp_path)) for argument in arguments)) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1
    assert "Traceback" not in captured.err
    assert list(tmp_path.iterdir()) == []


def test_a_session_that_does_not_fit_its_face_is_refused(smile: Path, tmp_path: Path, capsys: Capture) -> None:
    data = json.loads(smile.read_text())
    data["constraints"][1]["anchor"] = {"vertex": 123456}
    smile.write_text(json.dumps(data))
    assert run("solve", smile, "-o", tmp_path / "a.obj") == 2
    assert "constraints[1]: vertex 123456 belongs to no triangle" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [("--help",), ("solve", "--help"), ("render", "--help"), ("demo", "--help")])
def test_help_is_everywhere(arguments: tuple[str, ...], capsys: Capture) -> None:
    assert run(*arguments) == 0
    assert "usage: faceposer" in capsys.readouterr().out
