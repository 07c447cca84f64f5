"""Strokes that can depict a feature at all, by their length against the face in the image."""

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.face_in_view import FaceInView
from faceposer.sketch.polyline import cleaned, lengths_along
from faceposer.sketch.recognition import DrawnStroke

Array = NDArray[np.float64]

#: Least and greatest length of a stroke that can depict a feature, in heights of the face.
SHORTEST, LONGEST = 0.04, 3.0
# The same of a stroke whose feature is named.
_SHORTEST_NAMED, _LONGEST_NAMED = 0.015, 10.0


def objection(stroke: DrawnStroke, character: Character, named: bool = False) -> str:
    """Return why ``stroke`` cannot depict a feature of ``character``, for a sentence; "" if it can.

    Args:
        stroke: The stroke.
        character: The character.
        named: True if the user says which feature it depicts; it may then be shorter, or longer.
    """
    try:
        face = FaceInView.of(character, stroke.camera)
        points = cleaned(stroke.pixels)
        if len(points) < 2:
            return "it has no length"
        face.check_near(points)
    except ValueError as error:
        return str(error)
    length = float(lengths_along(points)[-1]) / max(face.height, 1e-12)
    least, most = (_SHORTEST_NAMED, _LONGEST_NAMED) if named else (SHORTEST, LONGEST)
    if float(np.hypot(*np.ptp(points, axis=0))) / max(face.height, 1e-12) < least:
        return f"it is shorter than {100.0 * least:g} % of the face's height"
    if length > most:
        return f"it is longer than {most:g} heights of the face"
    return ""
