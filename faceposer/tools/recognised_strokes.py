"""What the recognition of strokes has found, kept while a session is edited."""

from collections import OrderedDict
from dataclasses import dataclass

from faceposer.sketch.recognition import Candidate, DrawnStroke
from faceposer.solve.constraints.sketch import SketchConstraint

# Number of strokes whose candidates are kept.
_MOST_STROKES = 500


@dataclass(frozen=True, eq=False)
class UnnamedStroke:
    """A stroke that depicts no feature.

    Attributes:
        stroke: The stroke.
        candidates: Features that it may depict, the most probable first.
    """

    stroke: DrawnStroke
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True, eq=False)
class _Known:
    candidates: tuple[Candidate, ...]
    replaced: tuple[SketchConstraint, ...]


class RecognisedStrokes:
    """What the recognition of each stroke has found, and what the stroke has replaced; undo does not change it."""

    def __init__(self) -> None:
        self._known: OrderedDict[object, _Known] = OrderedDict()

    def remember(
        self, sketch: SketchConstraint, candidates: tuple[Candidate, ...], replaced: tuple[SketchConstraint, ...]
    ) -> None:
        """Keep the ``candidates`` of the stroke of ``sketch``, and the sketches that it has ``replaced``."""
        self._known[_key(sketch)] = _Known(candidates, replaced)
        while len(self._known) > _MOST_STROKES:
            self._known.popitem(last=False)

    def candidates(self, sketch: SketchConstraint) -> tuple[Candidate, ...] | None:
        """Return the candidates of the stroke of ``sketch``, the most probable first, or None if it is not known."""
        known = self._known.get(_key(sketch))
        return None if known is None else known.candidates

    def replaced(self, sketch: SketchConstraint) -> tuple[SketchConstraint, ...]:
        """Return the sketches that ``sketch`` has replaced as the feature that it depicts."""
        known = self._known.get(_key(sketch))
        return () if known is None else known.replaced


def _key(sketch: SketchConstraint) -> object:
    return sketch.stroke, sketch.camera
