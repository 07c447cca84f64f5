"""Canonical frame of a face: the similarity from the axes and unit of its file to upright centimetres.

In the canonical frame a face looks along +z with its left at +x, in centimetres. Files use metres or inches, with z up,
rotated or shifted. The motion determines the rest: brows are above the mouth, and the face is the front of the head.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from faceposer.geometry.alignment import Similarity, determines_rotation, rigid_alignment
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.character_file import load_character

Array = NDArray[np.float64]

#: Root mean square distance of the moving part from its centroid, in centimetres, for a face without known shapes.
_FACE_RADIUS = 4.0
#: Largest difference between both halves, as a share of the face's radius, of a mesh with a plane of symmetry.
_SYMMETRIC = 0.12
_SAMPLES = 3000
_MOST_TRIANGLES = 200_000
_ROUNDS = 60
_FEW = 500
#: Centroid of the moving part of the built-in man, in centimetres.
_FACE_MIDDLE = np.array([0.0, -5.3, 7.4])
# Radius around the face that contains the head, in centimetres, and the least excess of faces that point inwards.
_HEAD = 16.0
_CLEARLY_INWARDS = 0.2
# Correlation of opposite directions.
_NEGATED = 0.5
# Least motion of vertices of the face, as a share of the motion of most moving vertices.
_MOVING = 0.15
# Penalty, as a share of the distance, for an upward direction perpendicular to the y and z axes of the file.
_UNUSUAL = 0.2
# Largest mean distance in centimetres of a face that resembles the man's, and the least cosine of an axis with up.
_RESEMBLES_MAN = 0.36
_NEARLY_UP = 0.7
# Initial pitch angles of the search in degrees, and the share of the points that it uses.
_PITCHES = (-40.0, -30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0, 40.0)
_TRIMMED = 0.8
_MIRROR = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class FaceFrame:
    """The canonical frame of a face with ARKit's shapes, found from its geometry, and the sides of its shapes.

    Attributes:
        upright: Similarity from the file's axes and unit to the canonical frame.
        exchanged: True if the left shapes move the right side.
        inwards: True if the faces point inwards.
        negated: True if the shapes move vertices in the opposite directions.
    """

    upright: Similarity
    exchanged: bool
    inwards: bool
    negated: bool = False

    @property
    def mirrored(self) -> Similarity:
        """The frame followed by a reflection of left and right."""
        rotation, shift = self.upright.rotation, self.upright.translation
        return Similarity(_MIRROR[:, None] * rotation, _MIRROR * shift, self.upright.scale)


def frame_from_shapes(
    vertices: Array, triangles: NDArray[np.integer], shapes: Mapping[str, NDArray[np.float32]]
) -> FaceFrame | None:
    """Return the canonical frame of a face with ARKit's shapes, or None if the shapes do not determine one.

    The centroids of each shape's motion are aligned with those of the built-in man, with the sides as named and with
    exchanged ones. Names of the wrong side turn the face around; so the side is chosen by where the face looks: the
    moving part is in front of the rest, and lips and jaw move forward as those of the man. Then the plane of symmetry
    is refined.

    Args:
        vertices: Vertices in the file's unit and axes, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        shapes: Offsets, (N, 3), by ARKit's names.
    """
    reference = _reference_middles()
    names = [name for name in shapes if name in reference and np.any(shapes[name])]
    if len(names) < 4:
        return None
    middles = np.array([_middle(vertices, shapes[name]) for name in names])
    targets = np.array([reference[name] for name in names])
    if not determines_rotation(middles):
        return None
    crossed = np.array([reference[opposite_name(name)] for name in names])
    fits = [rigid_alignment(middles, places, scale=True) for places in (targets, crossed)]
    misses = [
        float(np.linalg.norm(fit.apply(middles) - places, axis=1).mean())
        for fit, places in zip(fits, (targets, crossed), strict=True)
    ]
    motion = np.sum([np.einsum("nd,nd->n", shapes[name], shapes[name], dtype=np.float64) for name in names], axis=0)
    extent = _capped_extent(motion)
    total = max(sum(misses), np.finfo(float).tiny)
    directions = {name: mean_direction(shapes[name]) for name in names}
    triangles = triangles[:: max(1, len(triangles) // _MOST_TRIANGLES)]
    likeness = [_directions_like_man(fit, directions) for fit in fits]
    # Displacements with the opposite sign move up where the man's move down.
    scores = [
        _frontness(fit.apply(vertices), triangles, extent)
        + forward * (1.0 if up >= 0.0 else -1.0)
        + (rest - miss) / total
        for fit, (up, forward), miss, rest in zip(fits, likeness, misses, misses[::-1], strict=True)
    ]
    exchanged = scores[1] > scores[0]
    upright = _make_symmetric(vertices, fits[int(exchanged)])
    inwards = _points_inwards(upright.apply(vertices), triangles, extent)
    up, forward = likeness[int(exchanged)]
    return FaceFrame(upright, exchanged, inwards, max(up, forward) < -_NEGATED)


def _frontness(placed: Array, triangles: NDArray[np.integer], extent: Array) -> float:
    """Return how far the moving part is in front of the rest of the head, from -1 to 1.

    Args:
        placed: Vertices in a canonical frame, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        extent: Displacement of each vertex, shape (N,).
    """
    corners = placed[triangles]
    centres = corners.mean(axis=1)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    moving = areas * extent[triangles].mean(axis=1)
    middle = moving @ centres / max(float(moving.sum()), np.finfo(float).tiny)
    areas = areas * (np.linalg.norm(centres - middle, axis=1) < _HEAD)
    depth = middle[2] - areas @ centres[:, 2] / max(float(areas.sum()), np.finfo(float).tiny)
    return float(np.clip(depth / _FACE_RADIUS, -1.0, 1.0))


def _directions_like_man(fit: Similarity, directions: Mapping[str, Array]) -> tuple[float, float]:
    """Return the correlation with the man's of upward and of forward motion, each from -1 to 1.

    Args:
        fit: Similarity to a canonical frame.
        directions: Mean direction, shape (3,), by name of the shape.
    """
    man = _reference_directions()
    ours = np.array([fit.rotation @ direction for direction in directions.values()])
    theirs = np.array([man[name] for name in directions])
    products, squares = (ours * theirs).sum(axis=0), (ours**2).sum(axis=0) * (theirs**2).sum(axis=0)
    _, up, forward = (products / np.sqrt(np.maximum(squares, np.finfo(float).tiny))).tolist()
    return up, forward


def _points_inwards(placed: Array, triangles: NDArray[np.integer], extent: Array) -> bool:
    """Return True if the moving faces of a head that looks along +z point backwards."""
    corners = placed[triangles]
    forward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    weighted = forward * extent[triangles].mean(axis=1)
    return float(weighted.sum()) < -_CLEARLY_INWARDS * float(np.abs(weighted).sum())


def mean_direction(offsets: NDArray[np.floating]) -> Array:
    """Return the mean of the displacements, (N, 3), weighted by and relative to their lengths; at most of length 1."""
    lengths = np.linalg.norm(offsets.astype(np.float64), axis=1)
    squares = float(lengths @ lengths)
    mean: Array = lengths @ offsets / squares if squares > 0.0 else np.zeros(3)
    return mean


def opposite_name(name: str) -> str:
    """Return the name of a shape's counterpart on the other side."""
    for side, other in (("Left", "Right"), ("Right", "Left")):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name


def frame_from_motion(vertices: Array, triangles: NDArray[np.integer], motion: Array) -> tuple[Similarity, bool] | None:
    """Return the canonical frame of a face from its motion alone, and True if it resembles the built-in man.

    Returns None if the mesh does not determine a frame.

    The moving part faces forward, and the plane of symmetry gives the sides. The upward direction and the pitch of the
    head are those of the best alignment with the built-in man by iterated closest points.

    Args:
        vertices: Vertices in the file's unit and axes, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        motion: Mean squared displacement of each vertex, shape (N,).
    """
    extent = _capped_extent(motion)
    weights = extent / max(float(extent.sum()), np.finfo(float).tiny)
    middle = weights @ vertices
    normals = VertexNormals(triangles, len(vertices))(vertices).astype(np.float64)
    forward = _unit(weights @ normals)
    sideways = min(np.eye(3), key=lambda axis: abs(float(axis @ forward)))
    up = _unit(sideways - (sideways @ forward) * forward)
    turned = np.stack([np.cross(up, forward), up, forward])
    radius = float(np.sqrt(weights @ ((vertices - middle) ** 2).sum(axis=1)))
    scale = np.array(_FACE_RADIUS / max(radius, np.finfo(float).tiny))
    centred = _sample(vertices) - middle

    def rolled(angle: float) -> Similarity:
        return Similarity(_rotation(np.array([0.0, 0.0, 1.0]), angle) @ turned, np.zeros(3), scale)

    angles = np.deg2rad(np.arange(0, 180, 5))
    errors = [_mirror_distance(rolled(angle).apply_to_directions(centred)) for angle in angles]
    roll = float(angles[int(np.argmin(errors))])
    upright = [_centre(rolled(angle), middle) for angle in (roll, roll + np.pi)]
    upright = [_make_symmetric(vertices, start) for start in upright]
    moving = _sample(vertices[extent > _MOVING * extent.max()])
    everything = _sample(vertices)
    tree = KDTree(everything)
    few = moving[:: max(1, len(moving) // _FEW)]
    starts = [_pitch(start, np.deg2rad(angle)) for start in upright for angle in _PITCHES]
    fits = [_align_to_man(few, everything, tree, start, 12) for start in starts]
    # Non-human faces align nearly as well upside down; most files have y or z up.
    best, miss = min(fits, key=lambda fit: fit[1] * (1.0 + _UNUSUAL * (1.0 - float(fit[0].rotation[1, 1:].max()))))
    if not np.isfinite(miss):
        return None
    found, distance = _align_to_man(moving, everything, tree, best, _ROUNDS)
    if distance < _RESEMBLES_MAN:
        return found, True
    # The pitch cannot be determined from a face so unlike the man's: use the file's upward axis.
    level = _level(found)
    return _align_to_man(moving, everything, tree, level, _ROUNDS, turning=False)[0], False


def _level(found: Similarity) -> Similarity:
    """Return ``found`` followed by a pitch that turns the file's y or z axis exactly up, if one of them nearly is."""
    _, up, forward = found.rotation
    axis = max((np.eye(3)[1], np.eye(3)[2]), key=lambda axis: float(axis @ up))
    if axis @ up < _NEARLY_UP:
        return found
    return _pitch(found, float(np.arctan2(-(axis @ forward), axis @ up)))


def _capped_extent(motion: Array) -> Array:
    """Return the displacement of the vertices, (N,), capped at its third quartile, since ears may dominate."""
    extent = np.sqrt(motion)
    moving = extent[extent > 0.05 * extent.max(initial=0.0)]
    return np.minimum(extent, np.quantile(moving, 0.75)) if len(moving) else extent


def _centre(turn: Similarity, middle: Array) -> Similarity:
    """Return ``turn`` with a translation of the ``middle`` of the moving part to its position on the built-in man."""
    return Similarity(turn.rotation, _FACE_MIDDLE - turn.apply_to_directions(middle[None])[0], turn.scale)


def _pitch(start: Similarity, angle: float) -> Similarity:
    """Return ``start`` followed by a pitch by ``angle`` about the centre of the face."""
    nod = _rotation(np.array([1.0, 0.0, 0.0]), angle)
    return Similarity(nod @ start.rotation, nod @ (start.translation - _FACE_MIDDLE) + _FACE_MIDDLE, start.scale)


def _align_to_man(
    moving: Array, everything: Array, tree: KDTree, start: Similarity, rounds: int, turning: bool = True
) -> tuple[Similarity, float]:
    """Refine ``start`` by iterated closest points with the man's face, and return it with the distance of the faces.

    Closest points are found from the moving part to the man's face and from the man's face to the head, so that neither
    shrinks into the other. Points are fitted together with their mirror images, to keep the plane of symmetry.
    """
    surface, surface_tree = _face_of_man()
    similarity, distance = start, np.inf
    for _ in range(rounds):
        to_man, man_ids = surface_tree.query(similarity.apply(moving))
        to_head, head_ids = tree.query(similarity.inverse().apply(surface))
        near, close = to_man <= np.quantile(to_man, _TRIMMED), to_head <= np.quantile(to_head, _TRIMMED)
        source = similarity.apply(np.vstack([moving[near], everything[head_ids[close]]]))
        target = np.vstack([surface[man_ids[near]], surface[close]])
        weights = np.repeat([1.0 / near.sum(), 1.0 / close.sum()], [near.sum(), close.sum()])
        distance = 0.5 * float(weights @ np.linalg.norm(source - target, axis=1))
        if not (determines_rotation(source) and determines_rotation(target)):
            return similarity, np.inf
        both = np.vstack([source, source * _MIRROR]), np.vstack([target, target * _MIRROR])
        step = rigid_alignment(*both, np.tile(weights, 2), scale=True)
        if not turning:
            shift = step.apply(source).mean(axis=0) - step.scale * source.mean(axis=0)
            step = Similarity(np.eye(3), shift * (0.0, 1.0, 1.0), step.scale)
        similarity = Similarity(
            step.rotation @ similarity.rotation,
            step.apply(similarity.translation[None])[0],
            step.scale * similarity.scale,
        )
    return similarity, distance


@lru_cache(maxsize=1)
def _face_of_man() -> tuple[Array, KDTree]:
    """Return the points of the man's face that expressions move, and their search tree."""
    man = load_character("man")
    skin = slice(*man.part("skin").vertices)
    extent = _capped_extent(np.einsum("snd,snd->n", man.shapes[:, skin], man.shapes[:, skin]))
    surface = _sample(man.vertices[skin][extent > 0.5 * _MOVING * extent.max()].astype(np.float64))
    return surface, KDTree(surface)


def _make_symmetric(vertices: Array, start: Similarity) -> Similarity:
    """Return ``start`` rotated and shifted to make x = 0 the plane of symmetry of the face, if it has one."""
    similarity = start
    points = _sample(vertices)
    for _ in range(_ROUNDS):
        placed = similarity.apply(points)
        distances, partners = KDTree(placed).query(placed * _MIRROR)
        near = distances <= np.quantile(distances, 0.7)
        if distances[near].mean() > _SYMMETRIC * _FACE_RADIUS:
            return start
        across = placed[near] - placed[partners[near]]
        halfway = 0.5 * (placed[near] + placed[partners[near]])
        normal = np.linalg.eigh(across.T @ across)[1][:, -1]
        normal = normal * np.sign(normal[0])
        axis = np.cross(normal, (1.0, 0.0, 0.0))
        turn = _rotation(axis, float(np.arcsin(min(float(np.linalg.norm(axis)), 1.0))))
        shift = np.array([-float((halfway @ turn.T)[:, 0].mean()), 0.0, 0.0])
        similarity = Similarity(turn @ similarity.rotation, turn @ similarity.translation + shift, similarity.scale)
        if np.linalg.norm(axis) < 1e-9 and abs(shift[0]) < 1e-9:
            break
    return similarity


def _mirror_distance(placed: Array) -> float:
    """Return the trimmed mean distance between points, (n, 3), and their mirror image, robust to one-sided points."""
    distances, _ = KDTree(placed).query(placed * _MIRROR)
    return float(np.sort(distances)[: int(0.7 * len(distances))].mean())


def _sample(vertices: Array) -> Array:
    step = max(1, len(vertices) // _SAMPLES)
    return vertices[::step]


@lru_cache(maxsize=1)
def _reference_middles() -> dict[str, Array]:
    man = load_character("man")
    pairs = zip(man.shape_names, man.shapes, strict=True)
    return {name: _middle(man.vertices.astype(np.float64), shape) for name, shape in pairs if np.any(shape)}


@lru_cache(maxsize=1)
def _reference_directions() -> dict[str, Array]:
    man = load_character("man")
    return {name: mean_direction(shape) for name, shape in zip(man.shape_names, man.shapes, strict=True)}


def _middle(vertices: Array, offsets: NDArray[np.float32]) -> Array:
    weights = np.einsum("nd,nd->n", offsets, offsets, dtype=np.float64)
    middle: Array = weights @ vertices / weights.sum()
    return middle


def _unit(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.array([0.0, 0.0, 1.0])


def _rotation(axis: Array, angle: float) -> Array:
    """Return the matrix of a rotation by ``angle`` about ``axis`` (Rodrigues' formula)."""
    x, y, z = _unit(axis)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * (skew @ skew)
