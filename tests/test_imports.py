"""What the window's start does not wait for."""

import subprocess
import sys

import pytest

# Each of these takes a good part of a second to import. The first three are for training and for foreign meshes; the
# others are for solves, for which the window gets ready once its first frame is there.
SLOW = ("scipy.stats", "sklearn", "trimesh", "scipy.optimize", "scipy.spatial", "scipy.ndimage")

FIRST_FRAME = """
from faceposer.gui.app import App
from faceposer.gui.settings import Settings

app = App("man", hidden=True, settings=Settings())
app.step(force=True)
assert app.frames_drawn == 1
app.close()
"""


def imported_by(code: str) -> set[str]:
    """Return the modules that a new Python has loaded after running ``code``."""
    result = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint('\\n'.join(sys.modules))"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return set(result.stdout.split())


@pytest.mark.gl
def test_window_shows_its_first_frame_without_slow_libraries() -> None:
    loaded = imported_by(FIRST_FRAME)
    assert {"numpy", "imgui_bundle", "faceposer.gui.app"} <= loaded
    assert not loaded.intersection((*SLOW, "faceposer.sketch.sketcher"))


def test_command_line_itself_loads_no_library() -> None:
    loaded = imported_by("import faceposer.cli")
    assert not loaded.intersection({"numpy", "scipy", "moderngl", "imgui_bundle", *SLOW})
