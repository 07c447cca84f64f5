"""Measures of the change of a face, in weights, millimetres and shares, to which limits apply.

Millimetres are those of a head of 17.5 cm. Measures of one side have "_left" or "_right" after the place
("corner_left_up"). Directions are up and down, forward and back; out and in for places of one side, left and right (the
character's) for places in the middle; "moved" is the length of the motion. "mouth_mean" and the like are the mean
motion of a region of the evaluation.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.gestures.gesture import HEAD_HEIGHT
from faceposer.evaluation.gestures.hand import Performed
from faceposer.evaluation.trials import FACE_REGIONS, region_vertices
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.solve.weight_fit import fit_weights

Array = NDArray[np.float64]
SIDES = ("Left", "Right")

#: Feature points of the left and right side, by the name of the place.
PAIRS: Mapping[str, tuple[str, str]] = {
    "corner": ("8.3", "8.4"),
    "cheek": ("5.1", "5.2"),
    "cheekbone": ("5.3", "5.4"),
    "brow_inner": ("4.1", "4.2"),
    "brow_middle": ("4.3", "4.4"),
    "brow_outer": ("4.5", "4.6"),
    "upper_lid": ("3.1", "3.2"),
    "lower_lid": ("3.3", "3.4"),
    "nostril": ("9.1", "9.2"),
    "upper_lip_half": ("8.5", "8.6"),
    "ear": ("10.1", "10.2"),
}
#: Feature points in the middle, by the name of the place.
MIDDLES: Mapping[str, str] = {
    "upper_lip": "8.1",
    "lower_lip": "8.2",
    "chin": "2.10",
    "nose_tip": "9.3",
    "nose_bridge": "9.12",
}
_DIRECTIONS = {"up": (1, 1.0), "down": (1, -1.0), "forward": (2, 1.0), "back": (2, -1.0)}
# Distance from the regions concerned, in millimetres, within which skin may stretch with them.
_MARGIN_MM = 5.0


@dataclass(frozen=True, eq=False)
class FaceChange:
    """Change of a face from neutral by a gesture."""

    performed: Performed

    @property
    def character(self) -> Character:
        """The character."""
        return self.performed.model.character

    @cached_property
    def motion(self) -> Array:
        """Motion of the vertices in millimetres, shape (N, 3)."""
        motion = self.performed.vertices - self.character.vertices
        return motion.astype(np.float64) * self._millimetres

    @property
    def _millimetres(self) -> float:
        return 10.0 * HEAD_HEIGHT / self.character.height

    @cached_property
    def weights(self) -> Mapping[str, float]:
        """Weights of ARKit's shapes as in the panel and in files; empty without such shapes."""
        if not set(self.character.shape_names) & set(ARKIT_SHAPES):
            return {}
        return fit_weights(self.performed.model, self.performed.pose)

    def values(self, unit: str) -> dict[str, float]:
        """Return the value of ``unit``, or of its two sides, by name; empty if the face does not have it."""
        names = sided(unit)
        return {name: value for name in names if (value := self._value(name)) is not None}

    def _value(self, name: str) -> float | None:
        if name in self.weights:
            return self.weights[name]
        place, _, direction = name.rpartition("_")
        if direction == "mean":
            ids = region_vertices(self.character).get(place)
            return None if ids is None else float(np.linalg.norm(self.motion[ids], axis=1).mean())
        if name.startswith("lids_"):
            return self._lids(*name.split("_")[1:])
        if name == "mouth_opens":
            return self._gap("2.2", "2.3")
        if name == "lip_overhang":
            # A lower lip that moves farther forward than the chin looks unnatural.
            lip, chin = self._feature("8.2"), self._feature("2.10")
            return None if lip is None or chin is None else float(lip[2] - chin[2])
        return self._point(place, direction)

    def _point(self, place: str, direction: str) -> float | None:
        outwards = 1.0
        key = MIDDLES.get(place)
        if key is None:
            base, _, side = place.rpartition("_")
            if base not in PAIRS:
                return None
            outwards = 1.0 if side == "left" else -1.0
            key = PAIRS[base][side == "right"]
        moved = self._feature(key)
        if moved is None:
            return None
        if direction == "moved":
            return float(np.linalg.norm(moved))
        if direction in ("out", "in", "left", "right"):
            sign = {"out": outwards, "in": -outwards, "left": 1.0, "right": -1.0}[direction]
            return float(sign * moved[0])
        axis, sign = _DIRECTIONS[direction]
        return float(sign * moved[axis])

    def _feature(self, key: str) -> Array | None:
        vertex = self.character.feature_points.get(key)
        return None if vertex is None else self.motion[vertex]

    def _gap(self, upper: str, lower: str) -> float | None:
        above, below = self._feature(upper), self._feature(lower)
        return None if above is None or below is None else float(above[1] - below[1])

    def _lids(self, side: str, direction: str) -> float | None:
        """Return the change of the gap between the lids as a share of its neutral size."""
        upper, lower = (PAIRS[lid][side == "right"] for lid in ("upper_lid", "lower_lid"))
        widened = self._gap(upper, lower)
        if widened is None:
            return None
        points, y = self.character.feature_points, self.character.vertices[:, 1]
        gap = float(y[points[upper]] - y[points[lower]]) * self._millimetres
        return (widened if direction == "open" else -widened) / max(gap, 1e-6)

    # Measures of the whole face
    def spill_mm(self, concerned: tuple[str, ...]) -> float:
        """Return the largest motion of skin outside the regions ``concerned`` and their margin, in millimetres."""
        outside = skin_outside(self.character, concerned)
        return float(np.linalg.norm(self.motion[outside], axis=1).max(initial=0.0))

    def other_side(self) -> float | None:
        """Return the motion of the pulled places' mirror images as a share of their own; None for middle places."""
        own = other = 0.0
        points = self.character.feature_points
        pulled = {drawn.vertex for drawn in self.performed.drawn}
        for pair in PAIRS.values():
            if not set(pair) <= points.keys():
                continue
            left, right = (float(np.linalg.norm(self.motion[points[key]])) for key in pair)
            if points[pair[0]] in pulled:
                own, other = own + left, other + right
            if points[pair[1]] in pulled:
                own, other = own + right, other + left
        return other / own if own > 1e-9 else None

    def gaze_deg(self) -> float | None:
        """Return the angle between the rotated axes of the two eyes, in degrees; None without two eyes."""
        axes: list[Array] = []
        vertices = self.character.vertices.astype(np.float64)
        for side in ("eye_left", "eye_right"):
            ids = self.character.regions.get(side)
            if ids is None or not len(ids):
                return None
            axes.append(_rotation(vertices[ids], vertices[ids] + self.motion[ids] / self._millimetres)[:, 2])
        left, right = axes
        return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(left, right)), left @ right)))


def sided(unit: str) -> tuple[str, ...]:
    """Return the names of both sides of ``unit``, or its own name if it has a side or no sides."""
    if all(unit + side in ARKIT_SHAPES for side in SIDES):
        return tuple(unit + side for side in SIDES)
    place, _, direction = unit.rpartition("_")
    if place in PAIRS or place == "lids":
        return (f"{place}_left_{direction}", f"{place}_right_{direction}")
    return (unit,)


def known_unit(unit: str) -> bool:
    """Return True if ``unit`` is a valid unit of limits."""
    names = sided(unit)
    if all(name in ARKIT_SHAPES for name in names) or names[0] in ("mouth_opens", "lip_overhang"):
        return True
    place, _, direction = names[0].rpartition("_")
    if direction == "mean":
        return place in FACE_REGIONS
    if place.startswith("lids_"):
        return direction in ("close", "open")
    one_sided = place.removesuffix("_left").removesuffix("_right") in PAIRS
    sideways = ("out", "in", "left", "right") if one_sided else ("left", "right")
    return (one_sided or place in MIDDLES) and direction in (*_DIRECTIONS, *sideways, "moved")


def region_ids(character: Character, name: str) -> NDArray[np.int64]:
    """Return the vertices of a region, or of both of its sides; empty if the character has no such region."""
    parts = [character.regions[key] for key in (name, f"{name}_left", f"{name}_right") if key in character.regions]
    return np.unique(np.concatenate(parts)).astype(np.int64) if parts else np.zeros(0, dtype=np.int64)


@lru_cache(maxsize=256)
def skin_outside(character: Character, concerned: tuple[str, ...]) -> NDArray[np.int64]:
    """Return the skin vertices outside the regions ``concerned`` and their margin.

    Skin between regions belongs to the closest region.
    """
    from scipy.spatial import cKDTree

    skin = np.concatenate([np.arange(*part.vertices) for part in character.parts if part.material == "skin"])
    inside = np.unique(np.concatenate([region_ids(character, name) for name in concerned]))
    if not len(inside):
        return skin
    others = np.setdiff1d(np.unique(np.concatenate(list(character.regions.values()))), inside)
    others = np.intersect1d(others, skin)
    vertices = character.vertices.astype(np.float64)
    near, _ = cKDTree(vertices[inside]).query(vertices[skin])
    if len(others):
        far, _ = cKDTree(vertices[others]).query(vertices[skin])
        belongs = near <= far
    else:
        belongs = np.ones(len(skin), dtype=bool)
    margin = 0.1 * _MARGIN_MM * character.height / HEAD_HEIGHT
    return skin[~belongs & (near > margin)]


def _rotation(before: Array, after: Array) -> Array:
    """Return the rotation, (3, 3), that best aligns the points ``before`` with ``after``, (n, 3) (Kabsch 1976)."""
    u, _, vt = np.linalg.svd((before - before.mean(axis=0)).T @ (after - after.mean(axis=0)))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation: Array = (u @ flip @ vt).T
    return rotation
