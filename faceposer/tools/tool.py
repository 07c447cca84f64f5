"""Pointer events, tools and the toolbox that sends one to the other.

Gesture: a generator that reads from top to bottom: on press, on move, on release. The toolbox sends it the events; Esc
closes it, which rolls back the edit that it holds open, with no code in the tool.
"""

from collections.abc import Generator
from dataclasses import dataclass
from typing import Literal, Protocol

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoint
from faceposer.session.session import Session

EventKind = Literal["press", "move", "release", "hover", "wheel"]
Button = Literal["left", "middle", "right"]
Navigation = Literal["blender", "maya"]


@dataclass(frozen=True)
class PointerEvent:
    """What the mouse or the pen did.

    Attributes:
        kind: "move" is a move with a button held, "hover" one without.
        position: Pixel in the view, from its top left.
        button: The button that was pressed or released, or is held.
        modifiers: Of "shift", "ctrl" and "alt", those held.
        time: Seconds on any clock that only rises.
        pressure: Of the pen, 0 to 1; 1 for a mouse.
        wheel: Notches turned away from the user.
    """

    kind: EventKind
    position: tuple[float, float]
    button: Button | None = None
    modifiers: frozenset[str] = frozenset()
    time: float = 0.0
    pressure: float = 1.0
    wheel: float = 0.0


Gesture = Generator[None, PointerEvent, None]


@dataclass(frozen=True)
class Hover:
    """What lies under the pointer: a pin, a place on the face, or neither.

    Attributes:
        pin: Index of the constraint, or None.
        surface: Whether a press would take hold of the face.
        position: Pixel in the view.
    """

    pin: int | None
    surface: bool
    position: tuple[float, float]


class ToolContext(Protocol):
    """What tools need of their surroundings; the window gives it, and so do tests."""

    session: Session
    view: OrbitView
    size: tuple[int, int]
    ui_scale: float
    navigation: Navigation

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        ...

    def pick(self, pixel: tuple[float, float]) -> SurfacePoint | None:
        """Return the point of the visible face under ``pixel``, or None."""
        ...


class Tool(Protocol):
    """Turns one kind of gesture into edits."""

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Whether the press ``event`` begins a gesture of this tool."""
        ...

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Run the gesture that the press ``event`` begins."""
        ...


class Selection:
    """The constraints that are selected, by index."""

    def __init__(self) -> None:
        self.indices: frozenset[int] = frozenset()

    def toggle(self, index: int) -> None:
        """Add ``index``, or take it out."""
        self.indices ^= {index}

    def set(self, *indices: int) -> None:
        """Select just ``indices``."""
        self.indices = frozenset(indices)

    def within(self, count: int) -> frozenset[int]:
        """Return the selected indices below ``count``: an undo may have taken some constraints away."""
        return frozenset(i for i in self.indices if i < count)
