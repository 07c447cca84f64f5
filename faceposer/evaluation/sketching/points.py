"""True places of feature points on a stroke, and how many a recognition has right."""

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.sketching.artist import TrueStroke
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.recognition import Candidate, MatchedPoint

Array = NDArray[np.float64]

# Tolerance of parameters at the ends of a stroke, in feature points.
_AT_END = 0.02


def true_points(true: TrueStroke) -> tuple[MatchedPoint, ...]:
    """Return the feature points of the true feature on a stroke; those beyond its ends are absent."""
    feature = FEATURES[true.feature]
    low, high = float(true.parameters.min()), float(true.parameters.max())
    found: dict[str, MatchedPoint] = {}
    for chain in feature.chains:
        for index, name in enumerate(chain):
            distance = np.abs(true.parameters - index)
            if feature.closed:
                distance = np.minimum(distance, len(chain) - distance)
            elif not low - _AT_END <= index <= high + _AT_END:
                continue
            u, v = true.stroke.pixels[int(np.argmin(distance))].tolist()
            found[name] = MatchedPoint(name, (u, v))
    return tuple(found.values())


def point_errors(true: TrueStroke, candidate: Candidate | None) -> list[float]:
    """Return the error of each true feature point of a stroke, in distances of neighbouring feature points.

    That of a point that is not matched, as if the feature is wrong, is infinite.
    """
    matched = {} if candidate is None else {point.feature_point: point.pixel for point in candidate.points}
    if candidate is not None and candidate.feature != true.feature:
        matched = {}
    feature = FEATURES[true.feature]
    index_of = {name: index for chain in feature.chains for index, name in enumerate(chain)}
    errors = []
    for point in true_points(true):
        pixel = matched.get(point.feature_point)
        if pixel is None:
            errors.append(float("inf"))
            continue
        nearest = int(np.argmin(((true.stroke.pixels - pixel) ** 2).sum(axis=1)))
        error = abs(float(true.parameters[nearest]) - index_of[point.feature_point])
        errors.append(min(error, len(feature.chains[0]) - error) if feature.closed else error)
    return errors
