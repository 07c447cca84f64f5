"""A chart of the face: two surface coordinates that denote the same place on every character.

Vertices are unrolled from a cylinder about the head's vertical axis, and a thin-plate spline (Bookstein 1989) maps the
feature points to their places in the chart, those of the built-in character "man". Texture coordinates are not needed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.model.character import Character

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

#: Chart coordinates (u, v) of MPEG-4's feature points of the left half, in centimetres of the built-in man: u along the
#: cylinder to the character's left, v up. The right half mirrors them.
_PLACES: dict[str, tuple[float, float]] = {
    "2.1": (0.00, -9.30),
    "2.10": (0.00, -7.74),
    "2.11": (1.93, -8.30),
    "3.7": (4.82, 1.60),
    "3.9": (3.22, 0.84),
    "3.11": (1.85, 1.52),
    "3.13": (3.04, 2.25),
    "4.1": (1.48, 3.69),
    "4.3": (3.24, 4.11),
    "4.5": (6.17, 3.59),
    "5.1": (4.45, -2.68),
    "5.3": (6.06, 0.29),
    "8.1": (0.00, -4.37),
    "8.2": (0.00, -5.69),
    "8.3": (2.64, -5.06),
    "9.1": (1.59, -1.91),
    "9.3": (0.00, -2.01),
    "9.12": (0.00, -0.43),
    "9.15": (0.00, -3.14),
    "11.1": (0.00, 8.66),
    "11.3": (6.39, 7.34),
}
_OTHER_SIDE = {
    "2.11": "2.12",
    "3.7": "3.12",
    "3.9": "3.10",
    "3.11": "3.8",
    "3.13": "3.14",
    "4.1": "4.2",
    "4.3": "4.4",
    "4.5": "4.6",
    "5.1": "5.2",
    "5.3": "5.4",
    "8.3": "8.4",
    "9.1": "9.2",
    "11.3": "11.2",
}
#: Feature points without which a face has no chart.
_REQUIRED = ("3.7", "3.12", "3.11", "3.8", "4.1", "4.2", "4.5", "4.6", "8.3", "8.4", "9.1", "9.2")
#: Radius of the cylinder, in centimetres of the man.
_RADIUS = 9.0
# Outer corners of the man's eyes: distance from the plane of symmetry, and distance in front of the cylinder's axis as
# a multiple of it.
_EYE_CORNER_CM, _EYE_CORNER_FORWARD = 4.46, 1.684
# Smoothing of the spline relative to its kernel, since detected feature points are inexact.
_SMOOTHING = 0.02
# Limits of the chart: the cheeks in front of the ears, the top of the forehead, the chin.
_LARGEST_ANGLE = 1.75
_LARGEST_DISTANCE_CM = 13.0
# Skin this much deeper than other skin in the same direction is inside the mouth, the nose or an eye socket.
_HIDDEN_CM = 0.7
_CELL_CM = 0.2
# Largest share of the face that a valid chart may fold over.
_MOST_FLIPPED = 0.06


@dataclass(frozen=True, eq=False)
class FaceChart:
    """The chart of one face.

    Attributes:
        places: Coordinates (u, v) of every vertex, shape (N, 2); far away for vertices outside the chart.
        visible: Degree from 0 to 1 to which each vertex is outer skin within the chart, shape (N,).
        scale: Length on the face of one centimetre of the chart.
    """

    places: Floats
    visible: Floats
    scale: float


def face_chart(character: Character) -> FaceChart | None:
    """Return the chart of the neutral face of ``character``, or None if its feature points do not determine one."""
    if not set(_REQUIRED) <= character.feature_points.keys():
        return None
    vertices = np.asarray(character.vertices, dtype=np.float64)
    named = {
        name: vertices[character.feature_points[name]] for name in _landmarks() if name in character.feature_points
    }
    left, right = named["3.7"], named["3.12"]
    half_width = 0.5 * float(left[0] - right[0])
    if half_width <= 0.0:
        return None
    scale = half_width / _EYE_CORNER_CM
    middle = 0.5 * (left + right)
    axis = np.array([middle[0], middle[1], middle[2] - _EYE_CORNER_FORWARD * half_width])
    rough, radius = _unrolled((vertices - axis) / scale)
    sources, _ = _unrolled((np.stack(list(named.values())) - axis) / scale)
    targets = np.array([_landmarks()[name] for name in named])
    spline = _ThinPlateSpline(sources, targets, _SMOOTHING)

    skin = np.zeros(len(vertices), dtype=bool)
    for part in character.parts:
        if part.material == "skin":
            skin[slice(*part.vertices)] = True
    within = skin & (np.abs(rough[:, 0]) < _LARGEST_ANGLE * _RADIUS) & (np.abs(rough[:, 1]) < _LARGEST_DISTANCE_CM)
    ids = np.flatnonzero(within)
    if not len(ids):
        return None
    places = np.full((len(vertices), 2), 1e3)
    places[ids] = spline(rough[ids])
    triangles = character.triangles[within[character.triangles].all(axis=1)]
    if not len(triangles):
        return None
    outer = _facing_out(vertices - axis, triangles) * _in_front(rough, radius, triangles)
    if _flipped(places, outer, triangles) > _MOST_FLIPPED:
        return None
    visible = np.where(within, outer, 0.0)
    return FaceChart(places.astype(np.float32), visible.astype(np.float32), scale)


def _landmarks() -> dict[str, tuple[float, float]]:
    mirrored = {other: (-_PLACES[name][0], _PLACES[name][1]) for name, other in _OTHER_SIDE.items()}
    return _PLACES | mirrored


def _unrolled(places: Array) -> tuple[Array, Array]:
    """Return the cylinder coordinates, (n, 2), and radii, (n,), of ``places`` relative to the axis, (n, 3)."""
    return (
        np.stack([_RADIUS * np.arctan2(places[:, 0], places[:, 2]), places[:, 1]], axis=1),
        np.hypot(places[:, 0], places[:, 2]),
    )


class _ThinPlateSpline:
    """Smoothing spline f(x) = A x + b + Σ_i w_i U(|x - x_i|), U(r) = r² log r, with λ on the kernel's diagonal."""

    def __init__(self, sources: Array, targets: Array, smoothing: float) -> None:
        self._sources = sources
        n = len(sources)
        kernel = self._kernel(sources)
        system = np.zeros((n + 3, n + 3))
        system[:n, :n] = kernel + smoothing * np.abs(kernel).mean() * np.eye(n)
        system[:n, n], system[:n, n + 1 :] = 1.0, sources
        system[n:, :n] = system[:n, n:].T
        self._solution = np.linalg.solve(system, np.vstack([targets, np.zeros((3, 2))]))

    def _kernel(self, points: Array) -> Array:
        squares = np.maximum(
            (points**2).sum(axis=1)[:, None] + (self._sources**2).sum(axis=1) - 2.0 * points @ self._sources.T, 1e-12
        )
        kernel: Array = 0.5 * squares * np.log(squares)
        return kernel

    def __call__(self, points: Array) -> Array:
        n = len(self._sources)
        mapped: Array = self._kernel(points) @ self._solution[:n] + self._solution[n] + points @ self._solution[n + 1 :]
        return mapped


def _facing_out(places: Array, triangles: NDArray[np.int32]) -> Array:
    """Return the degree from 0 to 1 to which the surface at each vertex faces away from the axis, shape (N,).

    Args:
        places: Positions relative to the axis, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
    """
    corners = places[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    summed = np.zeros_like(places)
    for k in range(3):
        for d in range(3):
            summed[:, d] += np.bincount(triangles[:, k], normals[:, d], minlength=len(places))
    outward = places * np.array([1.0, 0.0, 1.0])
    lengths = np.linalg.norm(summed, axis=1) * np.linalg.norm(outward, axis=1)
    cosine = np.einsum("nd,nd->n", summed, outward) / np.maximum(lengths, 1e-12)
    return _ramp(cosine, -0.05, 0.2)


def _in_front(rough: Array, radius: Array, triangles: NDArray[np.int32]) -> Array:
    """Return the visibility of each vertex along its radius, shape (N,): 1 for the outermost skin, 0 if occluded."""
    samples = np.concatenate([triangles.ravel(), [0]])[:-1]
    centres = rough[triangles].mean(axis=1)
    cells = np.floor(np.vstack([rough[samples], centres]) / _CELL_CM).astype(np.int64) + 256
    keys = cells[:, 0] * 512 + cells[:, 1]
    depths = np.concatenate([radius[samples], radius[triangles].mean(axis=1)])
    nearest = np.zeros(512 * 512)
    np.maximum.at(nearest, keys, depths)
    own = np.clip(np.floor(rough / _CELL_CM).astype(np.int64) + 256, 0, 511)
    return 1.0 - _ramp(nearest[own[:, 0] * 512 + own[:, 1]] - radius, 0.5 * _HIDDEN_CM, _HIDDEN_CM)


def _flipped(places: Array, outer: Array, triangles: NDArray[np.int32]) -> float:
    """Return the share of the outer skin near the middle of the face that the chart folds over."""
    a, b, c = (places[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    near = (outer[triangles].min(axis=1) > 0.5) & (np.abs(a) < [7.0, 8.0]).all(axis=1)
    total = np.abs(area[near]).sum()
    return float(-area[near & (area < 0.0)].sum() / total) if total > 0.0 else 1.0


def _ramp(values: ArrayLike, low: float, high: float) -> Array:
    """Return the cubic ramp from 0 at ``low`` to 1 at ``high``."""
    x = np.clip((np.asarray(values, dtype=np.float64) - low) / (high - low), 0.0, 1.0)
    ramp: Array = x * x * (3.0 - 2.0 * x)
    return ramp
