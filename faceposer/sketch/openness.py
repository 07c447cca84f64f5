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
    gaps = scale * rows.gaps[1][run].mean(axis=0)[1] + jacobian @ density.base + posterior.means @ moves
    deviation = float(np.sqrt(max(moves @ posterior.covariance @ moves, 0.0) + _SOFTNESS**2))
    return float(np.log(max(shares @ ndtr(state[1] * (gaps - OPEN) / deviation), 1e-9)))
