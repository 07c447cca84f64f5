"""Questions about paths that people and files give; none of them fails.

``Path.is_file`` and its like raise for names that are too long, for folders without permission and for links in
circles; ``Path.expanduser`` raises for users that do not exist.
"""
# ruff: noqa: PTH110, PTH111, PTH112, PTH113, PTH114, PTH116, PTH121, PTH208

import os
from pathlib import Path


def is_file(path: Path | str) -> bool:
    """Return True if ``path`` is a regular file or a link to one; False also if that cannot be found out."""
    return os.path.isfile(path)


def is_dir(path: Path | str) -> bool:
    """Return True if ``path`` is a folder or a link to one; False also if that cannot be found out."""
    return os.path.isdir(path)


def exists(path: Path | str) -> bool:
    """Return True if there is something at ``path``; False also if that cannot be found out."""
    return os.path.exists(path)


def is_link(path: Path | str) -> bool:
    """Return True if ``path`` is a symbolic link; False also if that cannot be found out."""
    try:
        return os.path.islink(path)
    except ValueError:
        return False


def folder_of(path: Path) -> Path:
    """Return the folder of the file ``path``, or if it is a link, that of the file that it leads to."""
    return resolved(path).parent if is_link(path) else path.parent


def can_enter(folder: Path | str) -> bool:
    """Return True if ``folder`` is a folder, or a link to one, that may be listed and entered."""
    try:
        return os.path.isdir(folder) and os.access(folder, os.R_OK | os.X_OK)
    except ValueError:
        return False


def same_file(one: Path | str, other: Path | str) -> bool:
    """Return True if both paths lead to one file or folder; False also if that cannot be found out."""
    try:
        return os.path.samefile(one, other)
    except (OSError, ValueError):
        return False


def expand_user(path: Path | str) -> Path:
    """Return ``path`` with the home folder for a leading "~" or "~name"; unchanged if there is no such user."""
    return Path(os.path.expanduser(path))


def modified_at(path: Path | str) -> int | None:
    """Return the time of the last modification in nanoseconds, or None if that cannot be found out."""
    try:
        return os.stat(path).st_mtime_ns
    except (OSError, ValueError):
        return None


def resolved(path: Path | str) -> Path:
    """Return ``path`` made absolute, with its links followed as far as possible; links in circles are kept."""
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError):
        # The working directory is gone, or the path has a character that no path has.
        return Path(path)


def problem(path: Path | str) -> str:
    """Return why nothing can be found out about ``path``, in the words of the system; "" if it exists or is missing."""
    try:
        os.stat(path)
    except FileNotFoundError:
        return ""
    except OSError as error:
        return error.strerror or str(error)
    except ValueError:
        return "the name has a character that no file name has"
    return ""


def absolute(path: Path | str) -> Path:
    """Return ``path`` made absolute, or unchanged if the working directory is gone."""
    try:
        return Path(path).absolute()
    except OSError:
        return Path(path)


def files_in(folder: Path, *suffixes: str) -> list[Path]:
    """Return the entries of ``folder`` that end in one of the ``suffixes``, by name; none if it cannot be listed."""
    try:
        return sorted(folder / name for name in os.listdir(folder) if name.endswith(suffixes))
    except (OSError, ValueError):
        return []
