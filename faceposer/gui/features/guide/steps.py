"""The guided pose: five steps to a first smile, each done when the user has really done it, by whatever way."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from faceposer.geometry.camera import VIEW_ANGLES
from faceposer.geometry.picking import surface_positions
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint

StepName = Literal["smile", "brow", "orbit", "undo", "save"]

# MPEG-4 feature points: the corners of the mouth, and each brow from its inner to its outer end.
MOUTH_CORNERS = ("8.3", "8.4")
BROWS = ("4.1", "4.2", "4.3", "4.4", "4.5", "4.6")

# Shares of the head's height: how near a point must lie to hold a place, and how far that place must rise.
_NEAR = 0.06
_RISE = 0.006
# Radians by which the view must turn.
_TURN = math.radians(6.0)
_PRESETS = tuple((math.radians(yaw), math.radians(pitch)) for yaw, pitch in VIEW_ANGLES.values())

Direction = tuple[float, float]


@dataclass(frozen=True)
class Step:
    """One thing to try.

    Attributes:
        name: By which the program knows it.
        title: What to do; ``{undo}`` stands for the key of the action "undo", and so on.
        text: More about it, likewise.
        place: Feature point to press on, or "".
        pull: Where to drag from there: x to the character's left, y up.
    """

    name: StepName
    title: str
    text: str
    place: str = ""
    pull: tuple[float, float] = (0.0, 0.0)


STEPS = (
    Step(
        "smile",
        "Drag a corner of the mouth up",
        "Press on it and pull. The rest of the face follows.",
        "8.3",
        (0.45, 0.9),
    ),
    Step(
        "brow",
        "Raise a brow",
        "Drag it up as well. The smile stays, for its point holds it.",
        "4.3",
        (0.0, 1.0),
    ),
    Step(
        "orbit",
        "Drag beside the face to orbit",
        "{view-front} looks from the front again, {compare} compares with the neutral face.",
    ),
    Step(
        "undo",
        "Undo with {undo}",
        "It takes back one drag at a time; {redo} does it again.",
    ),
    Step(
        "save",
        "Save the mesh with {export}",
        "The posed face as OBJ, which any 3D program opens.",
    ),
)
LAST_WORDS = "That is all. {keys} shows the keys, {palette} everything else."


@dataclass(frozen=True)
class Seen:
    """What the guide goes by.

    Attributes:
        session: What is edited; another one begins with another pose.
        heights: How high each of the places is, in shares of the head's height.
        held: Those of the places that a point holds.
        direction: Yaw and pitch of the view, radians.
        can_redo: Whether something has been undone.
        meshes_saved: How often a mesh has been saved.
    """

    session: object
    heights: Mapping[str, float]
    held: frozenset[str]
    direction: Direction
    can_redo: bool
    meshes_saved: int


@dataclass
class Guide:
    """Knows which steps are done.

    Attributes:
        done: Names of the steps that are.
    """

    done: set[StepName] = field(default_factory=set)
    _last: Seen | None = None
    _lowest: dict[str, float] = field(default_factory=dict)
    _from: Direction = (0.0, 0.0)

    @property
    def current(self) -> Step | None:
        """The first step that is not done, or None at the end."""
        return next((step for step in STEPS if step.name not in self.done), None)

    def follow(self, seen: Seen) -> bool:
        """Take note of what is ``seen`` while no gesture is under way; return whether another step is done."""
        last, self._last = self._last, seen
        if last is None or last.session is not seen.session:
            self._lowest, self._from = dict(seen.heights), seen.direction
            return False
        before = len(self.done)
        if self._risen(seen, MOUTH_CORNERS):
            self.done.add("smile")
        if self._risen(seen, BROWS):
            self.done.add("brow")
        if self._turned(seen.direction):
            self.done.add("orbit")
        if seen.can_redo and not last.can_redo:
            self.done.add("undo")
        if seen.meshes_saved > last.meshes_saved:
            self.done.add("save")
        for name, height in seen.heights.items():
            self._lowest[name] = min(self._lowest.get(name, height), height)
        return len(self.done) > before

    def _risen(self, seen: Seen, places: tuple[str, ...]) -> bool:
        """Whether one of ``places`` is held by a point, higher than the guide has seen it."""
        return any(
            seen.heights[name] - self._lowest.get(name, math.inf) > _RISE for name in places if name in seen.held
        )

    def _turned(self, direction: Direction) -> bool:
        """Whether the view was turned by hand: keys and buttons lead to the directions that have names."""
        if any(math.isclose(direction[0], yaw) and math.isclose(direction[1], pitch) for yaw, pitch in _PRESETS):
            self._from = direction
            return False
        turn = math.remainder(direction[0] - self._from[0], 2.0 * math.pi)
        return math.hypot(turn, direction[1] - self._from[1]) > _TURN


def places_of(session: Session) -> tuple[dict[str, float], frozenset[str]]:
    """Return how high each place of the guide is in the pose of ``session``, and which of them its points hold.

    A character without feature points has no places: there the steps that need them are left to the user to skip.
    """
    character = session.model.character
    names = [name for name in (*MOUTH_CORNERS, *BROWS) if name in character.feature_points]
    if not names:
        return {}, frozenset()
    indices = [character.feature_points[name] for name in names]
    heights = session.vertices[indices, 1] / character.height
    held: set[str] = set()
    pins = [c.anchor for c in session.document.constraints if isinstance(c, PointConstraint) and c.enabled]
    if pins:
        positions = surface_positions(character.vertices, session.model.triangles, pins)
        distances = np.linalg.norm(character.vertices[indices][:, None] - positions[None], axis=2)
        near = distances.min(axis=1) < _NEAR * character.height
        held = {name for name, is_near in zip(names, near.tolist(), strict=True) if is_near}
    return dict(zip(names, heights.tolist(), strict=True)), frozenset(held)
