"""The user's own folders, as the system has them."""

import sys
from pathlib import Path

import platformdirs

_NAME = "faceposer" if sys.platform.startswith("linux") else "FacePoser"


def config_folder() -> Path:
    """Return the folder for the user's settings; it need not exist."""
    return platformdirs.user_config_path(_NAME, appauthor=False)


def data_folder() -> Path:
    """Return the folder for what the user makes and the program keeps; it need not exist."""
    return platformdirs.user_data_path(_NAME, appauthor=False)


def state_folder() -> Path:
    """Return the folder for what the program remembers between runs; it need not exist."""
    return platformdirs.user_state_path(_NAME, appauthor=False)


def documents_folder() -> Path:
    """Return the folder where the user keeps documents: the home folder where the system has no other."""
    folder = platformdirs.user_documents_path()
    return folder if folder.is_dir() else Path.home()
