"""Mark of a curve."""

from dataclasses import dataclass

from faceposer.geometry.curves import curve_at, even_parameters, relaxed_bezier
from faceposer.gui.overlays.marks.mark import Array, MarkView, as_pixel
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, TARGET
from faceposer.solve.constraints.curve import CurveConstraint

_SAMPLES_PER_SEGMENT = 16


@dataclass(frozen=True)
class CurveMark:
    """A curve in the view: source on the face, (n, 2), target curve, (m, 2), and control points of the target."""

    index: int
    source: Array
    line: Array
    handles: Array
    own_view: bool

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw the mark with opacity ``alpha``."""
        highlighted = self.index in painter.highlighted
        ghost = painter.ghost(self.own_view)
        painter.line(self.source, ACCENT, 1.6, 0.75 * alpha)
        painter.line(self.line, TARGET, 2.4 if highlighted else 1.8, alpha * ghost)
        for x, y in self.handles.tolist():
            painter.knob((x, y), 4.6 if self.own_view else 3.2, TARGET, alpha * ghost, highlighted)

    @property
    def anchor(self) -> Pixel | None:
        """The last control point."""
        return as_pixel(self.handles[-1])


def mark_of(index: int, constraint: CurveConstraint, view: MarkView) -> CurveMark:
    """Return the mark of ``constraint``."""
    positions = view.positions(constraint.points)
    handles, own = view.shown(constraint.target, constraint.camera, positions)
    seen = view.camera.project(positions[~view.hidden(constraint.points)])
    return CurveMark(index, seen, curve_line(handles), handles, own)


def curve_line(control: Array) -> Array:
    """Return points on the relaxed curve through ``control``, shape (n, 2), for drawing, or a single point itself."""
    if len(control) < 2:
        return control
    return curve_at(relaxed_bezier(control), even_parameters(len(control) - 1, _SAMPLES_PER_SEGMENT))[0]
