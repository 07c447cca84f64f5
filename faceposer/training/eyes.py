"""Eyes of characters from files: a look and a gaze for those that have none."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.model.contact.eyeballs import fit_sphere
from faceposer.model.subject import Part

Array = NDArray[np.float64]

# How far the eyes of the program's own characters turn at full strength, in degrees (assets/README.md).
_TURN = {"LookIn": 30.0, "LookOut": 30.0, "LookUp": 22.0, "LookDown": 25.0}
# The eye's picture is seen along the gaze axis: this share of its width is 100 degrees from the middle.
_WIDTH_PER_DEGREE = 0.49 / 100.0
_MIDDLE_CM = 0.3
# Fewer vertices do not tell a sphere.
_FEWEST_IN_BALL = 12


def side_of(part: Part, vertices: NDArray[np.floating]) -> str:
    """Return on which side, "Left" or "Right", an eye lies: by its place, in the middle by its name."""
    x = float(vertices[slice(*part.vertices), 0].mean())
    if abs(x) < _MIDDLE_CM and re.search(r"(?i:right)|[\W_]r\d*$|R$", part.name):
        return "Right"
    return "Left" if x > -_MIDDLE_CM else "Right"


def misplaced_eyes(vertices: NDArray[np.floating], parts: Sequence[Part]) -> list[str]:
    """Return a sentence if eyes do not lie in their sockets: nodes without their positions leave them at the origin.

    Args:
        vertices: Of the neutral face, upright, shape (N, 3).
        parts: Pieces of the mesh; two eyes that overlap are misplaced, and so is one that lies outside the skin.
    """
    balls = {
        part.name: fit_sphere(vertices[slice(*part.vertices)].astype(np.float64))
        for part in parts
        if part.material == "eye" and part.vertices[1] - part.vertices[0] >= _FEWEST_IN_BALL
    }
    skins = [vertices[slice(*part.vertices)] for part in parts if part.material == "skin"]
    if not balls or not skins:
        return []
    skin = np.concatenate(skins)
    low, high = skin.min(axis=0), skin.max(axis=0)
    wrong = {name for name, (centre, _) in balls.items() if ((centre < low) | (centre > high)).any()}
    for name, (centre, radius) in balls.items():
        for other, (across, _) in balls.items():
            # Cornea and sclera are often meshes of their own, on the same side of the face.
            same_place = other != name and np.linalg.norm(centre - across) < radius
            if same_place and abs(centre[0]) < 0.5 * radius:
                wrong |= {name, other}
    if not wrong:
        return []
    names = " and ".join(f"'{name}'" for name in balls if name in wrong)
    if len(wrong) > 1:
        where = f"{names} do not lie in their sockets, as if their nodes had no positions"
    else:
        where = f"{names} does not lie in its socket, as if its node had no position"
    return [f"{where}: place the eyes in the program that wrote the file, and export it again."]


def add_gaze(vertices: Array, parts: Sequence[Part], names: Sequence[str], shapes: NDArray[np.float32]) -> list[str]:
    """Turn the eyes that no eyeLook shape moves, in ``shapes`` of shape (S, N, 3), and return their parts' names.

    In many files the eyes are turned by bones; as shapes they follow the gaze here.

    Args:
        vertices: Upright, shape (N, 3).
        parts: Pieces of the mesh.
        names: Of the shapes, ARKit's, S of them.
        shapes: Offsets; changed in place.
    """
    turned = []
    for part in parts:
        ids = slice(*part.vertices)
        looks = [i for i, name in enumerate(names) if name.startswith("eyeLook")]
        if part.material != "eye" or not looks or np.any(shapes[looks, ids]):
            continue
        centre, _ = fit_sphere(vertices[ids])
        side = side_of(part, vertices)
        for i in looks:
            if names[i].endswith(side):
                action = names[i].removeprefix("eye").removesuffix(side)
                shapes[i, ids] = _turned(vertices[ids] - centre, action, side) - (vertices[ids] - centre)
        turned.append(part.name)
    return turned


def _turned(points: Array, action: str, side: str) -> Array:
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
    """Return texture coordinates, (n, 2), of an eye's ``points``, (n, 3), for a picture seen along the gaze axis."""
    centre, radius = fit_sphere(points)
    directions = (points - centre) / max(radius, np.finfo(float).tiny)
    across = np.hypot(directions[:, 0], directions[:, 1])
    degrees = np.rad2deg(np.arctan2(across, directions[:, 2]))
    scale = np.minimum(_WIDTH_PER_DEGREE * degrees, 0.49) / np.maximum(across, 1e-9)
    return 0.5 + scale[:, None] * directions[:, :2]
