"""The keys of a folder: their names and files."""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.poses.pose_file import checked_name
from faceposer.transfer.examples import NEUTRAL


class KeyTakenError(FacePoserError):
    """The name of a new key is taken."""

    def __init__(self, folder: Path, name: str) -> None:
        self.taken = f"'{folder}' already has a key '{name}'"
        super().__init__(f"{self.taken}; choose another name, or replace it.")


def checked_key_name(name: str) -> str:
    """Return ``name`` if it can be the name of a key.

    Raises:
        FacePoserError: If it is a path, not a single line, or too long.
    """
    if re.search(r"[/\\]", name) or name.strip() in (".", ".."):
        raise FacePoserError(f"The name of a key cannot be a path such as '{name}'; give a name such as 'Happiness'.")
    return checked_name(name)


@dataclass(frozen=True)
class KeyFiles:
    """The files of a key.

    Attributes:
        name: Name of the files without suffix.
        source: Pose or mesh of the source, if there is one.
        target: Pose or mesh of the target, if there is one.
        problem: Sentence on a side that has two files, or "".
    """

    name: str
    source: Path | None
    target: Path | None
    problem: str = ""

    @classmethod
    def of(cls, name: str, source: Sequence[Path], target: Sequence[Path]) -> "KeyFiles":
        """Return the key ``name`` with the files of both sides, of which there should be one each."""
        double = next((files for files in (source, target) if len(files) > 1), None)
        problem = ""
        if double is not None:
            problem = f"The key '{name}' has two files, '{double[0]}' and '{double[1].name}'; remove one of them."
        return cls(name, source[0] if source else None, target[0] if target else None, problem)


def count_with_neutral(names: Collection[str]) -> int:
    """Return the number of keys with these ``names``, and the neutral face if it is none of them."""
    return len(names) + (not any(name.casefold() == NEUTRAL for name in names))


def delete_keys(files: Iterable[Path]) -> None:
    """Delete ``files`` of keys.

    Raises:
        FacePoserError: If one cannot be deleted.
    """
    for path in files:
        try:
            path.unlink()
        except OSError as error:
            raise FacePoserError(
                f"The key '{path}' cannot be deleted: {error.strerror}; allow changes of its folder."
            ) from error
