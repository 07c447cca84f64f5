"""Mark of a sketch."""

from dataclasses import dataclass

import numpy as np

from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.overlays.marks.mark import Array, MarkView
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, INK, TARGET, WARNING
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import as_pixels

# Distance in pixels at normal density from which the gap between a matched point and its point of the face is drawn.
_VISIBLE_GAP = 2.5


@dataclass(frozen=True)
class SketchMark:
    """A sketch in the view.

    Attributes:
        index: Index of the constraint.
        feature: Name of its feature.
        line: The stroke, shape (n, 2).
        matched: Places of the matched feature points on it, shape (k, 2).
        feet: These feature points of the face, shape (k, 2).
        source: Visible points of the feature on the face, shape (m, 2).
        own_view: True if the view is that of the constraint.
    """

    index: int
    feature: str
    line: Array
    matched: Array
    feet: Array
    source: Array
    own_view: bool

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw the mark with opacity ``alpha``."""
        highlighted = self.index in painter.highlighted
        alpha *= painter.ghost(self.own_view)
        if highlighted:
            painter.dots(self.source, 1.2, ACCENT, 0.6 * alpha)
        painter.line(self.line, TARGET, 2.4 if highlighted else 1.8, alpha)
        if highlighted and self.own_view:
            for place, foot in zip(self.matched, self.feet, strict=True):
                if np.hypot(*(place - foot)) > _VISIBLE_GAP * painter.scale:
                    painter.line(np.stack([foot, place]), WARNING, 1.2, alpha)
        radius = (3.2 if highlighted else 2.4) * (1.0 if self.own_view else 0.7)
        for x, y in self.matched.tolist():
            painter.knob((x, y), radius, INK if highlighted else TARGET, alpha, False)

    @property
    def anchor(self) -> Pixel | None:
        """None: the name is drawn beside the stroke."""
        return None


def mark_of(index: int, constraint: SketchConstraint, view: MarkView) -> SketchMark:
    """Return the mark of ``constraint``."""
    names, pixels = zip(*constraint.matched, strict=True)
    ids = view.viewport.session.model.character.feature_points
    feet = view.positions(SurfacePoints.at_vertices([ids[name] for name in names]))
    line, own = view.shown(constraint.stroke, constraint.camera, feet)
    matched, _ = view.shown(as_pixels(pixels), constraint.camera, feet)
    points = constraint.points
    source = view.camera.project(view.positions(points.subset(~view.hidden(points))))
    return SketchMark(index, constraint.feature, line, matched, view.camera.project(feet), source, own)
