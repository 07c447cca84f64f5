"""Writing through symbolic links replaces what they lead to, and the links remain."""

import os
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_folder, check_new_folder, check_output, write_text
from faceposer.files.paths import folder_of, is_link


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    return folder


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("steps", [1, 3])
def test_the_file_behind_a_link_is_replaced(tmp_path: Path, elsewhere: Path, steps: int) -> None:
    (elsewhere / "a.json").write_text("old")
    before = Path("elsewhere/a.json")
    for i in range(steps):
        (tmp_path / f"link{i}.json").symlink_to(before)
        before = Path(f"link{i}.json")
    link = tmp_path / f"link{steps - 1}.json"
    check_output(link, ".json")
    write_text(link, "new", "session")
    assert link.is_symlink()
    assert (elsewhere / "a.json").read_text() == "new"
    assert names(elsewhere) == ["a.json"]
    assert names(tmp_path) == ["elsewhere", *(f"link{i}.json" for i in range(steps))]


def test_after_a_failure_link_and_file_are_as_before(tmp_path: Path, elsewhere: Path) -> None:
    (elsewhere / "a.json").write_text("old")
    link = tmp_path / "a.json"
    link.symlink_to(elsewhere / "a.json")
    elsewhere.chmod(0o500)
    try:
        if not os.access(elsewhere, os.W_OK):
            with pytest.raises(FacePoserError, match=r"The folder '.*elsewhere' of the output is not writable"):
                check_output(link, ".json")
            with pytest.raises(FacePoserError, match=r"The session '.*a\.json' cannot be written: Permission denied"):
                write_text(link, "new", "session")
        with pytest.raises(UnicodeEncodeError):
            write_text(link, "\ud800", "session")
    finally:
        elsewhere.chmod(0o700)
    assert link.is_symlink()
    assert link.read_text() == "old"
    assert names(elsewhere) == ["a.json"]


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ("nowhere.json", "it is a link to something that does not exist"),
        ("missing/nowhere.json", "it is a link to something that does not exist"),
        ("link.json", "it is a link that cannot be followed, since it leads in a circle"),
        ("elsewhere", "it leads to a folder"),
        ("/dev/null", "it leads to a device or another special file"),
        ("pipe", "it leads to a device or another special file"),
        ("file/x", "it is a link that cannot be followed, Not a directory"),
        ("n" * 300, "it is a link that cannot be followed, File name too long"),
    ],
)
def test_links_that_lead_to_no_file_are_one_sentence(tmp_path: Path, elsewhere: Path, target: str, reason: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").write_text("x")
    link = tmp_path / "link.json"
    link.symlink_to(target)
    before = names(tmp_path)
    with pytest.raises(FacePoserError, match=reason) as said:
        write_text(link, "new", "session")
    assert str(said.value).startswith(f"The session '{link}' cannot be written: ")
    assert str(said.value).endswith(".")
    with pytest.raises(FacePoserError, match=r"link|folder"):
        check_output(link, ".json")
    assert names(tmp_path) == before
    assert names(elsewhere) == []
    assert link.is_symlink()


def test_a_new_folder_behind_a_link(tmp_path: Path, elsewhere: Path) -> None:
    link = tmp_path / "frames"
    link.symlink_to("elsewhere")
    check_new_folder(link)
    with atomic_folder(link) as temporary:
        (temporary / "1.obj").write_text("v")
    assert link.is_symlink()
    assert names(elsewhere) == ["1.obj"]
    with pytest.raises(FacePoserError, match=r"'.*frames' exists and is not an empty folder"), atomic_folder(link):
        pass
    for target in ("nowhere", "broken"):
        broken = tmp_path / "broken"
        broken.unlink(missing_ok=True)
        broken.symlink_to(target)
        with pytest.raises(FacePoserError, match="link"):
            check_new_folder(broken)
        with pytest.raises(FacePoserError, match="it is a link"), atomic_folder(broken):
            pass


def test_the_folder_of_a_file_is_that_of_what_a_link_leads_to(tmp_path: Path, elsewhere: Path) -> None:
    link = tmp_path / "a.json"
    link.symlink_to("elsewhere/a.json")
    assert folder_of(link) == elsewhere.resolve()
    assert folder_of(tmp_path / "b.json") == tmp_path
    assert not is_link("zero\0byte")
    assert not is_link("n" * 300)
