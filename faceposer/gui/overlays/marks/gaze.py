"""Mark of the gaze: a handle at which both eyes look."""

from dataclasses import dataclass

import numpy as np

from faceposer.gui.overlays.marks.mark import Array, MarkView
from faceposer.gui.overlays.painter import WHITE, Painter
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, EDGE, INK
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.tools.gaze_tool import handle_position, pupil_centres_of


@dataclass(frozen=True)
class GazeMark:
    """The handle of the gaze and the pupils, (2, 2); without an index before there is a constraint."""

    index: int | None
    handle: Pixel
    eyes: Array

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw the mark with opacity ``alpha``."""
        colour = INK if self.index is None else ACCENT
        for eye in self.eyes:
            painter.line(np.stack([eye, np.array(self.handle)]), colour, 1.2, 0.45 * alpha)
        highlighted = self.index is not None and self.index in painter.highlighted
        for tint, thickness in ((EDGE, 4.0), (WHITE if highlighted else colour, 2.2)):
            painter.ring(self.handle, 9.0, tint, 0.9 * alpha, thickness)
        painter.disc(self.handle, 3.0, colour, alpha)

    @property
    def anchor(self) -> Pixel | None:
        """The handle."""
        return self.handle


def mark_of(index: int, constraint: GazeConstraint, view: MarkView) -> GazeMark | None:
    """Return the mark of ``constraint``, or None if the character has no eyes."""
    return handle_mark(index, constraint.direction, view)


def handle_mark(index: int | None, direction: tuple[float, float], view: MarkView) -> GazeMark | None:
    """Return the handle for a ``direction`` in degrees, or None if the character has no eyes."""
    character = view.viewport.session.model.character
    eyes, position = pupil_centres_of(character, direction), handle_position(character, direction)
    if eyes is None or position is None:
        return None
    u, v = view.camera.project(position[None])[0].tolist()
    return GazeMark(index, (u, v), view.camera.project(eyes))
