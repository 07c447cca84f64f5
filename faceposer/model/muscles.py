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
    ("inner brow up", ("browInnerUp",)),
    ("outer brow up", ("browOuterUp",)),
    ("cheek", ("cheekSquint",)),
    ("nose", ("noseSneer",)),
    ("smile", ("mouthSmile", "mouthDimple")),
    ("frown", ("mouthFrown",)),
    ("stretch", ("mouthStretch",)),
    ("lower lip", ("mouthLowerDown",)),
    ("upper lip", ("mouthUpperUp",)),
    ("jaw", ("jaw", "mouthClose")),
    ("tongue", ("tongue",)),
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
# Share of what a muscle of one side does that is common to both sides, where people can move one side alone.
_COMMON = {
    "brow down": 0.4,
    "inner brow up": 0.4,
    "outer brow up": 0.4,
    "blink": 0.4,
    "wide": 0.5,
    "nose": 0.6,
    "upper lip": 0.6,
    "smile": 0.85,
    "frown": 0.85,
}
_USUALLY_COMMON = 0.93
# Share of what the jaw does that goes with the rest of the face: a mouth that is pulled stays as far open as it is.
_JAW_COMMON = 0.4
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


def independence(names: Sequence[str], sides: bool = True) -> Array:
    """Return how far the weights of shapes tell of each other as an artist means them, a correlation matrix, (S, S).

    Performers mostly move both sides alike, because exercises ask for it; an artist who pulls one side means that side.
    Each weight is taken for a sum of independent parts, the squares of whose shares add up to 1: one that is common to
    both sides and one of its own side, of which a shape of both sides has the first alone; of the jaw likewise one that
    it has in common with the rest of the face, and one of its own. The tongue has nothing in common with the rest.

    Args:
        names: Of the S shapes.
        sides: Whether sides have parts of their own; if not, only jaw and tongue have.
    """
    groups = [muscle_of_shape(name) for name in names]
    side = np.array([side_of_shape(name) for name in names])
    common = np.array([_COMMON.get(group, _USUALLY_COMMON) for group in groups])
    common[(side == "") | (not sides)] = 1.0
    both, own = np.sqrt(common), np.sqrt(1.0 - common)
    factors = np.outer(both, both) + np.outer(own, own) * (side[:, None] == side)
    jaw = np.array([group == "jaw" for group in groups])
    factors[jaw[:, None] != jaw] *= np.sqrt(_JAW_COMMON)
    # The tongue comes out when it is pulled, and with nothing else.
    tongue = np.array([group == "tongue" for group in groups])
    factors[tongue[:, None] != tongue] = 0.0
    return factors


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
