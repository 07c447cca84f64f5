"""Folders of poses: one JSON file per pose, and a thumbnail of the same name next to it."""

import re
import unicodedata
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.files.user_folders import data_folder
from faceposer.poses.pose_file import Pose, read_pose, write_pose
from faceposer.resources import asset_path

SUFFIX, PICTURE_SUFFIX = ".json", ".png"
_MOST_POSES = 2000
_LONGEST_STEM = 60
# Names reserved for devices on Windows, with any suffix.
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)


class PoseExistsError(FacePoserError):
    """A pose of that name already exists; nothing was written."""


@dataclass(frozen=True)
class Entry:
    """A file of a library.

    Attributes:
        path: The file.
        pose: The pose, or None if the file is invalid.
        problem: Message on an invalid file, or "".
        shipped: True for a read-only pose of the program.
    """

    path: Path
    pose: Pose | None
    problem: str = ""
    shipped: bool = False

    @property
    def title(self) -> str:
        """Name of the pose, or of the file if it is invalid."""
        return self.path.name if self.pose is None else self.pose.name

    @property
    def picture(self) -> Path:
        """Path of the thumbnail, which may not exist."""
        return self.path.with_suffix(PICTURE_SUFFIX)


class PoseLibrary:
    """The poses in one folder, which is created when a pose is saved."""

    def __init__(self, folder: Path) -> None:
        """Use ``folder``."""
        self.folder = folder

    @property
    def stamp(self) -> int:
        """Time stamp that changes when a file is added, removed or replaced."""
        try:
            return self.folder.stat().st_mtime_ns
        except OSError:
            return 0

    def entries(self) -> list[Entry]:
        """Return the entries of the folder by name; invalid files have a message.

        Raises:
            FacePoserError: If there are too many files, or the folder cannot be listed.
        """
        return sorted(_entries(self.folder, False), key=lambda entry: (entry.title.casefold(), entry.path.name))

    def find(self, name: str) -> Entry:
        """Return the pose with this name, ignoring case.

        Raises:
            FacePoserError: If there is none.
        """
        return found(self.entries(), name, f"in '{self.folder}'")

    def path_of(self, name: str) -> Path:
        """Return the path of the file of the pose with this name, ignoring case, or of a new file for it.

        Names that differ only in characters that no file name has get different files.
        """
        stem, number = safe_stem(name), 2
        path = self.folder / f"{stem}{SUFFIX}"
        while paths.exists(path) and _key(_name_in(path)) != _key(name):
            path, number = self.folder / f"{stem}-{number}{SUFFIX}", number + 1
        return path

    def save(self, pose: Pose, overwrite: bool = False) -> Path:
        """Write ``pose`` and return its file; the thumbnail of a replaced pose is deleted.

        Raises:
            PoseExistsError: If the name is taken and ``overwrite`` is False.
            FacePoserError: If the file cannot be written.
        """
        path = self.path_of(pose.name)
        if paths.exists(path) and not overwrite:
            raise PoseExistsError(
                f"'{self.folder}' already has a pose '{pose.name}'; choose another name, or replace it."
            )
        self.update(path, pose)
        return path

    def update(self, path: Path, pose: Pose) -> None:
        """Write ``pose`` to ``path``; the thumbnail of the replaced pose is deleted.

        Raises:
            FacePoserError: If the file cannot be written.
        """
        write_pose(path, pose)
        with suppress(OSError):
            path.with_suffix(PICTURE_SUFFIX).unlink(missing_ok=True)

    def rename(self, path: Path, name: str, overwrite: bool = False) -> Path:
        """Rename the pose in the file ``path`` and return its new file; the thumbnail is moved as well.

        Raises:
            PoseExistsError: If the name is taken and ``overwrite`` is False.
            FacePoserError: If a file cannot be read or written.
        """
        renamed = read_pose(path).renamed(name)
        target = self.path_of(name)
        if target == path or paths.same_file(target, path):
            write_pose(path, renamed)
            return path
        picture = path.with_suffix(PICTURE_SUFFIX)
        self.save(renamed, overwrite)
        try:
            if paths.is_file(picture):
                picture.replace(target.with_suffix(PICTURE_SUFFIX))
            path.unlink()
        except OSError as error:
            raise FacePoserError(f"The pose '{path}' cannot be renamed: {error.strerror}.") from error
        return target

    def delete(self, path: Path) -> None:
        """Delete the file ``path`` and its thumbnail.

        Raises:
            FacePoserError: If it cannot be deleted.
        """
        try:
            path.unlink()
            path.with_suffix(PICTURE_SUFFIX).unlink(missing_ok=True)
        except OSError as error:
            raise FacePoserError(f"The pose '{path}' cannot be deleted: {error.strerror}.") from error


def default_pose_folder() -> Path:
    """Return the default folder of the user's poses, which may not exist."""
    return data_folder() / "poses"


def starter_poses() -> list[Entry]:
    """Return the poses of the program for all its characters: expressions, then visemes."""
    root = asset_path("poses")
    return [entry for folder in (root, *sorted(root.glob("*/"))) for entry in _entries(folder, True)]


def found(entries: list[Entry], name: str, where: str) -> Entry:
    """Return the pose with this name among ``entries``, ignoring case.

    Raises:
        FacePoserError: If there is none; the message contains ``where``, such as "in 'folder'".
    """
    key = name.strip().casefold()
    for entry in entries:
        if entry.pose is not None and entry.title.casefold() == key:
            return entry
    names = [entry.title for entry in entries if entry.pose is not None]
    listed = f"; the poses are {', '.join(names[:24])}{'...' if len(names) > 24 else ''}" if names else ""
    raise FacePoserError(f"There is no pose '{name}' {where}{listed}.")


def safe_stem(name: str) -> str:
    """Return a file name without suffix for a pose with this name, valid on every system."""
    text = unicodedata.normalize("NFC", name).strip()
    stem = re.sub(r"[^\w-]+", "-", text).strip("-_")[:_LONGEST_STEM].strip("-_").lower()
    return f"pose-{stem}" if not stem or _DEVICES.fullmatch(stem) else stem


def _entries(folder: Path, shipped: bool) -> list[Entry]:
    try:
        files = sorted(path for path in folder.iterdir() if path.suffix == SUFFIX and path.name[0] != ".")
    except FileNotFoundError:
        return []
    except OSError as error:
        raise FacePoserError(f"The folder '{folder}' cannot be listed: {error.strerror}.") from error
    if len(files) > _MOST_POSES:
        raise FacePoserError(
            f"The folder '{folder}' has {counted(len(files), 'file')}, more than the maximum of {_MOST_POSES}."
        )
    entries = []
    for path in files:
        try:
            entries.append(Entry(path, read_pose(path), shipped=shipped))
        except FacePoserError as error:
            entries.append(Entry(path, None, str(error), shipped))
    return entries


def _name_in(path: Path) -> str:
    """Return the name of the pose in the file ``path``, or "" if it is invalid."""
    try:
        return read_pose(path).name
    except FacePoserError:
        return ""


def _key(name: str) -> str:
    return unicodedata.normalize("NFC", name).strip().casefold()
