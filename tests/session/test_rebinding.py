"""Sessions that were made on another version of their character find their places and poses again."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faceposer
from faceposer.animation.keyframes import Keyframes
from faceposer.cli import main
from faceposer.errors import FacePoserError, FacePoserWarning
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.character import Character
from faceposer.model.character_file import load_character, save_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.framing import face_view
from faceposer.photo.photo import Photo, Pin
from faceposer.session.autosave import Journal, find_orphans
from faceposer.session.document import Document
from faceposer.session.opening import open_session
from faceposer.session.session import Session
from faceposer.solve.constraints.curve import CurveConstraint
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import CONSTRAINTS, Constraint
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint
from tests.versions import renumbered

WEIGHTS = {"jawOpen": 0.4, "mouthSmileLeft": 0.6}


def without_shape(character: Character, name: str) -> Character:
    """Return ``character`` without the shape ``name``."""
    kept = [i for i, other in enumerate(character.shape_names) if other != name]
    names = tuple(character.shape_names[i] for i in kept)
    return replace(
        character, shape_names=names, shapes=character.shapes[kept], shape_limits=character.shape_limits[kept]
    )


def in_front(model: FaceModel) -> Camera:
    return face_view(model.character, "front", 4 / 3).camera((640, 480))


def pixel_of(model: FaceModel, points: SurfacePoints, camera: Camera) -> Any:
    return camera.project(model.positions_at(points, model.neutral()))


def brow_ends(model: FaceModel) -> list[int]:
    return [model.character.feature_points[name] for name in ("4.1", "4.5")]


def all_kinds(model: FaceModel) -> tuple[Constraint, ...]:
    """Return a constraint of each kind, with anchors on triangles and at vertices."""
    camera = in_front(model)
    corner = model.character.feature_points["8.3"]
    brow = model.character.feature_points["4.1"]
    face = int(np.flatnonzero((model.triangles == corner).any(axis=1))[0])
    on_face = SurfacePoint(face, (0.2, 0.3, 0.5))
    (u, v) = pixel_of(model, SurfacePoints.at_vertices([corner]), camera)[0]
    lip = model.character.regions["mouth"][:30]
    stroke = StrokeConstraint(((u, v), (u + 9, v)), ((u, v - 5), (u + 9, v - 5)), 8.0, camera)
    curve = CurveConstraint(((u - 20, v), (u, v)), ((u - 20, v), (u, v - 6)), camera)
    fixed = FixedConstraint(SurfacePoints.at_vertices(lip))
    pose = model.coefficients_of(WEIGHTS)
    ends = [tuple(pixel_of(model, SurfacePoints.at_vertices([v]), camera)[0].tolist()) for v in brow_ends(model)]
    sketch = SketchConstraint(tuple(ends), camera, "left brow", (("4.1", ends[0]), ("4.5", ends[1])), weight=2.0)
    return (
        PointConstraint(on_face, (u, v - 6), camera, weight=0.5),
        PointConstraint(brow, (10.0, 20.0), camera, locked=True),
        DistanceConstraint((corner, on_face), 30.0, camera),
        stroke.resolved(model, model.neutral()),
        curve.resolved(model, model.neutral()),
        fixed.resolved(model, pose),
        GazeConstraint((10.0, 5.0)),
        sketch.resolved(model, pose),
    )


def saved(folder: Path, change: Any = None) -> tuple[Path, FaceModel]:
    """Save a session with all that there is on a character of its own, and return its file and that character."""
    character = load_character("low")
    save_character(folder / "own.npz", character)
    model = build_face_model(load_character(folder / "own.npz"))
    pose, other = model.coefficients_of(WEIGHTS), model.coefficients_of({"browDownLeft": 0.7})
    vertex = model.character.feature_points["9.3"]
    pins = (Pin("8.3", (3.0, 4.0)), Pin(vertex, (5.0, 6.0)), Pin(SurfacePoint(40, (0.5, 0.25, 0.25)), (7.0, 8.0)))
    document = Document(
        str(folder / "own.npz"),
        all_kinds(model),
        camera=in_front(model),
        photos=(Photo(str(folder / "a.jpg"), (640, 480), pins, in_front(model)),),
        keyframes=Keyframes(length=10).with_key(0, other).with_key(5, pose),
    )
    session = Session(model, document.with_start(other).posed(pose))
    path = folder / "session.json"
    session.save(path)
    if change is not None:
        save_character(folder / "own.npz", change(character))
    return path, model


def rest_of(model: FaceModel, document: Document) -> list[Any]:
    """Return where all places of all constraints and pins are on the neutral face."""
    places = [one.places for one in document.constraints if one.places is not None]
    places += [
        SurfacePoints.of([pin.place])
        for photo in document.photos
        for pin in photo.pins
        if not isinstance(pin.place, str)
    ]
    return [points.positions(model.character.vertices, model.triangles) for points in places]


def test_every_kind_of_constraint_is_tried() -> None:
    model = build_face_model(load_character("low"))
    assert {one.kind for one in all_kinds(model)} == set(CONSTRAINTS)


def test_the_same_character_keeps_everything_as_it_is(tmp_path: Path) -> None:
    path, model = saved(tmp_path)
    before = open_session(str(path))
    assert before.remark == ""
    assert before.document.constraints == tuple(one.without_rest() for one in before.document.constraints)
    again = all_kinds(model)
    assert [one.places for one in before.document.constraints] == [one.places for one in again]
    data = json.loads(path.read_text())
    assert set(data["character"]) == {"vertices", "triangles", "faces", "parts", "feature_points", "box", "shapes"}
    assert len(data["constraints"][3]["rest"]) == len(data["constraints"][3]["source"]["anchors"])
    assert "rest" not in data["constraints"][6], "gaze has no places"
    before.save(path)
    assert json.loads(path.read_text()) == data


def test_places_are_found_again_in_another_order_of_the_mesh(tmp_path: Path) -> None:
    path, old = saved(tmp_path, renumbered)
    session = open_session(str(path))
    count = sum(len(places) for places in rest_of(old, Document("", all_kinds(old)))) + 2
    assert session.remark == (
        f'This session was made with another version of "own"; {count} points were reattached by position.'
    )
    expected = [*rest_of(old, Document("", all_kinds(old)))]
    found = rest_of(session.model, session.document)
    assert len(found) == len(expected) + 2
    for where, there in zip(expected, found, strict=False):
        np.testing.assert_allclose(there, where, atol=2e-3)
    # What holds points in space, what is locked and what was drawn stay as they were.
    new, made = session.document.constraints, all_kinds(old)
    assert isinstance(new[5], FixedConstraint)
    assert isinstance(made[5], FixedConstraint)
    assert (new[5].points.faces < 0).all(), "vertices are let go by their number"
    np.testing.assert_allclose(new[5].positions, made[5].positions, atol=2e-3)
    assert [(one.weight, one.enabled, one.locked) for one in new] == [
        (one.weight, one.enabled, one.locked) for one in made
    ]
    assert new[1].camera == made[1].camera
    pins = session.document.photos[0].pins
    assert [pin.pixel for pin in pins] == [(3.0, 4.0), (5.0, 6.0), (7.0, 8.0)]
    assert pins[0].place == "8.3"


def test_sketches_find_their_feature_again(tmp_path: Path) -> None:
    path, old = saved(tmp_path, renumbered)
    session = open_session(str(path))
    sketch, made = session.document.constraints[-1], all_kinds(old)[-1]
    assert isinstance(sketch, SketchConstraint)
    assert sketch == made
    there, where = (
        one.points.positions(model.character.vertices, model.triangles)
        for one, model in ((sketch, session.model), (made, old))
    )
    np.testing.assert_allclose(there, where, atol=2e-2)


def test_sketches_of_a_feature_that_is_gone_are_removed_and_named(tmp_path: Path) -> None:
    def browless(character: Character) -> Character:
        points = {name: vertex for name, vertex in character.feature_points.items() if name != "4.3"}
        titles = {name: title for name, title in character.feature_titles.items() if name in points}
        return replace(character, feature_points=points, feature_titles=titles)

    for change in (browless, lambda character: browless(renumbered(character))):
        path, _ = saved(tmp_path, change)
        session = open_session(str(path))
        assert "sketch" not in {one.kind for one in session.document.constraints}
        assert "removed, because their places no longer exist: constraints[7] (sketch)" in session.remark
        path.unlink()


def test_poses_come_back_by_the_weights_of_their_shapes(tmp_path: Path) -> None:
    path, old = saved(tmp_path, lambda character: without_shape(renumbered(character), "tongueOut"))
    session = open_session(str(path))
    assert session.model.n_coefficients < old.n_coefficients
    names = session.model.character.shape_names
    weights = dict(zip(names, session.model.weights_of(session.coefficients), strict=True))
    for name, value in WEIGHTS.items():
        assert weights[name] == pytest.approx(value, abs=1e-3)
    keyframes = session.document.keyframes
    assert keyframes is not None
    first = dict(zip(names, session.model.weights_of(keyframes.keys[0].pose), strict=True))
    assert first["browDownLeft"] == pytest.approx(0.7, abs=1e-3)
    start = session.document.start
    assert start is not None
    assert session.model.weights_of(start)[names.index("browDownLeft")] == pytest.approx(0.7, abs=1e-3)
    assert "lacks" not in session.remark, "no pose needs the shape that is gone"


def test_a_shape_that_a_pose_needs_and_that_is_gone_is_named(tmp_path: Path) -> None:
    path, _ = saved(tmp_path, lambda character: without_shape(character, "mouthSmileLeft"))
    remark = open_session(str(path)).remark
    assert remark == (
        'This session was made with another version of "own"; its poses were converted from shape weights; '
        "this version lacks mouthSmileLeft."
    )


def test_shapes_sculpted_anew_keep_the_pose_by_its_weights(tmp_path: Path) -> None:
    def sculpted(character: Character) -> Character:
        shapes = character.shapes.copy()
        shapes[character.shape_names.index("jawOpen")] *= 1.3
        return replace(character, shapes=shapes)

    path, old = saved(tmp_path, sculpted)
    session = open_session(str(path))
    assert "reattached" not in session.remark
    assert "shape weights" in session.remark
    assert [one.places for one in session.document.constraints] == [one.places for one in all_kinds(old)]
    jaw = session.model.weights_of(session.coefficients)[session.model.character.shape_names.index("jawOpen")]
    assert jaw == pytest.approx(0.4, abs=1e-3)


def test_a_character_of_another_size_takes_places_and_cameras_along(tmp_path: Path) -> None:
    path, old = saved(tmp_path, lambda character: renumbered(character, 2.5, 4.0))
    session = open_session(str(path))
    assert "may be wrong" not in session.remark
    camera = in_front(old)
    for old_one, new_one in zip(all_kinds(old), session.document.constraints, strict=True):
        if old_one.places is None or old_one.camera is None:
            continue
        assert new_one.places is not None
        assert new_one.camera is not None
        there = pixel_of(session.model, new_one.places, new_one.camera)
        np.testing.assert_allclose(there, pixel_of(old, old_one.places, camera), atol=0.05)
    fixed = session.document.constraints[5]
    made = all_kinds(old)[5]
    assert isinstance(fixed, FixedConstraint)
    assert isinstance(made, FixedConstraint)
    np.testing.assert_allclose(fixed.positions, np.asarray(made.positions) * 2.5 + 4.0, atol=0.02)


def test_a_place_stays_on_its_part(tmp_path: Path) -> None:
    """A pin of a tooth is not put on the lip, which may be nearer than the tooth now is."""
    character = load_character("low")
    teeth = character.part("teeth_upper")
    save_character(tmp_path / "own.npz", character)
    camera = in_front(build_face_model(character))
    vertex = teeth.vertices[0]
    Session(
        build_face_model(character), Document(str(tmp_path / "own.npz"), (PointConstraint(vertex, (1.0, 2.0), camera),))
    ).save(tmp_path / "s.json")
    moved = renumbered(character)
    vertices = moved.vertices.copy()
    vertices[slice(*teeth.vertices), 2] -= 0.3
    save_character(tmp_path / "own.npz", replace(moved, vertices=vertices))
    session = open_session(str(tmp_path / "s.json"))
    point = session.document.constraints[0].places
    assert point is not None
    first, last = session.model.character.part_triangles(session.model.character.part("teeth_upper"))
    assert first <= point.faces[0] < last


def test_the_sentence_for_one_point(tmp_path: Path) -> None:
    save_character(tmp_path / "own.npz", load_character("low"))
    model = build_face_model(load_character("low"))
    document = Document(str(tmp_path / "own.npz"), all_kinds(model)[:1]).posed(model.neutral())
    Session(model, document).save(tmp_path / "s.json")
    save_character(tmp_path / "own.npz", renumbered(load_character("low")))
    remark = open_session(str(tmp_path / "s.json")).remark
    assert remark == 'This session was made with another version of "own"; 1 point was reattached by position.'


def strip(path: Path, *keys: str) -> None:
    """Take from a session's file what older programs did not write."""
    data = json.loads(path.read_text())
    for key in keys:
        data.pop(key, None)
    for one in data["constraints"]:
        one.pop("rest", None)
    path.write_text(json.dumps(data))


def test_old_files_open_and_say_which_places_may_be_off(tmp_path: Path) -> None:
    path, old = saved(tmp_path)
    strip(path, "character", "weights", "start_weights")
    session = open_session(str(path))
    assert session.document.constraints == all_kinds(old)
    assert session.remark.startswith('This session does not state with which version of "own" it was made; if it')
    assert "constraints[0] (point)" in session.remark
    assert "constraints[5] (fixed)" in session.remark
    assert "gaze" not in session.remark
    assert "photos[0]" in session.remark
    session.save(path)
    assert open_session(str(path)).remark == "", "the version is known once it is saved"


def test_places_without_rest_positions_on_another_version(tmp_path: Path) -> None:
    path, _ = saved(tmp_path, renumbered)
    strip(path)
    session = open_session(str(path))
    assert "2 points were reattached by position" in session.remark, "those of the photo"
    assert "the places of constraints[0] (point), constraints[1] (point)" in session.remark
    assert len(session.document.constraints) == 8


def test_places_that_the_character_has_no_more_are_left_out(tmp_path: Path) -> None:
    path, old = saved(tmp_path, renumbered)
    strip(path)
    data = json.loads(path.read_text())
    data["constraints"][0]["anchor"] = {"face": len(old.triangles) + 7, "barycentric": [1, 0, 0]}
    path.write_text(json.dumps(data))
    session = open_session(str(path))
    assert len(session.document.constraints) == 7
    assert "removed, because their places no longer exist: constraints[0] (point)" in session.remark


def test_a_pose_of_another_version_is_solved_anew_where_that_is_possible(tmp_path: Path) -> None:
    model = build_face_model(load_character("low"))
    document = Document("low", all_kinds(model)[:2]).posed(np.full(7, 0.1))
    path = tmp_path / "old.json"
    path.write_text(json.dumps(document.to_json()))
    session = open_session(str(path))
    session.wait()
    assert len(session.coefficients) == session.model.n_coefficients
    assert "its pose was solved again; the places of constraints[0] (point) and constraints[1]" in session.remark
    path.write_text(json.dumps(document.with_start(np.full(7, 0.1)).to_json()))
    with pytest.raises(FacePoserError, match="coefficients has 7 numbers"):
        open_session(str(path))


def test_zeros_are_the_neutral_face_of_every_version(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    path.write_text(json.dumps(Document("low").posed(np.zeros(7)).to_json()))
    session = open_session(str(path))
    np.testing.assert_array_equal(session.coefficients, session.model.neutral())
    count = session.model.n_coefficients
    assert session.remark == (
        f"Its pose has 7 numbers instead of {count}; since all are 0, it was read as the neutral face."
    )


def test_python_warns_and_commands_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, _ = saved(tmp_path, renumbered)
    with pytest.warns(FacePoserWarning, match="points were reattached by position"):
        face = faceposer.load(path)
    assert face.constraints
    faceposer.load(tmp_path / "own.npz")
    outputs = {"solve": "a.obj", "export": "a.csv", "transfer": "other.json"}
    for command, output in outputs.items():
        target = ["low"] if command == "transfer" else []
        with pytest.raises(SystemExit) as end:
            main([command, str(path), *target, "-o", str(tmp_path / output)])
        assert not end.value.code
        assert "points were reattached by position" in capsys.readouterr().err, command


def test_unsaved_work_is_kept_for_another_version_too(tmp_path: Path) -> None:
    path, _ = saved(tmp_path)
    session = open_session(str(path))
    session.set_prior_weight(3.0)
    journal = Journal(tmp_path / "journals")
    journal.flush(session)
    journal.close(keep=True)
    save_character(tmp_path / "own.npz", renumbered(load_character("low")))
    orphan = find_orphans(tmp_path / "journals").orphans[0]
    again = orphan.open()
    orphan.release()
    assert "reattached" in again.remark
    assert again.document.prior_weight == 3.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data["character"].pop("faces"), "character lacks the key 'faces'"),
        (lambda data: data["character"].update(faces=5), "character.faces must be"),
        (lambda data: data["character"].update(shapes=[5]), "character.shapes\\[0\\] must be"),
        (lambda data: data["character"].update(box=[[0, 0, 0]]), "character.box must be"),
        (lambda data: data["character"].update(parts={"skin": {"triangles": [1]}}), "character.parts.skin"),
        (lambda data: data["character"].update(feature_points=[]), "character.feature_points must be"),
        (lambda data: data["constraints"][0]["rest"].append([0, 0, 0]), r"constraints\[0\].rest must be a list of 1"),
        (lambda data: data["constraints"][0].update(rest=[[0, "a", 0]]), r"constraints\[0\].rest\[0\]\[1\]"),
        (lambda data: data["constraints"][6].update(rest=[[0, 0, 0]]), r"constraints\[6\].rest must be a list of 0"),
        (lambda data: data["weights"].pop(), "weights has 53 numbers, but character.shapes has 54"),
        (lambda data: data["animation"]["keys"][1]["weights"].pop(), r"animation.keys\[1\].weights has 53"),
        (lambda data: data["photos"][0]["pins"][1].update(rest=[1]), r"photos\[0\].pins\[1\].rest must be"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: Any, message: str) -> None:
    path, _ = saved(tmp_path)
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises(FacePoserError, match=message):
        open_session(str(path))
