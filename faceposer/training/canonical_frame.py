"""Where a character's face looks: from the axes and the unit of its file to upright centimetres.

The program wants a face that looks along +z with its left at +x, in centimetres. Files come in metres or inches, with z
up, turned or shifted. What moves tells the rest: brows lie above the mouth, the left smile on the left.
"""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from faceposer.geometry.alignment import Similarity, determines_rotation, rigid_alignment
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.character_file import load_character

Array = NDArray[np.float64]

#: Root mean square distance of what moves from its middle, in centimetres, that a face without known shapes is given.
_FACE_RADIUS = 4.0
#: A mesh whose halves differ by more than this share of the face's radius has no plane of symmetry to find.
_SYMMETRIC = 0.12
_SAMPLES = 3000
_ROUNDS = 60
_FEW = 500
#: Where the middle of what moves is on the program's own man, in centimetres.
_FACE_MIDDLE = np.array([0.0, -5.3, 7.4])
# Left and right count as exchanged where that fits better by this factor.
_CLEARLY = 0.6
# What moves by less than this share of how far most of the moving vertices do is not taken for the face.
_MOVING = 0.15
# How much worse, as a share, a place must be whose way up is square to the file's.
_UNUSUAL = 0.2
# Mean distance, in centimetres, of faces that are like the man's, and the cosine of how far from up an axis may be.
_RESEMBLES_MAN = 0.36
_NEARLY_UP = 0.7
# Nods from which the search for the best place starts, in degrees, and the share of the points that counts in it.
_BENDS = (-40.0, -30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0, 40.0)
_TRIMMED = 0.8
_MIRROR = np.array([-1.0, 1.0, 1.0])


def frame_from_shapes(vertices: Array, shapes: Mapping[str, NDArray[np.float32]]) -> tuple[Similarity, bool] | None:
    """Return what brings a face with ARKit's shapes upright, and if its sides are exchanged; None if none can tell.

    The middles of what each shape moves are laid on those of the program's own man; then the plane of symmetry is made
    exact.

    Args:
        vertices: In the file's unit and axes, shape (N, 3).
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
    exchanged = misses[1] < _CLEARLY * misses[0]
    return _symmetrised(vertices, fits[int(exchanged)]), exchanged


def opposite_name(name: str) -> str:
    """Return the name of the same shape on the other side."""
    for side, other in (("Left", "Right"), ("Right", "Left")):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name


def frame_from_motion(vertices: Array, triangles: NDArray[np.integer], motion: Array) -> tuple[Similarity, bool]:
    """Return what brings a face upright of which only is known how much each vertex moves, and if it is like a man's.

    What moves faces forward; the plane of symmetry gives the sides; which way is up and how far the head is bent shows
    where its face lies best on that of the program's own man, by iterated closest points.

    Args:
        vertices: In the file's unit and axes, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        motion: Mean squared distance that each vertex moves, shape (N,).
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
    upright = [_centred_on(rolled(angle), middle) for angle in (roll, roll + np.pi)]
    upright = [_symmetrised(vertices, start) for start in upright]
    moving = _sample(vertices[extent > _MOVING * extent.max()])
    everything = _sample(vertices)
    tree = KDTree(everything)
    few = moving[:: max(1, len(moving) // _FEW)]
    starts = [_nodded(start, np.deg2rad(angle)) for start in upright for angle in _BENDS]
    fits = [_align_to_man(few, everything, tree, start, 12) for start in starts]
    # Faces of other beings lie on a man's nearly as well upside down; files mostly have y or z upwards.
    best, _ = min(fits, key=lambda fit: fit[1] * (1.0 + _UNUSUAL * (1.0 - float(fit[0].rotation[1, 1:].max()))))
    found, distance = _align_to_man(moving, everything, tree, best, _ROUNDS)
    if distance < _RESEMBLES_MAN:
        return found, True
    # How far the head is bent cannot be told from a face so unlike a man's: the file's own way up is taken.
    level = _levelled(found)
    return _align_to_man(moving, everything, tree, level, _ROUNDS, turning=False)[0], False


def _levelled(found: Similarity) -> Similarity:
    """Return ``found`` with a nod after it that puts the file's y or z straight up, if one of them nearly is."""
    _, up, forward = found.rotation
    axis = max((np.eye(3)[1], np.eye(3)[2]), key=lambda axis: float(axis @ up))
    if axis @ up < _NEARLY_UP:
        return found
    return _nodded(found, float(np.arctan2(-(axis @ forward), axis @ up)))


def _capped_extent(motion: Array) -> Array:
    """Return how far vertices move, (N,), at most as far as most of the moving ones do: ears may move most of all."""
    extent = np.sqrt(motion)
    moving = extent[extent > 0.05 * extent.max(initial=0.0)]
    return np.minimum(extent, np.quantile(moving, 0.75)) if len(moving) else extent


def _centred_on(turn: Similarity, middle: Array) -> Similarity:
    """Return ``turn`` with the ``middle`` of what moves put where it is on the program's own man."""
    return Similarity(turn.rotation, _FACE_MIDDLE - turn.apply_to_directions(middle[None])[0], turn.scale)


def _nodded(start: Similarity, angle: float) -> Similarity:
    """Return ``start`` followed by a nod by ``angle`` about the middle of the face."""
    nod = _rotation(np.array([1.0, 0.0, 0.0]), angle)
    return Similarity(nod @ start.rotation, nod @ (start.translation - _FACE_MIDDLE) + _FACE_MIDDLE, start.scale)


def _align_to_man(
    moving: Array, everything: Array, tree: KDTree, start: Similarity, rounds: int, turning: bool = True
) -> tuple[Similarity, float]:
    """Return ``start`` after iterated closest points with the man's face, and how far apart the faces are.

    What moves looks for the man's face and the man's face for the head, so that neither shrinks into the other. Points
    and their mirror images are fitted together, so that the plane of symmetry stays where it is.
    """
    surface, surface_tree = _face_of_man()
    similarity, distance = start, np.inf
    for _ in range(rounds):
        there, onto = surface_tree.query(similarity.apply(moving))
        back, of = tree.query(similarity.inverse().apply(surface))
        near, close = there <= np.quantile(there, _TRIMMED), back <= np.quantile(back, _TRIMMED)
        source = similarity.apply(np.vstack([moving[near], everything[of[close]]]))
        target = np.vstack([surface[onto[near]], surface[close]])
        weights = np.repeat([1.0 / near.sum(), 1.0 / close.sum()], [near.sum(), close.sum()])
        distance = 0.5 * float(weights @ np.linalg.norm(source - target, axis=1))
        if not determines_rotation(target):
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
    """Return the points of the man's face that expressions move, and a tree of them."""
    man = load_character("man")
    skin = slice(*man.part("skin").vertices)
    extent = _capped_extent(np.einsum("snd,snd->n", man.shapes[:, skin], man.shapes[:, skin]))
    surface = _sample(man.vertices[skin][extent > 0.5 * _MOVING * extent.max()].astype(np.float64))
    return surface, KDTree(surface)


def _symmetrised(vertices: Array, start: Similarity) -> Similarity:
    """Return ``start`` turned and shifted so that x = 0 is the face's plane of symmetry, if it has one."""
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
    """Return how far the mirror image of points, (n, 3), is from them; few one-sided points do not spoil it."""
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


def _middle(vertices: Array, offsets: NDArray[np.float32]) -> Array:
    weights = np.einsum("nd,nd->n", offsets, offsets, dtype=np.float64)
    middle: Array = weights @ vertices / weights.sum()
    return middle


def _unit(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.array([0.0, 0.0, 1.0])


def _rotation(axis: Array, angle: float) -> Array:
    """Return the turn by ``angle`` about ``axis`` (Rodrigues' formula)."""
    x, y, z = _unit(axis)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * (skew @ skew)
