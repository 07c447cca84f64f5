"""Eyes of imported characters: texture coordinates and gaze shapes for eyes without them."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Part
from faceposer.model.contact.eyeballs import CONCENTRIC, fit_sphere

Array = NDArray[np.float64]

# Rotation of the built-in characters' eyes at full strength, in degrees (assets/README.md).
_TURN = {"LookIn": 30.0, "LookOut": 30.0, "LookUp": 22.0, "LookDown": 25.0}
# The eye's texture is a view along the gaze axis, with this share of its width per 100 degrees from the centre.
_WIDTH_PER_DEGREE = 0.49 / 100.0
_MIDDLE_CM = 0.3


def side_of(part: Part, vertices: NDArray[np.floating]) -> str:
    """Return the side of an eye, "Left" or "Right", by its position or, if it is central, by its name."""
    x = float(vertices[slice(*part.vertices), 0].mean())
    if abs(x) < _MIDDLE_CM and re.search(r"(?i:right)|[\W_]r\d*$|R$", part.name):
        return "Right"
    return "Left" if x > -_MIDDLE_CM else "Right"


def misplaced_eyes(vertices: NDArray[np.floating], parts: Sequence[Part]) -> list[str]:
    """Return a warning for each pair of eyes at the same position, which exporters cause by losing transforms."""
    eyes = [(part, vertices[slice(*part.vertices)].mean(axis=0)) for part in parts if part.material == "eye"]
    return [
        f"{left.name} and {right.name} are in the same place instead of behind the lids: the file has lost their "
        "positions. Correct them in the program that wrote it."
        for left, left_centre in eyes
        for right, right_centre in eyes
        if (side_of(left, vertices), side_of(right, vertices)) == ("Left", "Right")
        and float(np.abs(left_centre - right_centre).max()) < _MIDDLE_CM
    ]


def add_gaze(vertices: Array, parts: Sequence[Part], names: Sequence[str], shapes: NDArray[np.float32]) -> list[str]:
    """Add rotations of the eyes that no eyeLook shape moves to ``shapes``, and return the names of their parts.

    Many files turn the eyes by bones. Concentric shells, such as sclera and iris, rotate about one centre.

    Args:
        vertices: Upright, shape (N, 3).
        parts: Parts of the mesh.
        names: ARKit's names of the S shapes.
        shapes: Offsets, shape (S, N, 3); modified in place.
    """
    turned = []
    for part in parts:
        ids = slice(*part.vertices)
        looks = [i for i, name in enumerate(names) if name.startswith("eyeLook")]
        if part.material != "eye" or not looks or np.any(shapes[looks, ids]):
            continue
        centre = _centre_of_shells(part, parts, vertices)
        side = side_of(part, vertices)
        for i in looks:
            if names[i].endswith(side):
                action = names[i].removeprefix("eye").removesuffix(side)
                shapes[i, ids] = _rotate(vertices[ids] - centre, action, side) - (vertices[ids] - centre)
        turned.append(part.name)
    return turned


def _centre_of_shells(part: Part, parts: Sequence[Part], vertices: Array) -> Array:
    """Return the centre, (3,), of the largest shell concentric with ``part``."""
    centre, radius = fit_sphere(vertices[slice(*part.vertices)])
    shells = [(radius, centre)]
    for other in parts:
        if other.material == "eye" and other is not part and side_of(other, vertices) == side_of(part, vertices):
            other_centre, other_radius = fit_sphere(vertices[slice(*other.vertices)])
            if np.linalg.norm(centre - other_centre) < CONCENTRIC * min(radius, other_radius):
                shells.append((other_radius, other_centre))
    return max(shells, key=lambda shell: shell[0])[1]


def _rotate(points: Array, action: str, side: str) -> Array:
    angle = np.deg2rad(_TURN[action])
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, z = points.T
    if action in ("LookUp", "LookDown"):
        up = 1.0 if action == "LookUp" else -1.0
        return np.stack([x, cosine * y + up * sine * z, cosine * z - up * sine * y], axis=1)
    outward = 1.0 if side == "Left" else -1.0
    to_left = outward if action == "LookOut" else -outward
    return np.stack([cosine * x + to_left * sine * z, y, cosine * z - to_left * sine * x], axis=1)


def eye_uv(points: Array) -> Array:
    """Return texture coordinates, (n, 2), of an eye's ``points``, (n, 3), for an image seen along the gaze axis."""
    centre, radius = fit_sphere(points)
    directions = (points - centre) / max(radius, np.finfo(float).tiny)
    across = np.hypot(directions[:, 0], directions[:, 1])
    degrees = np.rad2deg(np.arctan2(across, directions[:, 2]))
    scale = np.minimum(_WIDTH_PER_DEGREE * degrees, 0.49) / np.maximum(across, 1e-9)
    return 0.5 + scale[:, None] * directions[:, :2]
