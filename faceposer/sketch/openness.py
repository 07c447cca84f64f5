"""Probability that a feature can be drawn in a pose: inner lips of an open mouth, the line of a closed one."""

import numpy as np
from scipy.special import ndtr

from faceposer.sketch.curve_density import FACE_SIZE, FeatureRows
from faceposer.sketch.evidence import Evidence

#: Distance of lips or lids at which they are open, in units of the hand.
OPEN = 12.0
# Standard deviation of this distance for which people draw one line, not two.
_SOFTNESS = 3.0
#: The gap that must be open (1) or closed (-1) for a feature to be drawn.
STATES = {
    "inner upper lip": ("mouth", 1.0),
    "inner lower lip": ("mouth", 1.0),
    "mouth line": ("mouth", -1.0),
    "left lower lid": ("left eye", 1.0),
    "right lower lid": ("right eye", 1.0),
    "left eye outline": ("left eye", 1.0),
    "right eye outline": ("right eye", 1.0),
}

# Distance up to which the inner lips of a face at rest belong to a closed mouth, in units of the hand: on rigs of other
# people, they are some way inside of where the lips touch.
_CLOSED_AT_REST = 30.0


def resting_gap(rows: FeatureRows, name: str) -> float:
    """Return the distance of lips or lids on the neutral face in units of the hand, 0 for a mouth that is closed."""
    gap = float(rows.gaps[1][rows.gap_slices[name]].mean(axis=0)[1]) * FACE_SIZE / max(rows.size, 1e-12)
    return min(gap, 0.0) if name == "mouth" and gap < _CLOSED_AT_REST else gap


def log_openness(rows: FeatureRows, found: Evidence, index: int) -> float:
    """Return the log probability that the gap of line ``index`` is as it must be, given that the stroke depicts it."""
    state = STATES.get(found.tracks[index].feature)
    if state is None or state[0] not in rows.gap_slices:
        return 0.0
    run = rows.gap_slices[state[0]]
    density = found.curves.density
    posterior = found.posterior(index, *found.best(index))
    logs = density.log_weights + posterior.log_likelihood
    shares = np.exp(logs - np.logaddexp.reduce(logs))
    # Upper minus lower upwards, in units of the hand.
    scale = FACE_SIZE / rows.size
    jacobian = scale * rows.gaps[0][run].mean(axis=0)[1]
    moves = jacobian @ density.factor
    gaps = resting_gap(rows, state[0]) + jacobian @ density.base + posterior.means @ moves
    deviation = float(np.sqrt(max(moves @ posterior.covariance @ moves, 0.0) + _SOFTNESS**2))
    return float(np.log(max(shares @ ndtr(state[1] * (gaps - OPEN) / deviation), 1e-9)))
