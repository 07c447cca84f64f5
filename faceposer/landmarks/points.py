"""The 468 points of a face and its irises in an image.

Kartynnik et al., "Real-time facial surface geometry from monocular video on mobile GPUs", 2019, and Ablavatski et al.,
"Real-time pupil tracking from monocular video for digital puppetry", 2020. The numbers of the points are those of
MediaPipe's Face Mesh. Points are found in an upright crop of a face; the crop is taken again around the points found
until it stays the same.
"""

from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.landmarks.crops import Picture, Square
from faceposer.landmarks.detection import all_faces, searches
from faceposer.landmarks.network import networks

Array = NDArray[np.float64]

N_POINTS = 468
# Least logarithm of the odds that a crop has a face, and that from which it certainly has one: in trials, 17 and more
# for faces, down to 7 for small and blurred ones, up to 9 for faces upside down.
_LEAST, _SURE = 5.0, 12.0
# Number of crops taken at most, and their change, in sides and radians, below which no other is taken.
_MOST_PASSES, _STILL = 5, 0.03
# The crop's side over the extent of the points in it, and that of an eye over the distance of its corners.
_ROOM, _EYE_ROOM = 1.5, 2.3
#: Outer and inner corner of the person's right eye, inner and outer of the left.
EYE_CORNERS = ((33, 133), (362, 263))
# Crops with less light than this, on average of 0 to 255, are made brighter.
_DARK = 60.0
# The points of the iris network on the edges of the lids, of the right eye and of the left.
_LIDS = (
    (33, 7, 163, 144, 145, 153, 154, 155, 133, 246, 161, 160, 159, 158, 157, 173),
    (263, 249, 390, 373, 374, 380, 381, 382, 362, 466, 388, 387, 386, 385, 384, 398),
)


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Landmarks of a face in an image, in pixels from its top left corner.

    Left and right are those of the person.

    Attributes:
        points: The 468 points, numbered as in MediaPipe's Face Mesh: x to the right, y down, and a depth in the same
            unit, smaller nearer to the camera, relative to the middle of the head; shape (468, 3).
        iris: Middle of the iris and four points of its edge, of the right and of the left eye, shape (2, 5, 3).
        score: Probability that there is a face.
        box: Left, top, right and bottom of the points, shape (4,).
        logit: Logarithm of the odds of a face, which tells faces apart whose ``score`` is nearly 1.
    """

    points: Array
    iris: Array
    score: float
    box: Array
    logit: float


def find_landmarks(image: ArrayLike) -> Landmarks | None:
    """Return the landmarks of the most distinct face in ``image``, or None if there is no face.

    Args:
        image: 8-bit grey or colour values, top row first, of shape (h, w), (h, w, 3) or (h, w, 4).

    Raises:
        ValueError: If the image is of another shape or type.
    """
    return likely_landmarks(Picture(image))


def likely_landmarks(picture: Picture, most_searches: int | None = None) -> Landmarks | None:
    """Return the landmarks of the most distinct face in ``picture``, or None if there is no face.

    Args:
        picture: The image.
        most_searches: Number of searches to try, of those of ``faceposer.landmarks.detection``; all if None.
    """
    best: _Found | None = None
    for faces in islice(searches(picture), most_searches):
        for face in faces:
            found = _found_in(picture, face.square)
            if found is not None and (best is None or found.logit > best.logit):
                best = found
        if best is not None and best.logit >= _SURE:
            break
    return None if best is None else _with_eyes(picture, best)


def find_all_landmarks(image: ArrayLike) -> list[Landmarks]:
    """Return the landmarks of all faces in ``image``, the largest first; small faces take time to look for.

    Turned or dark faces are looked for only if there are no others.

    Raises:
        ValueError: If the image is not as ``find_landmarks`` needs it.
    """
    picture = Picture(image)
    candidates = [_found_in(picture, face.square) for face in all_faces(picture)]
    kept: list[Landmarks] = []
    for found in sorted((c for c in candidates if c is not None), key=lambda c: -c.logit):
        face = _with_eyes(picture, found)
        if not any(_same_face(face, other) for other in kept):
            kept.append(face)
    if not kept:
        only = likely_landmarks(picture)
        kept = [] if only is None else [only]
    return sorted(kept, key=lambda face: -float(np.prod(face.box[2:] - face.box[:2])))


def landmarks_in(picture: Picture, square: Square) -> Landmarks | None:
    """Return the landmarks of the face in the region ``square`` of ``picture``, or None if there is none."""
    found = _found_in(picture, square)
    return None if found is None else _with_eyes(picture, found)


def followed_landmarks(picture: Picture, before: Landmarks) -> Landmarks | None:
    """Return the landmarks of the face that was at ``before`` one frame ago, or None if it is lost."""
    return landmarks_in(picture, _square_around(before.points))


@dataclass(frozen=True, eq=False)
class _Found:
    """Points in an image, (468, 3), and the logarithm of the odds that they are of a face."""

    points: Array
    logit: float


def _found_in(picture: Picture, square: Square) -> _Found | None:
    points, logit = _points_in(picture, square)
    for _ in range(_MOST_PASSES - 1):
        # Faces at a wrong angle start low.
        if logit < _LEAST - 10.0:
            return None
        before, square = square, _square_around(points)
        if _nearly_equal(before, square):
            break
        points, logit = _points_in(picture, square)
    return _Found(points, logit) if logit >= _LEAST else None


def _nearly_equal(one: Square, other: Square) -> bool:
    moved = np.hypot(one.x - other.x, one.y - other.y) + abs(one.side - other.side)
    turned = abs(np.remainder(one.angle - other.angle + np.pi, 2.0 * np.pi) - np.pi)
    return bool(moved / other.side + turned < _STILL)


def _with_eyes(picture: Picture, found: _Found) -> Landmarks:
    points = found.points
    iris = np.stack([_refined_eye(picture, points, eye) for eye in (0, 1)])
    box = np.concatenate([points[:, :2].min(axis=0), points[:, :2].max(axis=0)])
    return Landmarks(points, iris, float(1.0 / (1.0 + np.exp(-found.logit))), box, found.logit)


def _points_in(picture: Picture, square: Square) -> tuple[Array, float]:
    network = networks()["points"]
    values, logit = network(_lit(picture.crop(square, network.side)))
    return _to_image(values, square, network.side), float(np.clip(logit.reshape(-1)[0], -100.0, 100.0))


def _lit(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return ``pixels`` in 0 to 1, dark crops brighter."""
    gain = max(1.0, _DARK / max(float(pixels.mean()), 1.0))
    return np.minimum(pixels * np.float32(gain / 255.0), np.float32(1.0))


def _to_image(values: NDArray[np.float32], square: Square, side: int) -> Array:
    """Return points in pixels of a crop as points in pixels of the image, shape (n, 3)."""
    local = values.reshape(-1, 3).astype(np.float64) / side
    return np.column_stack([square.to_image(local[:, :2] - 0.5), local[:, 2] * square.side])


def _square_around(points: Array) -> Square:
    """Return the crop for the next pass: upright by the line through the outer corners of the eyes."""
    across = points[EYE_CORNERS[1][1], :2] - points[EYE_CORNERS[0][0], :2]
    turned = Square(0.0, 0.0, 1.0, float(np.arctan2(across[1], across[0])))
    along = points[:, :2] @ turned.axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    x, y = ((low + high) / 2 @ turned.axes).tolist()
    return Square(x, y, max(_ROOM * float((high - low).max()), 1.0), turned.angle)


def _refined_eye(picture: Picture, points: Array, eye: int) -> Array:
    """Return the points of the iris of ``eye``, (5, 3), and move those of its lids in ``points``.

    The network knows one eye; the crop of the other is mirrored.
    """
    network = networks()["iris"]
    first, last = points[list(EYE_CORNERS[eye]), :2]
    (x, y), across = ((first + last) / 2).tolist(), last - first
    square = Square(x, y, max(_EYE_ROOM * float(np.linalg.norm(across)), 1.0), float(np.arctan2(across[1], across[0])))
    pixels = _lit(picture.crop(square, network.side))
    contour, iris = network(np.ascontiguousarray(pixels[:, ::-1] if eye else pixels))
    for values in (contour, iris):
        if eye:
            values[0::3] = network.side - values[0::3]
    lids = list(_LIDS[eye])
    points[lids, :2] = _to_image(contour, square, network.side)[: len(lids), :2]
    depth = points[list(EYE_CORNERS[eye]), 2].mean()
    found = _to_image(iris, square, network.side)
    return np.column_stack([found[:, :2], found[:, 2] - found[0, 2] + depth])


def _same_face(one: Landmarks, other: Landmarks) -> bool:
    """Return True if the nose of a face is inside the middle half of the other."""
    middle, half = (other.box[:2] + other.box[2:]) / 2, (other.box[2:] - other.box[:2]) / 4
    return bool((np.abs(one.points[1, :2] - middle) < half).all())
