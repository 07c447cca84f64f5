"""The user's folders are where the system has them."""

import sys
from pathlib import Path

import pytest

from faceposer.files.user_folders import config_folder, data_folder, state_folder

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
