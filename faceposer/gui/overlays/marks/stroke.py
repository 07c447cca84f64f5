"""Mark of a stroke."""

from dataclasses import dataclass

import numpy as np

from faceposer.gui.overlays.marks.mark import Array, MarkView, as_pixel
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, TARGET
from faceposer.solve.constraints.stroke import StrokeConstraint

# Number of dots that suffices for any stroke.
_MAX_DOTS = 600


@dataclass(frozen=True)
class StrokeMark:
    """A stroke in the view: source on the face, (n, 2), and path of the target, (m, 2)."""

    index: int
    source: Array
    target: Array
    width: float
    shape: str
    own_view: bool

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw the mark with opacity ``alpha``."""
        highlighted = self.index in painter.highlighted
        painter.dots(self.source, 1.3, ACCENT, (0.7 if highlighted else 0.45) * alpha)
        strength = (0.55 if highlighted else 0.38) * alpha * painter.ghost(self.own_view)
        painter.band(self.target, self.width, self.shape, TARGET, strength)

    @property
    def anchor(self) -> Pixel | None:
        """The end of the target."""
        return as_pixel(self.target[-1]) if len(self.target) else None


def mark_of(index: int, constraint: StrokeConstraint, view: MarkView) -> StrokeMark:
    """Return the mark of ``constraint``."""
    source = constraint.placed
    if len(source) > _MAX_DOTS:
        source = source.subset(np.linspace(0, len(source) - 1, _MAX_DOTS).astype(np.int64))
    positions = view.positions(source)
    target, own = view.shown(constraint.target, constraint.camera, positions)
    scale = view.camera.focal / constraint.camera.focal if own else 1.0
    seen = view.camera.project(positions[~view.hidden(source)])
    return StrokeMark(index, seen, target, constraint.width * scale, constraint.shape, own)
