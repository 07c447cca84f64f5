"""Pointer events and the base classes of tools.

Gesture: a generator that reads from top to bottom: on press, on move, on release. The toolbox sends it the events; Esc
closes it, which rolls back its open edit without any code in the tool.
"""

from collections import OrderedDict
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.picture_view import View
from faceposer.geometry.strokes import StrokeShape
from faceposer.model.character import Character
from faceposer.session.document import Document
from faceposer.session.effort import check_effort
from faceposer.session.session import Session
from faceposer.solve.constraints.stroke import StrokeEnergy
from faceposer.tools.symmetry import Symmetry

# Number of removals whose selection undo restores.
_MOST_REMOVALS = 100

EventKind = Literal["press", "move", "release", "hover", "wheel"]
Button = Literal["left", "middle", "right"]
Navigation = Literal["blender", "maya"]


@dataclass(frozen=True)
class PointerEvent:
    """An event of the mouse or the pen.

    Attributes:
        kind: "move" with a button held, "hover" without.
        position: Pixel in the view, from its top left corner.
        button: Button that was pressed or released, or is held.
        modifiers: Held modifier keys: "shift", "ctrl" and "alt".
        time: Seconds on a monotonic clock.
        pressure: Pressure of the pen, 0 to 1; 1 for a mouse.
        wheel: Notches of the wheel, positive away from the user.
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
    """The object under the pointer: a pin, a point of the face, or neither.

    Attributes:
        pin: Index of the constraint whose handle a press would grab, or None.
        point: Point of the face that a press would hit, or None.
        position: Pixel in the view.
    """

    pin: int | None
    point: SurfacePoint | None
    position: tuple[float, float]

    @property
    def surface(self) -> bool:
        """True if a press would hit the face."""
        return self.point is not None


class ToolContext(Protocol):
    """Environment of the tools, provided by the window and by tests."""

    session: Session
    view: View
    size: tuple[int, int]
    ui_scale: float
    navigation: Navigation

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        ...

    @property
    def unmarked(self) -> frozenset[int]:
        """Constraints whose marks the user has hidden; their handles cannot be grabbed."""
        ...

    def pick(self, pixel: tuple[float, float]) -> SurfacePoint | None:
        """Return the point of the visible face under ``pixel``, or None."""
        ...

    def pick_many(self, pixels: ArrayLike) -> tuple[SurfacePoints, NDArray[np.bool_]]:
        """Return the points of the visible face under ``pixels``, shape (n, 2), and a mask of the hits, (n,)."""
        ...

    def hidden(self, points: SurfacePoints) -> NDArray[np.bool_]:
        """Return a mask of the ``points`` that are hidden by the face, shape (n,)."""
        ...

    def notify(self, text: str) -> None:
        """Show ``text`` to the user for a few seconds."""
        ...


class Tool(Protocol):
    """A translation of one kind of gesture into edits."""

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` starts a gesture of this tool."""
        ...

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Return the gesture that the press ``event`` starts."""
        ...


class Selection:
    """The selected constraints, by index."""

    def __init__(self) -> None:
        self.indices: frozenset[int] = frozenset()
        self._before: OrderedDict[int, tuple[object, frozenset[int]]] = OrderedDict()

    def before_removal(self, constraints: object) -> None:
        """Keep the selection among ``constraints``, of which some are about to be removed, and deselect."""
        self._before[id(constraints)] = (constraints, self.indices)
        while len(self._before) > _MOST_REMOVALS:
            self._before.popitem(last=False)
        self.set()

    def return_to(self, constraints: object) -> None:
        """Select what was selected when some of the same ``constraints`` were removed, after undo."""
        known, indices = self._before.get(id(constraints), (None, frozenset[int]()))
        if known is constraints:
            self.indices = indices

    def toggle(self, index: int) -> None:
        """Add or remove ``index``."""
        self.indices ^= {index}

    def set(self, *indices: int) -> None:
        """Select only ``indices``."""
        self.indices = frozenset(indices)

    def within(self, count: int) -> frozenset[int]:
        """Return the selected indices below ``count``; undo may have removed some constraints."""
        return frozenset(i for i in self.indices if i < count)


@dataclass
class ToolOptions:
    """User settings of the tools.

    Attributes:
        brush: Diameter of the stroke's brush in pixels at normal density.
        shape: Shape of strokes: lines, closed lines or filled regions.
        energy: Measure of the difference between strokes.
        fix_brush: Diameter of the brush for fixed vertices.
        fix_mode: "brush" to paint fixed vertices, "lasso" to encircle them.
    """

    brush: float = 8.0
    shape: StrokeShape = "line"
    energy: StrokeEnergy = "distance"
    fix_brush: float = 36.0
    fix_mode: Literal["brush", "lasso"] = "brush"


@dataclass
class ToolSettings:
    """State shared by the tools: their options, the selection and symmetry."""

    options: ToolOptions = field(default_factory=ToolOptions)
    selection: Selection = field(default_factory=Selection)
    symmetry: Symmetry = field(default_factory=Symmetry)


class PosingTool:
    """A tool that the user can choose; an unfinished edit belongs to the tool, not to the document.

    Attributes:
        name: Name in the program, for actions and settings.
        label: Name in the window.
        key: Its key by default; "" for none.
        help: Purpose, in the imperative, for menus and tooltips.
        empty_text: Text of the empty list of constraints while the tool is chosen.
        cursor: Name of the mouse cursor over the view; see ``faceposer.gui.cursors``.
        drag_cursor: Mouse cursor during its gesture; "" for the same.
        drag_hint: Effect of the mouse during its gesture, for the status bar.
        handle_hint: Effect of the mouse on a handle of the tool, for the status bar.
        handle_order: Priority among handles at the same place; the lowest is grabbed.
        edited_by_points: True if the point tool edits and removes its constraints by their handles, too.
        traces_photos: True if it is used to draw over photos, so that its options are shown beside them, too.
    """

    name = ""
    label = ""
    key = ""
    help = ""
    empty_text = ""
    cursor = "press"
    drag_cursor = ""
    drag_hint = "Move: pull the face   ·   release: confirm   ·   Esc: cancel"
    handle_hint = "Drag: edit the constraint   ·   right click: remove it"
    handle_order = 9
    edited_by_points = True
    traces_photos = False

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use ``tool_settings``, which are shared with the other tools."""
        self._settings = tool_settings

    def hits_handle(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` hits a handle of this tool, which precedes the actions of others."""
        return False

    def handle_under(self, position: tuple[float, float], context: ToolContext) -> int | None:
        """Return the constraint whose handle would be grabbed by a press at ``position``, or None."""
        return None

    def usable(self, character: Character) -> bool:
        """Return True if the tool applies to ``character``."""
        return True

    def held(self, session: Session) -> str:
        """Return why the tool cannot be used in ``session`` at present, one sentence, or ""."""
        return ""

    @property
    def can_accept(self) -> bool:
        """True if ``accept`` finishes an edit."""
        return False

    @property
    def can_step_back(self) -> bool:
        """True if ``step_back`` reverts a step of an unfinished edit."""
        return False

    @property
    def can_step_forward(self) -> bool:
        """True if ``step_forward`` repeats a step."""
        return False

    @property
    def works_off_face(self) -> bool:
        """True if a press off the face has an effect as well."""
        return False

    def works_at(self, position: tuple[float, float], context: ToolContext) -> bool:
        """Return True if a press at ``position`` off the face has an effect as well."""
        return self.works_off_face

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` starts a gesture of this tool."""
        raise NotImplementedError

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Return the gesture that the press ``event`` starts."""
        raise NotImplementedError

    def remove_at(self, position: tuple[float, float], context: ToolContext) -> bool:
        """Remove the object under a right click at ``position``; return True if there was one."""
        return False

    def _remove(self, index: int, label: str, context: ToolContext) -> None:
        """Remove constraint ``index`` as the step ``label``, with symmetry also its partner."""
        self._settings.selection.before_removal(context.session.document.constraints)
        context.session.remove_constraints(self._settings.symmetry.with_partners(context.session, {index}), label)

    def _has_room(self, document: Document, noun: str, context: ToolContext) -> bool:
        """Return True if ``document``, with a new ``noun``, can be opened again; otherwise say that it is not kept."""
        try:
            check_effort(document.constraints)
        except FacePoserError:
            context.notify(f"The {noun} is not kept: the session has too many strokes, or they cover too many pixels")
            return False
        return True

    def accept(self, context: ToolContext) -> bool:
        """Finish the current edit (Enter); return True if there was one."""
        return False

    def step_back(self) -> bool:
        """Revert the last step of the current edit (undo); return True if there was one."""
        return False

    def step_forward(self) -> bool:
        """Repeat the step last reverted by ``step_back`` (redo); return True if there was one."""
        return False

    def follow_history(self, depth: int) -> None:
        """Record the depth of the session's history; edits begun at a greater depth are undone with it."""

    def discard(self) -> bool:
        """Discard the current edit (Esc); return True if there was one."""
        return False

    def left(self) -> None:
        """Discard the current edit, since another tool is chosen."""
        self.discard()

    def hint(self, context: ToolContext) -> str:
        """Return the effect of the mouse, for the status bar."""
        raise NotImplementedError
