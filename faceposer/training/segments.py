"""Segmentation of a face into regions that move independently, each with its own modes.

Blanz and Vetter ("A morphable model for the synthesis of 3D faces", 1999, section 3.2) divide the face into segments
and blend them at their borders. The segments are those of the built-in man, with whom an upright face is aligned, or
are clustered from the examples by correlated motion. The masks sum to one everywhere, so that the sum of all segments
is the face.
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

# Least motion of the vertices that determine the borders, as a share of the largest.
_STILL = 0.03
# Weight of the distance relative to the similarity of motion.
_NEARNESS = 0.8
_TRAITS = 16
# A cluster with less than this share of its motion within this many radii of the midline is split by sides.
_ACROSS = 0.15
_MIDLINE = 0.25
# Least motion of a separate segment, as a share of the largest.
_LEAST_MOTION = 0.05
# Width of the borders, as a share of the radius of the moving part.
_BORDER = 0.14


_FACE_RADIUS_CM = 4.0
#: The segments of a face, and the man's regions in each.
_FACE = (
    ("brow left", ("brow_left",)),
    ("brow right", ("brow_right",)),
    ("eye left", ("lids_left", "eye_left")),
    ("eye right", ("lids_right", "eye_right")),
    ("ears", ("ear_left", "ear_right")),
    # Separate cheeks and nose produced smiles without cheeks, and were less accurate with four or more points.
    ("mouth", ("mouth", "lip_upper", "lip_lower", "jaw", "cheek_left", "cheek_right", "nose", "neck", "scalp")),
)


@dataclass(frozen=True, eq=False)
class Segments:
    """A smooth partition of a face.

    Attributes:
        names: Names by position, such as "upper" or "lower left".
        masks: Share of each vertex in each segment, shape (R, N), summing to 1 over the segments.
    """

    names: tuple[str, ...]
    masks: NDArray[np.float32]


def whole_face(n_vertices: int) -> Segments:
    """Return a single segment, the whole face."""
    return Segments(("face",), np.ones((1, n_vertices), dtype=np.float32))


def face_segments(
    vertices: Array,
    triangles: NDArray[np.integer],
    sample: NDArray[np.float32],
    regions: Mapping[str, NDArray[np.int32]] | None = None,
) -> Segments:
    """Return the segments of an upright face: brows, eyes, ears if they move, and the mouth with all the rest.

    Args:
        vertices: Upright neutral face in centimetres, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        sample: Sample of the examples' displacements, shape (n, N, 3).
        regions: Regions of the face; if None, those of the built-in man, with whom it is aligned.
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
    """Cluster a face into ``count`` segments; a cluster on both sides, but not in the middle, is split into two.

    Args:
        vertices: Upright neutral face, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        sample: Sample of the examples' displacements, shape (n, N, 3).
        count: Number of clusters; 1 for the whole face.
        seed: Random seed of the clustering.
    """
    motion = np.sqrt(np.einsum("fnd,fnd->n", sample, sample, dtype=np.float64) / len(sample))
    moving = np.flatnonzero(motion > _STILL * motion.max(initial=0.0))
    if count <= 1 or len(moving) < 4 * count:
        return whole_face(len(vertices))
    weights = motion[moving] ** 2
    middle = weights @ vertices[moving] / weights.sum()
    radius = float(np.sqrt(weights @ ((vertices[moving] - middle) ** 2).sum(axis=1) / weights.sum()))
    traits = _movement_traits(sample[:, moving], motion[moving])
    # Both sides move similarly: they are clustered together before they are split.
    places = (vertices[moving] - middle) / radius
    places[:, 0] = np.abs(places[:, 0])
    from sklearn.cluster import KMeans  # slow to import

    clusters = KMeans(count, n_init=10, random_state=seed)
    clusters.fit(np.hstack([traits, _NEARNESS * places]), sample_weight=np.sqrt(motion[moving]))
    split = _split_sides(clusters.labels_, vertices[moving, 0] - middle[0], np.sqrt(motion[moving]), _MIDLINE * radius)
    labels, _ = _without_gaps(_extend(split, moving, vertices, triangles))
    masks = _smooth(labels, vertices, triangles, (_BORDER * radius) ** 2)
    shares = masks @ (motion**2)
    order = [int(i) for i in np.argsort(-shares) if shares[i] > 0]
    places_of = [(masks[i] * motion**2) @ (vertices - middle) / shares[i] / radius for i in order]
    return Segments(_names(places_of), masks[order])


def _split_sides(labels: NDArray[np.integer], x: Array, weights: Array, midline: float) -> NDArray[np.intp]:
    """Return ``labels`` with a new label for the right of each cluster with little weight near the midline."""
    result: NDArray[np.intp] = labels.astype(np.intp)
    for label in np.unique(labels).tolist():
        inside = labels == label
        if weights[inside & (np.abs(x) < midline)].sum() < _ACROSS * weights[inside].sum():
            result[inside & (x < 0.0)] = result.max() + 1
    return result


def _movement_traits(sample: NDArray[np.float32], motion: Array) -> Array:
    """Return traits of each vertex, (n, k), with distances that measure the difference in motion, whatever its extent.

    Symmetric motion to opposite sides, as in a smile, counts as equal: the sign of x is ignored.
    """
    sized = sample / motion[None, :, None]
    strengths = np.concatenate([np.abs(sized[..., :1]), sized[..., 1:]], axis=2)
    flat = strengths.transpose(1, 0, 2).reshape(sample.shape[1], -1) / np.sqrt(sample.shape[0])
    centred = flat - flat.mean(axis=0)
    u, s, _ = np.linalg.svd(centred.T @ centred)
    traits: Array = centred @ u[:, : min(_TRAITS, len(s))]
    return traits


def _extend(
    labels: NDArray[np.integer], moving: NDArray[np.intp], vertices: Array, triangles: NDArray[np.integer]
) -> NDArray[np.intp]:
    """Extend the ``labels`` of the moving vertices to all vertices by proximity, with one label per small component."""
    _, nearest = KDTree(vertices[moving]).query(vertices)
    return _whole_pieces(labels[nearest].astype(np.intp), triangles)


def _whole_pieces(labels: NDArray[np.intp], triangles: NDArray[np.integer]) -> NDArray[np.intp]:
    """Return ``labels``, (N,), with one label per small component of the mesh, since eyeballs must not be divided."""
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
    """Return the masks of ``labels``, (R, N), smoothed by heat diffusion along the surface; they sum to 1."""
    count = len(vertices)
    one_hot = np.zeros((count, int(labels.max()) + 1))
    one_hot[np.arange(count), labels] = 1.0
    edges = sparse.coo_array(_edges(triangles, count))
    i, j = edges.coords
    lengths = ((vertices[i] - vertices[j]) ** 2).sum(axis=1)
    # Conductance is the squared width over the squared edge length, so that the result is independent of mesh density.
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
    """Return names for segments with the centroids ``places``, in radii from the common centroid."""
    names: list[str] = []
    for place in places:
        height = "upper" if place[1] > 0.35 else "lower" if place[1] < -0.35 else "middle"
        side = " left" if place[0] > 0.35 else " right" if place[0] < -0.35 else ""
        name, number = height + side, 2
        while name in names:
            name, number = f"{height}{side} {chr(ord('a') + number - 1)}", number + 1
        names.append(name)
    return tuple(names)
