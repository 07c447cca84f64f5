"""Views that frame a face from chin to hairline, without the neck and the top of the head."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import OrbitView
from faceposer.model.character import Character

Array = NDArray[np.float64]

#: Share of the image's height above the hairline and below the chin; the face fills the rest.
ABOVE, BELOW = 0.15, 0.13
#: Largest share of the image's width that the head may take.
ACROSS = 0.97
# A vertex belongs to the moving part of a face if a shape moves it by at least this share of the largest displacement.
_MOVES = 0.12
_FOV_Y = math.radians(20.0)
# Foreheads hardly move: their height as a share of the height of the moving part.
_FOREHEAD = 0.22
# Largest distance from the plane of symmetry of a vertex that counts as near it, as a share of the mesh's width.
_NEAR_MIDDLE = 0.25
# Narrow images include long ears unless the face would shrink by more than this factor.
_FOR_EARS = 1.45
# Least number of vertices, and least height as a share of the mesh's, of a face.
_FEWEST, _LOWEST = 8, 0.1


@dataclass(frozen=True, eq=False)
class FaceFrame:
    """The geometry that a view of a face must contain, in the unit of the mesh.

    Attributes:
        chin: The lowest point of the face, shape (3,).
        hairline: The highest point of the face, shape (3,).
        outline: Vertices of the head level with the face and above it, without the ears, shape (n, 3).
        ears: Vertices of the ears, shape (m, 3).
        middle: Coordinates x and z of the vertical axis that views orbit.
    """

    chin: Array
    hairline: Array
    outline: Array
    ears: Array
    middle: tuple[float, float]


def face_frame(character: Character) -> FaceFrame | None:
    """Return the frame of the face of ``character``, or None if the face cannot be located on the mesh.

    Chin and hairline are MPEG-4's feature points 2.1 and 11.1; without them, the lowest and the highest point of the
    skin that the shapes move, with an estimated forehead above it.
    """
    vertices = character.vertices.astype(np.float64)
    points = [character.feature_points.get(name) for name in ("2.1", "11.1")]
    if points[0] is not None and points[1] is not None:
        chin, hairline = vertices[points[0]], vertices[points[1]]
    else:
        moving = vertices[_moving_skin(character)]
        if len(moving) < _FEWEST:
            return None
        chin, hairline = moving[moving[:, 1].argmin()], moving[moving[:, 1].argmax()].copy()
        hairline[1] = min(hairline[1] + _FOREHEAD * (hairline[1] - chin[1]), vertices[:, 1].max())
    if hairline[1] - chin[1] < _LOWEST * np.ptp(vertices[:, 1]):
        return None
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    ears = np.zeros(len(vertices), dtype=bool)
    for region in ("ear_left", "ear_right"):
        ears[character.regions.get(region, ())] = True
    outline = (vertices[:, 1] >= chin[1]) & ~ears
    middle = (low + high) / 2.0
    return FaceFrame(chin, hairline, vertices[outline], vertices[ears], (float(middle[0]), float(middle[2])))


def face_view(character: Character, name: str = "front", aspect: float = 1.0) -> OrbitView:
    """Return the view ``name`` that frames the face of ``character`` in images ``aspect`` times as wide as high.

    In the front view, chin and hairline are `BELOW` and `ABOVE` of the image's height away from its edges; in images
    too narrow for the head, the face is smaller but still centred. A mesh on which no face is found is framed whole.

    Raises:
        KeyError: If there is no such view.
    """
    return _front_view(character, aspect).looking(name)


def _front_view(character: Character, aspect: float) -> OrbitView:
    frame = face_frame(character)
    if frame is None:
        low, high = character.vertices.min(axis=0), character.vertices.max(axis=0)
        across = 1.15 * float(high[0] - low[0]) / max(float(high[1] - low[1]), 1e-9)
        return OrbitView.preset(low, high).zoomed(min(1.0, aspect / across))
    x, z = frame.middle
    half = math.tan(_FOV_Y / 2.0)
    # Image positions of hairline and chin, as shares of half the image's height from its middle.
    top, bottom = 1.0 - 2.0 * ABOVE, 1.0 - 2.0 * BELOW
    (chin_y, chin_z), (hair_y, hair_z) = ((p[1], p[2] - z) for p in (frame.chin, frame.hairline))
    tall = ((hair_y - chin_y) / half + top * hair_z + bottom * chin_z) / (top + bottom)
    wide, with_ears = (
        float((np.abs(points[:, 0] - x) / (ACROSS * half * aspect) + points[:, 2] - z).max(initial=0.0))
        for points in (frame.outline, frame.ears)
    )
    distance = max(tall, wide, min(with_ears, _FOR_EARS * tall))
    over, under = bottom / (distance - hair_z), top / (distance - chin_z)
    y = (over * hair_y + under * chin_y) / (over + under)
    return OrbitView((x, float(y), z), 0.0, 0.0, float(distance), _FOV_Y)


def _moving_skin(character: Character) -> NDArray[np.intp]:
    """Return the skin vertices near the plane of symmetry that a shape moves noticeably, shape (n,)."""
    ids = [np.arange(*part.vertices) for part in character.parts if part.material == "skin"]
    if not ids or not len(character.shapes):
        return np.zeros(0, dtype=np.intp)
    skin = np.concatenate(ids)
    moved = np.zeros(len(skin), dtype=np.float32)
    for shape in character.shapes:
        np.maximum(moved, np.abs(shape[skin]).max(axis=1), out=moved)
    x = character.vertices[skin, 0]
    near = np.abs(x - (x.min() + x.max()) / 2.0) < _NEAR_MIDDLE * np.ptp(x)
    return skin[near & (moved > _MOVES * max(float(moved.max()), 1e-9))]
