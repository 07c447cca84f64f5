"""Simplify a deforming mesh: merge vertices into neighbours with the least error over a set of poses.

Quadric errors (Garland and Heckbert, "Surface simplification using quadric error metrics", 1997), summed over poses
(Mohr and Gleicher, "Deformation sensitive decimation", 2003). Remaining vertices keep their positions, so that
their attributes, such as their motion in every shape, remain exact.
"""

import heapq

import numpy as np
from numpy.typing import NDArray

from scripts.asset_building.piece import Floats, Ints

#: Cosine of the largest rotation of a triangle in any pose, and least quality of a triangle: four times the root of
#: three times the area over the sum of the squared sides, which is 1 for an equilateral triangle.
_LEAST_COSINE, _LEAST_QUALITY = 0.25, 0.12
#: Weight of planes perpendicular to the surface along feature lines, and of the length of the collapsed edge.
_LINE_WEIGHT, _LENGTH_WEIGHT = 4.0, 2e-3


class Decimation:
    """Simplification of a triangle mesh.

    Attributes:
        triangles: Vertex ids of each remaining triangle, by its index in the original mesh.
    """

    def __init__(
        self,
        poses: Floats,
        triangles: Ints,
        weights: Floats,
        lines: Ints,
        locked: Ints | NDArray[np.intp],
        charts: Ints,
        flat: Floats,
    ) -> None:
        """Prepare.

        Args:
            poses: Vertices in each of P poses, the neutral one first, shape (P, N, 3).
            triangles: Vertex ids, shape (T, 3).
            weights: Weight of an error at each vertex, shape (N,).
            lines: Edges of feature lines, which are preserved, shape (L, 2); they must include all borders.
            locked: Vertices to keep, in addition to the ends and junctions of the lines.
            charts: Chart of the texture of each triangle, shape (T,).
            flat: Position of each vertex in each of C charts, if any, shape (C, N, 2); no triangle is flipped.
        """
        self.triangles = dict(enumerate(map(tuple, triangles.tolist())))
        self._poses = np.ascontiguousarray(poses.transpose(1, 0, 2))
        self._points = np.concatenate([self._poses, np.ones((*self._poses.shape[:2], 1))], axis=2)
        self._weights = weights
        self._charts = charts
        self._flat = flat
        self._at: dict[int, set[int]] = {}
        for number, corners in self.triangles.items():
            for vertex in corners:
                self._at.setdefault(vertex, set()).add(number)
        self._on_line: dict[int, set[int]] = {}
        for a, b in lines.tolist():
            self._on_line.setdefault(a, set()).add(b)
            self._on_line.setdefault(b, set()).add(a)
        self._locked = set(np.asarray(locked).tolist())
        self._locked |= {vertex for vertex, neighbours in self._on_line.items() if len(neighbours) != 2}
        self._quadrics = _quadrics(poses, triangles, lines)
        self._stamp = dict.fromkeys(self._at, 0)
        self._heap: list[tuple[float, int, int, int]] = []

    def run(self, n_vertices: int) -> None:
        """Merge vertices until ``n_vertices`` remain, or none can be merged."""
        for vertex in sorted(self._at):
            self._push(vertex)
        while len(self._at) > n_vertices and self._heap:
            _, vertex, target, stamp = heapq.heappop(self._heap)
            if self._stamp.get(vertex) == stamp and target in self._at and self._may_merge(vertex, target):
                self._merge(vertex, target)

    def _neighbours(self, vertex: int) -> set[int]:
        around = {corner for number in self._at[vertex] for corner in self.triangles[number]}
        around.discard(vertex)
        return around

    def _push(self, vertex: int) -> None:
        """Queue all merges of ``vertex`` into a neighbour."""
        self._stamp[vertex] += 1
        if vertex in self._locked:
            return
        targets = sorted(self._on_line.get(vertex) or self._neighbours(vertex))
        points = self._points[targets]
        quadrics = self._quadrics[targets] + self._quadrics[vertex]
        errors = np.einsum("kpi,kpij,kpj->k", points, quadrics, points)
        lengths = ((self._poses[targets, 0] - self._poses[vertex, 0]) ** 2).sum(axis=1)
        costs = (np.maximum(errors, 0.0) + _LENGTH_WEIGHT * lengths) * self._weights[vertex]
        # Single precision, so that rounding elsewhere does not change the order.
        for cost, target in zip(costs.astype(np.float32).tolist(), targets, strict=True):
            heapq.heappush(self._heap, (cost, vertex, target, self._stamp[vertex]))

    def _may_merge(self, vertex: int, target: int) -> bool:
        gone = self._at[vertex] & self._at[target]
        if len(self._neighbours(vertex) & self._neighbours(target)) != len(gone):
            return False
        left = sorted(self._at[vertex] - gone)
        if not left:
            return False
        before = np.array([self.triangles[number] for number in left])
        after = np.where(before == vertex, target, before)
        old, _ = _normals(self._poses[before])
        new, quality = _normals(self._poses[after])
        turned = np.einsum("tpi,tpi->tp", old, new)
        if turned.min() < _LEAST_COSINE or quality[:, 0].min() < _LEAST_QUALITY:
            return False
        chart = self._charts[left][:, None]
        return bool((_flat_areas(self._flat[chart, before]) * _flat_areas(self._flat[chart, after]) > 0.0).all())

    def _merge(self, vertex: int, target: int) -> None:
        for number in self._at.pop(vertex):
            corners = self.triangles[number]
            if target in corners:
                del self.triangles[number]
                for corner in corners:
                    if corner != vertex:
                        self._at[corner].discard(number)
            else:
                self.triangles[number] = tuple(target if corner == vertex else corner for corner in corners)
                self._at[target].add(number)
        for neighbour in self._on_line.pop(vertex, set()):
            self._on_line[neighbour].discard(vertex)
            if neighbour != target:
                self._on_line[neighbour].add(target)
                self._on_line[target].add(neighbour)
        self._quadrics[target] += self._quadrics[vertex]
        del self._stamp[vertex]
        for changed in sorted(self._neighbours(target) | {target}):
            self._push(changed)


def _normals(corners: Floats) -> tuple[Floats, Floats]:
    """Return unit normals and qualities of triangles in poses: ``corners`` (T, 3, P, 3) to (T, P, 3) and (T, P)."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(one, other)
    area = np.linalg.norm(normal, axis=-1)
    sides = (one**2).sum(-1) + (other**2).sum(-1) + ((other - one) ** 2).sum(-1)
    quality: Floats = 2.0 * np.sqrt(3.0) * area / np.maximum(sides, 1e-12)
    return normal / np.maximum(area, 1e-12)[..., None], quality


def _flat_areas(corners: Floats) -> Floats:
    """Return twice the signed areas of flat triangles, ``corners`` (T, 3, 2) to (T,)."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas: Floats = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return areas


def _quadrics(poses: Floats, triangles: Ints, lines: Ints) -> Floats:
    """Return each vertex's quadric in each pose, shape (N, P, 4, 4)."""
    n_poses, n_vertices = poses.shape[:2]
    result = np.zeros((n_vertices, n_poses, 4, 4))
    on_line = {frozenset(edge) for edge in lines.tolist()}
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1)
    on_side = np.array([[frozenset(side) in on_line for side in three] for three in sides.tolist()])
    for p, vertices in enumerate(poses):
        corners = vertices[triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        twice = np.linalg.norm(normal, axis=1)
        normal = normal / np.maximum(twice, 1e-12)[:, None]
        plane = np.concatenate([normal, -(normal * corners[:, 0]).sum(axis=1, keepdims=True)], axis=1)
        share = (twice / 6.0)[:, None, None] * plane[:, :, None] * plane[:, None, :]
        for k in range(3):
            np.add.at(result[:, p], triangles[:, k], share)
            chosen = on_side[:, k]
            a, b = sides[chosen, k].T
            along = vertices[b] - vertices[a]
            across = np.cross(along, normal[chosen])
            across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
            fence = np.concatenate([across, -(across * vertices[a]).sum(axis=1, keepdims=True)], axis=1)
            weight = _LINE_WEIGHT * (along**2).sum(axis=1) / 2.0
            outer = weight[:, None, None] * fence[:, :, None] * fence[:, None, :]
            np.add.at(result[:, p], a, outer)
            np.add.at(result[:, p], b, outer)
    return result / n_poses
