"""No writer writes a number that is not finite: it is refused in one sentence, and the old file remains."""

import ast
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import faceposer
from faceposer.cli import main
from faceposer.errors import FacePoserError
from faceposer.files.writing import check_finite, json_text, with_null, write_json
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.ply_io import write_ply
from faceposer.gui.settings import Settings, save_settings
from faceposer.identity.companion_file import save_companion
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import save_identity_model
from faceposer.interchange.formats import FORMATS, Output, write_sequence_steps, write_steps
from faceposer.interchange.glb import write_glb
from faceposer.interchange.gltf_builder import GltfBuilder
from faceposer.interchange.live_link import write_live_link
from faceposer.interchange.meshes import sequence_steps, write_posed_obj, write_posed_ply
from faceposer.interchange.weights_json import write_weights
from faceposer.model.character_file import load_character, save_character
from faceposer.model.expression_statistics import load_expression_statistics
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.poses.pose_file import Pose, write_pose
from faceposer.render.options import OutputOptions
from faceposer.session.autosave import Journal
from faceposer.session.document import Document, write_document
from faceposer.session.key_folder import KeyFolder
from faceposer.session.opening import open_session
from faceposer.training.summary import description_of
from faceposer.transfer.pairs import Pair, write_pairs
from tests.made_up import registered_formats

_ROOT = Path(faceposer.__file__).parent
_OLD = b"what was there before"
_BAD = [np.nan, np.inf, -np.inf, 1e300]
# Functions and methods that write; modules that call one of them, and why they write finite numbers only.
_WRITES = {"write_text", "write_bytes", "savez", "savez_compressed", "save", "savetxt", "savefig", "tofile", "dump"}
_MODULES = {
    "api/face.py": "sessions, by session/saved_state.py",
    "api/posing.py": "poses, by poses/pose_file.py",
    "cli/animated_session.py": "sessions",
    "cli/identity/fit_photo.py": "sessions; reports by files/writing.py",
    "cli/photo.py": "sessions",
    "cli/photo_render.py": "sessions; images",
    "cli/sketch.py": "sessions; reports by files/writing.py",
    "evaluation/figures.py": "plots",
    "evaluation/gestures/pictures.py": "images",
    "evaluation/gestures/report.py": "pages; JSON by files/writing.py",
    "evaluation/performers.py": "tables",
    "evaluation/study.py": "tables",
    "files/atomic.py": "text from others",
    "files/writing.py": "checked here",
    "geometry/obj_io.py": "checked here",
    "geometry/ply_io.py": "checked here",
    "geometry/texture_images.py": "images",
    "gui/features/film/stills.py": "images, in memory",
    "gui/features/keys/feature.py": "key poses, by session/key_edits.py",
    "gui/features/photo/saving.py": "images",
    "gui/features/poses/commands.py": "poses, by poses/library.py",
    "gui/session_files.py": "sessions",
    "identity/companion_file.py": "checked here",
    "identity/eye_colour.py": "images",
    "identity/model_file.py": "checked here",
    "identity/photos/photo_texture.py": "images",
    "identity/scans/baking.py": "images",
    "identity/texture_model.py": "images",
    "interchange/glb.py": "checked here",
    "interchange/meshes.py": "checked here; images and materials",
    "interchange/weights_json.py": "checked here",
    "landmarks/overlay.py": "images",
    "model/character_file.py": "checked here",
    "model/expression_statistics.py": "checked here",
    "poses/library.py": "poses, by poses/pose_file.py",
    "poses/pose_file.py": "checked here",
    "render/images.py": "images",
    "session/document.py": "checked here",
    "session/key_compositions.py": "poses, by poses/pose_file.py; meshes, checked as by geometry/obj_io.py",
    "session/key_edits.py": "poses, by poses/pose_file.py",
    "session/key_folder.py": "poses, by poses/pose_file.py",
    "session/session.py": "sessions, by session/saved_state.py",
    "training/summary.py": "plots; JSON by files/writing.py",
}


def broken(model: FaceModel, number: float) -> np.ndarray:
    """Return a pose with a coefficient ``number``."""
    pose = model.neutral().copy()
    pose[0] = number
    return pose


def refused(write: Callable[[Path], object], path: Path) -> None:
    """Check that ``write`` refuses to write ``path`` in one sentence, and leaves everything as it was."""
    before = sorted(entry.name for entry in path.parent.iterdir())
    old = path.read_bytes() if path.is_file() else None
    with pytest.raises(FacePoserError, match="a number in it is not finite") as said:
        write(path)
    assert str(path) in str(said.value)
    assert str(said.value).endswith(".")
    assert sorted(entry.name for entry in path.parent.iterdir()) == before
    assert old is None or path.read_bytes() == old


@pytest.fixture
def formats() -> Iterator[None]:
    """The formats, and made-up ones, whose writers check nothing."""
    with registered_formats():
        yield


@pytest.mark.usefixtures("formats")
@pytest.mark.parametrize("number", _BAD)
def test_no_format_writes_a_broken_motion(low: FaceModel, tmp_path: Path, number: float) -> None:
    pose = broken(low, number)
    performance = Performance(np.stack([low.neutral(), pose]), 30.0)
    for suffix, form in FORMATS.items():
        if form.missing():
            continue
        for motion in (pose, performance) if form.holds == "either" else (pose,):
            path = tmp_path / f"face{suffix}"
            path.write_bytes(_OLD)
            refused(lambda path, motion=motion: [*write_steps(Output(path, low, motion, OutputOptions()))], path)  # type: ignore[misc]
        if form.sequence is not None:
            output = Output(tmp_path / f"frames{suffix}", low, performance, OutputOptions())
            refused(lambda _, output=output, suffix=suffix: [*write_sequence_steps(output, suffix)], output.path)  # type: ignore[misc]


@pytest.mark.parametrize("number", _BAD)
@pytest.mark.parametrize(
    "write",
    [
        write_posed_obj,
        write_posed_ply,
        write_glb,
        write_weights,
        lambda path, model, pose: write_glb(path, model, Performance(pose[None], 30.0)),
        lambda path, model, pose: write_live_link(path, model, Performance(pose[None], 30.0)),
        lambda path, model, pose: [*sequence_steps(path, model, Performance(pose[None], 30.0), "ply")],
        lambda path, model, pose: [*sequence_steps(path, model, Performance(pose[None], 30.0), "obj")],
    ],
)
def test_no_writer_of_poses_relies_on_its_callers(
    low: FaceModel, tmp_path: Path, write: Callable[..., object], number: float
) -> None:
    refused(lambda path: write(path, low, broken(low, number)), tmp_path / "out")


@pytest.mark.parametrize("number", _BAD)
def test_no_mesh_is_written_with_a_broken_point_or_normal(tmp_path: Path, number: float) -> None:
    points, polygons = np.eye(3), np.array([[0, 1, 2]])
    bad = points.copy()
    bad[1, 2] = number
    for name, write in (("a.obj", write_obj), ("a.ply", write_ply)):
        (tmp_path / name).write_bytes(_OLD)
        refused(lambda path, write=write: write(path, bad, polygons, normals=points), tmp_path / name)  # type: ignore[misc]
        refused(lambda path, write=write: write(path, points, polygons, normals=bad), tmp_path / name)  # type: ignore[misc]
    builder = GltfBuilder({})
    builder.accessor(bad, "<f4")
    with pytest.raises(ValueError, match="not finite"):
        builder.to_bytes()
    builder = GltfBuilder({})
    builder.add("meshes", {"weights": [number if not np.isfinite(number) else np.nan]})
    with pytest.raises(ValueError, match="not JSON compliant"):
        builder.to_bytes()


def test_surfaces_that_leave_single_precision_are_not_written(low: FaceModel, tmp_path: Path) -> None:
    # Each coefficient is a number of single precision, but the points are not.
    pose = np.full_like(low.neutral(), 3e37)
    for write, name in ((write_posed_obj, "a.obj"), (write_posed_ply, "a.ply")):
        (tmp_path / name).write_bytes(_OLD)
        with np.errstate(all="ignore"):
            refused(lambda path, write=write: write(path, low, pose, False), tmp_path / name)  # type: ignore[misc]


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_characters_and_statistics(tmp_path: Path, number: float) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(_OLD)
    for name in ("vertices", "uv", "shapes", "shape_limits"):
        character = load_character("low")
        # Arrays can be changed after their check.
        array = getattr(character, name).copy()
        character = replace(character, **{name: array})
        array.flat[1] = number
        getattr(character, name).flat[1] = number
        refused(lambda path, character=character: save_character(path, character), path)  # type: ignore[misc]
    statistics = load_expression_statistics()
    statistics.coupling.flat[1] = number
    refused(statistics.save, path)
    assert statistics.examples is not None
    coarse = replace(load_expression_statistics(), examples=1e6 * np.ones_like(statistics.examples))
    refused(coarse.save, path)


@pytest.mark.parametrize("number", _BAD[:3])
def test_models_of_heads(tmp_path: Path, number: float) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(_OLD)
    model = IdentityModel().fit(np.random.default_rng(0).normal(size=(4, 5, 3)))
    refused(lambda path: save_identity_model(path, model, {"texture.mean": np.full(3, number)}), path)
    model.mean[1] = number
    refused(lambda path: save_identity_model(path, model), path)


@pytest.mark.parametrize("number", _BAD[:3])
def test_companions_of_models(tmp_path: Path, number: float) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(_OLD)
    refused(lambda path: save_companion(path, "faceposer.x", "file", {}, {"a": np.full(3, number)}), path)
    refused(lambda path: save_companion(path, "faceposer.x", "file", {"a": number}, {"a": np.zeros(3)}), path)


def test_a_character_with_a_broken_summary_is_written_with_null(tmp_path: Path) -> None:
    character = replace(load_character("low"), summary={"worst": [np.nan, {"energy": np.inf}], "kind": "x"})
    save_character(tmp_path / "a.npz", character)
    with np.load(tmp_path / "a.npz") as members:
        json.loads(bytes(members["meta"]), parse_constant=pytest.fail)
    expected = {"worst": [None, {"energy": None}], "kind": "x"}
    assert load_character(tmp_path / "a.npz").summary == expected
    assert description_of(character)["summary"] == expected


@pytest.mark.parametrize("number", _BAD[:3])
def test_documents_of_all_kinds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: float) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(_OLD)
    refused(lambda path: write_document(path, Document("low", prior_weight=number)), path)
    refused(lambda path: write_pose(path, Pose("A", {"jawOpen": number}, "low")), path)
    keys = KeyFolder(tmp_path / "keys", "low", "low")
    keys.write()
    key = keys.folder / "source" / "a.json"
    key.write_bytes(_OLD)
    refused(lambda _: keys.add(Pose("A", {"jawOpen": number}), None, replace=True), key)
    refused(lambda path: write_pairs(path, [Pair("a", "2.1", "2.2", weight=number)]), path)
    refused(lambda path: write_json(path, {"energy": [number]}, "report"), path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    save_settings(Settings())
    (settings,) = tmp_path.rglob("window.json")
    refused(lambda _: save_settings(Settings(key_light=number)), settings)


def test_the_journal_keeps_its_last_content(tmp_path: Path) -> None:
    session, journal = open_session("low"), Journal(tmp_path)
    session.set_prior_weight(2.0)
    journal.flush(session)
    assert journal.path is not None
    with session.edit("Break it"):
        session.set_without_history(replace(session.document, prior_weight=np.nan))
    refused(lambda _: journal.flush(session), journal.path)
    journal.close(keep=False)


def test_the_report_of_a_solve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from faceposer.cli import solve

    write_document(tmp_path / "s.json", Document("low"))
    (tmp_path / "r.json").write_bytes(_OLD)
    monkeypatch.setattr("faceposer.session.report.solve_report", lambda *_: {"energy": np.nan})
    if hasattr(solve, "solve_report"):
        monkeypatch.setattr(solve, "solve_report", lambda *_: {"energy": np.nan})
    with pytest.raises(SystemExit) as end:
        main(["solve", str(tmp_path / "s.json"), "-o", str(tmp_path / "a.obj"), "--report", str(tmp_path / "r.json")])
    assert end.value.code == 2
    assert (tmp_path / "r.json").read_bytes() == _OLD


def test_what_is_finite_passes() -> None:
    check_finite(Path("a"), "mesh", [], np.zeros((0, 3)), [3e38], np.array([1], dtype=np.int16))
    assert json_text(Path("a"), {"ü": 1.5}, "report", indent=None, ascii_only=False) == '{"ü": 1.5}'
    assert with_null([1.0, np.nan, {"a": -np.inf}]) == [1.0, None, {"a": None}]


def _calls(tree: ast.AST) -> Iterator[tuple[str, ast.Call]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield name, node


def test_every_module_that_writes_is_known() -> None:
    found = set()
    for path in _ROOT.rglob("*.py"):
        names = {name for name, _ in _calls(ast.parse(path.read_text(encoding="utf-8")))}
        if names & _WRITES:
            found.add(path.relative_to(_ROOT).as_posix())
    assert found == set(_MODULES), "add the check of what is written, a test of it here, and the module to the table"
    for name, reason in _MODULES.items():
        if reason.startswith("checked here"):
            text = (_ROOT / name).read_text(encoding="utf-8")
            assert any(check in text for check in ("check_finite(", "not_finite(", "json_text(")), name


def test_json_text_is_made_in_one_place() -> None:
    """``json.dumps`` writes NaN, unless told otherwise; elsewhere its text is compared or shown."""
    shown = {
        *("api/checks.py", "cli/character.py", "evaluation/trial_log.py", "evaluation/tuning.py"),
        *("files/json_documents.py", "files/writing.py", "model/character_file.py"),
    }
    for path in _ROOT.rglob("*.py"):
        for name, call in _calls(ast.parse(path.read_text(encoding="utf-8"))):
            strict = any(keyword.arg == "allow_nan" for keyword in call.keywords)
            if name == "dumps" and not strict:
                assert path.relative_to(_ROOT).as_posix() in shown, f"{path.name}: use files/writing.py"
