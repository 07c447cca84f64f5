"""The built-in file dialog with any folders and names: nothing fails, and the line below the field says why."""

import os
from pathlib import Path

import pytest

from faceposer.gui.widgets import path_browser
from faceposer.gui.widgets.file_request import FileRequest, Purpose
from faceposer.gui.widgets.path_browser import PathBrowser
from faceposer.gui.widgets.text import displayed, shortened, widget_id


def browser(start: Path, purpose: Purpose = "open") -> PathBrowser:
    return PathBrowser(FileRequest(purpose, "Title", "Sessions", (".json",), start, lambda _: None))


def entered(start: Path, name: str, purpose: Purpose = "save") -> str:
    """Return what the dialog says to ``name``."""
    dialog = browser(start, purpose)
    dialog.name = name
    assert dialog.accept() is None, name
    text, warns = dialog.advice()
    assert warns
    assert text.isprintable()
    return text


@pytest.mark.parametrize(
    ("name", "saving", "opening"),
    [
        ("n" * 300, "File name too long", "File name too long"),
        ("~nouser", "There is no user 'nouser'; enter './~nouser'", "There is no user 'nouser'"),
        ("~nouser/a.json", "There is no user 'nouser'", "There is no user 'nouser'"),
        (" ", "Enter a name", "Enter a name"),
        ("no/a", "does not exist", "does not exist"),
        ("file/a", "cannot be read: Not a directory|does not exist", "cannot be read: Not a directory|does not exist"),
        ("circle/a", "Too many levels of symbolic links", "Too many levels of symbolic links"),
        ("circle.json", "Too many levels of symbolic links", "Too many levels of symbolic links"),
        ("zero\0byte", "a character that no file name has", "a character that no file name has"),
        ("line\nbreak/\udce9/a", r"line\nbreak/\udce9' does not exist", r"line\nbreak/\udce9/a' does not exist"),
        ("d/" * 3000 + "a", "File name too long", "File name too long"),
    ],
)
def test_what_is_typed_is_answered_below_the_field(tmp_path: Path, name: str, saving: str, opening: str) -> None:
    (tmp_path / "file").write_text("x")
    for link in ("circle", "circle.json"):
        (tmp_path / link).symlink_to(link)
    said = entered(tmp_path, name), entered(tmp_path, name, "open")
    if name.strip():
        entered(tmp_path, name, "folder")
    assert any(part in said[0] for part in saving.split("|")), said
    assert any(part in said[1] for part in opening.split("|")), said


def test_a_name_that_begins_with_a_tilde_is_a_file_where_it_is_one(tmp_path: Path) -> None:
    (tmp_path / "~a.json").write_text("x")
    dialog = browser(tmp_path)
    dialog.name = "~a.json"
    assert dialog.accept() == tmp_path / "~a.json"
    dialog = browser(tmp_path, "save")
    dialog.name = "./~b"
    assert dialog.accept() == tmp_path / "~b.json"


def test_folders_come_first_and_files_that_are_left_out_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(path_browser, "_MAX_FILES", 20)
    for i in range(100):
        (tmp_path / f"a{i:03}.txt").touch()
        (tmp_path / f"b{i:03}.json").touch()
        (tmp_path / f"z{i:03}").mkdir()
    (tmp_path / "self").symlink_to("self")
    (tmp_path / "gone.json").symlink_to("nowhere")
    dialog = browser(tmp_path)
    assert [name for is_folder, name in dialog._entries if is_folder] == [f"z{i:03}" for i in range(100)]
    assert [name for is_folder, name in dialog._entries if not is_folder] == [f"b{i:03}.json" for i in range(20)]
    assert dialog.advice() == ("81 more files are not listed; enter the name of one to open it", True)


def test_a_folder_that_is_gone_gives_way_to_the_documents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(path_browser, "documents_folder", lambda: tmp_path)
    (tmp_path / "circle").symlink_to("circle")
    for start in (tmp_path / "gone" / "a.json", tmp_path / "circle" / "a.json", Path("/" + "n" * 300 + "/a.json")):
        dialog = browser(start, "save")
        assert dialog.folder == tmp_path
        assert dialog.name == "a.json"
        assert dialog.message == ""


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain ü 😀", "plain ü 😀"),
        ("caf\udce9", r"caf\udce9"),
        ("a##b###c####", "a# #b# # #c# # # #"),
        ("tab\tbell\a\x7f\x9f", r"tab\tbell\x07\x7f\x9f"),
        ("two\nlines", "two\nlines"),
        ("\u202etxt.\u2066", r"\u202etxt.\u2066"),
        ("%s%n", "%s%n"),
        ("\ue123 icon", "\ue123 icon"),
    ],
)
def test_every_name_can_be_displayed(text: str, shown: str) -> None:
    assert displayed(text) == shown
    assert "##" not in displayed(text)
    displayed(text).encode("utf-8")
    assert shortened(text, 1000.0, lambda text: float(len(text))) == shown


def test_long_text_is_cut_and_identifiers_are_different() -> None:
    assert len(displayed("x" * 100_000)) < 5000
    names = ["a##b", "c##b", "a###b", "c###b", "\udce9", "\\udce9", "é", "e\u0301", "a\n", "a\\n"]
    assert len({widget_id(name) for name in names}) == len(names)
    assert all(widget_id(name).isascii() and "#" not in widget_id(name) for name in names)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")
def test_a_folder_that_is_not_writable_is_told_below_the_field(tmp_path: Path) -> None:
    # Imported here: it needs a system that can fork.
    from scripts.torture import forked

    def enter() -> None:
        assert "is not writable; choose another" in entered(tmp_path, "a")

    tmp_path.chmod(0o500)
    try:
        # In a child that obeys the permissions even as root.
        ended = forked.run(enter)
    finally:
        tmp_path.chmod(0o700)
    assert ended.status == 0, ended.err
