"""Smooth weights in space, with which face units are re-sculpted."""

import numpy as np

from scripts.asset_building.piece import Floats


def ramp(start: float, stop: float, x: Floats) -> Floats:
    """Return a weight per value of ``x`` that rises from 0 at ``start`` to 1 at ``stop``, with a level end at both."""
    t = np.clip((x - start) / (stop - start), 0.0, 1.0)
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)
