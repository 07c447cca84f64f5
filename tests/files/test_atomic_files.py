"""Several files are replaced together, or none of them."""

import os
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_files


def write(paths: list[Path], text: str) -> None:
    with atomic_files(paths, "mesh") as temporaries:
        for temporary in temporaries:
            temporary.write_text(text)


def test_all_files_are_replaced(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.mtl", "a.obj", "a.png")]
    paths[1].write_text("old")
    write(paths, "new")
    assert [path.read_text() for path in paths] == ["new"] * 3
    assert sorted(tmp_path.iterdir()) == paths


@pytest.mark.parametrize("at", [0, 1, 2])
@pytest.mark.parametrize("links", [True, False])
def test_after_a_failure_the_old_files_are_there(
    at: int, links: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [tmp_path / name for name in ("a.mtl", "b.png", "c.obj")]
    paths[0].write_text("old")
    # A folder cannot be replaced by a file.
    paths[at].unlink(missing_ok=True)
    paths[at].mkdir()
    before = sorted(path.name for path in tmp_path.iterdir())
    if not links:
        monkeypatch.setattr(os, "link", lambda *_args, **_options: (_ for _ in ()).throw(OSError("no links here")))
    with pytest.raises(FacePoserError, match=r"The mesh '.*c\.obj' cannot be written"):
        write(paths, "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert at == 0 or paths[0].read_text() == "old"


def test_an_error_of_the_writer_leaves_everything(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.mtl", "a.obj")]
    paths[0].write_text("old")

    def stopped(temporary: Path) -> None:
        temporary.write_text("new")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), atomic_files(paths, "mesh") as temporaries:
        stopped(temporaries[0])
    assert paths[0].read_text() == "old"
    assert [*tmp_path.iterdir()] == [paths[0]]
