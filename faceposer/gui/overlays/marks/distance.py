"""Mark of a distance."""

from dataclasses import dataclass

import numpy as np

from faceposer.gui.overlays.marks.mark import Array, MarkView, as_pixel
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import TARGET, WARNING
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.tools.distance_tool import PairMark, pair_mark

# Residual in pixels at normal density from which the target is drawn.
_VISIBLE_GAP = 1.5


@dataclass(frozen=True)
class DistanceMark:
    """A distance in the view."""

    pair: PairMark

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw the mark with opacity ``alpha``."""
        ends, goal, scale = self.pair.ends, self.pair.goal, painter.scale
        highlighted = self.pair.index in painter.highlighted
        along = ends[1] - ends[0]
        length = float(np.hypot(*along))
        across: Array = np.array([-along[1], along[0]]) / length if length > 1e-6 else np.array([1.0, 0.0])
        if goal is not None and abs(float(np.hypot(*(goal[1] - goal[0]))) - length) > _VISIBLE_GAP * scale:
            for tip in goal:
                painter.line(np.stack([tip - 7.0 * scale * across, tip + 7.0 * scale * across]), WARNING, 2.0, alpha)
            painter.line(goal + 4.0 * scale * across, WARNING, 1.4, 0.8 * alpha)
        painter.line(ends, TARGET, 2.4 if highlighted else 1.8, alpha)
        for x, y in ends.tolist():
            painter.knob((x, y), 5.0 if goal is not None else 3.6, TARGET, alpha, highlighted)
        painter.text(ends.mean(axis=0) + (12.0 * scale, 0.0), f"{length:.0f} px", alpha)

    @property
    def anchor(self) -> Pixel | None:
        """The middle of the line."""
        return as_pixel(self.pair.ends.mean(axis=0))


def mark_of(index: int, constraint: DistanceConstraint, view: MarkView) -> DistanceMark:
    """Return the mark of ``constraint``."""
    return DistanceMark(pair_mark(index, constraint, view.viewport))
