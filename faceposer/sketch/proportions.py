"""Proportions of a drawing, separated from its expression (docs/drawings.md)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.feature_templates import NOSE_BASE, ViewedFeatures
from faceposer.sketch.polyline import evenly

Array = NDArray[np.float64]

#: Features whose proportions go together, by the name of the group.
GROUPS: Mapping[str, tuple[str, ...]] = {
    **{
        f"{side} eye": tuple(f"{side} {p}" for p in ("upper lid", "lower lid", "eye outline"))
        for side in ("left", "right")
    },
    "left brow": ("left brow",),
    "right brow": ("right brow",),
    "nose": (NOSE_BASE,),
    "mouth": (
        "outer upper lip",
        "outer lower lip",
        "inner upper lip",
        "inner lower lip",
        "mouth line",
        "mouth outline",
    ),
    "jaw": ("jaw line",),
    "left wing": ("left nose wing",),
    "right wing": ("right nose wing",),
    "left cheek": ("left cheek line",),
    "right cheek": ("right cheek line",),
}
#: Groups that are judged by a drawn neutral alone: by one drawing, outline and proportions cannot be told apart.
NEED_NEUTRAL = frozenset({"jaw", "left wing", "right wing", "left cheek", "right cheek"})
# Expressions of drawings in relation to the spread of the training poses.
_STRONGER = 2.5
# Deviations of proportions that are assumed at first, in units of the hand and as logarithms of sizes, and their weight
# as a number of measurements.
_PLACE, _SIZE, _WEIGHT = 8.0, 0.1, 2.0
_BINS = 9


@dataclass(frozen=True)
class Frame:
    """Place and size of a group of features, in units of the hand.

    Attributes:
        x: Middle between its left and right end.
        y: Height of the ends of an eye, of the lower end of a nose, of the upper edge of a mouth, else the mean height.
        width: Distance of its ends.
        height: Distance of its top and bottom.
    """

    x: float
    y: float
    width: float
    height: float

    @classmethod
    def of(cls, group: str, lines: Mapping[str, Array]) -> "Frame | None":
        """Return the frame of ``group`` in ``lines`` by feature, or None if none of its features is among them."""
        found = [evenly(lines[name], 64) for name in GROUPS[group] if name in lines]
        if not found:
            return None
        points = np.concatenate(found)
        low, high = points.min(axis=0), points.max(axis=0)
        if group.endswith("eye"):
            y = float(0.5 * (points[np.argmin(points[:, 0]), 1] + points[np.argmax(points[:, 0]), 1]))
        elif group == "nose":
            y = float(high[1])
        elif group == "mouth":
            at = np.clip(((points[:, 0] - low[0]) / max(high[0] - low[0], 1e-9) * _BINS).astype(int), 0, _BINS - 1)
            y = float(np.mean([points[at == i, 1].min() for i in np.unique(at)]))
        else:
            y = float(points[:, 1].mean())
        width, height = (float(size) for size in np.maximum(high - low, 1e-6))
        return cls(float(0.5 * (low[0] + high[0])), y, width, height)


@dataclass(frozen=True)
class GroupMap:
    """Map that takes the proportions of a drawing to those of a face: scales about a point, and a shift.

    Attributes:
        about: The fixed point of the scales.
        scale: Scales across and up.
        shift: The shift.
    """

    about: tuple[float, float]
    scale: tuple[float, float]
    shift: tuple[float, float]

    def __call__(self, points: Array) -> Array:
        """Return ``points``, shape (n, 2), in the proportions of the face."""
        return (points - self.about) * self.scale + self.about + self.shift


def by_neutral(features: ViewedFeatures, neutral: Mapping[str, Array]) -> dict[str, GroupMap]:
    """Return the maps by group that take the drawn ``neutral`` face, lines by feature, to the character's."""
    maps = {}
    for group, names in GROUPS.items():
        drawn = Frame.of(group, neutral)
        head = Frame.of(group, {name: features.neutral[name] for name in names if name in neutral})
        if drawn is None or head is None:
            continue
        across = head.width / drawn.width
        both_lids = group.endswith("eye") and drawn.height > 0.05 * drawn.width
        up = head.height / drawn.height if both_lids else across
        maps[group] = GroupMap((drawn.x, drawn.y), (across, up), (head.x - drawn.x, head.y - drawn.y))
    return maps


def by_statistics(features: ViewedFeatures, drawn: Mapping[str, Array]) -> dict[str, GroupMap]:
    """Return the maps by group for a drawing without a neutral face.

    Eyes are mapped by their corners, which expressions hardly move, the mouth by its height. Of other deviations from
    the neutral face, the share S^2 / (S^2 + E^2) is taken for proportion: E is the spread of the training poses, S that
    of the deviations of eyes and nose, which are known to be proportions.

    Args:
        features: The features of the character in the view.
        drawn: Lines of the drawing by feature.
    """
    frames: dict[str, tuple[Frame, Frame]] = {}
    for group, names in GROUPS.items():
        own = Frame.of(group, drawn)
        head = Frame.of(
            group, {name: features.neutral[name] for name in names if name in drawn and name in features.neutral}
        )
        if own is not None and head is not None:
            frames[group] = own, head
    rigid = [frames[group] for group in ("left eye", "right eye", "nose") if group in frames]
    places = [value for own, head in rigid for value in (head.x - own.x, head.y - own.y)]
    sizes = [float(np.log(head.width / own.width)) for own, head in rigid]
    place = (_WEIGHT * _PLACE**2 + float(np.square(places).sum())) / (_WEIGHT + len(places))
    size = (_WEIGHT * _SIZE**2 + float(np.square(sizes).sum())) / (_WEIGHT + len(sizes))
    maps = {}
    eyes = {}
    for group in ("left eye", "right eye"):
        if group in frames:
            own, head = frames[group]
            scale = head.width / own.width
            # Large eyes are drawn rounder, too.
            maps[group] = GroupMap((own.x, own.y), (scale, scale * min(scale, 1.0)), (head.x - own.x, head.y - own.y))
            eyes[group] = head.y - own.y
    lift = float(np.mean(list(eyes.values()))) if eyes else 0.0
    spread = _Spread(features)
    brows = [group for group in ("left brow", "right brow") if group in frames]
    outward = {"left brow": 1.0, "right brow": -1.0}
    if brows:
        x = np.mean([outward[g] * (frames[g][1].x - frames[g][0].x) for g in brows])
        y = np.mean([frames[g][1].y - frames[g][0].y for g in brows]) - lift
        log_width = np.mean([np.log(frames[g][1].width / frames[g][0].width) for g in brows])
        apart, up, wide = spread.of(brows[0])
        scale = float(np.exp(_share(size, wide) * log_width))
        for g in brows:
            shift = outward[g] * _share(place, apart) * float(x), lift + _share(place, up) * float(y)
            maps[g] = GroupMap((frames[g][0].x, frames[g][0].y), (scale, scale), shift)
    if "mouth" in frames:
        own, head = frames["mouth"]
        name = next(name for name in GROUPS["mouth"] if name in drawn)
        apart, _, wide = spread.of(name)
        scale = float(np.exp(_share(size, wide) * np.log(head.width / own.width)))
        shift = _share(place, apart) * (head.x - own.x), head.y - own.y
        maps["mouth"] = GroupMap((own.x, own.y), (scale, scale), shift)
    return maps


class _Spread:
    """Spread of features over the training poses."""

    def __init__(self, features: ViewedFeatures) -> None:
        self._features = features

    def of(self, name: str) -> tuple[float, float, float]:
        """Return the standard deviations of place across, place up, and logarithm of the width of a feature."""
        poses = self._features.poses[name]
        low, high = poses[..., 0].min(axis=1), poses[..., 0].max(axis=1)
        across, up = 0.5 * (low + high), poses[..., 1].mean(axis=1)
        width = np.log(np.maximum(high - low, 1e-6))
        return float(across.std()), float(up.std()), float(width.std())


def _share(proportion: float, expression: float) -> float:
    """Return the share of a deviation that is proportion, given its variance and the spread of expressions."""
    return proportion / (proportion + (_STRONGER * expression) ** 2 + 1e-12)
