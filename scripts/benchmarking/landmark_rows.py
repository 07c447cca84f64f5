"""Times of landmarks in photos and on meshes (docs/landmarks.md)."""

from faceposer.landmarks.crops import Picture
from faceposer.landmarks.detection import searches
from faceposer.landmarks.drawing import draw
from faceposer.landmarks.on_meshes import find_mesh_landmarks
from faceposer.landmarks.painting import painted_character
from faceposer.landmarks.points import find_landmarks, landmarks_in
from faceposer.model.character import Character
from faceposer.model.framing import face_view
from scripts.benchmarking.timing import Row, milliseconds, row

_SIDE = 512


def landmark_rows(character: Character, repeats: int) -> list[Row]:
    """Measure the detection of a face, the points of a crop, a whole photo, and the mesh of ``character``."""
    mesh = painted_character(character)
    image = draw(mesh, face_view(character).camera((_SIDE, _SIDE))).image
    picture = Picture(image)
    square = next(iter(searches(picture)))[0].square
    return [
        row("landmarks/detection", milliseconds(lambda: next(iter(searches(picture))), repeats)),
        row("landmarks/points", milliseconds(lambda: landmarks_in(picture, square), repeats)),
        row("landmarks/photo", milliseconds(lambda: find_landmarks(image), repeats)),
        row("landmarks/mesh", milliseconds(lambda: find_mesh_landmarks(mesh), max(repeats // 10, 1))),
    ]
