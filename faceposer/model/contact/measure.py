"""Depths of penetration between the surfaces of a posed face.

The meshes themselves are measured rather than the smooth obstacles of the contact step: radii of the eyeball's
triangles, the front of the triangles of teeth and gums. Depths are relative to the neutral face; skin that is inside
the eyeball or behind the teeth there, such as the lining of socket and mouth, is excluded.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.contact.arches import FINE, DentalArch, find_arches, radius_raster
from faceposer.model.contact.eyeballs import Eyeball, find_eyeballs
from faceposer.model.contact.lids import PRESSED, LidEdges, find_all_edges, skin_near_ball
from faceposer.model.contact.lips import find_covering, skin_samples, triangles_among
from faceposer.model.contact.samples import lattice
from faceposer.model.face_model import FaceModel

Array = NDArray[np.float64]
Ids = NDArray[np.intp]
Vertices = NDArray[np.floating]

#: Kinds of penetration: skin inside the eyeballs, lids past each other, skin behind the front of the teeth, and teeth
#: outside the skin.
KINDS = ("lids_eyeballs", "lid_lid", "lips_teeth", "teeth_skin")
_MM = 10.0
# Largest number of protruding vertices of teeth, the farthest first, that are measured exactly.
_MEASURED_EXACTLY = 48
# Triangles that extend farther than this from a point, in columns, are behind the axis and are skipped.
_LARGEST_EXTENT = 40.0 * FINE
# Number of triangles of the eyeball tested per direction, and tolerance of their barycentric coordinates.
_CANDIDATES, _OUTSIDE = 10, 0.02


def penetration_mm(model_or_character: FaceModel | Character, vertices: Vertices) -> dict[str, float]:
    """Return the greatest depth of each kind of penetration in a pose, in millimetres, 0 if there is none.

    Args:
        model_or_character: The face, or its character.
        vertices: The posed vertices, shape (N, 3), with or without the contact step.

    Returns:
        Depths by the names in ``KINDS``, without kinds for which the character lacks the parts. "lids_eyeballs" is the
        depth of skin below the surface of the eyeball, along the radius; "lid_lid" the overlap of the edges of upper
        and lower lid, along the eyeball, beyond the 0.04 radii by which closed lids press together; "lips_teeth" the
        depth of skin of lips, cheeks and chin behind the front of teeth and gums, or past their edge if that is nearer;
        "teeth_skin" the height of teeth or gums above the outer skin.

    Raises:
        ValueError: If the shape of ``vertices`` differs from that of the character's vertices.
    """
    character = model_or_character if isinstance(model_or_character, Character) else model_or_character.character
    if vertices.shape != character.vertices.shape:
        raise ValueError(f"vertices must have shape {character.vertices.shape}, not {vertices.shape}")
    result: dict[str, float] = {}
    for kind, depth in _gauges(character):
        result[kind] = max(result.get(kind, 0.0), _MM * depth(vertices))
    return {kind: result[kind] for kind in KINDS if kind in result}


@lru_cache(maxsize=4)
def _gauges(character: Character) -> list[tuple[str, Callable[[Vertices], float]]]:
    """Return pairs of a kind and a function from posed vertices to a depth in the character's unit."""
    gauges: list[tuple[str, Callable[[Vertices], float]]] = []
    balls = find_eyeballs(character)
    for ball, edges in zip(balls, find_all_edges(character, balls), strict=True):
        near = skin_near_ball(character, ball)
        if len(near):
            gauges.append(("lids_eyeballs", _BallGauge(character, ball, near)))
        if edges is not None:
            gauges.append(("lid_lid", _EdgeGauge(character, ball, edges)))
    for arch in find_arches(character):
        covering = find_covering(character, arch)
        if len(covering.outer):
            gauges.append(("lips_teeth", _SkinGauge(character, arch, covering.lips)))
            gauges.append(("teeth_skin", _TeethGauge(character, arch, covering.outer)))
    return gauges


class _BallGauge:
    """Depth of skin below the triangles of an eyeball, relative to the neutral face."""

    def __init__(self, character: Character, ball: Eyeball, near: Ids) -> None:
        from scipy.spatial import cKDTree

        self._ball = ball
        self._samples = skin_samples(character, near)
        corners = triangles_among(character, ball.frame.ids)
        self._corners = character.vertices[corners].astype(np.float64) - ball.centre
        middles = self._corners.mean(axis=1)
        self._tree = cKDTree(middles / np.linalg.norm(middles, axis=1, keepdims=True))
        self._farthest = float(np.linalg.norm(self._corners, axis=2).max())
        self._at_rest = np.zeros(len(self._samples))
        self._at_rest = self._depth(character.vertices)

    def __call__(self, vertices: Vertices) -> float:
        return float((self._depth(vertices) - self._at_rest).max(initial=0.0))

    def _depth(self, vertices: Vertices) -> Array:
        linear, centre = self._ball.motion(vertices)
        relative = (self._samples.places(vertices) - centre) @ np.linalg.inv(linear).T
        distance = np.linalg.norm(relative, axis=1)
        depth = np.zeros(len(relative))
        inside = np.flatnonzero(distance < self._farthest)
        if len(inside):
            directions = relative[inside] / np.maximum(distance[inside], 1e-9)[:, None]
            stretch = np.linalg.norm(directions @ linear.T, axis=1)
            depth[inside] = np.maximum(self._radii(directions) - distance[inside], 0.0) * stretch
        return depth

    def _radii(self, directions: Array) -> Array:
        """Return the distances at which rays from the centre in ``directions``, (n, 3), leave the mesh, shape (n,)."""
        _, found = self._tree.query(directions, k=min(_CANDIDATES, len(self._corners)))
        a, b, c = (self._corners[found.reshape(len(directions), -1), k] for k in range(3))
        rays = np.broadcast_to(directions[:, None], a.shape)
        volumes = np.stack(
            [np.einsum("nkd,nkd->nk", rays, np.cross(u, v)) for u, v in ((b, c), (c, a), (a, b))], axis=-1
        )
        total = volumes.sum(axis=-1)
        safe = np.where(np.abs(total) > 1e-12, total, 1.0)
        lengths = np.einsum("nkd,nkd->nk", a, np.cross(b, c)) / safe
        least = np.where(np.abs(total) > 1e-12, (volumes / safe[..., None]).min(axis=-1), -np.inf)
        met = least >= -_OUTSIDE
        nearest = np.take_along_axis(lengths, least.argmax(axis=1)[:, None], axis=1)[:, 0]
        outermost = np.where(met, lengths, -np.inf).max(axis=1)
        radii: Array = np.where(met.any(axis=1), outermost, nearest)
        return radii


class _EdgeGauge:
    """Overlap of the edges of the two lids of an eye, relative to the neutral face."""

    def __init__(self, character: Character, ball: Eyeball, edges: LidEdges) -> None:
        self._ball, self._edges = ball, edges
        self._at_rest = [np.maximum(angle, PRESSED) for angle in edges.overlap(ball, character.vertices)]

    def __call__(self, vertices: Vertices) -> float:
        angles = self._edges.overlap(self._ball, vertices)
        more = [(angle - rest).max() for angle, rest in zip(angles, self._at_rest, strict=True)]
        return self._ball.radius * max(0.0, *map(float, more))


class _SkinGauge:
    """Depth of skin behind the front of the teeth, relative to the neutral face."""

    def __init__(self, character: Character, arch: DentalArch, skin: Ids) -> None:
        self._arch = arch
        samples = skin_samples(character, skin)
        self._samples = samples
        self._at_rest = np.zeros(len(samples))
        self._at_rest = arch.depth(arch.resting(samples.places(character.vertices), character.vertices))

    def __call__(self, vertices: Vertices) -> float:
        depth = self._arch.depth(self._arch.resting(self._samples.places(vertices), vertices))
        return float((depth - self._at_rest).max(initial=0.0))


class _TeethGauge:
    """Height of teeth and gums above the outermost skin that covers them, relative to the neutral face."""

    def __init__(self, character: Character, arch: DentalArch, skin: Ids) -> None:
        self._arch = arch
        self._triangles = triangles_among(character, skin)
        self._skin = np.unique(self._triangles)
        self._at_rest = np.zeros(len(arch.frame.ids))
        self._at_rest = self._out(character.vertices)

    def __call__(self, vertices: Vertices) -> float:
        return float((self._out(vertices) - self._at_rest).max(initial=0.0))

    def _out(self, vertices: Vertices) -> Array:
        arch = self._arch
        row = arch.coarse_row
        rows = int(np.ceil((arch.top - arch.bottom) / row)) + 1
        resting = np.zeros((len(vertices), 3))
        resting[self._skin] = arch.resting(vertices[self._skin].astype(np.float64), vertices)
        corners = resting[self._triangles]
        low, high = corners[..., 1].min(axis=1), corners[..., 1].max(axis=1)
        corners = corners[(high > arch.bottom - row) & (low < arch.bottom + row * rows)]
        skin = radius_raster(lattice(corners, 0.6 * row), arch.axis, arch.bottom, row, rows)
        teeth = arch.resting(vertices[arch.frame.ids].astype(np.float64), vertices)
        place, height, radius = arch.cylinder(teeth)
        column, line = arch.coarse_cell(place, height)
        over = skin[np.clip(column, 0, len(skin) - 1), np.clip(line, 0, rows - 1)]
        out = np.where(np.isfinite(over), radius - over, 0.0)
        # Cells are too coarse for steep skin: vertices that seem to protrude are measured exactly.
        protruding = np.flatnonzero(out > 0.0)
        protruding = protruding[np.argsort(-out[protruding], kind="stable")[:_MEASURED_EXACTLY]]
        exact = np.zeros(len(radius))
        for i in protruding:
            exact[i] = self._above_skin(corners, teeth[i], float(place[i]), float(height[i]), float(radius[i]))
        return exact

    def _above_skin(self, corners: Array, point: Array, place: float, height: float, radius: float) -> float:
        """Return the height of ``point`` above the plane of the outermost triangle on its ray from the axis.

        It is 0 if the ray meets none of the triangles ``corners``, (F, 3, 3), or meets one beyond the point.
        """
        across, up, reach = (x.reshape(-1, 3) for x in self._arch.cylinder(corners.reshape(-1, 3)))
        around = (
            (np.abs(across - place).max(axis=1) < _LARGEST_EXTENT)
            & (up.min(axis=1) <= height)
            & (up.max(axis=1) >= height)
        )
        corners, x, y, reach = corners[around], across[around] - place, up[around] - height, reach[around]
        weights = np.stack([x[:, k - 2] * y[:, k - 1] - x[:, k - 1] * y[:, k - 2] for k in range(3)], axis=1)
        total = weights.sum(axis=1)
        inside = (weights * np.sign(total)[:, None] >= 0.0).all(axis=1) & (np.abs(total) > 1e-12)
        if not inside.any():
            return 0.0
        radii = (weights[inside] * reach[inside]).sum(axis=1) / total[inside]
        outermost = int(radii.argmax())
        if radii[outermost] >= radius:
            return 0.0
        a, b, c = corners[inside][outermost]
        normal = np.cross(b - a, c - a)
        return float(abs((point - a) @ normal) / max(float(np.linalg.norm(normal)), 1e-12))
