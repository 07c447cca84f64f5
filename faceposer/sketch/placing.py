"""Places of feature points on a stroke, by arc length along the most probable curve."""

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.curve_density import ViewedCurves, hand_unit
from faceposer.sketch.evidence import Evidence, evidence
from faceposer.sketch.hand import HandModel
from faceposer.sketch.intervals import refined
from faceposer.sketch.polyline import at_lengths, lengths_along, stroke_line
from faceposer.sketch.recognition import DrawnStroke, MatchedPoint

Array = NDArray[np.float64]

# A feature point this far beyond an end of a stroke, as a share of the line, is at the end.
_AT_END = 0.07


def placed_points(
    found: Evidence, index: int, stroke: DrawnStroke, samples: Array, hand: HandModel
) -> tuple[MatchedPoint, ...]:
    """Return the feature points of line ``index`` on ``stroke``.

    The curve is linearised again at the most probable pose, where intervals are compared on a finer grid.
    """
    row, direction = found.best(index)
    posterior = found.posterior(index, row, direction)
    density, track = found.curves.density, found.tracks[index]
    nearer = density.updated(posterior.log_likelihood, posterior.means, posterior.covariance)
    curves = ViewedCurves(found.curves.rows, nearer, found.curves.camera, [track.feature])
    coarse = found.intervals[index]
    finer = evidence(curves, samples, hand, [refined(float(coarse.begins[row]), float(coarse.ends[row]), track.closed)])
    row, _ = finer.best(0)
    weights = finer.log_evidence[:, direction] + finer.intervals[0].log_weights
    row = int(np.argmax(weights))
    begin, end = float(finer.intervals[0].begins[row]), float(finer.intervals[0].ends[row])
    line = curves.pixels[track.feature]
    along = lengths_along(line)
    share_of = along / max(float(along[-1]), 1e-9)
    # Standard deviation of the places of points along the line.
    spread = np.exp(weights - weights.max())
    spread /= spread.sum()
    unit = hand_unit(found.curves.rows, stroke.camera)
    points = stroke_line(stroke, unit) * unit + stroke.camera.principal_point
    lengths = lengths_along(points)
    matched: dict[str, MatchedPoint] = {}
    for names in track.names:
        knots = np.interp(np.linspace(0, track.parameters[-1], len(names)), track.parameters, share_of)
        distinct = len(names) - 1 if track.closed else len(names)
        for knot in range(distinct):
            place = _share(float(knots[knot]), begin, end, track.closed)
            if place is None:
                continue
            around = 0.5 * (knots[min(knot + 1, len(knots) - 1)] - knots[max(knot - 1, 0)])
            deviation = np.hypot(hand.ends + hand.slide, 4.0 * unit / max(float(lengths[-1]), 1e-9))
            sure = float(np.clip(around / (around + deviation * 0.5), 0.0, 1.0))
            at = (1.0 - place if direction else place) * lengths[-1]
            u, v = at_lengths(points, lengths, [at])[0].tolist()
            matched[names[knot]] = MatchedPoint(names[knot], (u, v), sure)
    return tuple(matched.values())


def _share(knot: float, begin: float, end: float, closed: bool) -> float | None:
    """Return the place of ``knot`` between ``begin`` and ``end``, all shares of a line, or None beyond them."""
    if closed:
        # Starts differ by whole turns; the first pass over a point counts.
        knot += np.ceil(begin - knot - _AT_END)
    place = (knot - begin) / max(end - begin, 1e-9)
    slack = _AT_END / max(end - begin, 1e-9)
    return float(np.clip(place, 0.0, 1.0)) if -slack <= place <= 1.0 + slack else None
