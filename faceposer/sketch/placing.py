"""Places of feature points on a stroke, by arc length along the most probable curve."""

import math

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.curve_density import ViewedCurves, hand_unit
from faceposer.sketch.evidence import Evidence, evidence
from faceposer.sketch.hand import HandModel
from faceposer.sketch.intervals import refined
from faceposer.sketch.polyline import at_lengths, lengths_along, stroke_line
from faceposer.sketch.recognition import DrawnStroke, MatchedPoint
from faceposer.solve.constraints.sketch_contour import ON_CONTOUR
from faceposer.solve.constraints.sketch_matching import distances

Array = NDArray[np.float64]

# A feature point this far beyond an end of a stroke, as a share of the line, is at the end.
_AT_END = 0.07
# The same of the jaw, the ends of which are not seen.
_AT_END_UNSEEN = 0.01
# Standard deviation of places along a line, as a share of its length, and greatest probability of a point, by which
# probabilities are those of being within half the distance of neighbours; measured on two folds of a performance.
_DEVIATION, _SURE = 0.033, 0.99


def placed_points(
    found: Evidence, index: int, stroke: DrawnStroke, samples: Array, hand: HandModel
) -> tuple[tuple[MatchedPoint, ...], float]:
    """Return the feature points of line ``index`` on ``stroke``, and its mean distance from the most probable curve.

    The curve is linearised again at the most probable pose, where intervals are compared on a finer grid. The
    distance is in units of the hand.
    """
    row, direction = found.best(index)
    posterior = found.posterior(index, row, direction)
    density, track = found.curves.density, found.tracks[index]
    nearer = density.updated(posterior.log_likelihood, posterior.means, posterior.covariance)
    curves = ViewedCurves(found.curves.rows, nearer, found.curves.camera, [track.feature])
    coarse = found.intervals[index]
    finer = evidence(curves, samples, hand, [refined(float(coarse.begins[row]), float(coarse.ends[row]), track.closed)])
    weights = finer.log_evidence[:, direction] + finer.intervals[0].log_weights
    row = int(np.argmax(weights))
    begin, end = float(finer.intervals[0].begins[row]), float(finer.intervals[0].ends[row])
    line = curves.pixels[track.feature]
    along = lengths_along(line)
    share_of = along / max(float(along[-1]), 1e-9)
    unit = hand_unit(found.curves.rows, stroke.camera)
    points = stroke_line(stroke, unit) * unit + stroke.camera.principal_point
    lengths = lengths_along(points)
    matched: dict[str, MatchedPoint] = {}
    slack = _AT_END_UNSEEN if track.feature in ON_CONTOUR else _AT_END
    for names in track.names:
        knots = np.interp(np.linspace(0, track.parameters[-1], len(names)), track.parameters, share_of)
        distinct = len(names) - 1 if track.closed else len(names)
        gaps = np.diff(knots)
        before, after = (
            (np.roll(gaps, 1), gaps) if track.closed else (np.append(gaps[:1], gaps), np.append(gaps, gaps[-1:]))
        )
        around = 0.5 * (before + after)
        for knot in range(distinct):
            place = _share(float(knots[knot]), begin, end, track.closed, slack)
            if place is None:
                continue
            sure = _SURE * math.erf(0.5 * float(around[knot]) / (math.sqrt(2.0) * _DEVIATION))
            at = (1.0 - place if direction else place) * lengths[-1]
            u, v = at_lengths(points, lengths, [at])[0].tolist()
            matched[names[knot]] = MatchedPoint(names[knot], (u, v), sure)
    return tuple(matched.values()), float(distances(samples, line).mean())


def _share(knot: float, begin: float, end: float, closed: bool, slack: float) -> float | None:
    """Return the place of ``knot`` between ``begin`` and ``end``, shares of a line, or None beyond the ``slack``."""
    if closed:
        # Starts differ by whole turns; the first pass over a point counts.
        knot += np.ceil(begin - knot - slack)
    place = (knot - begin) / max(end - begin, 1e-9)
    slack /= max(end - begin, 1e-9)
    return float(np.clip(place, 0.0, 1.0)) if -slack <= place <= 1.0 + slack else None
