"""``faceposer export``: every format from the command line, and one sentence for what cannot be."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.animation.keyframes import Key, Keyframes
from faceposer.geometry.gltf_io import read_gltf
from faceposer.geometry.mesh_io import read_mesh
from faceposer.interchange.formats import write
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.session.document import Document, write_document
from faceposer.training.capture import read_capture
from tests.command_line import run

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def take(low: FaceModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of a jaw that opens."""
    path = tmp_path_factory.mktemp("take") / "take.csv"
    poses = np.linspace(0.0, 1.0, 16)[:, None] * low.coefficients_of({"jawOpen": 1.0})
    write(path, low, Performance(poses, 30.0))
    return path


@pytest.fixture
def session(low: FaceModel, tmp_path: Path) -> Path:
    pose = low.coefficients_of({"jawOpen": 0.6}).tolist()
    data = {"format": "faceposer.session", "version": 1, "subject": "low", "constraints": [], "coefficients": pose}
    (tmp_path / "jaw.json").write_text(json.dumps(data))
    return tmp_path / "jaw.json"


@pytest.mark.gl
def test_a_session_goes_out_in_every_format(low: FaceModel, session: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    out.mkdir()
    for suffix in ("obj", "ply", "glb", "csv", "json", "png"):
        assert run("export", session, "-o", out / f"a.{suffix}", "--size", "64x64", "--no-materials") == 0
        assert capsys.readouterr().out == f"{out / f'a.{suffix}'} written\n"
    pose = low.coefficients_of({"jawOpen": 0.6})
    for suffix in ("obj", "ply"):
        np.testing.assert_allclose(read_mesh(out / f"a.{suffix}").vertices, low.surface(pose), atol=1e-4)
    assert "jawOpen" in read_gltf(out / "a.glb").targets
    assert read_capture(out / "a.csv").weights.max() == pytest.approx(0.6, abs=0.02)
    assert json.loads((out / "a.json").read_text())["subject"] == "low"
    with Image.open(out / "a.png") as picture:
        assert picture.size == (64, 64)
    assert len([*out.iterdir()]) == 6


@pytest.mark.gl
def test_an_animation_goes_out_at_another_rate(low: FaceModel, take: Path, tmp_path: Path, capsys: Capture) -> None:
    assert run("export", "low", "--animation", take, "--fps", 10, "-o", tmp_path / "a.json") == 0
    assert "16 frames at 30 fps" in capsys.readouterr().out
    data = json.loads((tmp_path / "a.json").read_text())
    assert (data["rate"], len(data["frames"])) == (10, 6)
    assert run("export", "low", "--animation", take, "--fps", 8, "--size", "48x48", "-o", tmp_path / "a.gif") == 0
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 5
    assert run("export", "low", "--animation", take, "--fps", 4, "--sequence", "obj", "-o", tmp_path / "yawn") == 0
    assert "3 files written" in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "yawn").glob("*.obj")) == [f"yawn.000{i}.obj" for i in (1, 2, 3)]
    last = read_mesh(tmp_path / "yawn" / "yawn.0003.obj").vertices
    np.testing.assert_allclose(last, low.surface(low.coefficients_of({"jawOpen": 1.0})), atol=0.1)


def test_what_the_timeline_of_a_session_plays_goes_out(
    low: FaceModel, take: Path, tmp_path: Path, capsys: Capture
) -> None:
    keys, jaw = tmp_path / "keys.json", low.coefficients_of({"jawOpen": 1.0})
    keyframes = Keyframes((Key.of(0, 0.0 * jaw), Key.of(10, jaw)), 24.0, 13)
    write_document(keys, Document("low", keyframes=keyframes, frame=10, animated=True).with_start(jaw).posed(jaw))
    assert run("export", keys, "-o", tmp_path / "a.json") == 0
    assert "13 frames at 24 fps" in capsys.readouterr().out
    data = json.loads((tmp_path / "a.json").read_text())
    opening = [frame[data["names"].index("jawOpen")] for frame in data["frames"]]
    assert (data["rate"], len(opening)) == (24, 13)
    assert opening[0] == pytest.approx(0.0, abs=0.02)
    assert 0.3 < opening[5] < 0.7
    assert opening[10:] == pytest.approx([1.0] * 3, abs=0.02)
    assert run("export", keys, "-o", tmp_path / "yawn", "--sequence", "ply", "--fps", 4) == 0
    assert len(list((tmp_path / "yawn").iterdir())) == 3
    assert run("export", keys, "-o", tmp_path / "b.json", "--still") == 0
    assert len(json.loads((tmp_path / "b.json").read_text())["frames"]) == 1
    assert run("export", keys, "-o", tmp_path / "b.obj") == 0
    np.testing.assert_allclose(read_mesh(tmp_path / "b.obj").vertices, low.surface(jaw), atol=1e-4)
    assert run("export", keys, "-o", tmp_path / "c.glb", "--fps", 240, "--animation", take) == 0


def test_inbetweens_are_those_of_the_session_or_of_the_option(low: FaceModel, tmp_path: Path, capsys: Capture) -> None:
    jaw = low.coefficients_of({"jawOpen": 0.6})
    keys = tuple(Key.of(frame, pose) for frame, pose in ((0, 0.0 * jaw), (4, jaw), (8, jaw)))
    keyframes = Keyframes(keys, 24.0, 9)
    frames = {}
    for name, made in (("a", keyframes), ("b", replace(keyframes, inbetweens="feature points"))):
        write_document(tmp_path / f"{name}.json", Document("low", keyframes=made).with_start(jaw).posed(jaw))
        for option in ((), ("--inbetweens", "poses"), ("--inbetweens", "feature points")):
            assert run("export", tmp_path / f"{name}.json", "-o", tmp_path / "out.json", *option) == 0
            frames[name, option[-1:]] = np.array(json.loads((tmp_path / "out.json").read_text())["frames"])
        written = Performance.weights(made.performance(low), low)
        np.testing.assert_allclose(frames[name, ()], np.clip(written, 0.0, 1.0), atol=0.02)
    np.testing.assert_allclose(frames["a", ("feature points",)], frames["b", ()], atol=1e-6)
    np.testing.assert_allclose(frames["b", ("poses",)], frames["a", ()], atol=1e-6)
    assert np.abs(frames["a", ()] - frames["b", ()]).max() > 0.01
    capsys.readouterr()
    assert run("export", "low", "-o", tmp_path / "c.json", "--inbetweens", "poses") == 2
    assert "the keys of a session, but 'low' has none" in capsys.readouterr().err


def test_a_pose_comes_from_a_file(low: FaceModel, take: Path, tmp_path: Path, capsys: Capture) -> None:
    assert run("export", "low", "--pose", take, "--frame", 16, "-o", tmp_path / "a.obj") == 0
    assert "Frame 16 of 16." in capsys.readouterr().out
    assert run("export", "low", "--pose", tmp_path / "a.obj", "-o", tmp_path / "b.csv") == 0
    assert "The pose matches the mesh exactly." in capsys.readouterr().out
    back = read_capture(tmp_path / "b.csv")
    assert back.weights[0, back.shape_names.index("jawOpen")] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("low", "-o", "{out}/a.fbx"), "must end in one of .glb, .obj, .ply"),
        (("low", "-o", "{out}/none/a.glb"), "does not exist"),
        (("low", "-o", "{out}/a.obj", "--frame", "2"), "give --pose as well"),
        (("low", "-o", "{out}/a", "--sequence", "obj"), "'low' has none; give one with --animation"),
        (("low", "-o", "{out}/a", "--sequence", "obj", "--pose", "{take}"), "leave out --pose and --still"),
        (("low", "-o", "{out}/none/a", "--sequence", "obj", "--animation", "{take}"), "does not exist"),
        (("low", "-o", "{out}/a.obj", "--animation", "{take}"), "--sequence obj"),
        (("low", "-o", "{out}/a.png", "--animation", "{take}"), "shows a single pose"),
        (("low", "-o", "{out}/a.glb", "--turntable", "3"), "--turntable applies to videos only"),
        (("low", "-o", "{out}/a.gif", "--transparent"), "applies to images only; use an output that ends in .png"),
        (("low", "-o", "{out}/a", "--sequence", "ply", "--transparent"), "use --sequence png"),
        (("low", "-o", "{out}/a", "--sequence", "gif"), "--sequence takes obj, ply, png, not 'gif'"),
        (("low", "-o", "{out}/a.glb", "--pose", "{take}", "--frame", "17"), "frames 1 to 16, but no frame 17"),
        (("low", "-o", "{take}", "--pose", "{take}"), "is also an input"),
        (("low", "-o", "{out}/a.glb", "--pose", "{out}/none.obj"), "cannot be read"),
        (("low", "-o", "{out}/a.glb", "--animation", "{out}/none.csv"), "cannot be read"),
        (("man", "-o", "{out}/a.glb", "--pose", "{out}/three.obj"), "has 3 vertices, but Man has 2"),
        (("low", "-o", "{out}/a.glb", "--pose", "{take}", "--animation", "{take}"), "not allowed with"),
        (("low", "-o", "{out}/a.gif", "--fps", "0"), "not a number of frames per second"),
        (("low", "-o", "{out}/a.gif", "--turntable", "nan"), "not a number of seconds"),
        (("low", "-o", "{out}/a.png", "--size", "2x2"), "not a size such as"),
        (("low", "-o", "{out}/a.png", "--pose", "{take}", "--frame", "0"), "not a frame number"),
        (("nobody", "-o", "{out}/a.glb"), "is neither a character"),
        (("low",), "required: -o/--output"),
    ],
)
def test_wrong_input_gets_one_sentence(
    arguments: tuple[str, ...], said: str, take: Path, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "three.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    before = take.read_bytes()
    filled = [argument.format(out=tmp_path, take=take) for argument in arguments]
    assert run("export", *filled) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1
    assert "Traceback" not in captured.err
    assert [path.name for path in tmp_path.iterdir()] == ["three.obj"]
    assert take.read_bytes() == before


def test_help_tells_every_format(capsys: Capture) -> None:
    assert run("export", "--help") == 0
    said = capsys.readouterr().out
    assert all(suffix in said for suffix in (".obj", ".ply", ".glb", ".csv", ".json", ".png", ".gif", ".mp4"))


def test_materials_go_out_unless_they_are_left_out(session: Path, tmp_path: Path, take: Path) -> None:
    for name, words in (("with", ()), ("without", ("--no-materials",))):
        (tmp_path / name).mkdir()
        assert run("export", session, "-o", tmp_path / name / "a.obj", *words) == 0
        assert run("solve", session, "-o", tmp_path / name / "b.obj", *words) == 0
        assert run("transfer", session, "low", "-o", tmp_path / name / "c.obj", *words) == 0
        sequence = ("--animation", take, "--fps", 4, "--sequence", "obj", "-o", tmp_path / name / "d")
        assert run("export", "low", *sequence, *words) == 0
    pictures = {f"_{key}.jpg" for key in ("skin", "eye", "tongue", "gums_throat", "teeth")}
    for stem in "abc":
        names = {path.name[1:] for path in (tmp_path / "with").glob(f"{stem}*")}
        assert names == {".obj", ".mtl", *pictures}
    meshes = {f"d.000{i}.obj" for i in (1, 2, 3)}
    assert {path.name for path in (tmp_path / "with" / "d").iterdir()} == meshes | {
        "d.mtl",
        *(f"d{picture}" for picture in pictures),
    }
    assert {path.name for path in (tmp_path / "without").iterdir()} == {"a.obj", "b.obj", "c.obj", "d"}
    assert {path.name for path in (tmp_path / "without" / "d").iterdir()} == meshes


@pytest.mark.gl
def test_pictures_without_background(session: Path, take: Path, tmp_path: Path, capsys: Capture) -> None:
    assert run("export", session, "-o", tmp_path / "a.png", "--size", "64x64", "--transparent") == 0
    assert run("render", session, "-o", tmp_path / "b.png", "--size", "64x64", "--transparent") == 0
    assert run("export", session, "-o", tmp_path / "c.obj") == 0
    assert run("render", tmp_path / "c.obj", "-o", tmp_path / "d.png", "--size", "64x64", "--transparent") == 0
    capsys.readouterr()
    words = ("--animation", take, "--fps", 4, "--sequence", "png", "--transparent", "--size", "64x64")
    assert run("export", "low", *words, "-o", tmp_path / "v1.2 yawn") == 0
    assert "3 files written" in capsys.readouterr().out
    frames = sorted((tmp_path / "v1.2 yawn").iterdir())
    assert [path.name for path in frames] == [f"v1.2 yawn.000{i}.png" for i in (1, 2, 3)]
    for path in (tmp_path / "a.png", tmp_path / "b.png", tmp_path / "d.png", *frames):
        with Image.open(path) as picture:
            assert picture.mode == "RGBA"
            assert picture.getextrema()[3] == (0, 255)


@pytest.mark.usefixtures("no_ffmpeg")
def test_without_ffmpeg_commands_say_so_before_any_work(take: Path, tmp_path: Path, capsys: Capture) -> None:
    for words in (("export", "nobody"), ("animate", "nobody", take), ("transfer", "nobody", "nowhere")):
        assert run(*words, "-o", tmp_path / "a.mp4") == 2
        said = capsys.readouterr().err
        assert "MP4 needs ffmpeg" in said
        assert "faceposer[film]" in said
        assert run(*words, "-o", tmp_path / "a.bmp") == 2
        said = capsys.readouterr().err
        assert ".gif" in said
        assert ".mp4" not in said
    assert not [*tmp_path.iterdir()]


def test_what_was_assumed_is_said_on_standard_error_and_can_be_stated(
    take: Path, tmp_path: Path, capsys: Capture
) -> None:
    out = tmp_path / "a.json"
    assert run("export", "low", "--animation", take, "-o", out) == 0
    said = capsys.readouterr()
    assert said.out == f"{take}: 16 frames at 30 fps\n{out} written\n"
    assert said.err.startswith(f"{take}: Its timecodes do not tell how many frames they count per second")
    assert run("export", "low", "--animation", take, "--rate", "12", "-o", out) == 0
    said = capsys.readouterr()
    assert "16 frames at 12 fps" in said.out
    assert said.err == ""
    assert json.loads(out.read_text())["rate"] == 12
    assert run("export", "low", "--rate", "12", "-o", out) == 2
    assert "give --animation as well" in capsys.readouterr().err


def test_weights_of_another_tool_go_out(tmp_path: Path, capsys: Capture) -> None:
    frames = [{"timestamp_ms": 40 * i, "blendShapes": {"jawOpen": i / 50}} for i in range(50) if not 20 <= i < 30]
    (tmp_path / "mp.json").write_text(json.dumps(frames))
    assert run("export", "low", "--animation", tmp_path / "mp.json", "-o", tmp_path / "a.csv") == 0
    said = capsys.readouterr()
    assert "50 frames at 25 fps" in said.out
    assert "10 of its 50 frames are missing" in said.err
    np.testing.assert_allclose(read_capture(tmp_path / "a.csv").weights.max(axis=1), np.arange(50) / 50, atol=0.02)
