"""The Python interface: what its page shows runs, all constraints do what the window's do, errors are one sentence."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import faceposer
from faceposer.api import Face
from faceposer.errors import FacePoserError, FacePoserWarning
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.session.document import read_document
from faceposer.session.opening import open_session
from tests.sketch.drawings import drawn, scribble

PAGE = Path(__file__).resolve().parents[2] / "docs" / "api.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def face() -> Face:
    return faceposer.load("man")


@pytest.fixture(autouse=True)
def default_pose_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return tmp_path / "data" / "faceposer" / "poses"


def test_keys_go_to_other_faces_and_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Face] = {}
    exec(compile(EXAMPLES[2], "docs/api.md", "exec"), names)
    face, goblin = names["face"], names["goblin"]
    assert [key.frame for key in goblin.session.animation.keyframes.keys] == [0, 20]
    performance = face.performance
    assert performance is not None
    jaw = performance.weights(face.model)[:, face.character.shape_names.index("jawOpen")]
    assert jaw[0] == pytest.approx(0.0, abs=1e-9)
    assert jaw[20] > 0.2
    assert len(json.loads((tmp_path / "goblin.json").read_text())["frames"]) == len(performance)
    assert (tmp_path / "man.glb").stat().st_size > 1_000_000
    moved = np.linalg.norm(
        goblin.model.surface(goblin.session.animation.keyframes.keys[1].pose) - goblin.vertices, axis=1
    )
    assert goblin.session.document.frame == 20
    assert moved.max() < 1e-3


def test_a_face_follows_its_own_motion(face: Face) -> None:
    names = ["8.3", "8.4", "8.1", "8.2", "2.10"]
    points = SurfacePoints.at_vertices([face.character.feature_points[name] for name in names])
    jaw = [face.model.coefficients_of({"jawOpen": weight}) for weight in np.linspace(0.0, 0.7, 12)]
    positions = np.stack([face.model.positions_at(points, pose) for pose in jaw])
    found = face.follow(faceposer.Trajectories(tuple(names), points, positions, 30.0), smoothness=0.1)
    opening = found.weights(face.model)[:, face.character.shape_names.index("jawOpen")]
    assert opening[-1] > 0.5
    face.play(found)
    assert face.performance is not None
    np.testing.assert_allclose(face.performance.coefficients, found.coefficients, atol=1e-9)


def test_the_example_on_the_page_is_ten_lines_and_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code = EXAMPLES[0]
    assert len([line for line in code.splitlines() if line.strip()]) == 10
    exec(compile(code, "docs/api.md", "exec"), {})
    shape, smile = re.fullmatch(r"\((\d+), 3\) ([\d.]+)\n", capsys.readouterr().out).groups()  # type: ignore[union-attr]
    assert float(smile) > 0.3
    mesh = read_mesh(tmp_path / "posed.obj")
    assert len(mesh.vertices) == int(shape)
    assert np.abs(mesh.vertices - faceposer.load("man").vertices).max() > 0.3


@pytest.mark.gl
def test_the_other_example_on_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert len(EXAMPLES) == 5
    exec(compile(EXAMPLES[1], "docs/api.md", "exec"), {})
    assert sorted(p.name for p in tmp_path.iterdir()) == ["poses", "surprised.png"]
    weights = json.loads((tmp_path / "poses" / "closed-smile.json").read_text())["weights"]
    assert weights["cheekSquintLeft"] > 0.5


def test_importing_the_package_is_cheap_and_its_names_are_there() -> None:
    code = (
        "import faceposer, sys; assert not {'numpy', 'scipy', 'imgui_bundle'} & set(sys.modules); "
        "assert all(getattr(faceposer, name) for name in faceposer.__all__); "
        "assert not {'imgui_bundle', 'moderngl', 'sklearn'} & set(sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    with pytest.raises(AttributeError, match="nothing_of_the_kind"):
        faceposer.nothing_of_the_kind  # noqa: B018


def test_nothing_moves_before_the_solve_and_then_all_is_met(face: Face) -> None:
    camera = face.camera("three-quarter", (800, 700))
    u, v = face.pixel("left mouth corner", camera)
    point = face.drag("mouth corner left", to=(u + 6, v - 8), camera=camera)
    np.testing.assert_array_equal(face.coefficients, face.model.neutral())
    assert face.residuals[0] == pytest.approx(10.0)
    solution = face.solve()
    assert face.constraints == (point,)
    assert face.residuals == pytest.approx(solution.residuals_px)
    assert face.residuals[0] < 2.0
    assert face.pixel("8.3", camera) == pytest.approx((u + 6, v - 8), abs=2.0)
    assert face.weights["mouthSmileLeft"] > 0.1


def test_every_kind_of_constraint(face: Face) -> None:
    camera = face.camera()
    lip, brow = np.array(face.pixel("lower lip")), np.array(face.pixel("top of the right brow"))
    corners = [np.array(face.pixel(name)) for name in ("right mouth corner", "left mouth corner")]
    face.set_distance("middle of the inner upper lip", "middle of the inner lower lip", 30)
    face.stroke([brow - (30, 0), brow, brow + (30, 0)], [brow - (30, 14), brow - (0, 14), brow + (30, -14)], 10)
    line = [corners[0], lip, corners[1]]
    face.curve(line, [corners[0] - (6, 6), lip + (0, 8), corners[1] + (6, -6)], weight=0.5)
    face.fix("left brow")
    face.fix([0, 5, 9], weight=2.0)
    face.look(12, 6)
    kinds = [constraint.kind for constraint in face.constraints]
    assert kinds == ["distance", "stroke", "curve", "fixed", "fixed", "gaze"]
    face.solve()
    assert np.max(face.residuals) < 8.0
    assert face.weights["eyeLookOutLeft"] == pytest.approx(12 / 31, abs=0.05)
    assert face.pixel("top of the right brow", camera)[1] < brow[1] - 6
    face.look(-12)
    assert len(face.constraints) == 6
    face.remove(face.constraints[0])
    assert [constraint.kind for constraint in face.constraints] == kinds[1:]
    face.sketch(drawn(face.model, "right brow", face.coefficients, camera), camera=camera)
    assert face.constraints[-1].kind == "sketch"
    face.reset()
    assert face.constraints == ()
    np.testing.assert_array_equal(face.vertices, face.model.instance(face.model.neutral()))


def test_drawn_features_are_recognised_and_followed(face: Face) -> None:
    model, camera = face.model, face.camera("three-quarter", (900, 800))
    truth = model.coefficients_of({"browInnerUp": 0.7, "browOuterUpLeft": 0.5})
    line = np.array(drawn(model, "left brow", truth, camera))
    found = face.sketch(line, camera=camera)
    assert found.best is not None
    assert found.best.feature == "left brow"
    assert {point.feature_point for point in found.best.points} <= {"4.1", "4.3", "4.5"}
    face.solve()
    assert face.residuals[0] < 1.5
    assert face.sketch(line[::-1] + (0.0, 4.0), camera=camera, weight=2.0).best.feature == "left brow"
    assert len(face.constraints) == 1, "drawn again"
    # A feature may be named, whatever the stroke looks like.
    assert face.sketch(line - (0.0, 10.0), feature="left upper lid", camera=camera).best.feature == "left upper lid"
    assert [one.feature for one in face.constraints] == ["left brow", "left upper lid"]
    assert face.sketch_method == "map"


def test_what_cannot_be_sketched_is_said_and_changes_nothing(face: Face) -> None:
    camera = face.camera()
    line = drawn(face.model, "left brow", face.coefficients, camera)
    for stroke, options, said in (
        (scribble(camera), {}, "depicts no feature of the face"),
        ([line[0], line[0]], {}, "depicts no feature of the face"),
        (line[:1], {}, "from 2 to 10000 points, not 1"),
        (line * 2000, {}, "from 2 to 10000 points"),
        ([(1, np.nan), (2, 3)], {}, "Pixels must be pairs of numbers"),
        (line, {"feature": "left eyebrow"}, "A feature must be one of 'left brow'"),
        (line, {"recognition": "hmm"}, "A method of recognition must be one of"),
        (line, {"weight": -1.0}, "The weight of a constraint"),
        (line, {"camera": "front"}, "A camera must be"),
        ([(1e7, 0), (0, 1e7)], {"feature": "jaw line"}, "must be from -1e"),
    ):
        with pytest.raises(FacePoserError, match=said):
            face.sketch(stroke, **options)
    with pytest.raises(FacePoserError, match="method of sketches must be one of 'map', 'paper'"):
        face.sketch_method = "lwr"
    assert face.constraints == ()
    assert not face.session.can_undo


def test_a_place_is_a_name_a_number_or_a_pixel(face: Face) -> None:
    vertex = face.character.feature_points["9.3"]
    tip = face.pixel("nose tip")
    assert face.pixel(vertex) == face.pixel("9.3") == face.pixel("tip of the nose") == tip
    assert face.pixel(tip) == pytest.approx(tip, abs=1e-6)
    assert face.pixel(np.int32(vertex)) == tip  # type: ignore[arg-type]


def test_the_prior_holds_the_face(face: Face) -> None:
    u, v = face.pixel("left mouth corner")
    face.drag("left mouth corner", to=(u + 30, v - 30))
    face.solve()
    held = face.residuals[0]
    face.prior_weight = 0.0
    face.solve()
    assert face.residuals[0] < held
    face.prior = "whole"
    assert face.session.document.prior == "whole"


def test_the_spread_says_how_much_of_the_face_follows(face: Face) -> None:
    u, v = face.pixel("left mouth corner")
    face.drag("left mouth corner", (u + 8, v - 10))
    assert face.spread == 0.5
    away = (
        np.linalg.norm(face.character.vertices - face.character.vertices[face.character.feature_points["8.3"]], axis=1)
        > 5
    )
    moved = []
    for spread in (0.0, 1.0):
        face.spread = spread
        assert face.session.document.spread == spread
        face.solve()
        moved.append(float(np.linalg.norm(face.vertices - face.character.vertices, axis=1)[away].mean()))
    assert moved[0] < 0.5 * moved[1]
    assert face.transfer_to("woman").spread == 1.0


def test_weights_and_poses_are_what_the_face_starts_from(face: Face) -> None:
    face.set_weights({"jawOpen": 0.5})
    assert face.weights["jawOpen"] == pytest.approx(0.5, abs=0.02)
    face.apply_pose("ANGER", regions=["brows"])
    assert face.weights["jawOpen"] == pytest.approx(0.5, abs=0.02)
    assert face.weights["browDownLeft"] > 0.9
    u, v = face.pixel("left mouth corner")
    face.drag("left mouth corner", to=(u + 5, v - 10))
    face.solve()
    assert face.weights["browDownLeft"] > 0.7
    face.apply_pose(faceposer.Pose("Shut", {}), 1.0)
    face.solve()
    assert face.weights["browDownLeft"] < 0.2, "constraints pull from the new start"


def test_the_name_of_a_whole_sets_both_halves(face: Face) -> None:
    face.set_weights({"browInnerUp": 0.8, "cheekPuffLeft": 0.5})
    for name, weight in {"browInnerUpLeft": 0.8, "browInnerUpRight": 0.8, "cheekPuffLeft": 0.5}.items():
        assert face.weights[name] == pytest.approx(weight, abs=0.05), name
    assert face.weights["cheekPuffRight"] < 0.1
    face.set_weights({"browInnerUpLeft": 0.8})
    assert face.weights["browInnerUpRight"] < 0.1


def test_own_poses_go_round(face: Face, default_pose_folder: Path) -> None:
    face.set_weights({"mouthSmileLeft": 0.7})
    path = face.save_pose("Half a smile")
    assert path == default_pose_folder / "half-a-smile.json"
    with pytest.raises(faceposer.FacePoserError, match="already"):
        face.save_pose("Half a smile")
    other = faceposer.load("woman")
    other.apply_pose("half a smile")
    assert other.weights["mouthSmileLeft"] == pytest.approx(0.7, abs=0.02)
    other.flip()
    assert other.weights["mouthSmileRight"] == pytest.approx(0.7, abs=0.05)
    other.mirror("right")
    assert other.weights["mouthSmileLeft"] == pytest.approx(0.7, abs=0.05)
    other.apply_pose(path, strength=-1.0, blend="add", side="right")


def test_a_session_goes_to_the_window_and_back(face: Face, tmp_path: Path) -> None:
    u, v = face.pixel("top of the left brow")
    face.drag("top of the left brow", to=(u, v - 15))
    face.solve()
    path = face.save(tmp_path / "work.json")
    assert read_document(path).constraints == face.constraints
    again = faceposer.load(path)
    np.testing.assert_allclose(again.vertices, face.vertices, atol=1e-4)
    assert open_session(str(path)).residuals_px == pytest.approx(face.residuals)


@pytest.mark.gl
def test_a_picture_comes_as_an_array_and_as_a_file(face: Face, tmp_path: Path) -> None:
    picture = face.render(tmp_path / "a.png", "left", (120, 160), "clay")
    assert picture.shape == (160, 120, 3)
    assert picture.std() > 10.0
    assert (tmp_path / "a.png").stat().st_size > 500
    assert face.render(view=face.camera("front", (64, 48))).shape == (48, 64, 3)


@pytest.mark.parametrize(
    ("do", "sentence"),
    [
        ("faceposer.load('mann')", "Did you mean 'man'"),
        ("face.drag('mouth corner', (1, 2))", "is ambiguous"),
        ("face.drag('nostrils', (1, 2))", "no feature point 'nostrils'"),
        ("face.drag('', (1, 2))", "no feature point"),
        ("face.drag((1.0, 2.0), (1, 2))", "does not see the face"),
        ("face.drag(-1, (1, 2))", "has the vertices 0 to"),
        ("face.drag('8.3', 'left')", "pairs of numbers"),
        ("face.drag('8.3', (float('nan'), 1))", "pairs of numbers"),
        ("face.drag('8.3', (1, 2), weight=-1)", "weight of a constraint"),
        ("face.stroke([(1, 2)], [(3, 4)])", "does not touch the face"),
        ("face.curve([(480, 500)], [(480, 500)])", "two points or more"),
        ("face.fix('elbow')", "no region 'elbow'"),
        ("face.fix([])", "at least one"),
        ("face.fix([10**7])", "has the vertices 0 to"),
        ("face.set_weights({'jaw': 1.0})", "no shape 'jaw'"),
        ("face.apply_pose('joy')", "no pose 'joy'"),
        ("face.apply_pose('nowhere.json')", "cannot be read"),
        ("face.apply_pose('anger', 3.0)", "strength"),
        ("face.save('face.xyz')", "must end in one of"),
        ("face.save_pose(' ')", "name of a pose must be"),
        ("face.remove(other)", "is not on this face"),
        ("setattr(face, 'prior_weight', -1.0)", "prior weight"),
        ("setattr(face, 'prior_weight', None)", "The prior weight must be a number"),
        ("setattr(face, 'spread', True)", "The spread must be a number from 0 to 1"),
        ("face.set_distance('8.3', '8.4', 'x')", "The distance must be a number"),
        ("face.set_distance('8.3', '8.3', 5)", "between two different places"),
        ("face.stroke([(480, 500)] * 2, [(480, 500)] * 2, width='x')", "The width must be a number"),
        ("setattr(face, 'spread', 1.5)", "The spread must be a number from 0 to 1, not 1.5"),
        ("setattr(face, 'prior', 'none')", "The prior must be one of"),
        ("face.set_distance('8.3', '8.4', nan)", "distance constraint.target must be a number"),
        ("face.set_distance('8.3', '8.4', -5)", "distance constraint.target must be a number"),
        ("face.drag('8.3', (1e15, 1))", "point constraint.target"),
        ("face.drag('8.3', (1, 2), camera='front')", "A camera must be of the class that Face.camera()"),
        ("face.stroke([(480, 500)] * 2, [(480, 500)] * 2, width=0)", "stroke constraint.width"),
        ("face.stroke([(480, 500)] * 2, [(480, 500)] * 2, shape='x')", "stroke constraint.shape"),
        ("face.stroke([(480, 500)] * 2, [(480, 500)] * 2, energy='x')", "stroke constraint.energy"),
        ("face.look(nan)", "An angle must be a number"),
        ("faceposer.load('creature').look(10)", "cannot be turned, because the character has no eyeLook shapes"),
        ("face.set_weights({'jawOpen': nan})", "weight of 'jawOpen' must be a number"),
        ("face.set_weights({'jawOpen': 1e300})", "weight of 'jawOpen' must be a number"),
        ("face.apply_pose('anger', regions=['nose'])", "A region must be one of 'brows'"),
        ("face.apply_pose('anger', side='up')", "A side must be one of"),
        ("face.apply_pose('anger', blend='mul')", "The blend must be one of"),
        ("face.mirror('up')", "must be one of 'left', 'right'"),
        ("face.camera('up')", "A view must be one of 'front'"),
        ("face.camera('front', (0, 5))", "The size of an image"),
        ("face.camera('front', (nan, 5))", "The size of an image"),
        ("face.render(size=(100000, 100000))", "The size of an image"),
        ("face.render('face.jpg')", "must end in '.png'"),
        ("face.render(shading='x')", "The shading must be one of"),
        ("face.pixel(SurfacePoint(10**8, (1.0, 0.0, 0.0)))", "The place is not on 'Man'"),
        ("face.set_key(-1)", "A frame must be a whole number"),
        ("face.set_key(1.5)", "A frame must be a whole number"),
        ("face.set_key('a')", "A frame must be a whole number"),
        ("face.set_animation(length=0)", "A length must be a whole number"),
        ("face.set_animation(rate=-1)", "The rate must be a number"),
        ("face.set_animation(loop=3)", "The loop must be one of"),
        ("face.set_animation(inbetweens='x')", "The in-betweens must be one of 'poses', 'feature points'"),
        ("face.play(Performance(np.zeros((2, 3)), 30.0))", "transfer the motion of another face"),
        ("face.play(np.zeros((2, 3)))", "A motion must be a Performance"),
        ("face.export('face.glb', Performance(np.zeros((2, 3)), 30.0))", "transfer the motion of another face"),
        ("face.export('face.gif', turn=nan)", "duration of a turn"),
        ("face.export('face.obj', turn=3)", "turns in videos only"),
        ("face.export('face.gif', transparent=True)", "GIF cannot have a transparent background; write .png"),
        ("face.export_sequence('face', 'gif')", "The kind of a sequence must be one of 'obj', 'ply', 'png'"),
        ("face.export_sequence('face')", "The face has no animation"),
        (
            "face.export_sequence('face', 'png', Performance(np.zeros((2, 3)), 30.0))",
            "transfer the motion of another face",
        ),
        ("face.follow('none.csv', smoothness=-1)", "The smoothness must be a number"),
        ("face.transfer_to('woman', method='x')", "The method must be one of"),
        ("face.transfer_to('woman', pairs=['8.3'])", "Pairs must be"),
    ],
)
def test_errors_are_one_sentence_and_nothing_is_left(
    do: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    face = faceposer.load("man")
    other = faceposer.load("man").drag("8.3", (1, 2))
    names = {"face": face, "faceposer": faceposer, "other": other, "nan": float("nan"), "np": np}
    names |= {"SurfacePoint": SurfacePoint, "Performance": faceposer.Performance}
    with pytest.raises(faceposer.FacePoserError) as refused:
        eval(do, names)
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)
    assert face.constraints == ()
    assert not face.session.can_undo
    assert list(tmp_path.iterdir()) == []


@pytest.mark.gl
def test_pictures_without_background_and_sequences(tmp_path: Path) -> None:
    face = faceposer.load("low")
    picture = face.render(tmp_path / "a.png", size=(48, 64), transparent=True)
    assert picture.shape == (64, 48, 4)
    with Image.open(tmp_path / "a.png") as written:
        np.testing.assert_array_equal(np.asarray(written), picture)
    assert (picture[..., 3].min(), picture[..., 3].max()) == (0, 255)
    face.set_key(0)
    face.set_weights({"jawOpen": 1.0})
    face.set_key(3)
    folder = face.export_sequence(tmp_path / "yawn", "png", size=(48, 64), transparent=True)
    assert len([*folder.iterdir()]) == len(face.performance)
    with Image.open(folder / "yawn.0004.png") as written:
        assert (written.mode, written.size) == ("RGBA", (48, 64))
    before = face.performance.coefficients
    face.set_animation(length=12, rate=24.0, loop=True, inbetweens="feature points")
    assert (len(face.performance), face.performance.rate) == (12, 24.0)
    np.testing.assert_array_equal(face.performance.coefficients[3], before[3])
    assert np.abs(face.performance.coefficients[11] - before[11]).max() > 1e-3, "it returns to the first key"
    assert face.session.document.keyframes.inbetweens == "feature points"
    face.session.undo()
    np.testing.assert_array_equal(face.performance.coefficients, before)
    motion = faceposer.Performance(face.performance.coefficients[:2], 24.0)
    folder = face.export_sequence(tmp_path / "two", motion=motion, materials=False)
    assert sorted(path.name for path in folder.iterdir()) == ["two.0001.obj", "two.0002.obj"]
    face.export(tmp_path / "b.obj", materials=False)
    assert not (tmp_path / "b.mtl").exists()
    face.save(tmp_path / "c.obj")
    assert (tmp_path / "c.mtl").exists()


@pytest.mark.usefixtures("no_ffmpeg")
def test_without_ffmpeg_python_says_so(tmp_path: Path) -> None:
    with pytest.raises(faceposer.FacePoserError, match=r"MP4 needs ffmpeg.*faceposer\[film\]"):
        faceposer.load("low").export(tmp_path / "a.mp4")


def test_what_was_assumed_of_an_animation_is_a_warning(tmp_path: Path) -> None:
    face = faceposer.load("low")
    rows = [f"{40 * i},{i / 50}" for i in range(50) if not 20 <= i < 30]
    (tmp_path / "a.csv").write_text("\n".join(["time_ms,jawOpen", *rows]))
    with pytest.warns(FacePoserWarning, match="10 of its 50 frames are missing") as caught:
        performance = face.take_animation(tmp_path / "a.csv")
    assert caught[0].filename == __file__
    assert (len(performance), performance.rate, performance.seconds) == (50, 25.0, 2.0)
    assert face.performance is not None
    assert face.performance.seconds == 2.0
    (tmp_path / "b.csv").write_text("jawOpen\n0\n0.5\n1\n")
    with pytest.warns(FacePoserWarning, match=r"b\.csv: It has no weights of 53 of the 54 shapes"):
        assert face.take_animation(tmp_path / "b.csv", rate=24.0).rate == 24.0
    with pytest.raises(FacePoserError, match="The rate"):
        face.take_animation(tmp_path / "b.csv", rate=0.0)
    places = face.character.vertices[face.character.feature_points["8.3"]].tolist()
    (tmp_path / "c.csv").write_text("8.3.x,8.3.y,8.3.z\n" + 3 * (",".join(map(str, places)) + "\n"))
    with pytest.warns(FacePoserWarning, match="30 frames per second were assumed"):
        assert face.follow(tmp_path / "c.csv").rate == 30.0
    assert face.follow(tmp_path / "c.csv", rate=24.0).rate == 24.0


def test_a_key_holds_the_solved_pose() -> None:
    keyed, solved = faceposer.load("man"), faceposer.load("man")
    for face in (keyed, solved):
        u, v = face.pixel("left mouth corner")
        face.drag("left mouth corner", to=(u + 30, v - 30))
    solved.solve()
    keyed.set_key(0)
    assert keyed.performance is not None
    assert np.abs(keyed.coefficients).max() > 1e-3
    np.testing.assert_allclose(keyed.coefficients, solved.coefficients, atol=1e-9)


def test_the_example_of_key_poses_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(EXAMPLES[3], "docs/api.md", "exec"), names)
    goblin = names["goblin"]
    ears = goblin.character.regions["ear_left"]
    assert np.abs(goblin.vertices - goblin.character.vertices)[ears].max() > 0.2, "only its keys move its ears"


def test_a_pose_goes_to_another_character_by_key_poses(tmp_path: Path) -> None:
    from faceposer.session.key_folder import KeyFolder
    from faceposer.session.keys import load_keys

    keys = faceposer.KeyPoses.create("low", "low", tmp_path / "keys")
    assert len(keys.names) == 18
    face = faceposer.load("low")
    face.apply_pose("Happiness")
    clone = face.transfer_to("low", "examples", keys=keys)
    key = next(pair for pair in load_keys(KeyFolder.read(keys.folder)).transfer.pairs if pair.name == "happiness")
    np.testing.assert_allclose(clone.vertices, face.session.model.surface(key.target), atol=2e-3)
    motion = faceposer.Performance(np.array([key.source, 0.5 * key.source]), 30.0)
    assert keys.coverage(motion).distances.max() < 0.02
    assert keys.importance("target").values.max() <= 1.0
    assert keys.rename("happiness", "Joy") == "joy"
    assert "joy" in keys.names
    assert "happiness" not in keys.names
    keys.remove("joy")
    assert keys.coverage(motion).missed > 0.001
    assert keys.helpful_frames(motion, 1)[0].frame == 0
    with pytest.raises(FacePoserError, match="needs 'keys'"):
        face.transfer_to("low", "examples")
    with pytest.raises(FacePoserError, match="not for Man"):
        face.transfer_to("man", "examples", keys=keys.folder)


@pytest.mark.parametrize("path", [None, 5, b"x"])
def test_what_is_no_path_is_refused(path: Any, tmp_path: Path) -> None:
    face = faceposer.load("woman")
    with pytest.raises(FacePoserError, match="The film must be a name or a path, not "):
        face.follow_film(path)
    if path is not None:
        with pytest.raises(FacePoserError, match="The path must be a name or a path, not "):
            face.put_back(0, path)


@pytest.mark.parametrize("start", ["x", "2", None])
def test_times_of_a_film_must_be_numbers(start: Any, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match="The start must be a number from 0 to "):
        faceposer.load("woman").follow_film(tmp_path / "a.gif", start=start)


def test_wrong_arguments_of_key_poses_are_told(tmp_path: Path) -> None:
    folder: Any = tmp_path / "keys"
    wrong: tuple[Any, ...] = (None, 5, ["a"], b"a")
    (tmp_path / "poses").mkdir()
    pose = {"format": "faceposer.pose", "version": 1, "name": "Open", "weights": {"jawOpen": 0.8}}
    (tmp_path / "poses" / "open.json").write_text(json.dumps(pose))
    keys = faceposer.KeyPoses.create("low", "low", folder, tmp_path / "poses")
    face = faceposer.load("low")
    for value in wrong:
        calls: list[Callable[[], object]] = [
            lambda value=value: faceposer.KeyPoses(value),
            lambda value=value: faceposer.KeyPoses.create(value, "low", tmp_path / "new"),
            lambda value=value: faceposer.KeyPoses.create("low", value, tmp_path / "new"),
            lambda value=value: faceposer.KeyPoses.create("low", "low", value),
            lambda value=value: keys.add(value, tmp_path / "poses" / "open.json"),
            lambda value=value: keys.add("a", value),
            lambda value=value: keys.remove(value),
            lambda value=value: keys.rename("open", value),
            lambda value=value: keys.choose(value, 1),
            lambda value=value: face.transfer_to(value),
            lambda value=value: face.transfer_to("low", "examples", keys=value),
        ]
        for i, call in enumerate(calls):
            with pytest.raises(FacePoserError) as caught:
                call()
            said = "needs 'keys'" if value is None and i == len(calls) - 1 else "must be "
            assert said in str(caught.value), i
    with pytest.raises(FacePoserError, match="Pairs must be"):
        face.transfer_to("low", pairs=5)  # type: ignore[arg-type]
    assert not (tmp_path / "new").exists()
    assert keys.names == ["open"]
