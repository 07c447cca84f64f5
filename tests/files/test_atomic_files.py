"""Several files are replaced together, or none of them."""

import os
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_files, atomic_folder


def write(paths: list[Path], text: str, blocked: Path | None = None) -> None:
    """Write ``text`` to all ``paths``, while another program puts a folder in the place of ``blocked``."""
    with atomic_files(paths, "mesh") as temporaries:
        for temporary in temporaries:
            temporary.write_text(text)
        if blocked is not None:
            blocked.unlink(missing_ok=True)
            blocked.mkdir()


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
    before = sorted({path.name for path in tmp_path.iterdir()} | {paths[at].name})
    if not links:
        monkeypatch.setattr(os, "link", lambda *_args, **_options: (_ for _ in ()).throw(OSError("no links here")))
    with pytest.raises(FacePoserError, match=r"The mesh '.*c\.obj' cannot be written"):
        write(paths, "new", blocked=paths[at])
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


def test_special_files_and_folders_are_refused_before_the_work(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "device.png").symlink_to("/dev/null")
    for name, what in (("pipe", "is a device"), ("folder", "is a folder"), ("device", "leads to a device")):
        paths = [tmp_path / f"{name}.png", tmp_path / "a.obj"]
        with pytest.raises(FacePoserError, match=f"The file '.*{name}.png' cannot be written: it {what}"):
            write(paths, "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["device.png", "folder.png", "pipe.png"]


def test_files_behind_links_are_replaced_where_they_are(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    paths = [tmp_path / "a.mtl", tmp_path / "a.obj"]
    for path in paths:
        (elsewhere / path.name).write_text("old")
        path.symlink_to(elsewhere / path.name)
    write(paths, "new")
    assert all(path.is_symlink() for path in paths)
    assert [(elsewhere / path.name).read_text() for path in paths] == ["new"] * 2
    with pytest.raises(FacePoserError, match="cannot be written"):
        write(paths, "newer", blocked=elsewhere / "a.obj")
    assert paths[0].read_text() == "new"
    assert sorted(path.name for path in elsewhere.iterdir()) == ["a.mtl", "a.obj"]


def test_two_links_to_one_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    paths = [tmp_path / "a.mtl", tmp_path / "a.obj"]
    for path in paths:
        path.symlink_to("file")
    with pytest.raises(FacePoserError, match=r"'.*a\.mtl' and '.*a\.obj' are links to one file"):
        write(paths, "new")
    assert (tmp_path / "file").read_text() == "old"


def test_errors_of_files_in_a_new_folder_name_the_folder(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError) as caught, atomic_folder(tmp_path / "frames") as temporary:
        raise FacePoserError(f"The mesh '{temporary / 'a.0001.ply'}' cannot be written: No space left on device.")
    assert str(caught.value) == (
        f"The mesh '{tmp_path / 'frames' / 'a.0001.ply'}' cannot be written: No space left on device."
    )
    assert not list(tmp_path.iterdir())
