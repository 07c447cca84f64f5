"""What the shaders of eyes and lashes need to know of the pose and of the camera.

A ball is followed as a rigid body; where its lids end on it is a table of elevations over azimuths, from which the
shader takes the lids' soft shadow; the catchlight is the picture of a soft box beside the camera in the cornea, kept on
the cornea and between the lids however the eye turns, as photographers place it.
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

#: Columns of the table of lids that the shader reads (shaders/eye.frag).
COLUMNS = 17
# Where the soft box stands in camera space, which has y down and z forward.
_SOFT_BOX = np.array([-0.42, -0.40, -0.82])
# The cornea is curved more than the ball: its normals turn this much faster, up to this angle from the gaze.
_STEEPER, _STEEPEST = 1.6, np.radians(28.0)
# How far from the margins of the upper and the lower lid the catchlight stays, in radians.
_BELOW_UPPER, _ABOVE_LOWER = np.radians(5.0), np.radians(4.0)
# Vertices that a ball is followed by, and beyond which distance from the sphere, in radii, they are the cornea's.
_FOLLOWED, _ON_SPHERE = 64, 0.012
# Texture coordinates may differ by this from those of the program's own pictures of eyes.
_SAME_PICTURE = 0.02
# Lashes fade over this angle, in radians, around where the nose hides their eye.
_FADE = np.radians(7.0)


@dataclass(frozen=True, eq=False)
class Eye:
    """An eyeball in a pose.

    Attributes:
        centre: Shape (3,).
        radius: Of the sphere, without the cornea.
        turn: Rotation since the neutral pose, shape (3, 3); its third column is the gaze.
        corners: Azimuths of inner and outer end of the opening, seen from the centre.
        lids: Elevations of upper and lower margin at `COLUMNS` azimuths between them, shape (COLUMNS, 2).
        own_picture: Whether the texture is seen along the gaze axis as those of the program's own eyes are.
    """

    centre: Array
    radius: float
    turn: Array
    corners: tuple[float, float]
    lids: Array
    own_picture: bool

    @property
    def gaze(self) -> Array:
        """The direction that it looks in, shape (3,)."""
        gaze: Array = self.turn[:, 2]
        return gaze

    def catchlight(self, camera: Camera) -> Array:
        """Return the direction from the centre, shape (3,), in which the soft box is mirrored for ``camera``."""
        to_camera = camera.center - (self.centre + self.radius * self.gaze)
        half = camera.rotation.T @ _SOFT_BOX + to_camera / np.linalg.norm(to_camera)
        half /= np.linalg.norm(half)
        angle = float(np.arccos(np.clip(half @ self.gaze, -1.0, 1.0)))
        aside = half - (half @ self.gaze) * self.gaze
        aside /= max(float(np.linalg.norm(aside)), 1e-9)
        on_cornea = _STEEPEST * np.tanh(angle / _STEEPEST) / _STEEPER
        azimuth, elevation = angles_of((np.cos(on_cornea) * self.gaze + np.sin(on_cornea) * aside)[None])[0].tolist()
        upper, lower = self.opening(azimuth)
        if upper - lower < _BELOW_UPPER + _ABOVE_LOWER:
            elevation = lower + (upper - lower) * _ABOVE_LOWER / (_BELOW_UPPER + _ABOVE_LOWER)
        else:
            elevation = min(max(elevation, lower + _ABOVE_LOWER), upper - _BELOW_UPPER)
        return directions_of(azimuth, elevation)

    def opening(self, azimuth: float) -> tuple[float, float]:
        """Return the elevations of the upper and the lower margin at ``azimuth``."""
        columns = np.linspace(*self.corners, COLUMNS)
        return tuple(float(np.interp(azimuth, columns, lid)) for lid in self.lids.T)  # type: ignore[return-value]


class _Ball:
    """An eyeball and its lids in the neutral face."""

    def __init__(self, character: Character, part: Part, skin: NDArray[np.integer]) -> None:
        first, last = part.vertices
        points = character.vertices[first:last].astype(np.float64)
        centre, radius = fit_sphere(points)
        off = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
        if (round_ones := points[off <= max(_ON_SPHERE * radius, float(np.median(off)))]).size >= 12:
            centre, radius = fit_sphere(round_ones)
        self.centre, self.radius = centre, radius
        self._ids = first + np.unique(np.linspace(0, last - first - 1, _FOLLOWED).astype(int))
        followed = character.vertices[self._ids].astype(np.float64)
        self._middle = followed.mean(axis=0)
        self._rest = followed - self._middle
        self._margins: LidMargins | None = find_lid_margins(character.vertices, skin, centre, radius)
        self._own_picture = _has_own_picture(character, part, points)

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
            # No lids: nothing shades the ball.
            return (-1.5, 1.5), np.tile([1.5, -1.5], (COLUMNS, 1))
        upper, lower = self._margins.angles(vertices, centre)
        # The corners lie a little beyond the last points, where both lids meet.
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
    """Follows the eyes of one character.

    Attributes:
        eyes: The eyeballs as they are now, by the names of their parts.
    """

    def __init__(self, character: Character) -> None:
        """Find the eyes of ``character`` and the margins of their lids."""
        skins = [slice(*character.part_triangles(part)) for part in character.parts if part.material == "skin"]
        skin = (
            np.concatenate([character.triangles[run] for run in skins]) if skins else np.zeros((0, 3), dtype=np.int32)
        )
        self._balls = {part.name: _Ball(character, part, skin) for part in character.parts if part.material == "eye"}
        self.eyes: dict[str, Eye] = {}
        self._lashes = {part.name: self._nearest_eye(character, part) for part in character.parts}
        self._hidden_from = {name: _hidden_from(character, ball, skin) for name, ball in self._balls.items()}
        self.update(character.vertices)

    def update(self, vertices: NDArray[np.float32]) -> None:
        """Take over a pose, shape (N, 3)."""
        self.eyes = {name: ball.posed(vertices) for name, ball in self._balls.items()}

    def lashes_seen(self, part: Part, camera: Camera) -> float:
        """Return the opacity of the lashes ``part``: 0 where the nose hides their eye from ``camera``, else 1."""
        name = self._lashes.get(part.name)
        if name is None:
            return 1.0
        ball = self._balls[name]
        x, _, z = (camera.center - ball.centre).tolist()
        across = -np.sign(ball.centre[0]) * x
        if across <= 0.0:
            return 1.0
        t = float(np.clip((self._hidden_from[name] + _FADE - np.arctan2(across, z)) / (2.0 * _FADE), 0.0, 1.0))
        return t * t * (3.0 - 2.0 * t)

    def _nearest_eye(self, character: Character, part: Part) -> str | None:
        if part.material != "lashes" or not self._balls:
            return None
        middle = character.vertices[slice(*part.vertices)].mean(axis=0)
        return min(self._balls, key=lambda name: float(np.linalg.norm(self._balls[name].centre - middle)))


def _hidden_from(character: Character, ball: _Ball, skin: NDArray[np.integer]) -> float:
    """Return the angle towards the other side beyond which the nose hides the front of the ball from a camera."""
    front = ball.centre + [0.0, 0.0, ball.radius]
    points = character.vertices[np.unique(skin)].astype(np.float64) - front
    towards = -np.sign(ball.centre[0]) * points[:, 0]
    nose = (towards > 0.6 * ball.radius) & (towards < 3.0 * ball.radius) & (np.abs(points[:, 1]) < 0.35 * ball.radius)
    if not nose.any():
        return np.pi
    return float(np.pi / 2.0 - np.arctan2(points[nose, 2], towards[nose]).max())


def _has_own_picture(character: Character, part: Part, points: Array) -> bool:
    """Whether the texture of an eye is seen along the gaze axis, its radius in proportion to the angle."""
    corners = slice(*part.polygons)
    used, first = np.unique(character.polygons[corners], return_index=True)
    uv = character.uv[character.polygon_uvs[corners].ravel()[first]][used >= 0]
    wanted = eye_uv(points)[used[used >= 0] - part.vertices[0]]
    return bool(np.median(np.abs(uv - wanted)) < _SAME_PICTURE)
