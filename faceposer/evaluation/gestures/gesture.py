"""Gestures as data: drags and strokes, with limits on their effects."""

from dataclasses import dataclass
from typing import Literal

from faceposer.geometry.camera import ViewName

#: Reference height of a head from chin to crown, in centimetres; millimetres on other heads are scaled to it.
HEAD_HEIGHT = 17.5
#: "arkit" for characters with ARKit's shapes, "modes" for those with modes from examples.
Kind = Literal["arkit", "modes"]


@dataclass(frozen=True)
class Pull:
    """A drag of the Point tool, from the current position of a place to an offset from its neutral position.

    Attributes:
        place: An MPEG-4 feature point ("8.3"), or a region ("forehead"), which is dragged at its front.
        right: Offset to the right of the image, in millimetres; in the front view, the character's left.
        up: Offset upwards in the image, in millimetres.
        view: View of the drag.
        both: True for a drag with *Symmetry* on.
        onto: Place whose current position replaces the neutral position, or None.
    """

    place: str
    right: float = 0.0
    up: float = 0.0
    view: ViewName = "front"
    both: bool = False
    onto: str | None = None

    @property
    def places(self) -> tuple[str, ...]:
        """Places that the character must have."""
        return (self.place,) if self.onto is None else (self.place, self.onto)


@dataclass(frozen=True)
class Paint:
    """A stroke over the places ``along``, followed by its target.

    Attributes:
        along: Feature points along the stroke, from end to end.
        narrower: Width of the target as a share of the width of the source, around the same centre.
        up: Offset of the target upwards, in millimetres.
        view: View of the stroke.
    """

    along: tuple[str, ...]
    narrower: float = 1.0
    up: float = 0.0
    view: ViewName = "front"

    @property
    def places(self) -> tuple[str, ...]:
        """Places that the character must have."""
        return self.along


Action = Pull | Paint


@dataclass(frozen=True)
class Limit:
    """A bound on a measure of the face after a gesture; exactly one of the two bounds is given.

    Attributes:
        unit: A weight of ARKit's shapes ("eyeBlinkLeft", or "eyeBlink" for both sides), or a measure of
            ``faceposer.evaluation.gestures.measures`` ("brow_inner_left_up", or "brow_inner_up" for both sides).
        at_least: Lower bound, for what must move.
        at_most: Upper bound, for what must not move.
    """

    unit: str
    at_least: float | None = None
    at_most: float | None = None

    def __post_init__(self) -> None:
        if (self.at_least is None) == (self.at_most is None):
            raise ValueError(f"the limit of '{self.unit}' needs one of at_least and at_most")

    def holds(self, value: float) -> bool:
        """Return True if ``value`` satisfies the limit."""
        return value >= self.at_least if self.at_least is not None else value <= self.at_most  # type: ignore[operator]

    def missed_by(self, value: float) -> float:
        """Return the excess of ``value`` beyond the limit, 0 if it holds."""
        return max(self.at_least - value if self.at_least is not None else value - self.at_most, 0.0)  # type: ignore[operator]


@dataclass(frozen=True)
class Gesture:
    """Actions of an artist on the neutral face, with the expected effects.

    Attributes:
        name: Name in rows, files and the command line.
        title: Display name.
        actions: Actions in order; a drag with *Symmetry* is one action.
        concerned: Regions that may move ("brow" for both sides); motion elsewhere counts as spill.
        limits: Limits on the measures of the face.
        other_side: Largest motion of the mirror image of the pulled place, as a share of its own; None for no limit.
        spill_mm: Largest motion of skin outside the regions concerned, in millimetres; None for no limit.
        residual: Largest remaining share of a pull; None for places that can hardly move.
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
        """View of the first action."""
        return self.actions[0].view


def least(unit: str, value: float) -> Limit:
    """Return a lower limit: ``unit`` is at least ``value``."""
    return Limit(unit, at_least=value)


def most(unit: str, value: float) -> Limit:
    """Return an upper limit: ``unit`` is at most ``value``."""
    return Limit(unit, at_most=value)
