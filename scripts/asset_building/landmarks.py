"""Regions of the face, and the feature points of MPEG-4 (ISO/IEC 14496-2).

Positions are given on the base mesh in centimetres, whose vertices are the same for every person; positions on the
character's left are mirrored to the right.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.loops import LASH_RING, among
from faceposer.model.character import Part
from scripts.asset_building.head import Skin
from scripts.asset_building.looks import MAN_SKIN
from scripts.asset_building.piece import Floats, Ints
from scripts.asset_building.skin_texture import above_hairline, brow_frame

#: Feature points in the middle: id, title, place.
_MIDDLE = {
    "2.1": ("bottom of the chin", (0.0, 61.62, 13.6)),
    "2.2": ("middle of the inner upper lip", (0.0, 66.30, 15.78)),
    "2.3": ("middle of the inner lower lip", (0.0, 65.74, 15.59)),
    "2.10": ("chin", (0.0, 63.27, 14.99)),
    "8.1": ("middle of the outer upper lip", (0.0, 66.98, 15.95)),
    "8.2": ("middle of the outer lower lip", (0.0, 64.89, 15.56)),
    "9.3": ("nose tip", (0.0, 69.15, 16.82)),
    "9.12": ("nose bridge", (0.0, 71.05, 15.83)),
    "9.15": ("base of the nose", (0.0, 67.89, 15.63)),
    "11.1": ("middle of the hairline", (0.0, 79.9, 14.1)),
    "11.4": ("top of the head", (0.0, 84.95, 5.8)),
    "11.6": ("back of the head", (0.0, 75.5, -4.0)),
}
#: Feature points on the left with their partners on the right: (left id, right id), title, place.
_PAIRS = {
    ("2.4", "2.5"): ("inner {} mouth corner", (2.42, 65.97, 14.45)),
    ("2.6", "2.7"): ("{} half of the inner upper lip", (1.25, 66.27, 15.45)),
    ("2.8", "2.9"): ("{} half of the inner lower lip", (1.25, 65.72, 15.35)),
    ("2.11", "2.12"): ("{} corner of the chin", (1.9, 62.6, 14.2)),
    ("2.13", "2.14"): ("{} corner of the jaw", (6.1, 65.6, 8.0)),
    ("4.1", "4.2"): ("inner end of the {} brow", (1.55, 74.8, 15.0)),
    ("4.3", "4.4"): ("top of the {} brow", (3.7, 75.15, 14.4)),
    ("4.5", "4.6"): ("outer end of the {} brow", (5.55, 74.5, 12.6)),
    ("5.1", "5.2"): ("centre of the {} cheek", (4.3, 68.2, 13.1)),
    ("5.3", "5.4"): ("{} cheekbone", (5.2, 70.9, 12.2)),
    ("8.3", "8.4"): ("{} mouth corner", (2.66, 66.08, 14.35)),
    ("8.5", "8.6"): ("{} half of the outer upper lip", (1.43, 67.06, 15.43)),
    ("8.7", "8.8"): ("{} half of the outer lower lip", (1.4, 65.1, 15.2)),
    ("8.10", "8.9"): ("{} peak of the upper lip", (0.5, 67.1, 15.92)),
    ("9.1", "9.2"): ("{} nostril", (1.78, 69.0, 14.9)),
    ("9.5", "9.4"): ("{} bottom edge of the nose", (1.0, 68.25, 15.2)),
    ("10.1", "10.2"): ("top of the {} ear", (8.0, 73.35, 5.0)),
    ("10.3", "10.4"): ("back of the {} ear", (8.5, 72.0, 3.8)),
    ("10.5", "10.6"): ("{} ear lobe", (7.1, 68.4, 5.8)),
    ("11.3", "11.2"): ("{} end of the hairline", (5.3, 78.6, 11.3)),
}
#: Feature points of the lids: (left id, right id), title, ring around the eye, direction from the eye's middle.
_LIDS = {
    ("3.1", "3.2"): ("edge of the {} upper lid", LASH_RING, (0.0, 1.0)),
    ("3.3", "3.4"): ("edge of the {} lower lid", LASH_RING, (0.0, -1.0)),
    ("3.13", "3.14"): ("{} upper lid", LASH_RING + 3, (0.0, 1.0)),
    ("3.9", "3.10"): ("{} lower lid", LASH_RING + 3, (0.0, -1.0)),
    ("3.7", "3.12"): ("outer corner of the {} eye", LASH_RING, (1.0, 0.0)),
    ("3.11", "3.8"): ("inner corner of the {} eye", LASH_RING, (-1.0, 0.0)),
}


def mirrored_ids(place: Floats) -> Ints:
    """Return the vertex opposite each vertex of the skin in x on the base mesh, shape (N,)."""
    distance, mirror = cKDTree(place).query(place * [-1.0, 1.0, 1.0])
    if distance.max() > 1e-6:
        raise ValueError("the base mesh is not symmetric")
    return np.asarray(mirror, dtype=np.int32)


def feature_points(
    skin: Skin,
    place: Floats,
    parts: tuple[Part, ...],
    kept: Ints | None = None,
    elsewhere: Mapping[str, tuple[float, float, float]] | None = None,
) -> tuple[dict[str, int], dict[str, str]]:
    """Return vertex id and title of each feature point.

    Args:
        skin: Topology of the skin, which is the first part.
        place: The skin's vertices on the base mesh in centimetres, shape (N, 3).
        parts: The parts of the character.
        kept: Vertices of the skin that the character has, on both sides and in its order, if not all.
        elsewhere: Other places of feature points in the middle or on the left, by id.
    """
    places = elsewhere or {}
    mirror = mirrored_ids(place)
    kept = np.arange(len(place), dtype=np.int32) if kept is None else kept
    number = {vertex: k for k, vertex in enumerate(kept.tolist())}
    outside = np.setdiff1d(kept, hidden_ids(skin, place))
    middle = outside[np.abs(place[outside, 0]) < 1e-6]
    points: dict[str, int] = {}
    titles: dict[str, str] = {}

    def nearest(candidates: NDArray[np.intp], target: tuple[float, float, float]) -> int:
        return int(candidates[np.linalg.norm(place[candidates] - target, axis=1).argmin()])

    def add_pair(pair: tuple[str, str], title: str, left_vertex: int) -> None:
        for name, side, vertex in zip(pair, ("left", "right"), (left_vertex, mirror[left_vertex]), strict=True):
            points[name], titles[name] = number[int(vertex)], title.format(side)

    for name, (title, target) in _MIDDLE.items():
        points[name], titles[name] = number[nearest(middle, places.get(name, target))], title
    for pair, (title, target) in _PAIRS.items():
        add_pair(pair, title, nearest(outside, places.get(pair[0], target)))
    for pair, (title, ring, (x, y)) in _LIDS.items():
        ids = np.intersect1d(skin.rings_left[ring], kept)
        from_middle = place[ids, :2] - 0.5 * (place[ids, :2].min(axis=0) + place[ids, :2].max(axis=0))
        along, aside = from_middle @ [x, y], from_middle @ [y, -x]
        # The middle of a lid is above the pupil, not at its highest point.
        score = along if x else np.where(along > 0, -np.abs(aside), -np.inf)
        add_pair(pair, title, int(ids[score.argmax()]))
    by_name = {part.name: part for part in parts}
    for name, side in (("3.5", "left"), ("3.6", "right")):
        points[name], titles[name] = by_name[f"eye_{side}"].vertices[0], f"{side} pupil"
    return dict(sorted(points.items(), key=_numeric)), dict(sorted(titles.items(), key=_numeric))


def regions(skin: Skin, place: Floats, masks: dict[str, Floats], parts: tuple[Part, ...]) -> dict[str, Ints]:
    """Return the vertex ids of each region.

    Args:
        skin: Topology of the skin, which is the first part.
        place: The skin's vertices on the base mesh in centimetres, shape (N, 3).
        masks: The masks "lips" and "ears" at the skin's vertices, 0..1, shape (N,).
        parts: The parts of the character.
    """
    mirror = mirrored_ids(place)
    x, y, z = np.abs(place[:, 0]), place[:, 1], place[:, 2]
    # Rounding must not put only one of two opposite vertices into a region.
    x, y, z = (np.round(0.5 * (values + values[mirror]), 6) for values in (x, y, z))
    masks = {name: np.round(0.5 * (values + values[mirror]), 6) for name, values in masks.items()}
    even = np.stack([x, y, z], axis=1).astype(np.float32)
    outer = np.ones(len(place), dtype=bool)
    outer[hidden_ids(skin, place)] = False
    lips = outer & (masks["lips"] > 0.5) & (z > 13.0)
    ears = (masks["ears"] > 0.5) & (x > 6.0)
    hair = above_hairline(even) > 0.0
    along, across, _ = brow_frame(even, MAN_SKIN)
    brows = outer & (along > -0.12) & (along < 1.08) & (np.abs(across) < 2.4) & (np.abs(y - 74.9) < 1.0) & (z > 10)
    lids = (_ring_mask(skin, len(place), LASH_RING - 2, LASH_RING + 4) | _around_eyes(skin, place)) & ~brows
    nose_width = np.interp(y, [67.6, 68.3, 69.5, 70.5, 71.5, 73.0, 74.0], [1.3, 2.1, 2.1, 1.7, 1.25, 0.9, 0.9])
    nose = outer & (x < nose_width) & (y > 67.85) & (y <= 74.0) & (z > 12.0) & ~lips
    near_lips = cKDTree(place[lips & outer]).query(place)[0] < 0.75
    philtrum = (x < 1.5) & (y > 66.5) & (y < 68.0) & (z > 14.0)
    mouth = lips | (outer & (near_lips | philtrum) & ~nose)
    neck = outer & (y < 61.2 + 0.3 * (13.2 - z)) & ~hair & ~ears & ~lips
    lower = np.interp(z, [6.0, 10.0, 14.0], [68.0, 66.5, 65.2])
    jaw = outer & (y < lower) & (z > 5.5) & ~neck & ~mouth & ~ears
    cheek = outer & (y <= 74.0) & (z > 6.5) & ~jaw & ~neck & ~mouth & ~nose & ~lids & ~brows & ~ears & ~hair
    forehead = outer & (y > 74.0) & (z > 8.0) & ~hair & ~brows & ~lids & ~nose
    left = place[:, 0] > 1e-6
    right = place[:, 0] < -1e-6
    found = {
        "brow_left": brows & left,
        "brow_right": brows & right,
        "lids_left": lids & left,
        "lids_right": lids & right,
        "nose": nose,
        "cheek_left": cheek & left,
        "cheek_right": cheek & right,
        "mouth": mouth,
        "lip_upper": lips & (y > _LIP_LINE),
        "lip_lower": lips & (y <= _LIP_LINE),
        "jaw": jaw,
        "ear_left": ears & left,
        "ear_right": ears & right,
        "neck": neck,
        "scalp": outer & hair & ~ears,
        "forehead": forehead,
    }
    result = {name: np.flatnonzero(mask).astype(np.int32) for name, mask in found.items()}
    for part in parts:
        if part.material == "eye":
            result[part.name] = np.arange(*part.vertices, dtype=np.int32)
    return result


_LIP_LINE = 66.0


def hidden_ids(skin: Skin, place: Floats) -> Ints:
    """Return the vertices of the sockets' and the mouth's insides, which are hidden in the neutral face."""
    rings = [ring for k, ring in enumerate(skin.rings_left) if k < LASH_RING - 2]
    inside = among(skin.fine, np.concatenate(rings + [skin.mirror[ring] for ring in rings]))
    quads = np.unique(skin.fine.quads[np.repeat(skin.in_mouth, 4)])
    behind_lips = quads[place[quads, 2] < 15.0]
    return np.union1d(inside, behind_lips).astype(np.int32)


def _around_eyes(skin: Skin, place: Floats) -> NDArray[np.bool_]:
    """Return the mask of vertices over or around the opening of either eye, up to the fold below the brow."""
    lashes = place[skin.rings_left[LASH_RING]]
    low, high = lashes.min(axis=0), lashes.max(axis=0)
    middle, half = 0.5 * (low + high)[:2], 0.5 * (high - low)[:2]
    beside = (np.abs(place[:, 0]) - middle[0]) / (1.30 * half[0])
    beyond = (place[:, 1] - middle[1]) / np.where(place[:, 1] > middle[1], half[1] + 1.1, half[1] + 0.6)
    around: NDArray[np.bool_] = (np.round(np.hypot(beside, beyond), 6) < 1.0) & (place[:, 2] > low[2] - 0.8)
    return around


def _ring_mask(skin: Skin, n_vertices: int, first: int, last: int) -> NDArray[np.bool_]:
    """Return the mask of fine vertices on or between the rings ``first`` to ``last`` around either eye."""
    rings = [skin.rings_left[k] for k in range(first, last + 1)]
    mask = np.zeros(n_vertices, dtype=bool)
    mask[among(skin.fine, np.concatenate(rings + [skin.mirror[ring] for ring in rings]))] = True
    return mask


def _numeric(item: tuple[str, object]) -> tuple[int, ...]:
    return tuple(int(part) for part in item[0].split("."))
