"""What the window's start does not wait for."""

import subprocess
import sys

# Each of these takes a large part of a second to import, and only training or reading foreign meshes needs them.
SLOW = ("scipy.stats", "sklearn", "trimesh")


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


def test_window_starts_without_slow_libraries() -> None:
    loaded = imported_by(
        "import faceposer.viewer.app\nfrom faceposer.session.opening import open_session\nopen_session('man')"
    )
    assert {"numpy", "imgui_bundle", "faceposer.viewer.app"} <= loaded
    assert not loaded.intersection(SLOW)


def test_command_line_itself_loads_no_library() -> None:
    loaded = imported_by("import faceposer.cli")
    assert not loaded.intersection({"numpy", "scipy", "moderngl", "imgui_bundle", *SLOW})
