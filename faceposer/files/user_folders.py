"""Standard folders of the user on this system."""

import sys
from pathlib import Path

import platformdirs

from faceposer.files import paths

_NAME = "faceposer" if sys.platform.startswith("linux") else "FacePoser"


def config_folder() -> Path:
    """Return the folder of the user's settings, which may not exist."""
    return platformdirs.user_config_path(_NAME, appauthor=False)


def data_folder() -> Path:
    """Return the folder of data created by the user, such as poses and characters, which may not exist."""
    return platformdirs.user_data_path(_NAME, appauthor=False)


def state_folder() -> Path:
    """Return the folder of the program's state between runs, which may not exist."""
    return platformdirs.user_state_path(_NAME, appauthor=False)


def documents_folder() -> Path:
    """Return the documents folder of the user, or the home folder if the system has none."""
    folder = platformdirs.user_documents_path()
    return folder if paths.is_dir(folder) else Path.home()
