"""Eyelashes: curved strips along the edges of the lids that rotate with the lid in every shape."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_ROWS = 4
#: Number of vertices of the lid's edge without lashes next to each corner of the eye.
_BARE = 2
#: Number of vertices that determine the rotation of the lid at one root, and of roots over which it is averaged.
_NEIGHBOURS, _EVENED = 20, 2.5
#: Share of the rotation about z that is removed, since lashes at the outer corner would lean over the eye.
_UPRIGHT = 0.8


def lash_strips(
    side: str, skin: Floats, skin_shapes: Floats, halves: tuple[Ints, Ints], lid: Ints, centre: Floats, length: float
) -> list[tuple[Floats, Floats]]:
    """Return the lashes of the upper and of the lower lid of one eye, each a grid of vertices from root to tip.

    Args:
        side: "Left" or "Right".
        skin: The skin's vertices in centimetres, shape (N, 3).
        skin_shapes: Its offsets per shape, shape (S, N, 3).
        halves: The skin vertices that the lashes of either lid grow from, upper and lower, each from the inner to the
            outer corner.
        lid: Skin vertices around them that determine the rotation of the lid, shape (m,).
        centre: Centre of the eyeball, shape (3,).
        length: Factor on the lashes' length.

    Returns:
        For each lid, vertices, shape (rows, r, 3), and their offsets per shape, shape (S, rows, r, 3).
    """
    sign = 1.0 if side == "Left" else -1.0
    upper, lower = halves
    strips = []
    for edge, opposite, is_upper in ((upper, lower, True), (lower, upper, False)):
        root = edge[_BARE:-_BARE]
        strip = _strip(skin[root], centre, sign, is_upper, length)
        turns = _without_leaning(_turns(skin, skin_shapes, root, opposite, lid))
        along = strip - skin[root]
        turned = np.einsum("snij,rnj->srni", turns, along) - along + skin_shapes[:, root][:, None]
        strips.append((strip, turned))
    return strips


def lash_length(side: str, skin: Floats, halves: tuple[Ints, Ints], centre: Floats, lashes: Floats) -> float:
    """Return the factor on the length with which `lash_strips` makes ``lashes``, (n, 3); parameters as there."""
    sign = 1.0 if side == "Left" else -1.0
    edges = [(edge[_BARE:-_BARE], is_upper) for edge, is_upper in zip(halves, (True, False), strict=True)]
    bare, full = (
        np.concatenate([_strip(skin[root], centre, sign, is_upper, length).reshape(-1, 3) for root, is_upper in edges])
        for length in (0.0, 1.0)
    )
    return float(((lashes - bare) * (full - bare)).sum() / np.square(full - bare).sum())


def _strip(root: Floats, centre: Floats, sign: float, is_upper: bool, length: float) -> Floats:
    """Return the rows of a strip that grows from ``root`` (n, 3), shape (rows, n, 3)."""
    t = np.linspace(0.0, 1.0, len(root))[:, None]
    out = root - centre
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    ahead, up, aside = np.eye(3)[2], np.eye(3)[1], sign * np.eye(3)[0]
    fan = 1.1 * (t - 0.42) * aside
    if is_upper:
        start = 0.7 * out + 0.5 * ahead - 0.10 * up + 0.4 * fan
        end = 0.35 * ahead + 0.85 * up + 0.9 * fan
        reach = length * (0.42 + 0.48 * np.sin(np.pi * np.clip(0.12 + 0.66 * t, 0, 1)))
    else:
        start = 0.45 * out + 0.35 * ahead - 0.6 * up + 0.4 * fan
        end = 0.5 * ahead - 0.65 * up + 0.9 * fan
        reach = length * (0.22 + 0.20 * np.sin(np.pi * np.clip(0.05 + 0.72 * t, 0, 1)))
    start /= np.linalg.norm(start, axis=1, keepdims=True)
    end /= np.linalg.norm(end, axis=1, keepdims=True)
    s = np.linspace(0.0, 1.0, _ROWS)[:, None, None]
    # A quarter of a turn from the first direction to the second, rooted a hair's breadth inside the skin.
    return root - 0.015 * out + reach * (s * (1.0 - 0.5 * s) * start + 0.5 * s**2 * end)


def _turns(skin: Floats, skin_shapes: Floats, root: Ints, other: Ints, lid: Ints) -> Floats:
    """Return the rotation of the lid around each root in each shape, as matrices, shape (S, n, 3, 3).

    It is the best-fit rotation of the neighbourhood from the neutral face to the shape: W. Kabsch,
    "A solution for the best rotation to relate two sets of vectors" (1976).
    """
    nearest = np.linalg.norm(skin[lid][:, None] - skin[np.concatenate([root, other])][None], axis=2).argmin(axis=1)
    lid = lid[nearest < len(root)]
    distance = np.linalg.norm(skin[root][:, None] - skin[lid][None], axis=2)
    near = lid[np.argsort(distance, axis=1, kind="stable")[:, :_NEIGHBOURS]]
    rest = skin[near] - skin[near].mean(axis=1, keepdims=True)
    moved = skin[near] + skin_shapes[:, near]
    moved -= moved.mean(axis=2, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("snki,nkj->snij", moved, rest))
    turns = _proper(u, vt)
    still = ~skin_shapes[:, near].any(axis=(2, 3))
    turns[still] = np.eye(3)
    # Averaged along the lid, so that the strip does not crumple: the rotation nearest to the sum of rotations.
    u, _, vt = np.linalg.svd(gaussian_filter1d(turns, _EVENED, axis=1, mode="nearest"))
    return _proper(u, vt)


def _without_leaning(turns: Floats) -> Floats:
    """Return the rotations ``turns`` (S, n, 3, 3) with a reduced part about z, the slope of raised lids."""
    vectors = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_rotvec().reshape(*turns.shape[:2], 3)
    vectors[..., 2] *= 1.0 - _UPRIGHT
    upright: Floats = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(turns.shape)
    return upright


def _proper(u: Floats, vt: Floats) -> Floats:
    """Return the rotations nearest to the matrices with the singular vectors ``u`` and ``vt`` (..., 3, 3)."""
    flip = np.ones(u.shape[:-1])
    flip[..., 2] = np.linalg.det(u @ vt)
    rotations: Floats = (u * flip[..., None, :]) @ vt
    return rotations
