"""Density of strokes of people who exaggerate: brows, nose wings and upper lids farther from rest than poses go.

The density of poses covers what the shapes of a character can do. A drawn surprise raises a brow by 4 to 6 % of the
face and a drawn anger makes it straight. Here, a feature keeps its place along the face but moves across its chord,
turns and bends as a whole: one Gaussian about its present and one about its neutral line, for each interval of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.sketch.curve_density import FeatureRows
from faceposer.sketch.hand import SAMPLES, HandModel
from faceposer.sketch.intervals import candidate_intervals, sampled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Freedom:
    """Moves of a feature that is drawn freely, as standard deviations in units of the hand unless stated otherwise.

    Attributes:
        along: Common move along the chord.
        across: Common move across the chord.
        turn: Move of one end across the chord, and of the other one to the other side.
        bend: Move of the middle against the ends.
        size: Relative size.
        log_share: Log of the share of strokes that are drawn so.
        pieces: True if pieces of the feature are drawn as often as all of it, since its ends are not seen.
    """

    along: float
    across: float
    turn: float
    bend: float
    size: float
    log_share: float
    pieces: bool = False


#: Freedom of features by their names without the side; others are drawn as the shapes of the character move them.
FREEDOMS: Mapping[str, Freedom] = {
    "brow": Freedom(10.0, 26.0, 22.0, 10.0, 0.1, -0.7),
    "nose wing": Freedom(16.0, 12.0, 8.0, 6.0, 0.2, -0.7, pieces=True),
    "jaw line": Freedom(12.0, 20.0, 8.0, 24.0, 0.08, -0.7, pieces=True),
    "upper lid": Freedom(4.0, 4.0, 4.0, 26.0, 0.06, -1.6),
}


def is_free(name: str) -> bool:
    """Return True if the feature ``name`` is drawn farther from rest than the shapes of a character move it."""
    return _kind(name) in FREEDOMS


def _kind(name: str) -> str:
    """Return the ``name`` of a feature without its side."""
    return name.removeprefix("left ").removeprefix("right ")


def log_free(
    rows: FeatureRows, name: str, poses: Array, camera: Camera, unit: float, samples: Array, hand: HandModel
) -> float:
    """Return the log density of ``samples`` as the feature ``name`` drawn freely, -inf if it is never drawn so.

    Args:
        rows: The lines of the character.
        name: Name of the feature.
        poses: Poses about which it is drawn, equally likely, shape (n, r).
        camera: Camera of the stroke.
        unit: The unit of the hand in its pixels.
        samples: Even samples of the stroke in units of the hand about the principal point, shape (SAMPLES, 2).
        hand: Errors of the hand.
    """
    freedom = FREEDOMS.get(_kind(name))
    if freedom is None:
        return -np.inf
    track = rows.tracks[name]
    intervals = candidate_intervals(track.closed)
    weights = np.full(len(intervals), -np.log(len(intervals))) if freedom.pieces else intervals.log_weights
    logs = []
    for pose in poses:
        places = rows.neutral[track.rows] + rows.jacobian[track.rows] @ pose
        line = (camera.project(places) - camera.principal_point) / unit
        i, j, share = sampled(line, track.closed, intervals)
        share = share[..., None]
        means = (1.0 - share) * line[i] + share * line[j]
        logs.append(_log_densities(means, line, samples, hand, freedom) + weights[:, None])
    return freedom.log_share + float(np.logaddexp.reduce(np.ravel(logs))) - float(np.log(2.0 * len(poses)))


def _log_densities(means: Array, line: Array, samples: Array, hand: HandModel, freedom: Freedom) -> Array:
    """Return the log densities of ``samples``, forwards and backwards, about ``means``, (m, SAMPLES, 2); (m, 2)."""
    chord = line[-1] - line[0]
    chord = chord / max(float(np.hypot(*chord)), 1e-9)
    across = np.array([-chord[1], chord[0]])
    along = (means - line[0]) @ chord
    middle = 0.5 * (along.max(axis=1) + along.min(axis=1))[:, None]
    place = (along - middle) / np.maximum(0.5 * np.ptp(along, axis=1), 1e-9)[:, None]
    around = means - means.mean(axis=1, keepdims=True)
    moves = np.stack(
        [
            np.broadcast_to(freedom.along * chord, means.shape),
            np.broadcast_to(freedom.across * across, means.shape),
            freedom.turn * place[..., None] * across,
            freedom.bend * (1.0 - place**2)[..., None] * across,
            freedom.size * around,
        ],
        axis=-1,
    )
    factor = np.concatenate([moves, hand.slack(means)], axis=-1)
    count, size = len(means), factor.shape[-1]
    white = (hand.whitener @ factor.reshape(count, SAMPLES, 2 * size)).reshape(count, 2 * SAMPLES, size)
    both = np.stack([samples, samples[::-1]], axis=-1) - means[..., None]
    residual = (hand.whitener @ both.reshape(count, SAMPLES, 4)).reshape(count, 2 * SAMPLES, 2)
    transposed = white.transpose(0, 2, 1)
    system = transposed @ white + np.eye(size)
    right = transposed @ residual
    quadratic = (residual * residual).sum(axis=1) - (right * np.linalg.solve(system, right)).sum(axis=1)
    return np.asarray(hand.log_peak - 0.5 * (np.linalg.slogdet(system)[1][:, None] + quadratic))
