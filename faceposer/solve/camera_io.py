"""Cameras in JSON files: their parameters, or the name of a view that frames the character."""

from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from faceposer.files.json_documents import JsonObject, convert, read_json
from faceposer.geometry.camera import Camera, OrbitView, ViewName
from faceposer.model.character import Character
from faceposer.model.framing import face_view
from faceposer.solve.constraints import codec

_MAX_BYTES = 2**28
_Side = Annotated[float, Meta(ge=1.0, le=65536.0)]


class _ViewJson(JsonObject):
    view: ViewName
    size: tuple[_Side, _Side]


def read_camera(path: Path, character: Character, of_face: bool = False) -> Camera:
    """Return the camera in the JSON file ``path``, or the view of ``character`` named there; see ``camera_from_json``.

    Raises:
        FacePoserError: If the file cannot be read or has no camera.
    """

    def parsed(data: Any) -> Camera:
        inner = data["camera"] if isinstance(data, dict) and "camera" in data else data
        return camera_from_json(inner, "camera", character, of_face)

    return read_json(path, "camera", parsed, _MAX_BYTES)


def camera_from_json(data: Any, where: str, character: Character, of_face: bool = False) -> Camera:
    """Return the camera described by ``data``: its parameters, or a view that frames ``character`` with an image size.

    Args:
        data: The JSON data.
        where: Place of the data, for messages.
        character: The character.
        of_face: True for a view that frames the face, as ``Face.camera`` does; False for one of the whole head.

    Raises:
        FacePoserError: If the data is invalid; the message names the place, which starts with ``where``.
    """
    if not (isinstance(data, dict) and "view" in data):
        return convert(data, codec.CameraJson, where).camera()
    form = convert(data, _ViewJson, where)
    width, height = map(int, form.size)
    if of_face:
        return face_view(character, form.view, width / height).camera((width, height))
    vertices = character.vertices
    return OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0), form.view).camera((width, height))
