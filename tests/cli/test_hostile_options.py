"""Streams that are closed, early Ctrl+C, outputs without a name, and numbers in other digits."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from faceposer.model.character_file import load_character, save_character
from tests.command_line import run, run_captured

Capture = pytest.CaptureFixture[str]
TAKE = "Timecode,BlendShapeCount,JawOpen\n" + "".join(f"00:00:0{i // 60}:{i % 60:02}.000,61,0.5\n" for i in range(70))


@pytest.fixture
def take(tmp_path: Path) -> Path:
    path = tmp_path / "take.csv"
    path.write_text(TAKE)
    return path


def in_shell(words: str, redirected: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    line = f"{shlex.quote(sys.executable)} -m faceposer {words} {redirected}"
    here = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.run(line, shell=True, cwd=folder, env=here, capture_output=True, text=True, check=False)


@pytest.mark.skipif(sys.platform == "win32", reason="closed streams are of POSIX shells")
@pytest.mark.parametrize("redirected", ["2>&-", ">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams_lead_nowhere(redirected: str, take: Path, tmp_path: Path) -> None:
    # Samples are missing, which is said on standard error only.
    take.write_text(TAKE.replace("00:00:00:30.000,61,0.5\n", ""))
    done = in_shell("export low --animation take.csv -o out.glb", redirected, tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.glb").read_bytes().startswith(b"glTF")
    assert "interpolated" not in done.stdout
    assert "Traceback" not in done.stderr
    assert in_shell("export nobody -o out.obj", redirected, tmp_path).returncode == 2


@pytest.mark.skipif(sys.platform == "win32", reason="signals are those of POSIX")
def test_ctrl_c_during_imports_ends_quietly() -> None:
    code = (
        "import builtins, os, signal\n"
        # Who starts the tests in the background has interrupts ignored.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "load = builtins.__import__\n"
        "def slow(name, *rest, **more):\n"
        "    if name == 'faceposer.cli':\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "    return load(name, *rest, **more)\n"
        "from faceposer.__main__ import start\n"
        "builtins.__import__ = slow\n"
        "start()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "")


@pytest.mark.skipif(sys.platform == "win32", reason="signals are those of POSIX")
def test_ctrl_c_later_ends_with_the_same_status(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "faceposer", "demo", "-o", str(tmp_path / "demo")],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode in (130, -signal.SIGINT)
    assert "Traceback" not in said


@pytest.mark.parametrize("kind", ["ply", "obj", "png"])
@pytest.mark.parametrize("output", [".", "./", "/", "..", "sub/.."])
def test_a_sequence_needs_a_name(
    output: str, kind: str, take: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path)
    status, _, said = run_captured(capsys, "export", "low", "--animation", take, "--sequence", kind, "-o", output)
    assert status == 2
    assert "is not the name of a new folder; give a name, such as" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sub", "take.csv"]


def test_a_sequence_may_replace_the_empty_folder_behind_a_link(take: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to("empty")
    assert run("export", "low", "--animation", take, "--sequence", "ply", "-o", tmp_path / "link") == 0
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "empty" / "link.0001.ply").is_file()


@pytest.mark.parametrize(
    "words",
    [
        *("solve a.json", "export low", "render low", "photo low a.png --pins p.json", "transfer a.csv low"),
        *("animate low a.csv", "train --rig a.glb", "demo", "evaluate"),
    ],
)
def test_an_empty_output_is_said(words: str, capsys: Capture) -> None:
    status, _, said = run_captured(capsys, *words.split(), "-o", "")
    assert status == 2
    assert said.startswith("Argument -o/--output: its name is empty; give a file or folder")


def test_a_file_is_no_folder_for_the_demo(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "file").write_text("kept")
    status, _, said = run_captured(capsys, "demo", "-o", tmp_path / "file")
    assert (status, (tmp_path / "file").read_text()) == (2, "kept")
    assert said == f"The folder '{tmp_path / 'file'}' cannot be created, since '{tmp_path / 'file'}' is a file.\n"


@pytest.mark.parametrize("name", ["summary.json", "summary.png"])
def test_files_of_a_summary_are_checked_before_work(name: str, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "sum" / name).mkdir(parents=True)
    words = ("train", "--examples", tmp_path / "none", "-o", tmp_path / "a.npz", "--summary", tmp_path / "sum")
    status, _, said = run_captured(capsys, *words)
    assert status == 2
    assert said == f"The output '{tmp_path / 'sum' / name}' is a folder; give the name of a file.\n"


@pytest.mark.parametrize(
    "words",
    [
        *("export low -o a.mp4 --fps ٣", "export low -o a.mp4 --fps 1_0", "export low -o a.png --size \uff1100x100"),
        *(
            "export low -o a.mp4 --turntable 1_0",
            "render low -o a.png --size 1_0x10",
            "solve a.json -o a.obj --spread \u0661",
        ),
        *("export low --pose a.csv --frame ٣ -o a.obj", "transfer a.csv low -o a.glb --frames ٣:5"),
        *("train --examples a -o a.npz --dimensions ²", "train --examples a -o a.npz --regions ٣"),
        *(
            "evaluate -o a --examples ٣00",
            "evaluate -o a --noise 1_0",
            "train --rig a.glb -o a.npz --weights-range 1_00",
        ),
    ],
)
def test_numbers_have_plain_digits(words: str, capsys: Capture) -> None:
    status, _, said = run_captured(capsys, *words.split())
    assert status == 2
    assert said.startswith("Argument --")
    assert said.count("\n") == 1


@pytest.mark.parametrize("number", [1, 2, 10, 199, 100_001])
def test_examples_of_a_study_have_limits(number: int, tmp_path: Path, capsys: Capture) -> None:
    status, _, said = run_captured(capsys, "evaluate", "-o", tmp_path / "study", "--examples", number)
    assert status == 2
    assert f"'{number}' is not a number from 200 to 100000" in said


def test_files_of_other_programs_are_no_characters(tmp_path: Path, capsys: Capture) -> None:
    for suffix in ("fbx", "blend", "dae", "usd"):
        path = tmp_path / f"head.{suffix}"
        path.write_bytes(b"Kaydara FBX Binary")
        status, _, said = run_captured(capsys, "render", path, "-o", tmp_path / "a.png")
        assert status == 2
        assert f"'{path}' cannot be rendered; give a character (.npz), a session (.json) or a mesh (.obj, " in said


@pytest.mark.gl
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="there is no folder in which nothing can be created")
def test_a_video_that_cannot_be_created_is_said_without_ffmpeg(capsys: Capture) -> None:
    status, _, said = run_captured(capsys, "export", "low", "--turntable", "1", "--size", "64x64", "-o", "/proc/a.mp4")
    assert status == 2
    assert said.startswith(
        ("The video '/proc/a.mp4' cannot be written: ", "The folder '/proc' of the output", "MP4 needs")
    )
    assert ".tmp" not in said


def test_parts_of_a_mesh_that_are_folders_or_pipes_are_named(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "a.mtl").mkdir()
    os.mkfifo(tmp_path / "b.mtl")
    for name, reason in (("a", "a folder"), ("b", "a device or another special file")):
        status, _, said = run_captured(capsys, "export", "low", "-o", tmp_path / f"{name}.obj")
        assert status == 2
        assert said == f"The file '{tmp_path / name}.mtl' cannot be written: it is {reason}; enter another name.\n"
        assert not (tmp_path / f"{name}.obj").exists()
    assert (tmp_path / "b.mtl").is_fifo()
    os.mkfifo(tmp_path / "c_skin.jpg")
    assert run("export", "low", "-o", tmp_path / "c.obj") == 0
    assert (tmp_path / "c_skin.jpg").is_fifo()


def damaged(folder: Path) -> Path:
    """Return a character whose texture of the eyes is damaged."""
    path = folder / "damaged.npz"
    low = load_character("low")
    save_character(path, replace(low, textures={**low.textures, "eye": low.textures["eye"][:100]}))
    return path


def test_damaged_textures_are_found_and_not_written(tmp_path: Path, capsys: Capture) -> None:
    path = damaged(tmp_path)
    status, _, said = run_captured(capsys, "character", "check", path)
    assert status == 2
    assert said.startswith(f"The character file '{path}' cannot be used: its texture 'eye' is unusable, since it")
    for name in ("a.obj", "a.glb"):
        status, _, said = run_captured(capsys, "export", path, "-o", tmp_path / name)
        assert status == 2
        assert "the texture 'eye' of the character is unusable, since it is damaged; create the character again" in said
    assert [file.name for file in tmp_path.iterdir()] == ["damaged.npz"]
    assert run("export", path, "--no-materials", "-o", tmp_path / "a.obj") == 0
    assert run("character", "check", "low") == 0


def test_json_has_no_invisible_characters(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "a.npz"
    title = "Left\u202eright\u200b\x1b \u00fc"
    save_character(path, replace(load_character("low"), title=title))
    capsys.readouterr()
    status, said, _ = run_captured(capsys, "character", "info", "--json", path)
    assert status == 0
    assert json.loads(said)["title"] == title
    assert all(char.isprintable() or char == "\n" for char in said)
