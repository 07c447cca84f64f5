"""Pointer events, tools and the toolbox that sends one to the other.

Gesture: a generator that reads from top to bottom: on press, on move, on release. The toolbox sends it the events; Esc
closes it, which rolls back the edit that it holds open, with no code in the tool.
"""

from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.picture_view import View
from faceposer.geometry.strokes import StrokeShape
from faceposer.session.session import Session
from faceposer.solve.constraints.stroke import StrokeEnergy
from faceposer.tools.symmetry import Symmetry

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
        point: Of the face that a press would take hold of, or None.
        position: Pixel in the view.
    """

    pin: int | None
    point: SurfacePoint | None
    position: tuple[float, float]

    @property
    def surface(self) -> bool:
        """Whether a press would take hold of the face."""
        return self.point is not None


class ToolContext(Protocol):
    """What tools need of their surroundings; the window gives it, and so do tests."""

    session: Session
    view: View
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

    def pick_many(self, pixels: ArrayLike) -> tuple[SurfacePoints, NDArray[np.bool_]]:
        """Return the points of the visible face under ``pixels``, shape (n, 2), and which of them meet it, (n,)."""
        ...

    def hidden(self, points: SurfacePoints) -> NDArray[np.bool_]:
        """Return which of ``points`` the face itself hides, shape (n,)."""
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


@dataclass
class ToolOptions:
    """What the user sets for the tools.

    Attributes:
        brush: Diameter of the stroke's brush in pixels at normal density.
        shape: Whether strokes are lines, closed lines or filled regions.
        energy: How strokes are compared.
        fix_brush: Diameter of the brush that paints fixed vertices.
        fix_mode: Whether fixed vertices are painted or encircled.
    """

    brush: float = 8.0
    shape: StrokeShape = "line"
    energy: StrokeEnergy = "distance"
    fix_brush: float = 36.0
    fix_mode: Literal["brush", "lasso"] = "brush"


@dataclass
class ToolSettings:
    """What the tools share: their options, the selection and symmetry."""

    options: ToolOptions = field(default_factory=ToolOptions)
    selection: Selection = field(default_factory=Selection)
    symmetry: Symmetry = field(default_factory=Symmetry)


class PosingTool:
    """A tool that the user chooses; what it has begun and not finished is its own, not the document's.

    Attributes:
        name: By which panels and keys refer to it.
        cursor: Name of the pointer's shape over the view; see ``faceposer.gui.cursors``.
        drag_cursor: Likewise during its gesture; "" for the same.
        drag_hint: What the mouse does during its gesture.
        handle_order: Of handles at the same place, that of the tool with the lowest is taken.
    """

    name = ""
    cursor = "press"
    drag_cursor = ""
    drag_hint = "Move: pull the face   ·   release: keep   ·   Esc: take back"
    handle_order = 9

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Share ``tool_settings`` with the other tools."""
        self._settings = tool_settings

    def hits_handle(self, event: PointerEvent, context: ToolContext) -> bool:
        """Whether the press ``event`` takes hold of a handle of this tool, which goes before what others would do."""
        return False

    def handle_under(self, position: tuple[float, float], context: ToolContext) -> int | None:
        """Return the constraint whose handle a press at ``position`` would take, or None."""
        return None

    @property
    def works_beside(self) -> bool:
        """Whether a press beside the face does something, too."""
        return False

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Whether the press ``event`` begins a gesture of this tool."""
        raise NotImplementedError

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Run the gesture that the press ``event`` begins."""
        raise NotImplementedError

    def remove_at(self, position: tuple[float, float], context: ToolContext) -> bool:
        """Remove what a right click at ``position`` means; return whether there was anything."""
        return False

    def _remove(self, index: int, label: str, context: ToolContext) -> None:
        """Remove constraint ``index``, with symmetry also what lies across, as the step ``label``."""
        self._settings.selection.set()
        context.session.remove_constraints(self._settings.symmetry.with_partners(context.session, {index}), label)

    def accept(self, context: ToolContext) -> bool:
        """Finish what was begun (Enter); return whether there was anything."""
        return False

    def step_back(self) -> bool:
        """Take back the last step of what was begun (undo); return whether there was anything."""
        return False

    def step_forward(self) -> bool:
        """Do again what ``step_back`` took back last (redo); return whether there was anything."""
        return False

    def follow_history(self, depth: int) -> None:
        """Note the depth of the session's history: what was begun at a greater one is undone with it."""

    def discard(self) -> bool:
        """Forget what was begun (Esc); return whether there was anything."""
        return False

    def hint(self, context: ToolContext) -> str:
        """Return what the mouse will do now."""
        raise NotImplementedError
