"""Pose files: shape weights by name, which fit every character with these shapes (docs/poses.md)."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from msgspec import Meta

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.json_documents import JsonDocument, JsonError, check_header, convert, read_json
from faceposer.files.writing import json_text

FORMAT = "faceposer.pose"
VERSION = 1
#: Maximum number of characters of a name or a tag, and of a note.
LONGEST_NAME, LONGEST_NOTE = 80, 400
_MAX_WEIGHTS, _MAX_TAGS = 2000, 32
_MAX_WEIGHT = 1e6
# Decimals of a weight: the rounding error of 1e-6 of a shape is far below a micrometre.
_DECIMALS = 6

_Weight = Annotated[float, Meta(ge=-_MAX_WEIGHT, le=_MAX_WEIGHT)]
_Word = Annotated[str, Meta(max_length=LONGEST_NAME, title="words")]


class _PoseFile(JsonDocument, kw_only=True):
    name: Any = None
    weights: Annotated[dict[str, _Weight], Meta(max_length=_MAX_WEIGHTS)]
    subject: _Word = ""
    tags: Annotated[tuple[_Word, ...], Meta(max_length=_MAX_TAGS)] = ()
    note: Annotated[str, Meta(max_length=LONGEST_NOTE)] = ""

    def __post_init__(self) -> None:
        texts = {"subject": self.subject, "note": self.note} | {f"tags[{i}]": tag for i, tag in enumerate(self.tags)}
        for key, text in texts.items():
            if not text.isprintable():
                raise JsonError("must be a single line of printable characters", key)


@dataclass(frozen=True)
class Pose:
    """A named pose.

    Attributes:
        name: Displayed name.
        weights: Weight of each shape by its name; missing shapes have weight 0.
        character: Name of the character that it was made on.
        tags: Search terms; "expression" and "viseme" also assign it to these groups.
        note: A sentence about it, or "".
    """

    name: str
    weights: Mapping[str, float] = field(default_factory=dict)
    character: str = ""
    tags: tuple[str, ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", MappingProxyType(dict(self.weights)))

    def __hash__(self) -> int:
        return hash((self.name, self.character, tuple(self.weights.items()), self.tags, self.note))

    def renamed(self, name: str) -> "Pose":
        """Return the pose under another name."""
        return replace(self, name=checked_name(name))

    def to_json(self) -> dict[str, Any]:
        """Return the pose as written in a file."""
        data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "name": self.name, "subject": self.character}
        if self.tags:
            data["tags"] = list(self.tags)
        if self.note:
            data["note"] = self.note
        rounded = {name: round(float(weight), _DECIMALS) for name, weight in self.weights.items()}
        return data | {"weights": {name: weight for name, weight in rounded.items() if weight}}

    @classmethod
    def from_json(cls, data: Any) -> "Pose":
        """Return the pose described by ``data``.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; the message names it.
        """
        check_header(data, FORMAT, VERSION)
        form = convert(data, _PoseFile)
        return cls(checked_name(form.name), form.weights, form.subject, form.tags, form.note)


def checked_name(name: Any) -> str:
    """Return ``name`` without surrounding spaces.

    Raises:
        FacePoserError: If it is empty, too long, or not a single line of printable text.
    """
    text = name.strip() if isinstance(name, str) else ""
    if not 0 < len(text) <= LONGEST_NAME or not text.isprintable():
        raise FacePoserError(f"The name of a pose must be a single line of 1 to {LONGEST_NAME} characters.")
    return text


def read_pose(path: Path) -> Pose:
    """Return the pose in the file ``path``.

    Raises:
        FacePoserError: If the file cannot be read or is not a pose file; the message names the place.
    """
    return read_json(path, "pose", Pose.from_json)


def write_pose(path: Path, pose: Pose, durable: bool = True) -> None:
    """Write ``pose`` to ``path``, whose folder is created if necessary; for ``durable`` see ``atomic_file``.

    Raises:
        FacePoserError: If a weight is not finite, or the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FacePoserError(f"The pose '{path}' cannot be written: {error.strerror}.") from error
    write_text(path, pose_text(path, pose), "pose", durable)


def pose_text(path: Path, pose: Pose) -> str:
    """Return the text of the file ``path`` of ``pose``.

    Raises:
        FacePoserError: If a weight is not finite.
    """
    return json_text(path, pose.to_json(), "pose", ascii_only=False) + "\n"
