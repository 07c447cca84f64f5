"""The mark of a stroke."""

from dataclasses import dataclass

import numpy as np

from faceposer.gui.overlays.marks.mark import Array, MarkView, as_pixel
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, TARGET
from faceposer.solve.constraints.stroke import StrokeConstraint

# More points of a stroke than these tell the eye nothing more.
_MOST_DOTS = 600


@dataclass(frozen=True)
class StrokeMark:
    """A stroke in the view: its source on the face, (n, 2), and the way of its target, (m, 2)."""

    index: int
    source: Array
    target: Array
    width: float
    shape: str
    own_view: bool

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw it with the opacity ``alpha``."""
        lit = self.index in painter.lit
        painter.dots(self.source, 1.3, ACCENT, (0.7 if lit else 0.45) * alpha)
        strength = (0.55 if lit else 0.38) * alpha * painter.ghost(self.own_view)
        painter.band(self.target, self.width, self.shape, TARGET, strength)

    @property
    def anchor(self) -> Pixel | None:
        """The end of its target."""
        return as_pixel(self.target[-1]) if len(self.target) else None


def mark_of(index: int, constraint: StrokeConstraint, view: MarkView) -> StrokeMark:
    """Return how ``constraint`` appears."""
    source = constraint.placed
    if len(source) > _MOST_DOTS:
        source = source.subset(np.linspace(0, len(source) - 1, _MOST_DOTS).astype(np.int64))
    places = view.places(source)
    target, own = view.shown(constraint.target, constraint.camera, places)
    scale = view.camera.focal / constraint.camera.focal if own else 1.0
    seen = view.camera.project(places[~view.hidden(source)])
    return StrokeMark(index, seen, target, constraint.width * scale, constraint.shape, own)
