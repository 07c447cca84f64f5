"""What the recognition of strokes has found, kept while a session is edited."""

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from faceposer.geometry.camera import Camera
from faceposer.sketch.recognition import Candidate, DrawnStroke
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import as_pixels

# Number of strokes whose candidates are kept.
_MOST_STROKES = 500


@dataclass(eq=False)
class UnnamedStroke:
    """A stroke that depicts no feature.

    Attributes:
        stroke: The stroke.
        candidates: Features that it may depict, the most probable first.
        depth: Depth of the session's history when it was drawn.
        shown: False while the view is turned away from the one in which it was drawn.
        named_at: Depth of the history after the step that named it, or None.
        named: True while that step is not undone.
    """

    stroke: DrawnStroke
    candidates: tuple[Candidate, ...]
    depth: int
    shown: bool = True
    named_at: int | None = None
    named: bool = False


class UnnamedStrokes:
    """The strokes that depict no feature, kept until they are named or discarded."""

    def __init__(self) -> None:
        self._strokes: list[UnnamedStroke] = []

    @property
    def shown(self) -> tuple[UnnamedStroke, ...]:
        """Those without a name in the present view, the last one drawn at the end."""
        return tuple(stroke for stroke in self._strokes if stroke.shown and not stroke.named)

    def add(self, stroke: DrawnStroke, candidates: tuple[Candidate, ...], depth: int) -> None:
        """Keep the ``stroke``, drawn at the ``depth`` of the history."""
        self._strokes.append(UnnamedStroke(stroke, candidates, depth))

    def name(self, unnamed: UnnamedStroke, depth: int) -> None:
        """Record that a step of the history, after which its depth is ``depth``, has named the stroke."""
        unnamed.named_at, unnamed.named = depth, True

    def discard(self, unnamed: Iterable[UnnamedStroke]) -> None:
        """Discard the strokes ``unnamed``."""
        gone = set(map(id, unnamed))
        self._strokes = [stroke for stroke in self._strokes if id(stroke) not in gone]

    def follow(self, depth: int, constraints: Sequence[Constraint], camera: Camera) -> None:
        """Show the strokes drawn in the view of ``camera``, and take names back and return them as undo and redo do.

        Args:
            depth: The depth of the history.
            constraints: The constraints of the document.
            camera: Camera of the view.
        """
        for stroke in self._strokes:
            stroke.shown = stroke.stroke.camera.same_viewpoint(camera)
            if stroke.named_at is None:
                continue
            if depth < stroke.named_at:
                stroke.named = False
            elif not stroke.named:
                # Redone, unless other steps have replaced the one that named it.
                stroke.named = _has_stroke(constraints, stroke.stroke)
                stroke.named_at = stroke.named_at if stroke.named else None


def _has_stroke(constraints: Sequence[Constraint], stroke: DrawnStroke) -> bool:
    """Return True if one of ``constraints`` is a sketch with the pixels of ``stroke``."""
    pixels = as_pixels(stroke.pixels)
    return any(isinstance(c, SketchConstraint) and c.stroke == pixels for c in constraints)


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
