"""The mark of a fixed area; also the one of kinds that have none of their own: their points."""

from dataclasses import dataclass

import numpy as np

from faceposer.gui.overlays.marks.mark import Array, MarkView, as_pixel
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, HELD, Colour
from faceposer.solve.constraints.registry import Constraint


@dataclass(frozen=True)
class AreaMark:
    """The points of one constraint that the view shows, (n, 2), as dots."""

    index: int
    pixels: Array
    colour: Colour = HELD

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw it with the opacity ``alpha``."""
        # Where vertices lie densely, smaller dots leave the face to be seen.
        radius = min(max(40.0 / max(len(self.pixels), 1) ** 0.5, 0.9), 2.2)
        painter.dots(self.pixels, radius * (1.3 if self.index in painter.lit else 1.0), self.colour, 0.8 * alpha)

    @property
    def anchor(self) -> Pixel | None:
        """The point farthest to the right."""
        return as_pixel(self.pixels[int(np.argmax(self.pixels[:, 0]))]) if len(self.pixels) else None


def mark_of(index: int, constraint: Constraint, view: MarkView) -> AreaMark:
    """Return how ``constraint`` appears."""
    points = constraint.points
    return AreaMark(index, view.camera.project(view.places(points.subset(~view.hidden(points)))))


def points_mark_of(index: int, constraint: Constraint, view: MarkView) -> AreaMark:
    """Return the points of a constraint whose kind has no mark of its own."""
    return AreaMark(index, mark_of(index, constraint, view).pixels, ACCENT)
