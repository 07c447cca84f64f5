"""Discovery of ffmpeg, the program that writes MP4."""

import functools
import shutil

from faceposer.errors import FacePoserError

_MISSING = (
    "MP4 needs ffmpeg, which was not found; install it, or its Python package with pip install 'faceposer[film]', or "
    "write a .gif instead."
)


def missing_ffmpeg() -> str:
    """Return a message with the remedy if ffmpeg is missing, or ""."""
    return "" if _ffmpeg() else _MISSING


def find_ffmpeg() -> str:
    """Return the path of ffmpeg: that of the system, or else that of the package imageio-ffmpeg.

    Raises:
        FacePoserError: If neither is installed.
    """
    program = _ffmpeg()
    if program is None:
        raise FacePoserError(_MISSING)
    return program


def _ffmpeg() -> str | None:
    return shutil.which("ffmpeg") or bundled_ffmpeg()


@functools.cache
def bundled_ffmpeg() -> str | None:
    """Return the path of ffmpeg in the optional package imageio-ffmpeg, or None."""
    try:
        import imageio_ffmpeg

        program: str = imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError, OSError):
        return None
    return program
