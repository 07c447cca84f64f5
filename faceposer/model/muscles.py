"""The muscles behind ARKit's shapes: groups of shapes that one muscle produces, sides, and co-contractions.

Only names are used, so that this applies to any rig with ARKit's names, including rigs with some shapes split in
halves. Every shape of another name is a group by itself, without a side.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The first matching prefix determines the group.
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
#: Co-contractions on the same side: a shape, the shape that follows it, and its weight per unit. The orbicularis oculi
#: contracts in a felt smile (Ekman, Davidson and Friesen 1990: action units 6 and 12 together), and the levator of the
#: upper lid with the frontalis.
CO_CONTRACTIONS: tuple[tuple[str, str, float], ...] = (
    ("mouthSmile", "cheekSquint", 0.75),
    ("mouthSmile", "eyeSquint", 0.35),
    ("browOuterUp", "eyeWide", 0.15),
)
#: Shapes limited by another: a shape, the limiting shape, and by how much the first may exceed it. ARKit's mouthClose
#: brings the lips together over an open jaw; over a closed jaw it would lift the lower lip through the upper.
DEPENDENT_SHAPES: tuple[tuple[str, str, float], ...] = (("mouthClose", "jawOpen", 0.05),)
# Muscles that relax when they are pulled against, each with the groups that end along with it on the same side, and at
# most how much of their weight goes per unit of the muscle. A broad smile parts the lips and raises the cheeks, and
# lowered brows wrinkle the nose; a wide open jaw, a tongue that is out or a kiss are an artist's own.
_SUBSIDING: dict[str, dict[str, float]] = {
    "smile": {
        "cheek": 1.0,
        "squint": 1.0,
        "stretch": 1.0,
        "upper lip": 1.0,
        "lower lip": 1.0,
        "lips": 0.25,
        "jaw": 0.2,
        "tongue": 0.15,
    },
    "frown": {"stretch": 1.0, "lower lip": 1.0, "lips": 0.25},
    "stretch": {"lower lip": 1.0},
    "upper lip": {},
    "lower lip": {},
    "lips": {},
    "cheek": {},
    "nose": {},
    "brow down": {"nose": 0.5},
    "inner brow up": {},
    "outer brow up": {},
}
# Share of a muscle's variance that both sides have in common, for muscles that people can move on one side alone.
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
# Share of the jaw's variance in common with the rest of the face: pulling the mouth hardly changes how far it is open.
_JAW_COMMON = 0.4
_SIDES = ("Left", "Right")


def muscle_of_shape(name: str) -> str:
    """Return the muscle group that produces the shape ``name``; the name itself if it is not one of ARKit's."""
    for group, prefixes in _GROUPS:
        if name.startswith(prefixes):
            return group
    return name


def side_of_shape(name: str) -> str:
    """Return the side of the shape ``name``: "Left", "Right", or "" for both."""
    return next((side for side in _SIDES if name.endswith(side)), "")


def subsiding(muscle: str) -> dict[str, float] | None:
    """Return the muscle groups that end with ``muscle`` when it is pulled against, and how much; None if it stays."""
    return _SUBSIDING.get(muscle)


def independence(names: Sequence[str], sides: bool = True) -> Array:
    """Return the correlation matrix of shape weights in an artist's edits, shape (S, S).

    Performers mostly move both sides together, because exercises require it; an artist who pulls one side means that
    side. Each weight is modelled as a sum of independent components whose squared shares sum to 1: one common to both
    sides and one specific to its side, the latter absent from shapes of both sides. The jaw likewise has a component in
    common with the rest of the face and a specific one. The tongue is independent of the rest.

    Args:
        names: Names of the S shapes.
        sides: True to give each side a specific component; otherwise only jaw and tongue are treated separately.
    """
    groups = [muscle_of_shape(name) for name in names]
    side = np.array([side_of_shape(name) for name in names])
    common = np.array([_COMMON.get(group, _USUALLY_COMMON) for group in groups])
    common[(side == "") | (not sides)] = 1.0
    both, own = np.sqrt(common), np.sqrt(1.0 - common)
    factors = np.outer(both, both) + np.outer(own, own) * (side[:, None] == side)
    jaw = np.array([group == "jaw" for group in groups])
    factors[jaw[:, None] != jaw] *= np.sqrt(_JAW_COMMON)
    # The tongue comes out only when it is pulled itself.
    tongue = np.array([group == "tongue" for group in groups])
    factors[tongue[:, None] != tongue] = 0.0
    return factors


def mirrored_pairs(names: Sequence[str]) -> NDArray[np.bool_]:
    """Return the mask of pairs of shapes that are equal or mirror images of each other, shape (S, S)."""
    plain = np.array([name.removesuffix(side_of_shape(name)) for name in names])
    return np.asarray(plain[:, None] == plain)


def mirror_images(names: Sequence[str]) -> NDArray[np.intp]:
    """Return the index of each shape's mirror image, its own if there is none or it is of both sides, shape (S,)."""
    index = {name: i for i, name in enumerate(names)}
    other = dict(zip(_SIDES, reversed(_SIDES), strict=True))
    images = [name.removesuffix(side) + other.get(side, "") for name in names for side in (side_of_shape(name),)]
    return np.array([index.get(image, i) for i, image in enumerate(images)], dtype=np.intp)


def co_contraction(names: Sequence[str]) -> Array:
    """Return the matrix L of co-contraction, shape (S, S): weights w of single muscles become L w."""
    index = {name: i for i, name in enumerate(names)}
    along = np.eye(len(names))
    for muscle, follower, amount in CO_CONTRACTIONS:
        for side in _SIDES:
            if muscle + side in index and follower + side in index:
                along[index[follower + side], index[muscle + side]] = amount
    return along


def dependent_pairs(names: Sequence[str]) -> list[tuple[int, int, float]]:
    """Return those ``DEPENDENT_SHAPES`` of which both shapes are in ``names``, by index."""
    return [
        (names.index(shape), names.index(other), beyond)
        for shape, other, beyond in DEPENDENT_SHAPES
        if shape in names and other in names
    ]


def nearest_correlation(matrix: Array) -> Array:
    """Return the symmetric ``matrix``, (S, S), with negative eigenvalues set to 0, scaled to a unit diagonal."""
    values, axes = np.linalg.eigh(matrix)
    nearest = (axes * np.maximum(values, 0.0)) @ axes.T
    scale = 1.0 / np.sqrt(np.diag(nearest))
    correlation: Array = nearest * np.outer(scale, scale)
    return correlation
