"""Files are opened by one function, which refuses all that is no regular file."""

import os
import re
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from faceposer.animation.trajectory_io import read_trajectories
from faceposer.errors import FacePoserError
from faceposer.files.reading import open_file, open_text, read_bytes
from faceposer.geometry.marker_io import read_markers
from faceposer.geometry.marker_map import read_marker_map
from faceposer.geometry.mesh_io import MESH_SUFFIXES, read_mesh
from faceposer.geometry.mesh_sequence import open_sequence
from faceposer.geometry.rig_io import read_rig
from faceposer.model.character_file import load_character
from faceposer.model.expression_statistics import load_expression_statistics
from faceposer.photo.pins_file import read_pins
from faceposer.photo.reading import inspect_photo, read_photo
from faceposer.poses.pose_file import read_pose
from faceposer.session.document import read_document
from faceposer.training.capture import read_capture
from faceposer.training.gltf_weights import read_gltf_weights
from faceposer.training.weights_file import read_weights

ROOT = Path(__file__).resolve().parents[2]
READERS: list[tuple[Callable[[Path], Any], tuple[str, ...]]] = [
    (read_mesh, MESH_SUFFIXES),
    (read_rig, (".glb", ".gltf", ".vrm")),
    (open_sequence, (".npz",)),
    (read_markers, (".c3d", ".csv")),
    (read_marker_map, (".json",)),
    (read_capture, (".csv", ".txt")),
    (read_weights, (".json",)),
    (read_gltf_weights, (".glb",)),
    (load_character, (".npz",)),
    (load_expression_statistics, (".npz",)),
    (read_photo, (".png", ".jpg")),
    (inspect_photo, (".png",)),
    (read_pins, (".json",)),
    (read_pose, (".json",)),
    (read_document, (".json",)),
]
ALL = [(reader, suffix) for reader, suffixes in READERS for suffix in suffixes]
IDS = [f"{reader.__name__}-{suffix[1:]}" for reader, suffix in ALL]


def special_files(folder: Path, suffix: str) -> dict[str, Path]:
    """Create one of each kind of special file that every user may create."""
    pipe = folder / f"pipe{suffix}"
    os.mkfifo(pipe)
    for name, target in (("device", "/dev/zero"), ("linked", str(pipe)), ("circle", f"circle{suffix}")):
        (folder / f"{name}{suffix}").symlink_to(target)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(folder / f"socket{suffix}"))
    (folder / f"folder{suffix}").mkdir()
    return {name: folder / f"{name}{suffix}" for name in ("pipe", "device", "linked", "circle", "socket", "folder")}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes")
@pytest.mark.parametrize(("reader", "suffix"), ALL, ids=IDS)
def test_every_reader_refuses_special_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reader: Callable[[Path], Any], suffix: str
) -> None:
    monkeypatch.chdir(tmp_path)
    found = special_files(Path(), suffix)
    for name, path in found.items():
        if name == "folder" and reader in (open_sequence, read_rig):
            continue
        with pytest.raises(FacePoserError) as caught:
            reader(path)
        said = str(caught.value)
        assert str(path) in said
        assert said.endswith(".")


@pytest.mark.parametrize(("reader", "suffix"), ALL, ids=IDS)
def test_every_reader_refuses_paths_that_no_file_can_have(
    tmp_path: Path, reader: Callable[[Path], Any], suffix: str
) -> None:
    for name in ("n" * 300, "zero\0byte", "lone\ud800surrogate", "~nobody at all/x", "none"):
        with pytest.raises(FacePoserError) as caught:
            reader(tmp_path / f"{name}{suffix}")
        assert str(caught.value).isprintable()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes")
def test_reasons(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    said = {}
    for name, path in special_files(Path(), "").items():
        with pytest.raises(OSError) as caught:  # noqa: PT011
            open_file(path)
        said[name] = caught.value.strerror
    assert said == {
        "pipe": "it is a pipe, not a file",
        "device": "it is a device, not a file",
        "linked": "it is a pipe, not a file",
        "circle": os.strerror(40),
        "socket": "it is a socket, not a file",
        "folder": "it is a folder",
    }


def test_a_pipe_that_takes_the_place_of_a_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"a")
    status = path.stat()
    path.unlink()
    os.mkfifo(path)
    monkeypatch.setattr(os, "stat", lambda *_, **__: status)
    with pytest.raises(OSError, match="it is a pipe"):
        open_file(path)


def test_size(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_bytes(path, 5) == b"12345"
    with open_text(path) as file:
        assert file.read() == "12345"
    with pytest.raises(OSError, match="larger than"):
        read_bytes(path, 4)
    with path.open("wb") as file:
        file.truncate(2**31)
    with pytest.raises(OSError, match="larger than 1 GB"):
        read_bytes(path)
    # Files of the system that do not tell their size.
    with pytest.raises(OSError, match="larger than"):
        read_bytes("/proc/self/status", 10)


def test_no_module_opens_files_for_reading_by_itself() -> None:
    own = re.compile(
        r"\.read_bytes\(|\.read_text\(|\.open\((\"rb?\"|newline|encoding)|np\.load\(path|ZipFile\(path\)"
        r"|Image\.open\(path"
    )
    # Files of the program, of the system, and copies of what was just written.
    exempt = {"resources.py", "evaluation/study.py", "evaluation/gestures/report.py", "training/frames.py"}
    found = {}
    for path in (ROOT / "faceposer").rglob("*.py"):
        name = path.relative_to(ROOT / "faceposer").as_posix()
        if name.startswith("files/") or name in exempt:
            continue
        lines = [line.strip() for line in path.read_text(encoding="utf-8").splitlines() if own.search(line)]
        found |= {name: lines} if lines else {}
    assert found == {}


def test_trajectories(tmp_path: Path) -> None:
    character = load_character("low")
    for suffix in (".csv", ".json", ".c3d"):
        (tmp_path / f"a{suffix}").symlink_to("/dev/zero")
        with pytest.raises(FacePoserError, match="device"):
            read_trajectories(tmp_path / f"a{suffix}", character)
