"""Gestures as data: what the hand pulls or paints, what must move with it and what must not."""

from dataclasses import dataclass
from typing import Literal

from faceposer.geometry.camera import ViewName

#: Millimetres are those of a head of this height from the chin to the crown, in centimetres; others are scaled to it.
HEAD_HEIGHT = 17.5
#: "arkit" where the character has ARKit's shapes, "modes" where it has modes of its own.
Kind = Literal["arkit", "modes"]


@dataclass(frozen=True)
class Pull:
    """One drag of the Point tool, from where a place lies by then to a distance from where it lies at rest.

    Attributes:
        place: An MPEG-4 feature point ("8.3"), or a region ("forehead"), which is taken hold of at its front.
        right: Millimetres to the right of the picture, which from the front is the character's left.
        up: Millimetres upwards in the picture.
        view: From where the artist looks.
        both: With *Symmetry* on.
        onto: Another place; if given, the drag goes to where that lies by then, and from there by ``right`` and ``up``.
    """

    place: str
    right: float = 0.0
    up: float = 0.0
    view: ViewName = "front"
    both: bool = False
    onto: str | None = None

    @property
    def places(self) -> tuple[str, ...]:
        """What the character must have."""
        return (self.place,) if self.onto is None else (self.place, self.onto)


@dataclass(frozen=True)
class Paint:
    """One stroke: the places under ``along`` are painted, then where they should be.

    Attributes:
        along: Feature points that the brush passes, from end to end.
        narrower: The target's width as a share of the source's, about the same middle.
        up: Millimetres by which the target lies higher.
        view: From where the artist looks.
    """

    along: tuple[str, ...]
    narrower: float = 1.0
    up: float = 0.0
    view: ViewName = "front"

    @property
    def places(self) -> tuple[str, ...]:
        """What the character must have."""
        return self.along


Action = Pull | Paint


@dataclass(frozen=True)
class Limit:
    """A bound on a measure of the face that a gesture leaves; exactly one of both is given.

    Attributes:
        unit: A weight of ARKit's shapes ("eyeBlinkLeft", or "eyeBlink" for the sides), or a measure of
            ``faceposer.evaluation.gestures.measures`` ("brow_inner_left_up", or "brow_inner_up" for the sides).
        at_least: What must move.
        at_most: What must not.
    """

    unit: str
    at_least: float | None = None
    at_most: float | None = None

    def __post_init__(self) -> None:
        if (self.at_least is None) == (self.at_most is None):
            raise ValueError(f"the limit of '{self.unit}' needs one of at_least and at_most")

    def holds(self, value: float) -> bool:
        """Whether ``value`` keeps the limit."""
        return value >= self.at_least if self.at_least is not None else value <= self.at_most  # type: ignore[operator]

    def missed_by(self, value: float) -> float:
        """Return how far ``value`` is beyond the limit, 0 where it holds."""
        return max(self.at_least - value if self.at_least is not None else value - self.at_most, 0.0)  # type: ignore[operator]


@dataclass(frozen=True)
class Gesture:
    """What an artist does from the neutral face, and what the face should do.

    Attributes:
        name: By which rows, files and the command line refer to it.
        title: For people.
        actions: In the order in which they are done; a drag with *Symmetry* is one.
        concerned: Regions that may move ("brow" for both sides); what else moves counts as spill.
        limits: What must move and what must not.
        other_side: Greatest share of the pulled place's motion that its mirror image may have, or None if unlimited.
        spill_mm: Greatest motion of skin outside the regions concerned, or None if unlimited.
        residual: Greatest share of a pull that may remain, or None for places that can hardly move.
    """

    name: str
    title: str
    actions: tuple[Action, ...]
    concerned: tuple[str, ...]
    limits: tuple[Limit, ...] = ()
    other_side: float | None = None
    spill_mm: float | None = None
    residual: float | None = 0.35

    @property
    def view(self) -> ViewName:
        """From where the first action is seen."""
        return self.actions[0].view


def least(unit: str, value: float) -> Limit:
    """Return the limit that ``unit`` moves by ``value`` or more."""
    return Limit(unit, at_least=value)


def most(unit: str, value: float) -> Limit:
    """Return the limit that ``unit`` moves by ``value`` or less."""
    return Limit(unit, at_most=value)
