"""A kind of constraint that is registered is read, written and solved like any other, with no other change."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from faceposer.cli import main
from faceposer.errors import FacePoserError
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character_file import load_character, save_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.framing import face_view
from faceposer.session.document import Document, read_document, write_document
from faceposer.session.opening import open_session
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import CONSTRAINTS, register
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from tests.made_up import MidpointConstraint, registered_constraint
from tests.versions import renumbered


@pytest.fixture
def made_up() -> Iterator[None]:
    with registered_constraint():
        yield


def lips_at(model: FaceModel, pose: np.ndarray) -> MidpointConstraint:
    """Return the constraint that is met by ``pose``, shape (r,): where it shows the middle of both lips."""
    camera = face_view(model.character, "three-quarter", 1.0).camera((800, 800))
    lips = tuple(model.character.feature_points[name] for name in ("2.2", "2.3"))
    u, v = camera.project(model.positions_at(SurfacePoints.of(lips), pose)).mean(axis=0).tolist()
    return MidpointConstraint((lips[0], lips[1]), (u, v), camera)


@pytest.mark.usefixtures("made_up")
def test_a_session_saves_and_reads_it(model: FaceModel, tmp_path: Path) -> None:
    constraint = lips_at(model, model.neutral())
    document = Document("man", (constraint,)).resolved(model)
    write_document(tmp_path / "a.json", document)
    assert json.loads((tmp_path / "a.json").read_text())["constraints"][0]["type"] == "midpoint"
    read = read_document(tmp_path / "a.json").resolved(model)
    assert isinstance(read.constraints[0], MidpointConstraint)
    assert read.constraints[0].target == pytest.approx(constraint.target)
    assert read.constraints[0].camera == constraint.camera
    assert read.constraints[0].points == constraint.points


def test_it_is_unknown_before_and_after(model: FaceModel, tmp_path: Path) -> None:
    known = dict(CONSTRAINTS)
    document = Document("man", (lips_at(model, model.neutral()),))
    with registered_constraint():
        write_document(tmp_path / "a.json", document)
        with pytest.raises(ValueError, match="the kind of constraint 'midpoint' is already registered"):
            register(MidpointConstraint)
    assert known == CONSTRAINTS
    with pytest.raises(FacePoserError, match=r"constraints\[0\]\.type is .*midpoint"):
        read_document(tmp_path / "a.json")


@pytest.mark.usefixtures("made_up")
def test_its_derivatives_agree_with_finite_differences(model: FaceModel) -> None:
    problem = PoseProblem(model, [lips_at(model, model.coefficients_of({"jawOpen": 1.0}))], bare=True)
    term, step = problem.terms[1], 1e-6 * np.eye(model.n_coefficients)
    pose = np.random.default_rng(3).normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)

    def energy(p: np.ndarray) -> float:
        return term.value_and_gradient(problem.state(p))[0]

    differences = np.array([(energy(pose + s) - energy(pose - s)) / 2e-6 for s in step])
    gradient = term.value_and_gradient(problem.state(pose))[1]
    np.testing.assert_allclose(gradient, differences, rtol=1e-5, atol=1e-5 * np.abs(gradient).max())


@pytest.mark.usefixtures("made_up")
def test_the_solver_meets_it_beside_others(model: FaceModel) -> None:
    pose = model.coefficients_of({"jawOpen": 0.6})
    lips = lips_at(model, pose)
    brow = model.character.feature_points["4.1"]
    u, v = lips.camera.project(model.positions_at(SurfacePoints.of([brow]), pose))[0].tolist()
    problem = PoseProblem(model, [PointConstraint(brow, (u, v), lips.camera), lips])
    before = problem.residuals_px(model.neutral())
    after = problem.residuals_px(solve(problem).coefficients)
    assert before[1] > 10
    assert after[1] < 0.1 * before[1]
    assert after[0] < 1.5


@pytest.mark.usefixtures("made_up")
def test_a_disabled_one_does_not_count(model: FaceModel) -> None:
    session = Session(model, Document("man"))
    lips = lips_at(model, model.coefficients_of({"jawOpen": 0.6}))
    session.add_constraint(lips, "Set a midpoint")
    session.wait()
    met = session.residuals_px[0]
    session.change_constraint(0, MidpointConstraint(lips.anchors, lips.target, lips.camera, enabled=False), "Disable")
    session.wait()
    assert met < 2.0
    assert session.residuals_px[0] > 10.0
    session.undo()
    session.wait()
    assert session.residuals_px[0] == pytest.approx(met, abs=0.05)
    session.undo()
    assert session.document.constraints == ()


@pytest.mark.usefixtures("made_up")
def test_the_command_solves_it(model: FaceModel, tmp_path: Path) -> None:
    write_document(tmp_path / "a.json", Document("man", (lips_at(model, model.coefficients_of({"jawOpen": 0.6})),)))
    report = tmp_path / "report.json"
    with pytest.raises(SystemExit) as end:
        main(["solve", str(tmp_path / "a.json"), "-o", str(tmp_path / "a.obj"), "--report", str(report)])
    assert not end.value.code
    assert (tmp_path / "a.obj").stat().st_size > 10_000
    assert "midpoint" in report.read_text()


@pytest.mark.usefixtures("made_up")
def test_it_follows_to_another_version_of_its_character(tmp_path: Path) -> None:
    character = load_character("low")
    save_character(tmp_path / "own.npz", character)
    model = build_face_model(character)
    pose = model.coefficients_of({"jawOpen": 0.6})
    session = Session(model, Document(str(tmp_path / "own.npz"), (lips_at(model, pose),)), path=tmp_path / "a.json")
    session.save(tmp_path / "a.json")
    save_character(tmp_path / "own.npz", renumbered(character, 1.1))
    opened = open_session(str(tmp_path / "a.json"))
    (constraint,) = opened.document.constraints
    assert isinstance(constraint, MidpointConstraint)
    np.testing.assert_allclose(
        constraint.points.positions(opened.model.character.vertices, opened.model.triangles),
        1.1 * model.character.vertices[[model.character.feature_points[name] for name in ("2.2", "2.3")]],
        atol=1e-4,
    )
    opened.apply()
    opened.wait()
    assert opened.residuals_px[0] < 2.0
