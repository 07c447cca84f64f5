"""Files of strokes, read by ``faceposer sketch`` (docs/sketching-files.md)."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import JsonDocument, JsonError, JsonObject, check_header, convert, read_json
from faceposer.geometry.camera import Camera
from faceposer.model.character import Character
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.recognition import DrawnStroke
from faceposer.solve.camera_io import camera_from_json
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.sketch import MOST_STROKE_POINTS

FORMAT = "faceposer.strokes"
VERSION = 1
#: Largest number of strokes of a file.
MOST_STROKES = 200
_MAX_BYTES = 64 * 2**20


class _StrokeJson(JsonObject):
    pixels: Annotated[list[codec.Pixel], Meta(min_length=2, max_length=MOST_STROKE_POINTS)]
    feature: str | None = None

    def __post_init__(self) -> None:
        if self.feature is not None and self.feature not in FEATURES:
            raise JsonError(f"must be null or the name of a feature: {', '.join(FEATURES)}", "feature")


class _StrokesFile(JsonDocument, kw_only=True):
    # A camera or the name of a view; see ``camera_from_json``.
    camera: Any = None
    strokes: Annotated[list[Annotated[_StrokeJson, Meta(title="strokes")]], Meta(min_length=1, max_length=MOST_STROKES)]


def read_strokes(path: Path, character: Character, camera: Camera | None = None) -> tuple[DrawnStroke, ...]:
    """Return the strokes in the file ``path``, in the order of drawing.

    Args:
        path: The file; its name ends in ".json".
        character: The character that is drawn.
        camera: The camera under which they were drawn, in place of that of the file.

    Raises:
        FacePoserError: If the file cannot be read or is not valid; the message names the place.
    """
    if path.suffix.lower() != ".json":
        raise FacePoserError(f"The strokes '{path}' must be a file that ends in '.json', or in '.svg' for a drawing.")
    return read_json(path, "strokes", lambda data: strokes_from_json(data, character, camera), _MAX_BYTES)


def strokes_from_json(data: Any, character: Character, camera: Camera | None = None) -> tuple[DrawnStroke, ...]:
    """Return the strokes that ``data`` describes; see ``read_strokes``.

    Raises:
        FacePoserError: If the data are invalid; the message names the place.
    """
    check_header(data, FORMAT, VERSION)
    form = convert(data, _StrokesFile)
    if camera is None and form.camera is None:
        raise FacePoserError("the file lacks the key 'camera'; add it, or give the camera separately.")
    if camera is None:
        camera = camera_from_json(form.camera, "camera", character, of_face=True)
    for i, stroke in enumerate(form.strokes):
        if stroke.feature is not None:
            missing = [name for name in FEATURES[stroke.feature].points if name not in character.feature_points]
            if missing:
                raise FacePoserError(
                    f"strokes[{i}].feature is '{stroke.feature}', but '{character.title}' lacks its feature points "
                    f"{', '.join(missing)}."
                )
    return tuple(DrawnStroke(np.array(stroke.pixels), camera, stroke.feature) for stroke in form.strokes)
