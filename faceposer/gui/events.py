"""What happens to the window: the pointer, keys, dropped files, and the window itself."""

from dataclasses import dataclass
from typing import Literal

from faceposer.tools.tool import Button

Modifiers = frozenset[str]
PointerKind = Literal["press", "release", "move", "wheel", "leave"]


@dataclass(frozen=True)
class Pointer:
    """The mouse moved, or a button or the wheel did; the position is in window units from the top left."""

    kind: PointerKind
    position: tuple[float, float]
    button: Button | None
    modifiers: Modifiers
    time: float
    wheel: float = 0.0


@dataclass(frozen=True)
class Key:
    """A key went down, repeats or came up; letters are those of the user's layout."""

    kind: Literal["press", "repeat", "release"]
    key: str
    modifiers: Modifiers
    time: float


@dataclass(frozen=True)
class Drop:
    """Files were dropped onto the window."""

    paths: tuple[str, ...]


@dataclass(frozen=True)
class FocusLost:
    """Another window has the keyboard now; releases may not arrive here any more."""


@dataclass(frozen=True)
class CloseRequest:
    """The user wants the window closed."""


@dataclass(frozen=True)
class Changed:
    """The window has another size or scale, or needs to be drawn again."""


Event = Pointer | Key | Drop | FocusLost | CloseRequest | Changed
