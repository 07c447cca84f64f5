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
# Least distance of the knobs, in their radii: those of the points of a cupid's bow would cover the stroke.
_KNOBS_APART = 6.0


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
        for x, y in apart(self.matched, _KNOBS_APART * radius * painter.scale).tolist():
            painter.knob((x, y), radius, INK if highlighted else TARGET, alpha, False)

    @property
    def anchor(self) -> Pixel | None:
        """None: the name is drawn beside the stroke."""
        return None


def apart(places: Array, distance: float) -> Array:
    """Return the ``places``, shape (n, 2), that are ``distance`` apart, beginning with the first and the last."""
    order = [0, len(places) - 1, *range(1, len(places) - 1)] if len(places) > 1 else list(range(len(places)))
    kept: list[int] = []
    for i in order:
        if all(np.hypot(*(places[i] - places[k])) >= distance for k in kept):
            kept.append(i)
    return places[sorted(kept)]


def mark_of(index: int, constraint: SketchConstraint, view: MarkView) -> SketchMark:
    """Return the mark of ``constraint``."""
    names, pixels = zip(*constraint.matched, strict=True)
    ids = view.viewport.session.model.character.feature_points
    feet = view.positions(SurfacePoints.at_vertices([ids[name] for name in names]))
    points = constraint.points
    positions = view.positions(points)
    own = constraint.camera.same_viewpoint(view.camera)
    line, matched = (
        view.shown(as_pixels(part), constraint.camera, positions)[0]
        if own
        else _lifted(part, constraint, positions, view)
        for part in (np.array(constraint.stroke), np.array(pixels))
    )
    # Shown while the sketch is highlighted: what faces away is left out, what something else hides is not.
    source = view.camera.project(positions[~view.scene.facing_away(view.camera, points)])
    return SketchMark(index, constraint.feature, line, matched, view.camera.project(feet), source, own)


def _lifted(pixels: Array, sketch: SketchConstraint, positions: Array, view: MarkView) -> Array:
    """Return ``pixels`` of the camera of ``sketch``, (n, 2), in another view, at the depth of the feature on the face.

    Args:
        pixels: Pixels on the stroke.
        sketch: The sketch.
        positions: Positions of its points of the face, shape (m, 3).
        view: The view.
    """
    camera = sketch.camera
    offsets = pixels[:, None] - sketch.on_face.targets[None]
    # Mostly that of the nearest points, without steps between them.
    weights = 1.0 / (np.einsum("nmk,nmk->nm", offsets, offsets) + 1.0) ** 2
    depth = (weights @ camera.to_camera(positions)[:, 2] / weights.sum(axis=1))[:, None]
    local = np.hstack([(pixels - camera.principal_point) / camera.focal * depth, depth])
    return view.camera.project((local - camera.translation) @ camera.rotation)
