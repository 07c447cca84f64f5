"""Inputs of the eye and lash shaders that depend on pose and camera.

An eyeball is tracked as a rigid body. The margins of its lids are a table of elevations over azimuths, from which the
shader computes the soft shadow of the lids. The catchlight is the reflection in the cornea of a soft box next to the
camera, kept on the cornea and between the lids for every gaze, as photographers place it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.lid_margins import LidMargins, angles_of, directions_of, find_lid_margins
from faceposer.model.character import Character, Part
from faceposer.model.contact.eyeballs import fit_sphere
from faceposer.training.eyes import eye_uv

Array = NDArray[np.float64]

#: Columns of the lid table that the shader reads (shaders/eye.frag).
COLUMNS = 17
# Position of the soft box in camera space (y down, z forward).
_SOFT_BOX = np.array([-0.42, -0.40, -0.82])
# The cornea is more curved than the ball: ratio of their normals' angles, and largest angle from the gaze.
_CORNEA_RATIO, _CORNEA_ANGLE = 1.6, np.radians(28.0)
# Smallest angles between the catchlight and the margins of the upper and lower lid, in radians.
_UPPER_MARGIN, _LOWER_MARGIN = np.radians(5.0), np.radians(4.0)
# Number of tracked vertices of a ball, and distance from the sphere, in radii, beyond which they belong to the cornea.
_TRACKED_VERTICES, _SPHERE_TOLERANCE = 64, 0.012
# Tolerance of texture coordinates compared to the layout of the built-in eye textures.
_UV_TOLERANCE = 0.02
# Angle over which lashes fade, in radians, where the nose begins to hide their eye.
_FADE = np.radians(7.0)


@dataclass(frozen=True, eq=False)
class Eye:
    """An eyeball in a pose.

    Attributes:
        centre: Centre, shape (3,).
        radius: Radius of the sphere, without the cornea.
        turn: Rotation from the neutral pose, shape (3, 3); its third column is the gaze.
        corners: Azimuths of the inner and outer end of the opening, as seen from the centre.
        lids: Elevations of the upper and lower margin at ``COLUMNS`` azimuths between them, shape (COLUMNS, 2).
        own_picture: True if the texture is projected along the gaze axis like the built-in eye textures.
    """

    centre: Array
    radius: float
    turn: Array
    corners: tuple[float, float]
    lids: Array
    own_picture: bool

    @property
    def gaze(self) -> Array:
        """Direction of the gaze, shape (3,)."""
        gaze: Array = self.turn[:, 2]
        return gaze

    def catchlight(self, camera: Camera) -> Array:
        """Return the direction from the centre, shape (3,), in which ``camera`` sees the reflection of the soft box."""
        to_camera = camera.center - (self.centre + self.radius * self.gaze)
        half = camera.rotation.T @ _SOFT_BOX + to_camera / np.linalg.norm(to_camera)
        half /= np.linalg.norm(half)
        angle = float(np.arccos(np.clip(half @ self.gaze, -1.0, 1.0)))
        sideways = half - (half @ self.gaze) * self.gaze
        sideways /= max(float(np.linalg.norm(sideways)), 1e-9)
        cornea_angle = _CORNEA_ANGLE * np.tanh(angle / _CORNEA_ANGLE) / _CORNEA_RATIO
        direction = np.cos(cornea_angle) * self.gaze + np.sin(cornea_angle) * sideways
        azimuth, elevation = angles_of(direction[None])[0].tolist()
        upper, lower = self.opening(azimuth)
        if upper - lower < _UPPER_MARGIN + _LOWER_MARGIN:
            elevation = lower + (upper - lower) * _LOWER_MARGIN / (_UPPER_MARGIN + _LOWER_MARGIN)
        else:
            elevation = min(max(elevation, lower + _LOWER_MARGIN), upper - _UPPER_MARGIN)
        return directions_of(azimuth, elevation)

    def opening(self, azimuth: float) -> tuple[float, float]:
        """Return the elevations of the upper and lower lid margin at ``azimuth``."""
        columns = np.linspace(*self.corners, COLUMNS)
        return tuple(float(np.interp(azimuth, columns, lid)) for lid in self.lids.T)  # type: ignore[return-value]


class _Ball:
    """An eyeball and its lids in the neutral face."""

    def __init__(self, character: Character, part: Part, skin: NDArray[np.integer]) -> None:
        first, last = part.vertices
        points = character.vertices[first:last].astype(np.float64)
        centre, radius = fit_sphere(points)
        distances = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
        on_sphere = points[distances <= max(_SPHERE_TOLERANCE * radius, float(np.median(distances)))]
        if on_sphere.size >= 12:
            centre, radius = fit_sphere(on_sphere)
        self.centre, self.radius = centre, radius
        self._ids = first + np.unique(np.linspace(0, last - first - 1, _TRACKED_VERTICES).astype(int))
        tracked = character.vertices[self._ids].astype(np.float64)
        self._middle = tracked.mean(axis=0)
        self._rest = tracked - self._middle
        self._margins: LidMargins | None = find_lid_margins(character.vertices, skin, centre, radius)
        self._own_picture = _has_built_in_layout(character, part, points)

    def posed(self, vertices: NDArray[np.float32]) -> Eye:
        """Return the ball in the pose ``vertices``, shape (N, 3)."""
        points = vertices[self._ids].astype(np.float64)
        middle = points.mean(axis=0)
        points -= middle
        u, _, vt = np.linalg.svd(points.T @ self._rest)
        turn = u @ vt
        if turn[0] @ np.cross(turn[1], turn[2]) < 0.0:
            u[:, 2] *= -1.0
            turn = u @ vt
        scale = math.sqrt(float(np.vdot(points, points) / np.vdot(self._rest, self._rest)))
        centre = middle + scale * turn @ (self.centre - self._middle)
        corners, lids = self._opening(vertices, centre)
        return Eye(centre, scale * self.radius, turn, corners, lids, self._own_picture)

    def _opening(self, vertices: NDArray[np.float32], centre: Array) -> tuple[tuple[float, float], Array]:
        if self._margins is None:
            # Without lids, nothing shades the ball.
            return (-1.5, 1.5), np.tile([1.5, -1.5], (COLUMNS, 1))
        upper, lower = self._margins.angles(vertices, centre)
        # The corners, where both lids meet, are slightly beyond the last points.
        ends = [0.5 * (upper[end] + lower[end]) for end in (0, -1)]
        step = float(upper[-1, 0] - upper[0, 0]) / (len(upper) - 1)
        corners = (float(ends[0][0]) - 0.7 * step, float(ends[1][0]) + 0.7 * step)
        columns = np.linspace(*corners, COLUMNS)
        lids = np.empty((COLUMNS, 2))
        for k, lid in enumerate((upper, lower)):
            azimuths = np.concatenate([corners[:1], lid[:, 0], corners[1:]])
            elevations = np.concatenate([ends[0][1:], lid[:, 1], ends[1][1:]])
            lids[:, k] = np.interp(columns, azimuths, elevations)
        return corners, lids


class EyeShading:
    """Tracker of the eyes of one character.

    Attributes:
        eyes: The eyeballs in the current pose, by the names of their parts.
    """

    def __init__(self, character: Character) -> None:
        """Detect the eyes of ``character`` and the margins of their lids."""
        skins = [slice(*character.part_triangles(part)) for part in character.parts if part.material == "skin"]
        skin = (
            np.concatenate([character.triangles[run] for run in skins]) if skins else np.zeros((0, 3), dtype=np.int32)
        )
        self._balls = {part.name: _Ball(character, part, skin) for part in character.parts if part.material == "eye"}
        self.eyes: dict[str, Eye] = {}
        self._lashes = {part.name: self._nearest_eye(character, part) for part in character.parts}
        self._nose_angles = {name: _nose_angle(character, ball, skin) for name, ball in self._balls.items()}
        self.update(character.vertices)

    def update(self, vertices: NDArray[np.float32]) -> None:
        """Update the eyes to the pose ``vertices``, shape (N, 3)."""
        self.eyes = {name: ball.posed(vertices) for name, ball in self._balls.items()}

    def lashes_seen(self, part: Part, camera: Camera) -> float:
        """Return the opacity of the lashes ``part``: 0 if the nose hides their eye from ``camera``, else 1."""
        name = self._lashes.get(part.name)
        if name is None:
            return 1.0
        ball = self._balls[name]
        x, _, z = (camera.center - ball.centre).tolist()
        across = -np.sign(ball.centre[0]) * x
        if across <= 0.0:
            return 1.0
        t = float(np.clip((self._nose_angles[name] + _FADE - np.arctan2(across, z)) / (2.0 * _FADE), 0.0, 1.0))
        return t * t * (3.0 - 2.0 * t)

    def _nearest_eye(self, character: Character, part: Part) -> str | None:
        if part.material != "lashes" or not self._balls:
            return None
        middle = character.vertices[slice(*part.vertices)].mean(axis=0)
        return min(self._balls, key=lambda name: float(np.linalg.norm(self._balls[name].centre - middle)))


def _nose_angle(character: Character, ball: _Ball, skin: NDArray[np.integer]) -> float:
    """Return the angle towards the other side, in radians, beyond which the nose hides the front of the ball."""
    front = ball.centre + [0.0, 0.0, ball.radius]
    points = character.vertices[np.unique(skin)].astype(np.float64) - front
    towards = -np.sign(ball.centre[0]) * points[:, 0]
    nose = (towards > 0.6 * ball.radius) & (towards < 3.0 * ball.radius) & (np.abs(points[:, 1]) < 0.35 * ball.radius)
    if not nose.any():
        return np.pi
    return float(np.pi / 2.0 - np.arctan2(points[nose, 2], towards[nose]).max())


def _has_built_in_layout(character: Character, part: Part, points: Array) -> bool:
    """Return True if an eye's texture is projected along the gaze axis, with the radius proportional to the angle."""
    corners = slice(*part.polygons)
    used, first = np.unique(character.polygons[corners], return_index=True)
    uv = character.uv[character.polygon_uvs[corners].ravel()[first]][used >= 0]
    expected = eye_uv(points)[used[used >= 0] - part.vertices[0]]
    return bool(np.median(np.abs(uv - expected)) < _UV_TOLERANCE)
