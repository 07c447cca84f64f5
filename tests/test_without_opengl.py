"""Poses, sessions, weights and meshes need neither OpenGL nor a window system: servers and render farms have none."""

import subprocess
import sys
from pathlib import Path

BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("moderngl", "glfw", "imgui_bundle"):
            raise ModuleNotFoundError(f"{name} is absent", name=name)

sys.meta_path.insert(0, Blocked())
"""

SCRIPT = """
import faceposer
face = faceposer.load("low")
face.drag("8.4", (430.0, 500.0))
face.solve()
for name in ("a.obj", "session.json"):
    face.save(name)
for name in ("b.obj", "b.ply", "b.glb", "b.csv", "weights.json"):
    face.export(name)
from faceposer.cli import main
for words in (
    ["solve", "session.json", "-o", "c.obj"],
    ["export", "session.json", "-o", "c.ply"],
    ["transfer", "session.json", "man", "-o", "d.json"],
    ["landmarks", "low", "-o", "e.json", "--image", "e.png"],
):
    try:
        main(words)
    except SystemExit as end:
        assert end.code == 0, words
"""


def test_meshes_sessions_and_weights_are_saved_without_opengl(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED + SCRIPT], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    written = {path.name for path in tmp_path.iterdir()}
    assert written >= {
        "a.obj",
        "b.obj",
        "b.ply",
        "b.glb",
        "b.csv",
        "weights.json",
        "c.obj",
        "c.ply",
        "d.json",
        "e.json",
        "e.png",
    }


def test_pictures_without_opengl_get_one_sentence(tmp_path: Path) -> None:
    words = ["render", "low", "-o", str(tmp_path / "a.png")]
    code = BLOCKED + f"from faceposer.cli import main\nmain({words!r})\n"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert "moderngl" in done.stderr
