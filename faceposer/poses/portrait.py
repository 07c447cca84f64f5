"""The view for thumbnails of poses: the face fills it, while hair, ears and neck may be cut off."""

import math
from dataclasses import replace

import numpy as np

from faceposer.geometry.camera import OrbitView
from faceposer.model.character import Character

# From the brows to the chin, as MPEG-4 feature points.
_FRAME = ("2.1", "4.3", "4.4", "4.5", "4.6", "8.3", "8.4", "9.3")
# Slightly from the side, where pursed lips are visible.
_YAW, _PITCH = math.radians(8.0), math.radians(2.0)
# Margins as shares of the face's height, for raised brows and an open jaw.
_ABOVE, _BELOW = 0.16, 0.14
# Preset views have margins that are too wide for a thumbnail.
_CLOSER = 1.25


def portrait_view(character: Character) -> OrbitView:
    """Return the view that frames the face of ``character`` for a square image."""
    ids = [character.feature_points[name] for name in _FRAME if name in character.feature_points]
    points = character.vertices[ids] if len(ids) >= 4 else character.vertices
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    height = high[1] - low[1]
    low[1] -= _BELOW * height
    high[1] += _ABOVE * height
    # Preset views frame the height; a square one must also contain the width.
    wider = 0.5 * max((high[0] - low[0]) - (high[1] - low[1]), 0.0)
    low[1] -= wider
    high[1] += wider
    return replace(OrbitView.preset(low, high), yaw=_YAW, pitch=_PITCH).zoomed(_CLOSER)
