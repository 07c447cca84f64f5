"""Landmarks on any mesh of a head: it is drawn from several sides, and the points found are lifted to the surface."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity, determines_rotation, rigid_alignment
from faceposer.geometry.camera import Camera
from faceposer.landmarks.crops import Picture, Square
from faceposer.landmarks.drawing import Drawing, PaintedMesh, draw
from faceposer.landmarks.points import N_POINTS, Landmarks, landmarks_in, likely_landmarks
from faceposer.landmarks.reference import Reference, reference
from faceposer.progress import Progress

Array = NDArray[np.float64]

# Side of the pictures in which a face is looked for, and of those in which its points are found, in pixels.
_SEARCH_SIDE, _SIDE = 320, 400
#: Angles of the five views about the vertical axis, in radians.
YAWS = (0.0, -0.28, 0.28, -0.55, 0.55)
# Width of these pictures at the face and distance of the camera, in centimetres of the man.
_WIDTH, _DISTANCE = 27.0, 75.0
# Middle of the man's face, about which the views turn, and the side of the crop around it, in centimetres.
_MIDDLE, _CROP = np.array([0.0, 0.3, 5.0]), 24.0
# Distance of the camera from the mesh in the search, in radii of the mesh, and the share of the picture that it fills.
_SEARCH_DISTANCE, _FILLED = 6.0, 0.9
# Share of the corners of triangles on each side of an axis that may be strays.
_STRAY = 0.002
# Least cosine between surface and view at which a point counts, and the distance in pixels to the nearest surface.
_FACING, _NEAR_PX = 0.15, 3
# Least weight of a view in which a point of the man faces away.
_LEAST_TRUST = 0.05
# Depth behind the surface, in centimetres of the man, at which a point counts as hidden.
_HIDDEN = 0.5
# Share of the points with the smallest residuals by which faces are aligned.
_TRIMMED = 0.7
_ROUNDS = 12
# Views from the front that improve the frame before the points are found.
_FRAME_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class View:
    """A picture of the mesh with the landmarks found in it.

    Attributes:
        camera: Its camera.
        drawing: The picture.
        landmarks: Landmarks in its pixels.
    """

    camera: Camera
    drawing: Drawing
    landmarks: Landmarks

    @classmethod
    def of(
        cls, mesh: PaintedMesh, frame: Similarity, yaw: float, mirror: NDArray[np.int64] | None = None
    ) -> "View | None":
        """Return a view of the face of ``mesh``, or None if no face is seen in it.

        Args:
            mesh: The mesh.
            frame: The similarity from the mesh to upright centimetres, with the face about where the man's is.
            yaw: Direction of the camera from the front to the left of the face, in radians.
            mirror: Partner of each point; if given, the points are also found in the mirrored picture, and the mean of
                both is taken, which favours no side.
        """
        back, scale = frame.inverse(), float(frame.scale)
        target = back.apply(_MIDDLE[None])[0]
        direction = frame.rotation.T @ (np.sin(yaw), 0.0, np.cos(yaw))
        camera = _looking(target, direction, frame.rotation[1], _DISTANCE / scale, _WIDTH / scale, _SIDE)
        drawing = draw(mesh, camera)
        square = Square(_SIDE / 2, _SIDE / 2, _SIDE * _CROP / _WIDTH)
        found = landmarks_in(Picture(drawing.image), square)
        if found is None or mirror is None:
            return None if found is None else cls(camera, drawing, found)
        mirrored = landmarks_in(Picture(drawing.image[:, ::-1]), square)
        if mirrored is None:
            return None
        edge, turn = np.array([_SIDE, 0.0, 0.0]), np.array([-1.0, 1.0, 1.0])
        points = (found.points + edge + turn * mirrored.points[mirror]) / 2
        irises = (found.iris + edge + turn * mirrored.iris[::-1]) / 2
        return cls(camera, drawing, replace(found, points=points, iris=irises))

    def shows(self, place: Array) -> bool:
        """Return True if the surface point ``place``, (3,), is seen: nothing of the mesh is clearly nearer."""
        (column, row), (depth,) = (
            np.floor(self.camera.project(place[None])[0]),
            self.camera.to_camera(place[None])[:, 2],
        )
        height, width = self.drawing.faces.shape
        if not (0 <= column < width and 0 <= row < height):
            return False
        front = self.camera.to_camera(self.drawing.places[int(row), int(column)][None])[0, 2]
        return bool(np.isnan(front) or depth < front + _HIDDEN / _WIDTH * width / self.camera.focal * depth)

    def lifted(self, pixels: Array) -> tuple[Array, Array]:
        """Return the surface points under ``pixels``, (n, 2), shape (n, 3), and the cosines of surface to view, (n,).

        Beside the surface, the nearest of its pixels within 3 pixels counts; farther away they are NaN and 0.
        """
        side = self.drawing.facing.shape[0]
        offsets = [(x, y) for x in range(-_NEAR_PX, _NEAR_PX + 1) for y in range(-_NEAR_PX, _NEAR_PX + 1)]
        offsets = sorted((o for o in offsets if np.hypot(*o) <= _NEAR_PX), key=lambda o: float(np.hypot(*o)))
        places, facing = np.full((len(pixels), 3), np.nan), np.zeros(len(pixels))
        for offset in offsets:
            missing = np.flatnonzero(np.isnan(places[:, 0]))
            if not missing.size:
                break
            columns, rows = np.clip(np.floor(pixels[missing]).astype(np.intp) + offset, 0, side - 1).T
            places[missing], facing[missing] = self.drawing.places[rows, columns], self.drawing.facing[rows, columns]
        return places, facing


@dataclass(frozen=True, eq=False)
class MeshLandmarks:
    """Landmarks on a mesh.

    Attributes:
        mesh: The mesh.
        points: The 468 points in the unit and axes of the mesh, shape (468, 3); NaN where no view sees the surface.
        seen: Number of views in which each point was seen, shape (468,).
        spread: Median distance of the places in these views from the point, in the unit of the mesh, shape (468,).
        pupils: Middle of the irises of the right and the left eye, shape (2, 3); NaN where none was seen.
        score: Least probability that there is a face, of all views.
        frame: The similarity from the mesh to upright centimetres, with the face where the man's is.
        views: The views.
    """

    mesh: PaintedMesh
    points: Array
    seen: NDArray[np.int64]
    spread: Array
    pupils: Array
    score: float
    frame: Similarity
    views: tuple[View, ...]


def find_mesh_landmarks(
    mesh: PaintedMesh,
    frame: Similarity | None = None,
    progress: Progress | None = None,
    known: Reference | None = None,
) -> MeshLandmarks | None:
    """Return the landmarks of the face of ``mesh``, or None if none is found.

    Args:
        mesh: The mesh, in any unit and orientation.
        frame: The similarity to upright centimetres, if it is known; otherwise the face is looked for from all sides.
        progress: Progress to update.
        known: The points on the man; those of the installation if None.
    """
    progress = progress or Progress()
    known = known or reference()
    if not len(mesh.triangles) or not np.ptp(mesh.vertices[mesh.triangles], axis=(0, 1)).max() > 0.0:
        return None
    progress.at("Looking for the face")
    first = _first_view(mesh, frame, progress)
    if first is None:
        return None
    found = _aligned(first, known)
    for number in range(_FRAME_ROUNDS):
        progress.at("Finding its points", 0.4 + 0.1 * number)
        view = None if found is None else View.of(mesh, found, 0.0, known.mirror)
        found = None if view is None else _aligned(view, known)
    if found is None:
        return None
    views = []
    for number, yaw in enumerate(YAWS):
        progress.at("Finding its points", 0.6 + 0.08 * number)
        view = View.of(mesh, found, yaw, known.mirror)
        if view is not None:
            views.append(view)
    return combined(mesh, views, found, known) if views else None


def _first_view(mesh: PaintedMesh, frame: Similarity | None, progress: Progress) -> View | None:
    """Return the view of the whole mesh in which a face is most likely."""
    best: View | None = None
    corners = mesh.vertices[mesh.triangles].reshape(-1, 3)
    # A few stray triangles, as of scans, do not count.
    low, high = np.quantile(corners, (_STRAY, 1.0 - _STRAY), axis=0)
    middle, radius = (low + high) / 2, max(0.55 * float(np.linalg.norm(high - low)), 1e-9)
    directions = _axes() if frame is None else [frame.rotation.T @ (0.0, 0.0, 1.0)]
    for number, direction in enumerate(directions):
        progress.at("Looking for the face", 0.4 * number / len(directions))
        up = np.array([0.0, 1.0, 0.0]) if frame is None else frame.rotation[1]
        if abs(float(up @ direction)) > 0.9:
            up = np.array([0.0, 0.0, -1.0])
        camera = _looking(middle, direction, up, _SEARCH_DISTANCE * radius, 2.0 * radius / _FILLED, _SEARCH_SIDE)
        drawing = draw(mesh, camera)
        landmarks = likely_landmarks(Picture(drawing.image), 3)
        if landmarks is not None and (best is None or landmarks.logit > best.landmarks.logit):
            best = View(camera, drawing, landmarks)
        # Oblique directions are tried only if the axes of the file are not enough.
        if number >= 5 and best is not None:
            break
    return best


def _axes() -> list[Array]:
    """Return 26 directions: the axes, +z first, then those between two or three of them."""
    axes = [(0, 0, 1), (0, -1, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, 0, -1)]
    steps = (-1, 0, 1)
    others = [(x, y, z) for x in steps for y in steps for z in steps if abs(x) + abs(y) + abs(z) > 1]
    return [np.array(axis, dtype=np.float64) / np.linalg.norm(axis) for axis in (*axes, *others)]


def _looking(target: Array, direction: Array, up: Array, distance: float, width: float, side: int) -> Camera:
    """Return a camera at ``distance`` from ``target`` in ``direction``, which sees ``width`` in ``side`` pixels."""
    forward = -direction / np.linalg.norm(direction)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    centre = target - distance * forward
    return Camera(rotation, -rotation @ centre, side * distance / width, (side, side))


def _aligned(view: View, known: Reference) -> Similarity | None:
    """Return the similarity from the mesh to the man's frame by the points of one view, or None if it is not a face."""
    places, facing = view.lifted(view.landmarks.points[:, :2])
    weights = np.where(facing > _FACING, facing, 0.0)
    weights[np.isnan(places[:, 0])] = 0.0
    kept = weights.copy()
    found: Similarity | None = None
    for _ in range(4):
        seen = np.flatnonzero(kept > 0.0)
        if len(seen) < N_POINTS // 10 or not determines_rotation(places[seen]):
            return None
        found = rigid_alignment(places[seen], known.places[seen], kept[seen], scale=True)
        misses = np.full(N_POINTS, np.inf)
        usable = weights > 0.0
        misses[usable] = np.linalg.norm(found.apply(places[usable]) - known.places[usable], axis=1)
        kept = np.where(misses <= np.quantile(misses[usable], _TRIMMED), weights, 0.0)
    return found


def combined(mesh: PaintedMesh, views: list[View], frame: Similarity, known: Reference | None = None) -> MeshLandmarks:
    """Return the landmarks on the mesh from those of its views: of each point the weighted geometric median."""
    places, facing = (np.stack(v) for v in zip(*(v.lifted(v.landmarks.points[:, :2]) for v in views), strict=True))
    trust = np.ones_like(facing)
    if known is not None:
        # A point on the far side of the nose may lie on a surface that faces the camera, but is not its own.
        towards = -np.stack([view.camera.rotation[2] for view in views]) @ frame.rotation.T
        trust = np.clip(2.0 * known.normals @ towards.T, _LEAST_TRUST, 1.0).T
    irises, toward_irises = (
        np.stack(v) for v in zip(*(v.lifted(v.landmarks.iris[:, 0, :2]) for v in views), strict=True)
    )
    points, seen, spread = _medians(places, facing, trust)
    pupils, _, _ = _medians(irises, toward_irises, np.ones_like(toward_irises))
    score = min(view.landmarks.score for view in views)
    shown = np.flatnonzero(seen)
    if known is not None and len(shown) > N_POINTS // 2 and determines_rotation(points[shown]):
        frame = rigid_alignment(points[shown], known.places[shown], scale=True)
    return MeshLandmarks(mesh, points, seen, spread, pupils, score, frame, tuple(views))


def _medians(places: Array, facing: Array, trust: Array) -> tuple[Array, NDArray[np.int64], Array]:
    """Return the geometric medians, by Weiszfeld's iteration, of weighted ``places``, (v, n, 3).

    Returns:
        Points of shape (n, 3), the number of places of each, and their median distance from the point.
    """
    usable = (facing > _FACING) & ~np.isnan(places[..., 0])
    weights = np.where(usable, (facing * trust) ** 2, 0.0)
    filled = np.where(usable[..., None], places, 0.0)
    total = weights.sum(axis=0)
    sizes = np.where(total > 0.0, total, 1.0)
    points = np.einsum("vn,vnd->nd", weights, filled) / sizes[:, None]
    for _ in range(_ROUNDS if usable.any() else 0):
        distances = np.linalg.norm(filled - points, axis=2)
        shares = weights / np.maximum(distances, 1e-3 * max(float(np.median(distances[usable], axis=None)), 1e-12))
        points = np.einsum("vn,vnd->nd", shares, filled) / np.where(total > 0.0, shares.sum(axis=0), 1.0)[:, None]
    distances = np.where(usable, np.linalg.norm(filled - points, axis=2), np.nan)
    points[total == 0.0] = np.nan
    count = usable.sum(axis=0).astype(np.int64)
    spread = np.full(len(total), np.nan)
    spread[count > 0] = np.nanmedian(distances[:, count > 0], axis=0)
    return points, count, spread
