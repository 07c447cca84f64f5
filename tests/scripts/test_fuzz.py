"""Mutated files of every kind are refused in one sentence, in bounded time and memory; the long form is a script."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from scripts.torture import fuzz
from scripts.torture.fuzz_readers import READERS, Reader, finite
from scripts.torture.fuzz_seeds import make_seeds

ROOT = Path(__file__).resolve().parents[2]
FORKS = pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Path]]:
    return make_seeds(tmp_path_factory.mktemp("fuzz") / "seeds")


def test_the_seeds_are_valid(seeds: dict[str, list[Path]]) -> None:
    for name, reader in READERS.items():
        for number, seed in enumerate(seeds[name]):
            own = seed.parents[1] / f"{name}-{number}"
            own.mkdir()
            path = own / f"file{seed.suffix}"
            path.write_bytes(seed.read_bytes())
            assert finite(reader.read(path)), seed


@FORKS
def test_mutated_files(tmp_path: Path) -> None:
    # A process of its own: this one may have threads, which do not survive a fork.
    command = [sys.executable, "scripts/torture/fuzz.py", "--count", "500", "--seed", "16"]
    done = subprocess.run(
        [*command, "--json", str(tmp_path / "figures.json")], cwd=ROOT, capture_output=True, text=True, check=False
    )
    figures = json.loads((tmp_path / "figures.json").read_text())["readers"]
    assert figures.keys() == READERS.keys()
    assert {name: found["problems"] for name, found in figures.items() if found["problems"]} == {}
    assert done.returncode == 0, done.stderr


def test_mutations_depend_on_the_seed_alone(seeds: dict[str, list[Path]]) -> None:
    for name in READERS:
        files = seeds[name]
        first = [fuzz.mutated(files, name, 1, index) for index in range(4)]
        assert first == [fuzz.mutated(files, name, 1, index) for index in range(4)]
        assert first != [fuzz.mutated(files, name, 2, index) for index in range(4)]


@pytest.mark.parametrize(
    ("error", "problem"),
    [
        (FacePoserError("The mesh 'a' is broken at line 3: 'x' is not a number."), "refused"),
        (
            FacePoserError("The mesh 'a' is broken: could not convert a."),
            "wording: could not convert",
        ),
        (FacePoserError("broken"), "message that is not one printable sentence"),
        (ValueError("x"), "ValueError at ?: 'x'"),
        (MemoryError(), "MemoryError"),
    ],
)
def test_problems_are_told_apart(
    monkeypatch: pytest.MonkeyPatch, error: Exception, problem: str, tmp_path: Path
) -> None:
    def fails(path: Path) -> list[float]:
        raise error

    monkeypatch.setitem(fuzz.READERS, "made up", Reader("made up", fails, ()))  # type: ignore[arg-type]
    assert fuzz.read_file("made up", tmp_path) == problem
    monkeypatch.setitem(fuzz.READERS, "made up", Reader("made up", lambda _: iter([float("nan")]), ()))
    assert fuzz.read_file("made up", tmp_path) == "not finite"
