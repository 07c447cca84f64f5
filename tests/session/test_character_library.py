"""The characters that the user can choose: listed, renamed, removed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.character_file import available_characters, load_character, save_character
from faceposer.session.character_library import CharacterLibrary, LibraryEntry, library_folder


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("made") / "own.npz"
    save_character(path, replace(load_character("low"), name="own", title="My own"))
    return path


@pytest.fixture
def library(tmp_path: Path, file: Path) -> CharacterLibrary:
    found = CharacterLibrary(tmp_path / "characters")
    found.make_folder()
    (found.folder / "own.npz").write_bytes(file.read_bytes())
    return found


def test_it_lies_in_the_folder_of_the_users_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert library_folder().is_relative_to(tmp_path)
    assert CharacterLibrary().all() == [
        LibraryEntry(name, title, "installed") for name, title in available_characters()
    ]


def test_lists_what_is_there_and_nothing_that_is_no_character(
    library: CharacterLibrary, file: Path, tmp_path: Path
) -> None:
    (library.folder / "broken.npz").write_bytes(b"PK, but no archive")
    np.savez(library.folder / "other.npz", vertices=np.zeros(3))
    own = library.folder / "own.npz"
    found = library.all([str(file), str(own), str(tmp_path / "gone.npz")])
    assert found[len(available_characters()) :] == [
        LibraryEntry(str(own), "My own", "library"),
        LibraryEntry(str(file), "My own", "elsewhere"),
    ]
    assert library.holds(own)
    assert not library.holds(file)


def test_renaming_changes_the_title_and_leaves_the_file_and_the_face(library: CharacterLibrary) -> None:
    own = library.all()[-1]
    before = load_character(own.name)
    library.rename(own, "  Somebody else ")
    again = library.all()[-1]
    assert (again.name, again.title) == (own.name, "Somebody else")
    after = load_character(own.name)
    np.testing.assert_array_equal(after.vertices, before.vertices)
    np.testing.assert_allclose(after.shapes, before.shapes, atol=1e-6)
    assert after.feature_points == before.feature_points


@pytest.mark.parametrize("title", ["", "   ", "x" * 200])
def test_a_title_has_letters_but_not_too_many(library: CharacterLibrary, title: str) -> None:
    own = library.all()[-1]
    with pytest.raises(FacePoserError, match="name"):
        library.rename(own, title)
    assert library.all()[-1] == own


def test_only_the_users_own_can_be_removed(library: CharacterLibrary, file: Path) -> None:
    own = library.all()[-1]
    library.remove(own)
    assert not Path(own.name).exists()
    for other in (library.all()[0], LibraryEntry(str(file), "My own", "elsewhere")):
        with pytest.raises(FacePoserError, match="My characters"):
            library.remove(other)
        with pytest.raises(FacePoserError, match="My characters"):
            library.rename(other, "Else")
    assert file.exists()
    with pytest.raises(FacePoserError, match="cannot be deleted"):
        library.remove(own)


def test_new_files_take_no_others_place(library: CharacterLibrary) -> None:
    assert library.new_path("own") == library.folder / "own-2.npz"
    assert library.new_path("else") == library.folder / "else.npz"
    stuck = CharacterLibrary(library.folder / "own.npz" / "inside")
    with pytest.raises(FacePoserError, match="cannot be created"):
        stuck.make_folder()
