"""Steps of the guided pose: five steps to a first smile, each complete when its effect is observed."""

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

# Fractions of the head's height: distance within which a point holds a place, and rise of a place.
_NEAR = 0.06
_RISE = 0.006
# Rotation of the view in radians.
_TURN = math.radians(6.0)
_PRESETS = tuple((math.radians(yaw), math.radians(pitch)) for yaw, pitch in VIEW_ANGLES.values())

Direction = tuple[float, float]


@dataclass(frozen=True)
class Step:
    """One step of the guided pose.

    Attributes:
        name: Identifier of the step.
        title: Instruction, in which ``{undo}`` stands for the key of the action "undo", and so on.
        text: Explanation, with the same placeholders.
        place: Feature point to press on, or "".
        pull: Direction to drag from there: x to the character's left, y up.
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
        "Press on it and drag. The rest of the face follows.",
        "8.3",
        (0.45, 0.9),
    ),
    Step(
        "brow",
        "Raise a brow",
        "Drag it up as well. The point at the mouth keeps the smile.",
        "4.3",
        (0.0, 1.0),
    ),
    Step(
        "orbit",
        "Drag next to the face to orbit",
        "{view-front} returns to the front view, {compare} shows the neutral face.",
    ),
    Step(
        "undo",
        "Undo with {undo}",
        "It undoes one drag at a time; {redo} redoes it.",
    ),
    Step(
        "save",
        "Save the mesh with {export}",
        "The posed face is saved as OBJ, which any 3D program can open.",
    ),
)
CLOSING_TEXT = "That is all. {keys} lists the keys, {palette} finds any command."


@dataclass(frozen=True)
class Observation:
    """State of the editor from which completed steps are recognised.

    Attributes:
        session: The edited session; another session starts from another pose.
        heights: Height of each place, in fractions of the head's height.
        held: Places that a point constraint holds.
        direction: Yaw and pitch of the view in radians.
        can_redo: True if a step has been undone.
        meshes_saved: Number of meshes saved so far.
    """

    session: object
    heights: Mapping[str, float]
    held: frozenset[str]
    direction: Direction
    can_redo: bool
    meshes_saved: int


@dataclass
class Guide:
    """Progress through the steps.

    Attributes:
        done: Names of the completed steps.
    """

    done: set[StepName] = field(default_factory=set)
    _last: Observation | None = None
    _lowest: dict[str, float] = field(default_factory=dict)
    _start_direction: Direction = (0.0, 0.0)

    @property
    def current(self) -> Step | None:
        """The first step that is not completed, or None at the end."""
        return next((step for step in STEPS if step.name not in self.done), None)

    def update(self, observed: Observation) -> bool:
        """Update the progress while no gesture is in progress; return True if another step was completed."""
        last, self._last = self._last, observed
        if last is None or last.session is not observed.session:
            self._lowest, self._start_direction = dict(observed.heights), observed.direction
            return False
        before = len(self.done)
        if self._has_risen(observed, MOUTH_CORNERS):
            self.done.add("smile")
        if self._has_risen(observed, BROWS):
            self.done.add("brow")
        if self._has_turned(observed.direction):
            self.done.add("orbit")
        if observed.can_redo and not last.can_redo:
            self.done.add("undo")
        if observed.meshes_saved > last.meshes_saved:
            self.done.add("save")
        for name, height in observed.heights.items():
            self._lowest[name] = min(self._lowest.get(name, height), height)
        return len(self.done) > before

    def _has_risen(self, observed: Observation, places: tuple[str, ...]) -> bool:
        """Return True if a point holds one of ``places`` above its lowest height so far."""
        return any(
            observed.heights[name] - self._lowest.get(name, math.inf) > _RISE
            for name in places
            if name in observed.held
        )

    def _has_turned(self, direction: Direction) -> bool:
        """Return True if the view was turned by a drag, as opposed to the preset views of keys and buttons."""
        if any(math.isclose(direction[0], yaw) and math.isclose(direction[1], pitch) for yaw, pitch in _PRESETS):
            self._start_direction = direction
            return False
        turn = math.remainder(direction[0] - self._start_direction[0], 2.0 * math.pi)
        return math.hypot(turn, direction[1] - self._start_direction[1]) > _TURN


def feature_heights(session: Session) -> tuple[dict[str, float], frozenset[str]]:
    """Return the height of each place of the guide in the pose of ``session``, and the places that its points hold.

    A character without feature points has no places; the user can skip the steps that need them.
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
