"""The wheel holds all that the program needs, and works where there is no checkout."""

import os
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
Run = Callable[..., str]

# Compiles each vertex shader with the fragment shader of its name, loads each character with its model, and each pose.
USE_EVERYTHING = """
from pathlib import Path
import faceposer
from faceposer.model.character_file import available_characters
from faceposer.poses.library import starter_poses
from faceposer.session.opening import open_session
from faceposer.render.offscreen import offscreen_context
from faceposer.render.renderer import load_program

shaders = Path(faceposer.__file__).parent / "shaders"
with offscreen_context() as ctx:
    for vertex in sorted(shaders.glob("*.vert")):
        load_program(ctx, vertex.name, vertex.with_suffix(".frag").name).release()
        print("shader", vertex.stem)
for name, _ in available_characters():
    assert len(open_session(name).model.basis) > 0
    print("character", name)
for entry in starter_poses():
    assert entry.pose is not None, entry.problem
    print("pose", entry.path.parent.name, entry.pose.name)
print("package", Path(faceposer.__file__).parent)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)],
        cwd=CHECKOUT,
        check=True,
        capture_output=True,
    )
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def run_installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs a program of an environment with the wheel and the dependencies of this one, but without the checkout."""
    environment = tmp_path_factory.mktemp("installed") / "environment"
    venv.create(environment, symlinks=True)
    python = environment / "bin" / "python"
    install = ["install", "--quiet", "--no-deps", "--no-index", "--disable-pip-version-check", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", "--python", str(python), *install], check=True)
    (site_packages,) = environment.glob("lib/python*/site-packages")
    # Of a folder named in a .pth file the .pth files are not read, so the checkout stays out.
    (site_packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    elsewhere = tmp_path_factory.mktemp("elsewhere")

    def run(program: str, *arguments: str) -> str:
        paths = [
            path
            for path in os.environ.get("PYTHONPATH", "").split(os.pathsep)
            if not (Path(path) / "faceposer").is_dir()
        ]
        result = subprocess.run(
            [environment / "bin" / program, *arguments],
            cwd=elsewhere,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert result.returncode == 0, result.stderr
        return result.stdout

    return run


def test_wheel_holds_package_shaders_and_assets_alone(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    expected = {
        path.relative_to(CHECKOUT).as_posix()
        for path in (CHECKOUT / "faceposer").rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    for folder in ("shaders", "assets"):
        files = [path for path in (CHECKOUT / folder).rglob("*") if path.is_file()]
        assert files
        expected |= {f"faceposer/{path.relative_to(CHECKOUT).as_posix()}" for path in files}
    assert held == expected


def test_installed_program_tells_its_version(run_installed: Run) -> None:
    version = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]["version"]
    assert run_installed("faceposer", "--version").strip() == f"Face Poser {version}"


def test_installed_program_lists_its_characters(run_installed: Run) -> None:
    assert {line.split()[0] for line in run_installed("faceposer", "characters").splitlines()} >= {"man", "woman"}


@pytest.mark.gl
def test_shaders_compile_and_assets_load_outside_the_checkout(run_installed: Run) -> None:
    lines = [line.split(" ", 1) for line in run_installed("python", "-c", USE_EVERYTHING).splitlines()]
    assert {name for kind, name in lines if kind == "shader"} == {
        path.stem for path in (CHECKOUT / "shaders").glob("*.vert")
    }
    assert {name for kind, name in lines if kind == "character"} >= {"man", "woman"}
    poses = [name for kind, name in lines if kind == "pose"]
    assert len(poses) == 40
    assert {"poses Happiness", "creature Happiness"} <= set(poses)
    (package,) = (Path(name) for kind, name in lines if kind == "package")
    assert not package.is_relative_to(CHECKOUT)
