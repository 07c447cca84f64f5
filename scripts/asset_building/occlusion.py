"""Ambient occlusion of vertices."""

import numpy as np

from scripts.asset_building.piece import Floats, Ints

_DIRECTIONS = 128
_CELL = 0.22
_BIAS = 0.30


def ambient_occlusion(vertices: Floats, quads: Ints, normals: Floats) -> Floats:
    """Return the cosine-weighted share of unoccluded directions at each vertex, shape (N,).

    Computed from depth maps of surface points in many directions, accurate enough to darken folds softly.

    Args:
        vertices: Positions in centimetres, shape (N, 3).
        quads: Vertex ids, shape (F, 4).
        normals: Unit normals, shape (N, 3).
    """
    middles = vertices[quads].mean(axis=1)
    sides = 0.5 * (vertices[quads] + vertices[np.roll(quads, -1, axis=1)]).reshape(-1, 3)
    samples = np.concatenate([vertices, middles, sides])
    seen, total = np.zeros(len(vertices)), np.zeros(len(vertices))
    for direction in _sphere(_DIRECTIONS):
        side = np.cross(direction, [0.3, 0.9, 0.1] if abs(direction[1]) < 0.9 else [1.0, 0.0, 0.0])
        side /= np.linalg.norm(side)
        frame = np.stack([side, np.cross(direction, side)])
        cells = np.floor(samples @ frame.T / _CELL).astype(int)
        cells -= cells.min(axis=0)
        width = int(cells[:, 0].max()) + 1
        index = cells[:, 1] * width + cells[:, 0]
        depth = samples @ direction
        nearest = np.full(index.max() + 1, -np.inf)
        np.maximum.at(nearest, index, depth)
        n = len(vertices)
        cosine = np.maximum(normals @ direction, 0.0)
        seen += cosine * (depth[:n] > nearest[index[:n]] - _BIAS)
        total += cosine
    open_share = seen / np.maximum(total, 1e-9)
    a, b = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2).T
    count = np.bincount(a, minlength=len(vertices)) + np.bincount(b, minlength=len(vertices))
    for _ in range(3):
        around = np.bincount(a, open_share[b], len(vertices)) + np.bincount(b, open_share[a], len(vertices))
        open_share = 0.5 * open_share + 0.5 * around / np.maximum(count, 1)
    return open_share


def _sphere(count: int) -> Floats:
    """Return ``count`` directions spread evenly, on a Fibonacci spiral, shape (count, 3)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
