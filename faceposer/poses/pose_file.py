"""The file of a pose: weights of shapes by name, so that it fits every face with those shapes (docs/poses.md)."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from faceposer.errors import FacePoserError

FORMAT = "faceposer.pose"
VERSION = 1
#: Letters of a name, of a tag, and of a note.
LONGEST_NAME, LONGEST_NOTE = 80, 400
_MAX_BYTES = 1 << 20
_MAX_WEIGHTS, _MAX_TAGS = 2000, 32
_MAX_WEIGHT = 1e6
# Decimals of a weight: a hundred thousandth of a shape moves no point by a micrometre.
_DECIMALS = 6


@dataclass(frozen=True)
class Pose:
    """A named pose.

    Attributes:
        name: What people call it.
        weights: Weight of each shape by its name; shapes that are left out have 0.
        subject: Name of the subject that it was made on.
        tags: Words to find it by; "expression" and "viseme" also put it into the groups of these names.
        note: A sentence about it, or "".
    """

    name: str
    weights: Mapping[str, float] = field(default_factory=dict)
    subject: str = ""
    tags: tuple[str, ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", MappingProxyType(dict(self.weights)))

    def __hash__(self) -> int:
        return hash((self.name, self.subject, tuple(self.weights.items()), self.tags, self.note))

    def renamed(self, name: str) -> "Pose":
        """Return the pose under another name."""
        return replace(self, name=checked_name(name))

    def to_json(self) -> dict[str, Any]:
        """Return the pose as its file has it."""
        data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "name": self.name, "subject": self.subject}
        if self.tags:
            data["tags"] = list(self.tags)
        if self.note:
            data["note"] = self.note
        rounded = {name: round(float(weight), _DECIMALS) for name, weight in self.weights.items()}
        return data | {"weights": {name: weight for name, weight in rounded.items() if weight}}

    @classmethod
    def from_json(cls, data: Any) -> "Pose":
        """Return the pose that ``data`` describes.

        Raises:
            FacePoserError: If anything is unknown, missing or of the wrong kind, naming its place.
        """
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise FacePoserError(f'it is no pose: it lacks \'"format": "{FORMAT}"\'.')
        if data.get("version") != VERSION:
            raise FacePoserError(f"version is {_shown(data.get('version'))}; this program reads version {VERSION}.")
        unknown = sorted(set(data) - {"format", "version", "name", "subject", "tags", "note", "weights"})
        if unknown:
            raise FacePoserError(f"it has the unknown key {_shown(unknown[0])}.")
        tags, weights = data.get("tags", []), data.get("weights")
        if not isinstance(tags, list) or len(tags) > _MAX_TAGS or not all(_is_text(tag, LONGEST_NAME) for tag in tags):
            raise FacePoserError(f"tags must be a list of at most {_MAX_TAGS} words.")
        if not _is_text(data.get("subject", ""), LONGEST_NAME) or not _is_text(data.get("note", ""), LONGEST_NOTE):
            raise FacePoserError("subject and note must be short texts.")
        if not isinstance(weights, dict) or len(weights) > _MAX_WEIGHTS:
            raise FacePoserError(f"weights must be an object of at most {_MAX_WEIGHTS} numbers by the names of shapes.")
        for shape, weight in weights.items():
            number = isinstance(weight, (int, float)) and not isinstance(weight, bool)
            if not number or not -_MAX_WEIGHT <= weight <= _MAX_WEIGHT:
                raise FacePoserError(f"weights.{shape[:40]} must be a number, not {_shown(weight)}.")
        return cls(
            checked_name(data.get("name")),
            {shape: float(weight) for shape, weight in weights.items()},
            data.get("subject", ""),
            tuple(tags),
            data.get("note", ""),
        )


def checked_name(name: Any) -> str:
    """Return ``name`` without spaces around it.

    Raises:
        FacePoserError: If it is empty, too long, or no line of text.
    """
    text = name.strip() if isinstance(name, str) else ""
    if not text or not _is_text(text, LONGEST_NAME):
        raise FacePoserError(f"A pose needs a name of 1 to {LONGEST_NAME} letters on one line.")
    return text


def read_pose(path: Path) -> Pose:
    """Return the pose in the file ``path``.

    Raises:
        FacePoserError: If the file cannot be read or is not such a file, naming the place.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError("it is larger than 1 MB.")
        return Pose.from_json(json.loads(path.read_text(encoding="utf-8")))
    except FacePoserError as error:
        raise FacePoserError(f"The pose '{path}' cannot be used: {error}") from error
    except OSError as error:
        raise FacePoserError(f"The pose '{path}' cannot be read: {error.strerror}.") from error
    except (ValueError, RecursionError) as error:
        raise FacePoserError(f"The pose '{path}' is not valid JSON; save it again or delete it.") from error


def pose_text(pose: Pose) -> str:
    """Return the content of the file of ``pose``."""
    return json.dumps(pose.to_json(), indent=1, ensure_ascii=False) + "\n"


def _is_text(value: Any, longest: int) -> bool:
    return isinstance(value, str) and len(value) <= longest and (not value or value.isprintable())


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
