"""Regions of a face that move by themselves, each with modes of its own.

Blanz and Vetter ("A morphable model for the synthesis of 3D faces", 1999, section 3.2) cut the face into segments and
blend them at their borders. The cut is that of the program's own man, on whom an upright face lies; or it comes from
the examples: vertices whose movements go together belong together. The masks add up to one everywhere, so
that the sum of all segments is the face again.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from faceposer.model.character_file import load_character

Array = NDArray[np.float64]

# What moves less than this share of the most moving vertex has no say in where the borders are.
_STILL = 0.03
# How much nearness counts beside moving alike.
_NEARNESS = 0.8
_TRAITS = 16
# A cluster with less than this share of its movement within this many radii of the middle is two, left and right.
_ACROSS = 0.15
_MIDST = 0.25
# A segment that moves less than this share of what moves most has nothing of its own to learn.
_LEAST_MOTION = 0.05
# The borders are as wide as this share of the moving part's radius.
_BORDER = 0.14


_FACE_RADIUS_CM = 4.0
#: The segments of a face, with the man's regions that make them.
_FACE = (
    ("brow left", ("brow_left",)),
    ("brow right", ("brow_right",)),
    ("eye left", ("lids_left", "eye_left")),
    ("eye right", ("lids_right", "eye_right")),
    ("ears", ("ear_left", "ear_right")),
    # Cheeks and nose by themselves made smiles without cheeks, and were less accurate from four points on.
    ("mouth", ("mouth", "lip_upper", "lip_lower", "jaw", "cheek_left", "cheek_right", "nose", "neck", "scalp")),
)


@dataclass(frozen=True, eq=False)
class Segments:
    """A smooth partition of a face.

    Attributes:
        names: By where they lie, such as "upper" or "lower left".
        masks: How much each vertex belongs to each segment, shape (R, N), adding up to 1.
    """

    names: tuple[str, ...]
    masks: NDArray[np.float32]


def whole_face(n_vertices: int) -> Segments:
    """Return the one segment that is the whole face."""
    return Segments(("face",), np.ones((1, n_vertices), dtype=np.float32))


def face_segments(
    vertices: Array,
    triangles: NDArray[np.integer],
    sample: NDArray[np.float32],
    regions: Mapping[str, NDArray[np.int32]] | None = None,
) -> Segments:
    """Return brows, eyes, ears if they move, and the mouth with cheeks, nose and all the rest, of an upright face.

    Args:
        vertices: Upright neutral face in centimetres, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        sample: Displacements in some examples, shape (n, N, 3).
        regions: The face's own regions, if it has them; else those of the man, on whom it lies.
    """
    motion = np.sqrt(np.einsum("fnd,fnd->n", sample, sample, dtype=np.float64) / len(sample))
    places, of = vertices, regions
    if of is None:
        man = load_character("man")
        places, of = man.vertices.astype(np.float64), man.regions
    label_of = np.full(len(places), -1, dtype=np.intp)
    names = [name for name, _ in _FACE]
    for label, (_, members) in enumerate(_FACE):
        for region in members:
            label_of[of.get(region, [])] = label
    forehead = of.get("forehead", np.zeros(0, dtype=np.int32))
    label_of[forehead] = np.where(places[forehead, 0] > 0.0, names.index("brow left"), names.index("brow right"))
    known = np.flatnonzero(label_of >= 0)
    _, nearest = KDTree(places[known]).query(vertices)
    labels = _whole_pieces(label_of[known[nearest]], triangles)
    for label in range(len(_FACE)):
        if np.any(labels == label) and motion[labels == label].max() < _LEAST_MOTION * motion.max():
            labels[labels == label] = len(_FACE) - 1
    labels, used = _without_gaps(labels)
    masks = _smooth(labels, vertices, triangles, (_BORDER * _FACE_RADIUS_CM) ** 2)
    return Segments(tuple(names[label] for label in used), masks)


def find_segments(
    vertices: Array, triangles: NDArray[np.integer], sample: NDArray[np.float32], count: int, seed: int = 0
) -> Segments:
    """Return the segments of a face: ``count`` of them, those that lie on both sides and not between as two.

    Args:
        vertices: Upright neutral face, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        sample: Displacements in some examples, shape (n, N, 3).
        count: How many segments to find; 1 for the whole face.
        seed: Of the clustering.
    """
    motion = np.sqrt(np.einsum("fnd,fnd->n", sample, sample, dtype=np.float64) / len(sample))
    moving = np.flatnonzero(motion > _STILL * motion.max(initial=0.0))
    if count <= 1 or len(moving) < 4 * count:
        return whole_face(len(vertices))
    weights = motion[moving] ** 2
    middle = weights @ vertices[moving] / weights.sum()
    radius = float(np.sqrt(weights @ ((vertices[moving] - middle) ** 2).sum(axis=1) / weights.sum()))
    traits = _movement_traits(sample[:, moving], motion[moving])
    # What lies left and right moves alike, and is found together before it is parted.
    places = (vertices[moving] - middle) / radius
    places[:, 0] = np.abs(places[:, 0])
    from sklearn.cluster import KMeans  # slow to import

    clusters = KMeans(count, n_init=10, random_state=seed)
    clusters.fit(np.hstack([traits, _NEARNESS * places]), sample_weight=np.sqrt(motion[moving]))
    parted = _by_sides(clusters.labels_, vertices[moving, 0] - middle[0], np.sqrt(motion[moving]), _MIDST * radius)
    labels, _ = _without_gaps(_spread(parted, moving, vertices, triangles))
    masks = _smooth(labels, vertices, triangles, (_BORDER * radius) ** 2)
    shares = masks @ (motion**2)
    order = [int(i) for i in np.argsort(-shares) if shares[i] > 0]
    places_of = [(masks[i] * motion**2) @ (vertices - middle) / shares[i] / radius for i in order]
    return Segments(_names(places_of), masks[order])


def _by_sides(labels: NDArray[np.integer], x: Array, weights: Array, midst: float) -> NDArray[np.intp]:
    """Return ``labels`` with a new one for the right of each cluster that has little of its weight near the middle."""
    result: NDArray[np.intp] = labels.astype(np.intp)
    for label in np.unique(labels).tolist():
        inside = labels == label
        if weights[inside & (np.abs(x) < midst)].sum() < _ACROSS * weights[inside].sum():
            result[inside & (x < 0.0)] = result.max() + 1
    return result


def _movement_traits(sample: NDArray[np.float32], motion: Array) -> Array:
    """Return a few numbers per vertex, (n, k), whose distances tell how differently vertices move, whatever the extent.

    Movement to the left on the left and to the right on the right, as of a smile, is alike: x has no sign.
    """
    sized = sample / motion[None, :, None]
    strengths = np.concatenate([np.abs(sized[..., :1]), sized[..., 1:]], axis=2)
    flat = strengths.transpose(1, 0, 2).reshape(sample.shape[1], -1) / np.sqrt(sample.shape[0])
    centred = flat - flat.mean(axis=0)
    u, s, _ = np.linalg.svd(centred.T @ centred)
    traits: Array = centred @ u[:, : min(_TRAITS, len(s))]
    return traits


def _spread(
    labels: NDArray[np.integer], moving: NDArray[np.intp], vertices: Array, triangles: NDArray[np.integer]
) -> NDArray[np.intp]:
    """Return a label for every vertex: that of the nearest moving one, and one for each small piece as a whole."""
    _, nearest = KDTree(vertices[moving]).query(vertices)
    return _whole_pieces(labels[nearest].astype(np.intp), triangles)


def _whole_pieces(labels: NDArray[np.intp], triangles: NDArray[np.integer]) -> NDArray[np.intp]:
    """Return ``labels``, (N,), with one for each small piece of the mesh: an eyeball is rigid and must not be cut."""
    whole = labels.copy()
    n_pieces, piece = connected_components(_edges(triangles, len(labels)), directed=False)
    sizes = np.bincount(piece, minlength=n_pieces)
    for i in np.flatnonzero(sizes < 0.25 * len(labels)):
        members = piece == i
        whole[members] = np.bincount(whole[members]).argmax()
    return whole


def _without_gaps(labels: NDArray[np.intp]) -> tuple[NDArray[np.intp], list[int]]:
    used, renumbered = np.unique(labels, return_inverse=True)
    return renumbered.ravel(), used.tolist()


def _smooth(
    labels: NDArray[np.intp], vertices: Array, triangles: NDArray[np.integer], squared_width: float
) -> NDArray[np.float32]:
    """Return masks, (R, N), of ``labels`` after heat has flowed along the surface so far; they still add up to 1."""
    count = len(vertices)
    one_hot = np.zeros((count, int(labels.max()) + 1))
    one_hot[np.arange(count), labels] = 1.0
    edges = sparse.coo_array(_edges(triangles, count))
    i, j = edges.coords
    lengths = ((vertices[i] - vertices[j]) ** 2).sum(axis=1)
    # Each edge passes heat as the square of the width over its own squared length, so that density does not matter.
    flow = np.minimum(squared_width / np.maximum(lengths, 1e-12 * squared_width), 1e4) * 0.25
    weights = sparse.coo_array((flow, (i, j)), shape=(count, count))
    weights = (weights + weights.T).tocsc()
    laplacian = sparse.diags_array(np.asarray(weights.sum(axis=1)).ravel()) - weights
    masks = splu((sparse.eye_array(count) + laplacian).tocsc()).solve(one_hot)
    masks = np.clip(masks, 0.0, 1.0)
    return (masks / masks.sum(axis=1, keepdims=True)).T.astype(np.float32)


def _edges(triangles: NDArray[np.integer], count: int) -> sparse.csr_array:
    a, b, c = np.asarray(triangles, dtype=np.int32).T
    rows, columns = np.concatenate([a, b, c]), np.concatenate([b, c, a])
    low, high = np.minimum(rows, columns), np.maximum(rows, columns)
    pairs = np.unique(np.stack([low, high], axis=1), axis=0)
    return sparse.csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))


def _names(places: list[Array]) -> tuple[str, ...]:
    """Return what to call segments whose middles lie at ``places``, in radii from the middle of all."""
    names: list[str] = []
    for place in places:
        height = "upper" if place[1] > 0.35 else "lower" if place[1] < -0.35 else "middle"
        side = " left" if place[0] > 0.35 else " right" if place[0] < -0.35 else ""
        name, number = height + side, 2
        while name in names:
            name, number = f"{height}{side} {chr(ord('a') + number - 1)}", number + 1
        names.append(name)
    return tuple(names)
