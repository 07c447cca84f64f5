"""Edges of the lids, found as the border of the opening in the skin as seen from the centre of the eyeball."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.geometry.mirror import SurfaceMirror
from faceposer.model.character import Character
from faceposer.model.contact.eyeballs import Eyeball
from faceposer.model.contact.samples import lattice

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Map of directions from the eye's centre: extent sideways, extent up and down, and size of a cell, in degrees.
_SIDE, _UP, _CELL = 100, 80, 1.0
# Largest clearance of lid skin from the ball, and of skin that touches the ball, as shares of the radius.
_REACH, _TOUCHING = 0.8, 1e-3
#: Closed lids press on each other: edges that overlap by up to this angle, in radians, have not passed each other.
PRESSED = 0.04
# Tolerance of the mirror symmetry of the two eyes, as a share of the radius.
_SAME = 0.02
# Largest distance of an edge vertex from the border of the opening, in cells.
_NEAR = 4.0
# Least distance between vertices of an edge in azimuth, and largest retreat behind the chord of their neighbours, in
# radians.
_SPACING, _BEHIND = np.deg2rad(1.5), np.deg2rad(0.8)
# An eighth of the largest curvature of an edge, in 1 / radians.
_CURVATURE = 0.25
# Least number of vertices of an edge, and of columns of an opening.
_FEWEST, _NARROWEST = 3, 8


@dataclass(frozen=True, eq=False)
class LidEdges:
    """Edges of the upper and the lower lid of one eye, ordered from the character's right to its left.

    Attributes:
        upper: Vertex ids, shape (u,).
        lower: Vertex ids, shape (l,).
        corners: Vertex ids of the right and left corner of the eye, as far as known, which end both edges.
        left: True for the character's left eye.
    """

    upper: Ids
    lower: Ids
    corners: Ids
    left: bool

    def mirrored(self, across: Ids) -> Self | None:
        """Return the edges of the other eye, or None if a vertex has no mirror image.

        Args:
            across: Mirror image of each vertex, shape (N,); -1 if there is none.
        """
        ids = [across[each][::-1] for each in (self.upper, self.lower, self.corners)]
        return None if any((each < 0).any() for each in ids) else type(self)(ids[0], ids[1], ids[2], not self.left)

    def curves(self, vertices: NDArray[np.floating], centre: Array) -> tuple["EdgeCurve", "EdgeCurve"]:
        """Return the upper and the lower edge of the pose ``vertices``, (N, 3), as seen from ``centre``, (3,)."""
        places = (
            azimuth_and_elevation(vertices[ids].astype(np.float64) - centre)
            for ids in (self.upper, self.lower, self.corners)
        )
        azimuths, elevations, _ = zip(*places, strict=True)
        return self.curves_through(azimuths, elevations)

    def curves_through(self, azimuths: Sequence[Array], elevations: Sequence[Array]) -> tuple["EdgeCurve", "EdgeCurve"]:
        """Return the same, given the angles of upper edge, lower edge and corners."""
        upper, lower = (
            EdgeCurve.through(azimuths[i], elevations[i], azimuths[2], elevations[2], self.left) for i in range(2)
        )
        return upper, lower

    def overlap(self, ball: Eyeball, vertices: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return the angles by which vertices of the upper edge, (u,), and the lower edge, (l,), are past the other."""
        _, centre = ball.motion(vertices)
        upper, lower = self.curves(vertices, centre)
        (upper_side, upper_up, _), (lower_side, lower_up, _) = (
            azimuth_and_elevation(vertices[ids].astype(np.float64) - centre) for ids in (self.upper, self.lower)
        )
        return lower(upper_side) - upper_up, lower_up - upper(lower_side)


@dataclass(frozen=True, eq=False)
class EdgeCurve:
    """The elevation of a lid's edge as a function of the azimuth.

    Attributes:
        azimuth: Azimuths of its points, nondecreasing, shape (n,).
        elevation: Elevations of its points, shape (n,).
    """

    azimuth: Array
    elevation: Array

    @classmethod
    def through(
        cls, azimuth: Array, elevation: Array, end_azimuth: Array, end_elevation: Array, ascending: bool
    ) -> Self:
        """Return the curve through the points of an edge and the corners of the eye outside them.

        Where the edge, followed outwards from the nose, turns back, its azimuth is held. ``ascending`` states whether
        azimuths increase outwards.
        """
        azimuth = np.maximum.accumulate(azimuth) if ascending else np.minimum.accumulate(azimuth[::-1])[::-1]
        before, after = end_azimuth < azimuth[0], end_azimuth > azimuth[-1]
        return cls(
            np.concatenate([end_azimuth[before], azimuth, end_azimuth[after]]),
            np.concatenate([end_elevation[before], elevation, end_elevation[after]]),
        )

    def __call__(self, azimuth: Array) -> Array:
        """Return the elevation at each ``azimuth``, shape (n,)."""
        elevation: Array = np.interp(azimuth, self.azimuth, self.elevation)
        return elevation


def skin_near_ball(character: Character, ball: Eyeball) -> Ids:
    """Return the skin vertices on or above the front of the eyeball, in ascending order."""
    skin = skin_ids(character)
    relative = character.vertices[skin].astype(np.float64) - ball.centre
    clearance, distance = ball.clearance(relative)
    ahead = relative @ ball.axis > -0.1 * distance
    return skin[(clearance >= -_TOUCHING * ball.radius) & (clearance < _REACH * ball.radius) & ahead]


def skin_ids(character: Character) -> Ids:
    """Return the vertex ids of all skin parts, shape (n,)."""
    runs = [np.arange(*part.vertices, dtype=np.intp) for part in character.parts if part.material == "skin"]
    return np.concatenate(runs) if runs else np.zeros(0, dtype=np.intp)


def azimuth_and_elevation(relative: Array) -> tuple[Array, Array, Array]:
    """Return the angles to the left and up, and the distances, of points ``relative`` to a centre, shape (n,) each."""
    distance = np.sqrt(np.einsum("nd,nd->n", relative, relative))
    elevation = np.arcsin(np.clip(relative[:, 1] / np.maximum(distance, 1e-9), -1.0, 1.0))
    return np.arctan2(relative[:, 0], relative[:, 2]), elevation, distance


def find_all_edges(character: Character, balls: Sequence[Eyeball]) -> list[LidEdges | None]:
    """Find the edges of the lids of each of ``balls``, None if there are none.

    On symmetric faces the right eye gets the mirror image of the left eye's edges.
    """
    edges = [find_edges(character, ball) if ball.centre[0] >= 0.0 else None for ball in balls]
    lefts = [(ball, found) for ball, found in zip(balls, edges, strict=True) if found is not None]
    across: Ids | None = None
    for number, ball in enumerate(balls):
        if ball.centre[0] >= 0.0:
            continue
        tolerance = _SAME * ball.radius
        for left, found in lefts:
            if np.abs(left.centre * [-1.0, 1.0, 1.0] - ball.centre).max() < tolerance:
                if across is None:
                    across = SurfaceMirror(character.vertices, character.triangles, tolerance).vertices.astype(np.intp)
                edges[number] = found.mirrored(across)
        edges[number] = edges[number] or find_edges(character, ball)
    return edges


def find_edges(character: Character, ball: Eyeball) -> LidEdges | None:
    """Find the edges of the lids of ``ball``; return None if it is not behind an opening in the skin."""
    near = skin_near_ball(character, ball)
    chosen = np.zeros(len(character.vertices), dtype=bool)
    chosen[near] = True
    triangles = character.triangles[chosen[character.triangles].any(axis=1)]
    if not len(triangles):
        return None
    covered = _covered(character.vertices[triangles].astype(np.float64) - ball.centre, ball)
    labels, _ = ndimage.label(~covered)
    column, line = _cells(ball.axis[None])
    label = labels[column[0], line[0]]
    if label == 0:
        return None
    opening = labels == label
    columns = np.flatnonzero(opening.any(axis=1))
    border = opening[[0, -1]].any() or opening[:, [0, -1]].any()
    if border or len(columns) < _NARROWEST:
        return None
    highest = opening.shape[1] - 1 - np.argmax(opening[columns, ::-1], axis=1)
    lowest = np.argmax(opening[columns], axis=1)
    relative = character.vertices[near].astype(np.float64) - ball.centre
    azimuth, elevation, _ = azimuth_and_elevation(relative)
    across, up = np.rad2deg(azimuth) / _CELL + _SIDE / _CELL, np.rad2deg(elevation) / _CELL + _UP / _CELL
    edges = []
    for border_line, is_upper in ((highest + 0.5, True), (lowest - 0.5, False)):
        distance = np.hypot(across[:, None] - columns[None], up[:, None] - border_line[None]).min(axis=1)
        middle = np.interp(across, columns, 0.5 * (highest + lowest))
        on_side = (up > middle) == is_upper
        inside = (across > columns[0]) & (across < columns[-1])
        ids = near[(distance < _NEAR) & on_side & inside]
        edges.append(_one_per_place(ids, character.vertices, ball, is_upper))
    upper, lower = edges
    if min(len(upper), len(lower)) < _FEWEST:
        return None
    return LidEdges(
        upper, lower, _corners(character, ball, np.concatenate([upper, lower])), bool(ball.centre[0] >= 0.0)
    )


def _corners(character: Character, ball: Eyeball, edges: Ids) -> Ids:
    """Return those corners of the eye, from right to left, that are beyond all vertices of the ``edges``."""
    names = ("3.11", "3.7") if ball.centre[0] >= 0.0 else ("3.12", "3.8")
    known = np.array([character.feature_points[n] for n in names if n in character.feature_points], dtype=np.intp)
    azimuth, elevation, _ = azimuth_and_elevation(character.vertices[known].astype(np.float64) - ball.centre)
    on_edges = azimuth_and_elevation(character.vertices[edges].astype(np.float64) - ball.centre)[0]
    beyond = (azimuth < on_edges.min()) | (azimuth > on_edges.max())
    return known[beyond & (np.abs(elevation) < 0.5) & (np.abs(azimuth) < 0.5 * np.pi)]


def _one_per_place(ids: Ids, vertices: NDArray[np.floating], ball: Eyeball, is_upper: bool) -> Ids:
    """Return the subset of the vertices ``ids`` nearest to the opening at each azimuth, ordered by azimuth."""
    azimuth, elevation, _ = azimuth_and_elevation(vertices[ids].astype(np.float64) - ball.centre)
    away = elevation if is_upper else -elevation
    # From the nose outwards, for left-right symmetry.
    order = np.argsort(azimuth if ball.centre[0] >= 0.0 else -azimuth, kind="stable")
    kept: list[int] = []
    for i in order:
        if kept and abs(azimuth[i] - azimuth[kept[-1]]) < _SPACING:
            if away[i] < away[kept[-1]]:
                kept[-1] = int(i)
        else:
            kept.append(int(i))
    while len(kept) > _FEWEST:
        line, place = away[kept], azimuth[kept]
        share = (place[1:-1] - place[:-2]) / (place[2:] - place[:-2])
        behind = line[1:-1] - (line[:-2] + share * (line[2:] - line[:-2]))
        # An arch rises above the chord of neighbours far apart.
        behind -= _CURVATURE * (place[2:] - place[:-2]) ** 2
        if behind.max() < _BEHIND:
            break
        del kept[1 + int(behind.argmax())]
    return ids[kept] if ball.centre[0] >= 0.0 else ids[kept[::-1]]


def _covered(corners: Array, ball: Eyeball) -> NDArray[np.bool_]:
    """Return the mask of directions from the centre that meet triangles outside the ball, shape (columns, rows)."""
    points = lattice(corners, 0.4 * np.deg2rad(_CELL) * ball.radius)
    clearance, _ = ball.clearance(points)
    column, line = _cells(points[clearance >= -_TOUCHING * ball.radius])
    covered = np.zeros((int(2 * _SIDE / _CELL) + 1, int(2 * _UP / _CELL) + 1), dtype=bool)
    met = (column >= 0) & (column < covered.shape[0]) & (line >= 0) & (line < covered.shape[1])
    covered[column[met], line[met]] = True
    return covered


def _cells(relative: Array) -> tuple[Ids, Ids]:
    azimuth, elevation, _ = azimuth_and_elevation(relative)
    column = np.round((np.rad2deg(azimuth) + _SIDE) / _CELL).astype(np.intp)
    return column, np.round((np.rad2deg(elevation) + _UP) / _CELL).astype(np.intp)
