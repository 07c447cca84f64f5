"""The user's folders are where the system has them."""

import sys
from pathlib import Path

import pytest

from faceposer.files.user_folders import config_folder, data_folder, documents_folder, home_folder, state_folder

FOLDERS = {config_folder: ("XDG_CONFIG_HOME", ".config"), data_folder: ("XDG_DATA_HOME", ".local/share")}
FOLDERS |= {state_folder: ("XDG_STATE_HOME", ".local/state")}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the folders of Linux")
def test_linux_has_them_by_the_xdg_directories(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    for folder, (variable, usual) in FOLDERS.items():
        monkeypatch.delenv(variable, raising=False)
        assert folder() == tmp_path / usual / "faceposer"
        monkeypatch.setenv(variable, str(tmp_path / "elsewhere"))
        assert folder() == tmp_path / "elsewhere" / "faceposer"
        monkeypatch.setenv(variable, "")
        assert folder() == tmp_path / usual / "faceposer"


def test_asking_for_a_folder_does_not_make_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    for variable, _ in FOLDERS.values():
        monkeypatch.delenv(variable, raising=False)
    paths = [folder() for folder in FOLDERS]
    assert len(set(paths)) == len(paths)
    assert all(path.is_absolute() and not path.exists() for path in paths)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has its home folder elsewhere")
def test_a_home_that_is_no_folder_gives_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "home").mkdir()
    monkeypatch.chdir(tmp_path)
    for home in (str(tmp_path / "file"), "/no/such/home", "relative", "/dev/null"):
        monkeypatch.setenv("HOME", home)
        assert home_folder() == documents_folder() == tmp_path
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert home_folder() == documents_folder() == tmp_path / "home"
    monkeypatch.setenv("HOME", "/no/such/home")
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert home_folder() == Path("/")
    monkeypatch.chdir(tmp_path)
