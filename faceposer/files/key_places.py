"""Places of folders of key poses, in which other outputs are not written (``session.key_folder``)."""

from pathlib import Path
from typing import Literal

from faceposer.errors import FacePoserError
from faceposer.files import paths

#: Name of the file that describes a folder of keys.
DESCRIPTION = "keys.json"
Side = Literal["source", "target"]
SIDES: tuple[Side, Side] = ("source", "target")


def keys_around(path: Path) -> Path | None:
    """Return the folder of keys that has ``path`` as a key pose or as its description, or None."""
    place = paths.resolved(path)
    if place.name == DESCRIPTION and all(paths.is_dir(place.parent / side) for side in SIDES):
        return place.parent
    folder = place.parent.parent
    is_side = any(paths.same_file(place.parent, folder / side) for side in SIDES)
    return folder if is_side and paths.is_file(folder / DESCRIPTION) else None


def check_not_key(path: Path) -> None:
    """Check that an output ``path`` other than a key pose is not among key poses, which it would replace or join.

    Raises:
        FacePoserError: If it is.
    """
    folder = keys_around(path)
    if folder is not None:
        raise FacePoserError(f"'{path}' is among the key poses of '{folder}'; choose another folder for the output.")
