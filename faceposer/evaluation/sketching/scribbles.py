"""Strokes that depict no feature: loops, zigzags, spirals, letters, circles, dots, lines and random curves."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.polyline import evenly

Array = NDArray[np.float64]


def _loops(rng: np.random.Generator) -> Array:
    t = np.linspace(0.0, 2.0 * np.pi * rng.uniform(2.0, 5.0), 160)
    return np.stack([np.cos(t) + t * rng.uniform(0.15, 0.5), np.sin(t)], axis=1)


def _zigzag(rng: np.random.Generator) -> Array:
    count = int(rng.integers(4, 12))
    return np.stack([np.arange(count) * rng.uniform(0.3, 1.0), np.where(np.arange(count) % 2, 1.0, -1.0)], axis=1)


def _spiral(rng: np.random.Generator) -> Array:
    t = np.linspace(0.5, 2.0 * np.pi * rng.uniform(2.0, 4.0), 160)
    return np.stack([t * np.cos(t), t * np.sin(t)], axis=1)


# Capital letters in one stroke.
_LETTERS: dict[str, tuple[tuple[float, float], ...]] = {
    "L": ((0, 0), (0, 2), (1, 2)),
    "Z": ((0, 0), (1.2, 0), (0, 2), (1.2, 2)),
    "N": ((0, 2), (0, 0), (1.2, 2), (1.2, 0)),
    "W": ((0, 0), (0.5, 2), (1, 0.6), (1.5, 2), (2, 0)),
    "S": ((1, 0.2), (0.4, 0), (0, 0.5), (0.5, 1), (1, 1.5), (0.6, 2), (0, 1.8)),
    "A": ((0, 2), (0.7, 0), (1.4, 2), (1, 1.2), (0.4, 1.2)),
    "B": ((0, 2), (0, 0), (0.8, 0.2), (0.8, 0.8), (0, 1), (1, 1.2), (1, 1.8), (0, 2)),
}


def _letter(rng: np.random.Generator) -> Array:
    return np.array(_LETTERS[str(rng.choice(list(_LETTERS)))], dtype=np.float64)


def _circle(rng: np.random.Generator) -> Array:
    t = np.linspace(0.0, 2.0 * np.pi * rng.uniform(0.9, 1.1), 80) + rng.uniform(0.0, 6.0)
    return np.stack([np.cos(t), rng.uniform(0.8, 1.2) * np.sin(t)], axis=1)


def _dot(rng: np.random.Generator) -> Array:
    return rng.normal(0.0, 1.0, (int(rng.integers(2, 8)), 2))


def _line(rng: np.random.Generator) -> Array:
    return np.array([[-1.0, 0.0], [1.0, rng.uniform(-0.1, 0.1)]])


def _walk(rng: np.random.Generator) -> Array:
    turns = np.cumsum(np.cumsum(rng.normal(0.0, 0.03, 120)))
    return np.cumsum(np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0)


#: Makers of scribbles by kind, with the range of their extents in pixels of a view 960 pixels high.
KINDS: dict[str, tuple[Callable[[np.random.Generator], Array], tuple[float, float]]] = {
    "loops": (_loops, (80.0, 300.0)),
    "zigzag": (_zigzag, (80.0, 300.0)),
    "spiral": (_spiral, (60.0, 250.0)),
    "letter": (_letter, (60.0, 250.0)),
    "circle": (_circle, (60.0, 400.0)),
    "dot": (_dot, (1.0, 8.0)),
    "line": (_line, (150.0, 700.0)),
    "walk": (_walk, (100.0, 400.0)),
}


def scribble(kind: str, middle: Array, spread: float, rng: np.random.Generator) -> Array:
    """Return a scribble, shape (n, 2), about a random place of the face.

    Args:
        kind: One of ``KINDS``.
        middle: Pixel of the middle of the face, shape (2,).
        spread: Standard deviation of the scribble's place about it, in pixels.
        rng: Source of randomness.
    """
    make, (least, most) = KINDS[kind]
    shape = make(rng)
    shape = shape - 0.5 * (shape.min(axis=0) + shape.max(axis=0))
    shape *= rng.uniform(least, most) / max(float(np.ptp(shape, axis=0).max()), 1e-9)
    # Lines cross the face in any direction; the others are written nearly upright.
    angle = rng.uniform(0.0, np.pi) if kind == "line" else rng.normal(0.0, 0.3)
    cos, sin = np.cos(angle), np.sin(angle)
    turned = shape @ np.array([[cos, sin], [-sin, cos]])
    count = max(int(np.hypot(*np.diff(turned, axis=0).T).sum() / 6.0), 2)
    return np.asarray(evenly(turned, count) + middle + rng.normal(0.0, spread, 2))
