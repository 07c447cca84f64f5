"""Questions about paths that people and files give; none of them fails.

``Path.is_file`` and its like raise for names that are too long, for folders without permission and for links in
circles; ``Path.expanduser`` raises for users that do not exist.
"""
# ruff: noqa: PTH110, PTH111, PTH112, PTH113, PTH116, PTH121

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
