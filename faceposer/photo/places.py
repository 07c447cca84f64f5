"""Places of the face to pin in photos: their order, and their use for camera and expression."""

from dataclasses import dataclass

from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.photo.photo import Place

#: Feature points that determine the camera: most hardly move with the expression, and the first four are already
#: far apart.
ALIGNING = ("3.7", "3.12", "9.3", "2.1", "3.11", "3.8", "9.15", "8.3", "8.4", "10.5", "10.6")
#: Feature points that determine the expression, with little influence on the camera.
EXPRESSIVE = (
    "8.1",
    "8.2",
    "2.2",
    "2.3",
    "4.3",
    "4.4",
    "4.1",
    "4.2",
    "4.5",
    "4.6",
    "3.1",
    "3.3",
    "3.2",
    "3.4",
    "3.5",
    "3.6",
)
#: Order of the guided pins.
GUIDED = ALIGNING + EXPRESSIVE

# Weight of a pin in the estimation of the camera, by its rigidity.
_RIGID = {
    **dict.fromkeys(("3.7", "3.8", "3.11", "3.12"), 1.0),
    **dict.fromkeys(("9.1", "9.2", "9.3", "9.4", "9.5", "9.12", "9.15"), 1.0),
    **dict.fromkeys(("10.1", "10.2", "10.3", "10.4", "10.5", "10.6"), 1.0),
    **dict.fromkeys(("11.1", "11.2", "11.3", "11.4", "11.6"), 0.3),
    **dict.fromkeys(("5.3", "5.4", "2.13", "2.14"), 0.5),
    "2.1": 0.25,
}
_LOOSE = 0.05
_REGION_WEIGHTS = {"nose": 1.0, "ear_left": 1.0, "ear_right": 1.0, "forehead": 0.5}


@dataclass(frozen=True)
class Pair:
    """Two feature points whose distance depends on the expression, with a constant distance for comparison.

    Attributes:
        ends: Names of the two points.
        measure: Names of two points whose distance is the same in all expressions: it gives the size of the feature.
    """

    ends: tuple[str, str]
    measure: tuple[str, str]


#: Openings of the mouth and of the eyes.
OPENINGS = (
    Pair(("2.2", "2.3"), ("3.7", "3.12")),
    Pair(("3.1", "3.3"), ("3.7", "3.11")),
    Pair(("3.2", "3.4"), ("3.12", "3.8")),
)
#: Each pupil, which shows the gaze, with the corners of its eye.
PUPILS = (("3.5", ("3.7", "3.11")), ("3.6", ("3.12", "3.8")))
#: Groups of points whose position relative to the face varies between people.
GROUPS = (
    ("8.3", "8.4", "8.1", "8.2", "8.5", "8.6", "8.7", "8.8", "8.9", "8.10", "2.2", "2.3", "2.4", "2.5"),
    ("4.1", "4.2", "4.3", "4.4", "4.5", "4.6"),
    ("2.1",),
)


def guided(character: Character) -> list[str]:
    """Return the feature points of the guided order that ``character`` has."""
    return [name for name in GUIDED if name in character.feature_points]


def anchor_of(place: Place, character: Character) -> Place | None:
    """Return ``place`` as a vertex index or a surface point, or None if ``character`` lacks it."""
    if isinstance(place, str):
        vertex = character.feature_points.get(place)
        return None if vertex is None else int(vertex)
    if isinstance(place, int):
        return place if 0 <= place < len(character.vertices) else None
    return place if 0 <= place.face < len(character.triangles) else None


def rigidity(place: Place, model: FaceModel) -> float:
    """Return the rigidity of ``place``, 0 to 1: the weight of its pin in the estimation of the camera."""
    if isinstance(place, str):
        return _RIGID.get(place, _LOOSE)
    character = model.character
    vertex = place if isinstance(place, int) else int(character.triangles[place.face][0])
    names = [name for name, vertices in character.regions.items() if (vertices == vertex).any()]
    return max((_REGION_WEIGHTS.get(name, _LOOSE) for name in names), default=_LOOSE)
