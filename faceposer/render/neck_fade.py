"""Fading of a character's neck at its lower border, instead of a visible edge."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from faceposer.model.character import Character

# Share of the distance from the border to the chin over which the skin fades.
_FADE_SHARE = 0.66
# A border is that of the neck if it has at least this width, as a share of the mesh's width, and the fade at least this
# length, as a share of its height.
_MIN_WIDTH, _MIN_LENGTH = 0.25, 0.05


class NeckFade(NamedTuple):
    """The fade of a neck.

    Attributes:
        plane: (a, b, c, d), for which ax + by + cz + d is 0 at the neck's border and 1 where the fade ends.
        cut: Middle of the border, x, y, z, and the greatest distance of its points from there.
    """

    plane: tuple[float, float, float, float]
    cut: tuple[float, float, float, float]


#: A character without a fade: all is above the plane.
NO_FADE = NeckFade((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0))


def neck_fade(character: Character) -> NeckFade:
    """Return the fade of the character's neck.

    The border is the lowest open border of the skin. Without a neck region and a border well below the chin, there is
    no fade.
    """
    chin = character.feature_points.get("2.1")
    border = _lowest_border(character) if chin is not None else None
    if "neck" not in character.regions or chin is None or border is None:
        return NO_FADE
    low, high = character.vertices.min(axis=0), character.vertices.max(axis=0)
    middle = border.mean(axis=0)
    _, _, axes = np.linalg.svd(border - middle)
    normal = axes[2] * (1.0 if axes[2, 1] >= 0.0 else -1.0)
    length = _FADE_SHARE * float(normal @ (character.vertices[chin] - middle))
    if np.ptp(border[:, 0]) < _MIN_WIDTH * (high[0] - low[0]) or length < _MIN_LENGTH * (high[1] - low[1]):
        return NO_FADE
    a, b, c = (normal / length).tolist()
    x, y, z = middle.tolist()
    radius = float(np.linalg.norm(border - middle, axis=1).max())
    return NeckFade((a, b, c, float(-(normal @ middle) / length)), (x, y, z, radius))


def _lowest_border(character: Character) -> NDArray[np.float64] | None:
    """Return the vertices of the skin's lowest connected open border, shape (n, 3), or None."""
    skins = [character.triangles[slice(*character.part_triangles(p))] for p in character.parts if p.material == "skin"]
    if not skins:
        return None
    count = np.int64(len(character.vertices))
    sides = np.concatenate([np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]) for t in skins]).astype(np.int64)
    keys, uses = np.unique(sides.min(axis=1) * count + sides.max(axis=1), return_counts=True)
    a, b = np.divmod(keys[uses == 1], count)
    if not len(a):
        return None
    ids, local = np.unique(np.concatenate([a, b]), return_inverse=True)
    ends = local.reshape(2, -1)
    links = sparse.coo_array((np.ones(len(a)), (ends[0], ends[1])), shape=(len(ids), len(ids)))
    n, label = connected_components(links, directed=False)
    points = character.vertices[ids].astype(np.float64)
    heights = np.bincount(label, points[:, 1], n) / np.bincount(label, minlength=n)
    lowest: NDArray[np.float64] = points[label == heights.argmin()]
    return lowest
