"""The muscles behind ARKit's shapes: groups of shapes that one muscle makes, sides, and what contracts together.

Names of shapes are all that is looked at, so that any rig with ARKit's names has them, also with some shapes in halves.
Shapes of other names are groups of their own, without a side.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The first prefix that fits tells the group.
_GROUPS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("blink", ("eyeBlink",)),
    ("gaze", ("eyeLook",)),
    ("squint", ("eyeSquint",)),
    ("wide", ("eyeWide",)),
    ("brow down", ("browDown",)),
    ("brow up", ("browInnerUp", "browOuterUp")),
    ("cheek", ("cheekSquint",)),
    ("nose", ("noseSneer",)),
    ("smile", ("mouthSmile", "mouthDimple")),
    ("frown", ("mouthFrown",)),
    ("lower lip", ("mouthStretch", "mouthLowerDown")),
    ("upper lip", ("mouthUpperUp",)),
    ("jaw", ("jaw", "mouthClose", "tongue")),
    ("lips", ("mouth", "cheekPuff")),
)
#: What else contracts, on the same side, for each unit of a shape: the orbicularis oculi in a felt smile (Ekman,
#: Davidson and Friesen 1990: action units 6 and 12 together), the levator of the upper lid with the frontalis.
CO_CONTRACTIONS: tuple[tuple[str, str, float], ...] = (
    ("mouthSmile", "cheekSquint", 0.75),
    ("mouthSmile", "eyeSquint", 0.35),
    ("browOuterUp", "eyeWide", 0.15),
)
#: A shape that is there only as far as another is, and by how much it may go beyond that: ARKit's mouthClose brings the
#: lips together over an open jaw; with a closed one it would lift the lower lip through the upper.
DEPENDENT_SHAPES: tuple[tuple[str, str, float], ...] = (("mouthClose", "jawOpen", 0.05),)
# Correlations that remain between what the two sides of the face do, and between opposite brows.
_ACROSS, _ACROSS_BROWS = 0.95, 0.4
_SIDES = ("Left", "Right")


def muscle_of_shape(name: str) -> str:
    """Return the muscle group that makes the shape ``name``; its own name if it is none of ARKit's."""
    for group, prefixes in _GROUPS:
        if name.startswith(prefixes):
            return group
    return name


def side_of_shape(name: str) -> str:
    """Return "Left" or "Right", or "" for a shape of both sides."""
    return next((side for side in _SIDES if name.endswith(side)), "")


def side_factors(names: Sequence[str]) -> Array:
    """Return how far what one side of the face does tells of the other, a correlation matrix, shape (S, S).

    Performers mostly move both sides alike, because exercises ask for it; an artist who pulls one side means that side.
    A side and the middle share the root of half of it, as if the middle were the mean of both sides.
    """
    sides = np.array([side_of_shape(name) for name in names])
    middle = sides == ""
    opposite = (sides[:, None] != sides) & ~middle[:, None] & ~middle
    factors = np.where(opposite, _ACROSS, 1.0)
    factors[middle[:, None] != middle] = np.sqrt(0.5 * (1.0 + _ACROSS))
    brows = np.array([name.startswith("brow") for name in names])
    factors[opposite & brows[:, None] & brows] = _ACROSS_BROWS
    return nearest_correlation(factors)


def mirrored_pairs(names: Sequence[str]) -> NDArray[np.bool_]:
    """Return which pairs of shapes are the same shape, or that of the other side, shape (S, S)."""
    plain = np.array([name.removesuffix(side_of_shape(name)) for name in names])
    return np.asarray(plain[:, None] == plain)


def co_contraction(names: Sequence[str]) -> Array:
    """Return L, shape (S, S): weights w of single muscles become L w where others contract along with them."""
    index = {name: i for i, name in enumerate(names)}
    along = np.eye(len(names))
    for muscle, follower, amount in CO_CONTRACTIONS:
        for side in _SIDES:
            if muscle + side in index and follower + side in index:
                along[index[follower + side], index[muscle + side]] = amount
    return along


def dependent_pairs(names: Sequence[str]) -> list[tuple[int, int, float]]:
    """Return ``DEPENDENT_SHAPES`` by their indices among ``names``, those that are there."""
    return [
        (names.index(shape), names.index(other), beyond)
        for shape, other, beyond in DEPENDENT_SHAPES
        if shape in names and other in names
    ]


def nearest_correlation(matrix: Array) -> Array:
    """Return the symmetric ``matrix``, (S, S), without negative eigenvalues and scaled to a unit diagonal."""
    values, axes = np.linalg.eigh(matrix)
    nearest = (axes * np.maximum(values, 0.0)) @ axes.T
    scale = 1.0 / np.sqrt(np.diag(nearest))
    correlation: Array = nearest * np.outer(scale, scale)
    return correlation
