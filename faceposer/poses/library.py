"""A folder of poses: one JSON file for each, and a picture of the same name beside it."""

import re
import unicodedata
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.user_folders import data_folder
from faceposer.poses.pose_file import Pose, pose_text, read_pose
from faceposer.resources import asset_path

SUFFIX, PICTURE_SUFFIX = ".json", ".png"
_MOST_POSES = 2000
_LONGEST_STEM = 60
# Names that Windows keeps for devices, whatever their suffix.
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)


class PoseExistsError(FacePoserError):
    """A pose of that name is there already; nothing was written."""


@dataclass(frozen=True)
class Entry:
    """A file of a library.

    Attributes:
        path: The file.
        pose: What is in it, or None if it cannot be used.
        problem: Why not, in a sentence, or "".
        shipped: Whether it came with the program, which then keeps it as it is.
    """

    path: Path
    pose: Pose | None
    problem: str = ""
    shipped: bool = False

    @property
    def title(self) -> str:
        """The pose's name, or the file's where there is none."""
        return self.path.name if self.pose is None else self.pose.name

    @property
    def picture(self) -> Path:
        """Where its picture is, if it has one."""
        return self.path.with_suffix(PICTURE_SUFFIX)


class PoseLibrary:
    """The poses in one folder, which need not exist until something is saved."""

    def __init__(self, folder: Path) -> None:
        """Look into ``folder``."""
        self.folder = folder

    @property
    def stamp(self) -> int:
        """Changes when a file comes, goes or is replaced."""
        try:
            return self.folder.stat().st_mtime_ns
        except OSError:
            return 0

    def entries(self) -> list[Entry]:
        """Return what is in the folder, by name; files that cannot be read say why.

        Raises:
            FacePoserError: If there are too many files, or the folder cannot be listed.
        """
        return sorted(_entries(self.folder, False), key=lambda entry: (entry.title.casefold(), entry.path.name))

    def find(self, name: str) -> Entry:
        """Return the pose called ``name``, capitals aside.

        Raises:
            FacePoserError: If there is none.
        """
        return found(self.entries(), name, f"in '{self.folder}'")

    def path_of(self, name: str) -> Path:
        """Return the file that a pose called ``name`` has."""
        return self.folder / f"{safe_stem(name)}{SUFFIX}"

    def save(self, pose: Pose, overwrite: bool = False) -> Path:
        """Write ``pose`` and return its file; a picture of what it replaces is gone.

        Raises:
            PoseExistsError: If there is one of that name, unless it is to be replaced by ``overwrite``.
            FacePoserError: If the file cannot be written.
        """
        path = self.path_of(pose.name)
        if path.exists() and not overwrite:
            raise PoseExistsError(
                f"'{self.folder}' has a pose '{pose.name}' already; choose another name, or replace it."
            )
        self.update(path, pose)
        return path

    def update(self, path: Path, pose: Pose) -> None:
        """Write ``pose`` to ``path``; the picture of what was there is gone.

        Raises:
            FacePoserError: If the file cannot be written.
        """
        _write(path, pose_text(pose))
        with suppress(OSError):
            path.with_suffix(PICTURE_SUFFIX).unlink(missing_ok=True)

    def rename(self, path: Path, name: str, overwrite: bool = False) -> Path:
        """Give the pose in the file ``path`` another name and return its new file; its picture goes with it.

        Raises:
            PoseExistsError: If another has that name, unless it is to be replaced by ``overwrite``.
            FacePoserError: If a file cannot be read or written.
        """
        renamed = read_pose(path).renamed(name)
        target = self.path_of(name)
        if target == path or _same_file(target, path):
            _write(path, pose_text(renamed))
            return path
        picture = path.with_suffix(PICTURE_SUFFIX)
        self.save(renamed, overwrite)
        try:
            if picture.is_file():
                picture.replace(target.with_suffix(PICTURE_SUFFIX))
            path.unlink()
        except OSError as error:
            raise FacePoserError(f"The pose '{path}' cannot be renamed: {error.strerror}.") from error
        return target

    def delete(self, path: Path) -> None:
        """Remove the file ``path`` and its picture.

        Raises:
            FacePoserError: If it cannot be removed.
        """
        try:
            path.unlink()
            path.with_suffix(PICTURE_SUFFIX).unlink(missing_ok=True)
        except OSError as error:
            raise FacePoserError(f"The pose '{path}' cannot be deleted: {error.strerror}.") from error


def own_folder() -> Path:
    """Return the folder of the user's poses, unless another is chosen; it need not exist."""
    return data_folder() / "poses"


def starter_poses() -> list[Entry]:
    """Return the poses that come with the program: expressions, then visemes, for all its characters."""
    root = asset_path("poses")
    return [entry for folder in (root, *sorted(root.glob("*/"))) for entry in _entries(folder, True)]


def found(entries: list[Entry], name: str, where: str) -> Entry:
    """Return the pose called ``name`` among ``entries``, capitals aside.

    Raises:
        FacePoserError: If there is none; ``where`` says where it was looked for.
    """
    wanted = name.strip().casefold()
    for entry in entries:
        if entry.pose is not None and entry.title.casefold() == wanted:
            return entry
    names = [entry.title for entry in entries if entry.pose is not None]
    listed = f"; there are {', '.join(names[:24])}{'...' if len(names) > 24 else ''}" if names else ""
    raise FacePoserError(f"There is no pose '{name}' {where}{listed}.")


def safe_stem(name: str) -> str:
    """Return a file name without suffix for a pose called ``name``, good on every system."""
    text = unicodedata.normalize("NFC", name).strip()
    stem = re.sub(r"[^\w-]+", "-", text).strip("-_")[:_LONGEST_STEM].strip("-_").lower()
    return f"pose-{stem}" if not stem or _DEVICES.fullmatch(stem) else stem


def _entries(folder: Path, shipped: bool) -> list[Entry]:
    try:
        paths = sorted(path for path in folder.glob(f"*{SUFFIX}") if not path.name.startswith("."))
    except OSError as error:
        raise FacePoserError(f"The folder '{folder}' cannot be listed: {error.strerror}.") from error
    if len(paths) > _MOST_POSES:
        raise FacePoserError(f"The folder '{folder}' has {len(paths)} files; poses are kept to {_MOST_POSES} a folder.")
    entries = []
    for path in paths:
        try:
            entries.append(Entry(path, read_pose(path), shipped=shipped))
        except FacePoserError as error:
            entries.append(Entry(path, None, str(error), shipped))
    return entries


def _same_file(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FacePoserError(f"The pose '{path}' cannot be written: {error.strerror}.") from error
    write_text(path, text, "pose")
