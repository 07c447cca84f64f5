"""Eyeballs: spheres with a cornea, placed between the lids."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Angle of the border of the iris, where the cornea begins, from the gaze axis in degrees.
IRIS_ANGLE = 24.0
#: Height of the cornea over the sphere, in radii, about that of human eyes.
CORNEA_HEIGHT = 0.07
#: Rotation in the gaze shapes at full strength in degrees: about x (positive looks down) and about y (positive looks
#: to the left, of the left eye).
GAZE = {"LookDown": (25.0, 0.0), "LookUp": (-22.0, 0.0), "LookIn": (0.0, -27.0), "LookOut": (0.0, 27.0)}


def surface_radius(angle: Floats) -> Floats:
    """Return the distance of the surface from the centre, in radii, at ``angle`` in degrees from the gaze axis."""
    risen: Floats = 1.0 + CORNEA_HEIGHT * np.maximum(1.0 - (angle / IRIS_ANGLE) ** 2, 0.0) ** 2
    return risen


def place_eye(rest_lids: Floats, lids: Floats, rest_centre: Floats) -> tuple[Floats, float]:
    """Return centre and scale of an eyeball relative to ``lids`` (n, 3) as in a head relative to ``rest_lids`` (n, 3).

    The source's eyeballs do not follow the lids of every identity; here they get the translation and scale of the lids.
    """
    rest_middle, middle = rest_lids.mean(axis=0), lids.mean(axis=0)
    spread = np.sqrt(((lids - middle) ** 2).sum() / ((rest_lids - rest_middle) ** 2).sum())
    return middle + spread * (rest_centre - rest_middle), float(spread)


def ball_of(vertices: Floats) -> tuple[Floats, float]:
    """Return centre (3,) and radius of an eyeball, whose pole in front is the first of its ``vertices``, (n, 3).

    The last one is the pole at the back.
    """
    back, axis = vertices[-1], vertices[0] - vertices[-1]
    return back + axis / (2.0 + CORNEA_HEIGHT), float(np.linalg.norm(axis)) / (2.0 + CORNEA_HEIGHT)
