"""Mark of a fixed area, and the default mark of other kinds: dots at their points."""

from dataclasses import dataclass

import numpy as np

from faceposer.gui.overlays.marks.mark import Array, MarkView, as_pixel
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, HELD, Colour
from faceposer.solve.constraints.registry import Constraint


@dataclass(frozen=True)
class AreaMark:
    """Visible points of a constraint, (n, 2), as dots."""

    index: int
    pixels: Array
    colour: Colour = HELD

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw the mark with opacity ``alpha``."""
        # Many vertices get smaller dots, so that the face remains visible.
        radius = min(max(40.0 / max(len(self.pixels), 1) ** 0.5, 0.9), 2.2)
        painter.dots(
            self.pixels, radius * (1.3 if self.index in painter.highlighted else 1.0), self.colour, 0.8 * alpha
        )

    @property
    def anchor(self) -> Pixel | None:
        """The rightmost point."""
        return as_pixel(self.pixels[int(np.argmax(self.pixels[:, 0]))]) if len(self.pixels) else None


def mark_of(index: int, constraint: Constraint, view: MarkView) -> AreaMark:
    """Return the mark of ``constraint``."""
    points = constraint.points
    return AreaMark(index, view.camera.project(view.positions(points.subset(~view.hidden(points)))))


def points_mark_of(index: int, constraint: Constraint, view: MarkView) -> AreaMark:
    """Return the default mark of a constraint without a mark of its kind."""
    return AreaMark(index, mark_of(index, constraint, view).pixels, ACCENT)
