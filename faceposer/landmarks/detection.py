"""Detection of faces in images (Bazarevsky et al., "BlazeFace", 2019).

The network looks at 128 x 128 pixels and finds faces from about an eighth of them up, turned by up to 45 degrees or so.
Smaller faces are looked for in overlapping windows, faces at other angles in turned ones.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.landmarks.crops import Picture, Square
from faceposer.landmarks.network import networks

Array = NDArray[np.float64]

# Least probability of a detection, and the overlap above which two are of the same face.
_LEAST_SCORE, _OVERLAP = 0.5, 0.3
# Least side of a window in pixels, and the most halvings of the side of the image.
_LEAST_SIDE, _MOST_HALVINGS = 160, 3
# Distance of neighbouring windows as a share of their side.
_STEP = 0.7
_MOST_DETECTIONS = 64
# Mean brightness, of 0 to 255, of the brighter half to which dark images are stretched.
_BRIGHT = 180.0


@dataclass(frozen=True, eq=False)
class Detection:
    """A face found in an image.

    Attributes:
        corners: Corners of its box in pixels, shape (4, 2); the box is as turned as the window in which it was found.
        keypoints: Its right eye, left eye, nose tip, mouth, right ear and left ear (of the person), pixels, (6, 2).
        score: Probability that it is a face.
    """

    corners: Array
    keypoints: Array
    score: float

    @property
    def middle(self) -> Array:
        """The middle of its box, shape (2,)."""
        middle: Array = self.corners.mean(axis=0)
        return middle

    @property
    def size(self) -> float:
        """The longer side of its box."""
        return float(np.linalg.norm(self.corners[[1, 3]] - self.corners[0], axis=1).max())

    @property
    def square(self) -> Square:
        """The region in which to look for its points: half as large again, upright by the line through its eyes."""
        (x, y), across = self.middle.tolist(), self.keypoints[1] - self.keypoints[0]
        return Square(x, y, 1.5 * self.size, float(np.arctan2(across[1], across[0])))


def searches(picture: Picture) -> Iterator[list[Detection]]:
    """Yield the faces in ``picture``, the largest first, from searches that are each less likely to find any.

    The first sees the whole image, the next also turned; then come windows, for small faces, and darkness.
    """
    whole = Square(picture.width / 2, picture.height / 2, float(max(picture.width, picture.height)))
    yield _found(picture, [whole])
    quarter = np.pi / 2
    yield _found(picture, [replace(whole, angle=angle) for angle in (quarter, -quarter, 2 * quarter)])
    for halvings in (1, 2):
        yield _found(picture, _windows(picture, whole.side / 2**halvings))
    # A face that fills the image is found in a larger window.
    turned = [replace(whole, angle=float(angle)) for angle in np.arange(8) * np.pi / 4]
    yield _found(picture, [*turned, replace(whole, side=2.0 * whole.side)], stretched=True)
    yield _found(picture, _windows(picture, whole.side / 8))


def all_faces(picture: Picture) -> list[Detection]:
    """Return the upright faces in ``picture``, the largest first, also small ones."""
    side = float(max(picture.width, picture.height))
    whole = Square(picture.width / 2, picture.height / 2, side)
    windows = [square for halvings in range(1, _MOST_HALVINGS + 1) for square in _windows(picture, side / 2**halvings)]
    return _found(picture, [whole, *windows])


def _found(picture: Picture, windows: list[Square], stretched: bool = False) -> list[Detection]:
    found: list[Detection] = []
    # Those of windows at other angles differ, since the network also finds faces upside down, but not their eyes.
    for angle in dict.fromkeys(square.angle for square in windows):
        alike = [square for square in windows if square.angle == angle]
        found += _merged([face for square in alike for face in _in_window(picture, square, stretched)])
    return sorted(found, key=lambda face: -face.size)


def _windows(picture: Picture, side: float) -> list[Square]:
    """Return squares of ``side`` that cover the image, or none if they would be too small.

    Each overlaps its neighbours by more than the size of the faces that larger windows do not find.
    """
    if side < _LEAST_SIDE:
        return []
    middles = []
    for length in (picture.width, picture.height):
        count = max(1, int(np.ceil((length - side) / (_STEP * side))) + 1)
        middles.append(np.linspace(side / 2, length - side / 2, count) if count > 1 else np.array([length / 2]))
    return [Square(float(x), float(y), side) for y in middles[1] for x in middles[0]]


def _in_window(picture: Picture, square: Square, stretched: bool) -> list[Detection]:
    network = networks()["detection"]
    pixels = picture.crop(square, network.side, repeat_edge=False)
    if stretched:
        pixels = _stretched(pixels)
    values, logits = network((pixels / 127.5 - 1.0).astype(np.float32))
    scores = 1.0 / (1.0 + np.exp(-np.clip(logits[:, 0].astype(np.float64), -100.0, 100.0)))
    likely = np.flatnonzero(scores >= _LEAST_SCORE)
    likely = likely[np.argsort(-scores[likely])][:_MOST_DETECTIONS]
    boxes = values[likely].astype(np.float64) / network.side
    anchors = _anchors()[likely]
    found = []
    for box, anchor, score in zip(boxes, anchors, scores[likely], strict=True):
        middle, half = anchor + box[:2] - 0.5, box[2:4] / 2
        corners = middle + half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        keypoints = anchor + box[4:].reshape(6, 2) - 0.5
        found.append(Detection(square.to_image(corners), square.to_image(keypoints), float(score)))
    return _merged(found)


def _stretched(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return ``pixels`` with the mean of its brighter half raised to that of a well-lit face."""
    brightness = pixels.mean(axis=2)
    bright = float(brightness[brightness >= np.median(brightness)].mean())
    gain = np.clip(_BRIGHT / max(bright, 1.0), 1.0, 16.0)
    return np.minimum(pixels * np.float32(gain), 255.0)


def _merged(found: list[Detection]) -> list[Detection]:
    """Return one detection for each group that overlaps, their mean weighted by score (BlazeFace's blending)."""
    merged = []
    remaining = sorted(found, key=lambda face: -face.score)
    while remaining:
        overlaps = np.array([_overlap(remaining[0], other) for other in remaining])
        group = [face for face, share in zip(remaining, overlaps, strict=True) if share > _OVERLAP]
        remaining = [face for face, share in zip(remaining[1:], overlaps[1:], strict=True) if share <= _OVERLAP]
        weights = np.array([face.score for face in group])
        weights /= weights.sum()
        corners, keypoints = (
            np.einsum("g,gkd->kd", weights, np.stack([getattr(face, name) for face in group]))
            for name in ("corners", "keypoints")
        )
        merged.append(Detection(corners, keypoints, group[0].score))
    return merged


def _overlap(one: Detection, other: Detection) -> float:
    """Return the intersection of two boxes over their union; both count as upright squares."""
    if one is other:
        return 1.0
    apart = np.abs(one.middle - other.middle)
    sides = np.maximum((one.size + other.size) / 2 - apart, 0.0)
    common = float(np.prod(np.minimum(sides, min(one.size, other.size))))
    return common / max(one.size**2 + other.size**2 - common, 1e-12)


@lru_cache(maxsize=1)
def _anchors() -> Array:
    """Return the middles of the anchors in units of the window, shape (896, 2): 2 per 8 x 8, 6 per 16 x 16 pixels."""
    side = networks()["detection"].side
    found = []
    for stride, count in ((8, 2), (16, 6)):
        steps = (np.arange(side // stride) + 0.5) * stride / side
        columns, rows = np.meshgrid(steps, steps)
        found.append(np.repeat(np.stack([columns.ravel(), rows.ravel()], axis=1), count, axis=0))
    return np.concatenate(found)
