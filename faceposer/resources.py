"""Paths of shaders, assets and fonts, in an installation or a checkout."""

from importlib.util import find_spec
from pathlib import Path

from faceposer.errors import FacePoserError

_PACKAGE = Path(__file__).resolve().parent


def _data_dir(kind: str) -> Path:
    """Return the folder ``kind`` ("assets" or "shaders"): inside the package in a wheel, next to it in a checkout."""
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


def fonts_folder() -> Path:
    """Return the folder of the fonts in the package of Dear ImGui.

    Raises:
        FacePoserError: If the package is not installed.
    """
    spec = find_spec("imgui_bundle")
    if spec is None or spec.origin is None:
        raise FacePoserError("The fonts are missing; install Face Poser again.")
    return Path(spec.origin).parent / "assets" / "fonts"
