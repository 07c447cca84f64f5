"""Events of the window: pointer, keys, dropped files, and changes of the window itself."""

from dataclasses import dataclass
from typing import Literal

from faceposer.tools.tool import Button

Modifiers = frozenset[str]
PointerKind = Literal["press", "release", "move", "wheel", "leave"]


@dataclass(frozen=True)
class Pointer:
    """A movement of the mouse, a button or the wheel; the position is in window units from the top left."""

    kind: PointerKind
    position: tuple[float, float]
    button: Button | None
    modifiers: Modifiers
    time: float
    wheel: float = 0.0


@dataclass(frozen=True)
class Key:
    """The press, repetition or release of a key; letters follow the keyboard layout."""

    kind: Literal["press", "repeat", "release"]
    key: str
    modifiers: Modifiers
    time: float


@dataclass(frozen=True)
class Drop:
    """Files dropped onto the window."""

    paths: tuple[str, ...]


@dataclass(frozen=True)
class FocusLost:
    """Loss of the keyboard focus; later releases may not arrive."""


@dataclass(frozen=True)
class CloseRequest:
    """A request to close the window."""


@dataclass(frozen=True)
class Changed:
    """A change of size or scale, or a request to redraw."""


Event = Pointer | Key | Drop | FocusLost | CloseRequest | Changed
