"""Opening of films, whatever they are."""

from pathlib import Path

from faceposer.files import paths
from faceposer.files.reading import open_file
from faceposer.film.film import FILM_SUFFIXES, Film
from faceposer.film.pictures import AnimatedImage, PictureFolder
from faceposer.film.video import Video

# What films begin with, and where.
_SIGNS = (
    *((4, b"ftyp"), (4, b"moov"), (4, b"mdat"), (4, b"wide"), (0, b"\x1aE\xdf\xa3"), (8, b"AVI "), (0, b"OggS")),
    *((0, b"GIF8"), (0, b"\x00\x00\x01\xba"), (0, b"FLV\x01"), (0, b"0&\xb2u\x8ef\xcf\x11")),
)


def is_film(path: Path) -> bool:
    """Return True if ``path`` is a film by its ending or its first bytes, or a folder, of pictures."""
    if path.suffix.lower() in FILM_SUFFIXES or paths.is_dir(path):
        return True
    try:
        with open_file(path) as file:
            head = file.read(16)
    except OSError:
        return False
    return any(head[at:].startswith(sign) for at, sign in _SIGNS)


def open_film(path: Path, rate: float | None = None) -> Film:
    """Return the film ``path``: a video, an animated GIF, or a folder of pictures.

    Args:
        path: File or folder.
        rate: Frames per second at which it is sampled, and of pictures in a folder; its own if None.

    Raises:
        FacePoserError: If it cannot be read, or has no pictures; or if it is a video, and PyAV is missing.
    """
    if paths.is_dir(path):
        return PictureFolder(path, rate)
    return AnimatedImage(path, rate) if path.suffix.lower() == ".gif" else Video(path, rate)
