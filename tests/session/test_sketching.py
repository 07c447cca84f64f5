"""Sketches of a document: its method in files and history, and the problem that the solver gets."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import feature_curves
from faceposer.model.framing import face_view
from faceposer.session import sketching
from faceposer.session.document import Document, read_document
from faceposer.session.session import Session
from faceposer.session.sketching import (
    active_sketches,
    drawn_strokes,
    library_poses,
    pose_problem,
    prior_of,
    session_sketcher,
    solver_input,
)
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import as_pixels
from faceposer.solve.map_solver import solve


def brow(model: FaceModel, lifted: float, feature: str = "left brow") -> SketchConstraint:
    camera = face_view(model.character, "front", 1.0).camera((800, 800))
    curve = feature_curves(model.character)[feature][0]
    pixels = camera.project(model.positions_at(curve.points, model.neutral())) - (0.0, lifted)
    matched = tuple(zip(curve.names, as_pixels(pixels[curve.knots]), strict=True))
    return SketchConstraint(as_pixels(pixels), camera, feature, matched)


class PaperStub:
    """Stands for the paper's statistics: returns a pose that says which sketches it was given."""

    def __init__(self, model: FaceModel) -> None:
        self._model = model
        self.calls = 0

    def paper_pose(self, sketched: tuple[SketchConstraint, ...], start: np.ndarray) -> np.ndarray:
        self.calls += 1
        return start + self._model.coefficients_of({"browInnerUp": 0.3 * len(sketched)})


@pytest.fixture
def paper(man: FaceModel, monkeypatch: pytest.MonkeyPatch) -> Iterator[PaperStub]:
    stub = PaperStub(man)
    monkeypatch.setattr(sketching, "session_sketcher", lambda model: stub)
    sketching._paper_pose.cache_clear()
    yield stub
    sketching._paper_pose.cache_clear()


def test_the_method_is_kept_in_the_file_and_undone(man: FaceModel, paper: PaperStub, tmp_path) -> None:
    session = Session(man, Document("man", (brow(man, 12.0),)))
    session.wait()
    map_pose = session.coefficients
    session.set_sketch_method("paper")
    session.wait()
    np.testing.assert_allclose(session.coefficients, man.coefficients_of({"browInnerUp": 0.3}), atol=1e-6)
    session.save(tmp_path / "s.json")
    read = read_document(tmp_path / "s.json")
    assert read.sketch_method == "paper"
    assert read.constraints == session.document.constraints
    session.undo()
    session.wait()
    assert session.document.sketch_method == "map"
    np.testing.assert_array_equal(session.coefficients, map_pose)
    session.redo()
    assert session.document.sketch_method == "paper"
    session.set_sketch_method("paper")
    assert session.redo_label is None
    assert session.undo_label == "Change the method of sketches"


def test_sessions_without_a_method_are_as_before(man: FaceModel) -> None:
    document = Document("man", (brow(man, 5.0),))
    assert "sketch_method" not in document.to_json()
    assert Document.from_json(document.to_json()).sketch_method == "map"
    with pytest.raises(FacePoserError, match="sketch_method is 'lwr'; it must be one of 'map', 'paper'"):
        Document.from_json(document.to_json() | {"sketch_method": "lwr"})


def test_the_papers_face_is_where_other_constraints_start(man: FaceModel, paper: PaperStub) -> None:
    sketch = brow(man, 12.0).resolved(man, man.neutral())
    corner = man.character.feature_points["8.3"]
    u, v = sketch.camera.project(man.character.vertices[[corner]])[0].tolist()
    pull = PointConstraint(corner, (u + 8.0, v - 8.0), sketch.camera)
    document = Document("man", (pull, sketch), sketch_method="paper")
    constraints, start = solver_input(man, document)
    assert [c.enabled for c in constraints] == [True, False]
    assert start is not None
    np.testing.assert_allclose(pose_problem(man, document).start, start)
    session = Session(man, document)
    session.wait()
    brows = man.character.regions["brow_left"]
    expected = man.instance(start)[brows]
    np.testing.assert_allclose(man.instance(session.coefficients)[brows], expected, atol=0.05)
    assert session.residuals_px[0] < 6.0
    # Dragging another constraint asks the statistics once.
    calls = paper.calls
    with session.edit("Drag"):
        for step in range(3):
            session.change_constraint(0, replace(pull, target=(u + step, v)), "Drag")
            session.wait()
    assert paper.calls == calls


@pytest.mark.parametrize("change", [{"enabled": False}, {"weight": 0.0}])
def test_sketches_that_do_not_act_leave_the_start(man: FaceModel, paper: PaperStub, change: dict) -> None:
    document = Document("man", (replace(brow(man, 12.0), **change),), sketch_method="paper")
    assert active_sketches(document) == drawn_strokes(document.constraints) == ()
    assert solver_input(man, document) == (document.constraints, None)
    assert paper.calls == 0


def test_the_sketcher_learns_from_the_library(man: FaceModel, creature: FaceModel) -> None:
    poses = library_poses(man)
    assert len(poses) > 10
    assert all(pose.shape == (man.n_coefficients,) for pose in poses)
    assert session_sketcher(man) is session_sketcher(man)
    training = session_sketcher(man).training.coefficients
    assert all(np.abs(training - pose).max(axis=1).min() < 1e-12 for pose in poses)
    assert session_sketcher(creature).training.coefficients.shape[1] == creature.n_coefficients


def test_the_plain_prior_starts_from_the_face_of_the_paper(man: FaceModel, paper: PaperStub) -> None:
    document = Document("man", (brow(man, 12.0),), sketch_method="paper", prior="plain").resolved(man)
    assert prior_of(document) == "regions"
    assert prior_of(replace(document, sketch_method="map")) == "plain"
    start = man.coefficients_of({"browInnerUp": 0.3})
    np.testing.assert_allclose(solve(pose_problem(man, document)).coefficients, start, atol=1e-6)
