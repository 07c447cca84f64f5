"""Files and folders replace the old ones whole or not at all, whatever goes wrong."""

import os
import stat
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.files import temporary
from faceposer.files.atomic import (
    atomic_file,
    atomic_folder,
    check_distinct,
    check_folder_of,
    check_new_folder,
    check_not_input,
    check_output,
    write_text,
)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    folder.chmod(0o500)
    try:
        yield
    finally:
        folder.chmod(0o700)


def dead_process() -> int:
    """Return the id of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def left(name: str) -> str:
    """Return the name of a temporary file of this machine; ``name`` is that of the file and the process."""
    host = temporary.temporary_path(Path("x")).name.split(".")[3]
    return f".{name}.{host}.faceposer.tmp"


def fail_in_file(path: Path, error: Exception) -> None:
    """Raise ``error`` after half of the file ``path`` is written."""
    with atomic_file(path, "session") as temporary:
        temporary.write_text("half")
        raise error


def fail_in_folder(path: Path, error: Exception) -> None:
    """Raise ``error`` after half of the folder ``path`` is written."""
    with atomic_folder(path) as temporary:
        (temporary / "1.obj").write_text("v")
        raise error


NO_SPACE = OSError(28, "No space left on device")


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The order in which contents are synced and files replaced."""
    order: list[str] = []
    sync, replace = os.fsync, Path.replace

    def fsync(descriptor: int) -> None:
        order.append("sync folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "sync file")
        sync(descriptor)

    def replaced(self: Path, target: Path) -> Path:
        order.append("replace")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Path, "replace", replaced)
    return order


# What succeeds


def test_a_text_is_written_as_it_is_and_nothing_is_left(tmp_path: Path) -> None:
    path = tmp_path / "ä b.json"
    for text in ("one\n", "zwei: ä\n", ""):
        write_text(path, text, "session")
        assert path.read_bytes() == text.encode()
        assert names(tmp_path) == [path.name]


def test_the_old_content_stays_until_the_block_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    with atomic_file(path, "session") as temporary:
        temporary.write_text("new")
        assert temporary.parent == path.parent
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert names(tmp_path) == ["a.json"]


def test_a_folder_appears_whole(tmp_path: Path) -> None:
    path = tmp_path / "frames"
    for there in (False, True):
        if there:
            path.mkdir()
        with atomic_folder(path) as temporary:
            (temporary / "1.obj").write_text("v 0 0 0")
            assert not path.exists() or not any(path.iterdir())
        assert names(path) == ["1.obj"]
        assert names(tmp_path) == ["frames"]
        (path / "1.obj").unlink()
        path.rmdir()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot sync folders")
def test_the_content_reaches_the_disk_before_the_name_and_the_folder_after(tmp_path: Path, calls: list[str]) -> None:
    write_text(tmp_path / "a.json", "text", "session")
    assert calls == ["sync file", "replace", "sync folder"]
    calls.clear()
    write_text(tmp_path / "a.json", "text", "journal", durable=False)
    assert calls == ["replace"]
    calls.clear()
    with atomic_folder(tmp_path / "frames") as temporary:
        (temporary / "1.obj").write_text("v 0 0 0")
    assert calls[-2:] == ["replace", "sync folder"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows counts letters")
@pytest.mark.parametrize("name", ["n" * 250 + ".json", "ä" * 125 + ".json", "n" * 240 + ".json"])
def test_names_as_long_as_the_system_has_them(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    assert len(os.fsencode(name)) <= 255
    for text in ("one", "two"):
        write_text(path, text, "session")
        assert path.read_text() == text
    assert names(tmp_path) == [name]
    with pytest.raises(FacePoserError, match=r"The session .* cannot be written: File name too long"):
        write_text(tmp_path / ("n" * 256), "text", "session")
    assert names(tmp_path) == [name]


# What fails


def test_an_error_in_the_block_keeps_the_old_content(tmp_path: Path) -> None:
    path, folder = tmp_path / "a.json", tmp_path / "frames"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError):
        fail_in_file(path, ZeroDivisionError())
    with pytest.raises(ZeroDivisionError):
        fail_in_folder(folder, ZeroDivisionError())
    assert names(tmp_path) == ["a.json"]
    assert path.read_text() == "old"


def test_a_full_disk_is_one_sentence_and_keeps_the_old_content(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    said = r"cannot be written: No space left on device; free some space, or choose another folder\."
    with pytest.raises(FacePoserError, match=rf"The session '.*a\.json' {said}"):
        fail_in_file(path, NO_SPACE)
    with pytest.raises(FacePoserError, match=rf"The folder '.*frames' {said}"):
        fail_in_folder(tmp_path / "frames", NO_SPACE)
    assert names(tmp_path) == ["a.json"]
    assert path.read_text() == "old"


def test_a_failing_sync_keeps_the_old_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")

    def broken(descriptor: int) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", broken)
    with pytest.raises(FacePoserError, match="cannot be written: Input/output error"):
        write_text(path, "new", "session")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a.json"]
    write_text(path, "new", "journal", durable=False)
    assert path.read_text() == "new"


@pytest.mark.parametrize("at", ["in the block", "before the rename", "after the rename"])
def test_a_killed_program_leaves_the_old_or_the_new_file(tmp_path: Path, at: str) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    program = f"""
        import os
        from pathlib import Path
        from faceposer.files import atomic

        def die(*_):
            os._exit(9)

        if {at!r} == "before the rename":
            Path.replace = die
        if {at!r} == "after the rename":
            atomic._sync_folder = die
        with atomic.atomic_file(Path({str(path)!r}), "session") as temporary:
            temporary.write_text("new")
            if {at!r} == "in the block":
                die()
    """
    assert subprocess.run([sys.executable, "-c", textwrap.dedent(program)], check=False).returncode == 9
    assert path.read_text() == ("new" if at == "after the rename" else "old")
    assert len(names(tmp_path)) == (1 if at == "after the rename" else 2), "what it had written lies beside it"
    write_text(path, "later", "session")
    assert path.read_text() == "later"
    assert names(tmp_path) == ["a.json"], "and is removed by the next"


def test_a_killed_program_leaves_no_half_folder(tmp_path: Path) -> None:
    path = tmp_path / "frames"
    program = f"""
        import os
        from pathlib import Path
        from faceposer.files.atomic import atomic_folder

        with atomic_folder(Path({str(path)!r})) as temporary:
            (temporary / "1.obj").write_text("v")
            os._exit(9)
    """
    assert subprocess.run([sys.executable, "-c", textwrap.dedent(program)], check=False).returncode == 9
    assert not path.exists()
    assert len(names(tmp_path)) == 1
    with atomic_folder(path) as temporary:
        (temporary / "2.obj").write_text("v")
    assert names(tmp_path) == ["frames"]
    assert names(path) == ["2.obj"]


def test_only_what_dead_programs_left_is_removed(tmp_path: Path) -> None:
    path, dead = tmp_path / "a.json", dead_process()
    kept = [
        left(f"a.json.{os.getppid()}"),  # of a running program
        f".a.json.{dead}.00000000.faceposer.tmp",  # of another machine, not yet old
        f".a.json.{dead}.tmp",  # of another program
        left(f"a.json.{dead}")[1:],
        left(f"a.json.{dead}") + ".bak",
        left("a.json.99999999999999999999"),  # of no process that there can be
        left("a.json.0"),
    ]
    old = tmp_path / f".old.{dead}.00000000.faceposer.tmp"
    for name in (*kept, old.name, left(f"a.json.{dead}"), left(f"another.{dead}"), left(f"line\nbreak.{dead}")):
        (tmp_path / name).write_text("half")
    os.utime(old, (0, 0))
    write_text(path, "text", "session")
    assert names(tmp_path) == sorted([*kept, "a.json"])


def test_a_scratch_folder_goes_at_the_end_or_with_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / left(f"scratch-1.{dead_process()}")).mkdir()
    with temporary.scratch_folder() as folder:
        assert names(tmp_path) == [folder.name]
        (folder / "frames").write_text("x")
    assert names(tmp_path) == []


def test_a_stale_folder_is_removed_and_a_link_is_not_followed(tmp_path: Path) -> None:
    dead, outside = dead_process(), tmp_path / "outside"
    outside.mkdir()
    (outside / "mine.txt").write_text("mine")
    stale = tmp_path / left(f"frames.{dead}")
    (stale / "deep").mkdir(parents=True)
    link = tmp_path / left(f"other.{dead}")
    link.symlink_to(outside)
    for name in ("frames", "other"):
        with atomic_folder(tmp_path / name):
            pass
    assert names(tmp_path) == ["frames", "other", "outside"]
    assert names(outside) == ["mine.txt"]


def test_a_stale_file_that_cannot_be_removed_does_no_harm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, dead = tmp_path / "a.json", dead_process()
    stale = tmp_path / left(f"a.json.{dead}")
    stale.write_text("half")
    unlink = Path.unlink

    def refused(self: Path, missing_ok: bool = False) -> None:
        if self.name == stale.name:
            raise PermissionError(13, "Permission denied")
        unlink(self, missing_ok)

    monkeypatch.setattr(Path, "unlink", refused)
    write_text(path, "text", "session")
    assert names(tmp_path) == [stale.name, "a.json"]


def test_an_error_while_cleaning_up_does_not_hide_the_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(self: Path, missing_ok: bool = False) -> None:
        raise PermissionError(13, "cleaning up failed")

    monkeypatch.setattr(Path, "unlink", refused)
    with pytest.raises(ZeroDivisionError):
        fail_in_file(tmp_path / "a.json", ZeroDivisionError())
    with pytest.raises(FacePoserError, match="No space left"):
        fail_in_file(tmp_path / "b.json", NO_SPACE)
    # Even where nothing else went wrong, it is no reason to say that the file was not written.
    write_text(tmp_path / "c.json", "text", "session")
    assert (tmp_path / "c.json").read_text() == "text"


def test_an_error_while_removing_a_folder_does_not_hide_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise PermissionError(13, "cleaning up failed")

    monkeypatch.setattr(os, "unlink", refused)
    monkeypatch.setattr(os, "rmdir", refused)
    with pytest.raises(ZeroDivisionError):
        fail_in_folder(tmp_path / "frames", ZeroDivisionError())
    assert not (tmp_path / "frames").exists()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")
def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    # Imported here: it needs a system that can fork.
    from scripts.torture import forked

    folder = tmp_path / "locked"
    folder.mkdir()
    (folder / "a.json").write_text("old")

    def write() -> None:
        with pytest.raises(FacePoserError, match=r"The session '.*a\.json' cannot be written: Permission denied\."):
            write_text(folder / "a.json", "new", "session")
        with (
            pytest.raises(FacePoserError, match=r"The folder '.*' cannot be written: Permission denied"),
            atomic_folder(folder / "x"),
        ):
            pass
        with pytest.raises(FacePoserError, match="is not writable; choose another"):
            check_output(folder / "a.obj", ".obj")

    with read_only(folder):
        # In a child that obeys the permissions even as root.
        ended = forked.run(write)
    assert ended.status == 0, ended.err
    assert (folder / "a.json").read_text() == "old"
    assert names(folder) == ["a.json"]


def test_a_read_only_file_system_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # As root sees it, too.
    def refused(self: Path, *_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system")

    (tmp_path / "a.json").write_text("old")
    monkeypatch.setattr(Path, "write_text", refused)
    monkeypatch.setattr(Path, "mkdir", refused)
    with pytest.raises(FacePoserError, match=r"The session '.*a\.json' cannot be written: Read-only file system\."):
        write_text(tmp_path / "a.json", "new", "session")
    with pytest.raises(FacePoserError, match="Read-only file system"), atomic_folder(tmp_path / "frames"):
        pass
    assert names(tmp_path) == ["a.json"]
    assert (tmp_path / "a.json").read_text() == "old"


def test_a_file_where_a_folder_is_meant(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    with pytest.raises(FacePoserError, match=r"The session '.*' cannot be written: Not a directory"):
        write_text(file / "a.json", "text", "session")
    with pytest.raises(FacePoserError, match="exists and is not an empty folder"), atomic_folder(file):
        raise AssertionError("the block does not run")
    with pytest.raises(FacePoserError, match="Not a directory"), atomic_folder(file / "frames"):
        raise AssertionError("the block does not run")
    assert file.read_text() == "mine"
    assert names(tmp_path) == ["file"]


def test_a_folder_where_a_file_is_meant(tmp_path: Path) -> None:
    folder = tmp_path / "a.json"
    folder.mkdir()
    with pytest.raises(FacePoserError, match=r"The session '.*' cannot be written"):
        write_text(folder, "text", "session")
    with pytest.raises(FacePoserError, match="cannot be written: No such file or directory"):
        write_text(tmp_path / "no" / "a.json", "text", "session")
    assert names(tmp_path) == ["a.json"]
    assert names(folder) == []


def test_a_folder_with_something_in_it_is_kept(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "mine.txt").write_text("mine")
    with pytest.raises(FacePoserError, match="not an empty folder"), atomic_folder(tmp_path / "frames"):
        raise AssertionError("the block does not run")
    assert names(tmp_path / "frames") == ["mine.txt"]


def test_a_folder_that_is_filled_meanwhile_is_kept(tmp_path: Path) -> None:
    def write() -> None:
        with atomic_folder(tmp_path / "frames") as temporary:
            (temporary / "1.obj").write_text("v")
            (tmp_path / "frames").mkdir()
            (tmp_path / "frames" / "mine.txt").write_text("mine")

    with pytest.raises(FacePoserError, match="cannot be written"):
        write()
    assert names(tmp_path) == ["frames"]
    assert names(tmp_path / "frames") == ["mine.txt"]


def test_where_processes_cannot_be_asked_for_nothing_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stale = tmp_path / left(f"a.json.{dead_process()}")
    stale.write_text("half")
    monkeypatch.setattr(temporary.sys, "platform", "win32")
    write_text(tmp_path / "a.json", "text", "session")
    assert stale.exists()


# Outputs that are refused before any work is done


def test_an_output_is_no_input(tmp_path: Path) -> None:
    path, link = tmp_path / "a.obj", tmp_path / "b.obj"
    check_not_input(path, path)
    check_not_input(None, path)
    path.write_text("v")
    link.hardlink_to(path)
    for source in (path, str(path), link):
        with pytest.raises(FacePoserError, match="give the output another name"):
            check_not_input(path, None, source)
    check_not_input(path, tmp_path / "missing.obj", None)


def test_outputs_that_could_not_be_written(tmp_path: Path) -> None:
    check_output(tmp_path / "a.OBJ", ".obj", ".ply")
    (tmp_path / "b.obj").mkdir()
    for path, said in (
        (tmp_path / "a.fbx", "must end in '.obj', '.ply' or '.glb'"),
        (tmp_path / "b.obj", "is a folder; give the name of a file"),
        (tmp_path / "no" / "a.obj", "does not exist; create it first"),
    ):
        with pytest.raises(FacePoserError, match=said):
            check_output(path, ".obj", ".ply", ".glb")


def test_folders_that_cannot_be_written_are_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "circle").symlink_to("circle")
    check_new_folder(tmp_path / "new" / "deep")
    check_new_folder(tmp_path)
    check_folder_of(tmp_path / "a.obj")
    for path in (tmp_path / "file" / "x", tmp_path / ("n" * 300), tmp_path / "circle" / "x", tmp_path / "file"):
        with pytest.raises(FacePoserError, match=r"cannot be (written|created)"):
            check_new_folder(path)
    for path in (tmp_path / "no" / "x", tmp_path / ("n" * 300), tmp_path / "circle" / "x", tmp_path / "file" / "x"):
        with pytest.raises(FacePoserError, match=r"cannot be written|does not exist"):
            check_folder_of(path)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has other special files")
def test_special_files_are_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "device.obj").symlink_to("/dev/null")
    for name, verb in (("pipe.obj", "is"), ("device.obj", "leads to")):
        with pytest.raises(FacePoserError, match=f"it {verb} a device or another special file"):
            check_output(tmp_path / name, ".obj")
        with pytest.raises(FacePoserError, match=f"it {verb} a device or another special file"):
            write_text(tmp_path / name, "x", "mesh")
    assert names(tmp_path) == ["device.obj", "pipe.obj"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows counts letters")
def test_long_names_have_temporary_files_of_their_own(tmp_path: Path) -> None:
    paths = [tmp_path / ("n" * 251 + suffix) for suffix in (".mtl", ".obj")]
    assert len({temporary.temporary_path(path) for path in paths}) == 2
    assert all(len(os.fsencode(temporary.temporary_path(path).name)) <= 255 for path in paths)


def test_outputs_that_are_one_file_are_refused_whatever_leads_to_it(tmp_path: Path) -> None:
    one, two, folder = tmp_path / "one.json", tmp_path / "two.json", tmp_path / "folder"
    folder.mkdir()
    check_distinct(one, None, two, None)
    with pytest.raises(FacePoserError, match=r"one\.json' is given for two outputs; give each a name of its own"):
        check_distinct(two, one, one)
    two.write_text("{}")
    (folder / "link.json").symlink_to(two)
    for other in (folder / ".." / "two.json", folder / "link.json"):
        with pytest.raises(FacePoserError) as said:
            check_distinct(one, two, other)
        assert f"'{two}' and '{other}' are one file, given for two outputs" in str(said.value)
