"""Motion of the lower jaw: a rotation about the line through its two condyles, just in front of the ear canals.

The line is given by Bonwill's triangle: at 98 mm from the edge of the lower incisors, the condyles about as far
apart (W. G. A. Bonwill, 1899; mean of dry mandibles 97.4 to 98.6 mm). Maximum opening of adults is 51 mm between
the incisors (Woelfel, Igarashi and Dong, 2014), a large part of which is due to the condyles' glide; `OPENING` is the
rotation that opens as far as the face units do, 35 mm at the incisors of the base mesh.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Rotation of the jaw in the shape jawOpen at full strength, in degrees.
OPENING = 22.0
#: Distance of the condyles as a share of the width of the head there.
_CONDYLES = 0.70


def condyle(before_ear: Floats) -> Floats:
    """Return the middle of the left condyle, (3,), from the skin over it; the hinge is the line through it along x.

    Args:
        before_ear: Position in front of the left ear, at the height of its canal, in centimetres, shape (3,).
    """
    middle: Floats = before_ear * [_CONDYLES, 1.0, 1.0]
    return middle


def jaw_rotation(points: Floats, opening_angle: float | Floats, hinge: Floats) -> Floats:
    """Return ``points`` rotated with a jaw that opens about its hinge.

    Args:
        points: Positions in centimetres, shape (n, 3).
        opening_angle: Angle in degrees, for all points or for each, shape (n,); positive opens.
        hinge: Point of `condyle`, shape (3,).
    """
    angle = np.deg2rad(opening_angle)
    cosine, sine = np.cos(angle), np.sin(angle)
    y, z = points[:, 1] - hinge[1], points[:, 2] - hinge[2]
    return np.stack(
        [points[:, 0], hinge[1] + cosine * y - sine * z, hinge[2] + sine * y + cosine * z],
        axis=1,
    )


def jaw_opening(points: Floats, hinge: Floats, angle: float = OPENING) -> Floats:
    """Return the offsets of ``points``, rigidly on the jaw, in the shape jawOpen at full strength, shape (n, 3)."""
    return jaw_rotation(points, angle, hinge) - points
