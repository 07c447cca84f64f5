"""Finds the shaders, the assets and the user's own folders, installed or in a checkout."""

import os
import sys
from pathlib import Path

from faceposer.errors import FacePoserError

_PACKAGE = Path(__file__).resolve().parent


def _data_dir(kind: str) -> Path:
    """Return the folder ``kind`` ("assets" or "shaders"): inside the package in a wheel, beside it in a checkout."""
    for parent in (_PACKAGE, _PACKAGE.parent):
        if (parent / kind).is_dir():
            return parent / kind
    raise FacePoserError(f"The folder '{kind}' of the Face Poser installation is missing; install Face Poser again.")


def asset_path(name: str) -> Path:
    """Return the path of the asset ``name``, relative to the assets folder; it need not exist."""
    return _data_dir("assets") / name


def shader_text(name: str) -> str:
    """Return the GLSL source of the shader file ``name``.

    Raises:
        FacePoserError: If the shader does not exist.
    """
    path = _data_dir("shaders") / name
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise FacePoserError(
            f"The shader '{path}' cannot be read ({error.strerror}); install Face Poser again."
        ) from error


def user_config_dir() -> Path:
    """Return the folder for the user's settings; it need not exist."""
    return _user_dir("XDG_CONFIG_HOME", ".config")


def user_data_dir() -> Path:
    """Return the folder for what the user makes and the program keeps; it need not exist."""
    return _user_dir("XDG_DATA_HOME", ".local/share")


def user_state_dir() -> Path:
    """Return the folder for what the program remembers between runs; it need not exist."""
    return _user_dir("XDG_STATE_HOME", ".local/state")


def _user_dir(variable: str, fallback: str) -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData/Local")) / "FacePoser"
    if sys.platform == "darwin":
        return Path.home() / "Library/Application Support/FacePoser"
    base = os.environ.get(variable, "")
    return (Path(base) if base else Path.home() / fallback) / "faceposer"
