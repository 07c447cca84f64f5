"""JSON forms that the constraints share, each refused with the place of what is wrong."""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints

_MAX_COORDINATE = 1e6
_MAX_PICTURE = 65536
_MAX_POINTS = 100_000


def check_keys(data: Any, required: AbstractSet[str], optional: AbstractSet[str], where: str) -> None:
    """Raise ``FacePoserError`` unless ``data`` is an object with the ``required`` and perhaps ``optional`` keys."""
    if not isinstance(data, dict):
        raise FacePoserError(f"{where} must be an object with the keys {_listed(required)}.")
    unknown = sorted(set(data) - required - optional)
    if unknown:
        raise FacePoserError(
            f"{where} has the unknown key '{unknown[0]}'; the keys here are {_listed(required | optional)}."
        )
    missing = sorted(required - set(data))
    if missing:
        raise FacePoserError(f"{where} lacks the key '{missing[0]}'.")


def _listed(keys: AbstractSet[str]) -> str:
    return ", ".join(f"'{key}'" for key in sorted(keys))


def number_from_json(
    value: Any, where: str, minimum: float = -_MAX_COORDINATE, maximum: float = _MAX_COORDINATE
) -> float:
    """Return ``value`` as a finite number from ``minimum`` to ``maximum``, or raise ``FacePoserError``."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    # The comparison also tells what is not finite, and whole numbers too large to become one with a fraction.
    if not number or not minimum <= value <= maximum:
        raise FacePoserError(f"{where} must be a number from {minimum:g} to {maximum:g}, not {shown(value)}.")
    return float(value)


def index_from_json(value: Any, where: str) -> int:
    """Return ``value`` as a whole number of at least 0, or raise ``FacePoserError``."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**31:
        raise FacePoserError(f"{where} must be a whole number of at least 0, not {shown(value)}.")
    return value


def flag_from_json(value: Any, where: str) -> bool:
    """Return ``value`` as a truth value, or raise ``FacePoserError``."""
    if not isinstance(value, bool):
        raise FacePoserError(f"{where} must be true or false, not {shown(value)}.")
    return value


def numbers_from_json(value: Any, count: int, where: str) -> list[float]:
    """Return ``value`` as a list of ``count`` finite numbers, or raise ``FacePoserError``."""
    if not isinstance(value, list) or len(value) != count:
        raise FacePoserError(f"{where} must be a list of {count} numbers.")
    return [number_from_json(item, f"{where}[{i}]") for i, item in enumerate(value)]


def pixel_from_json(value: Any, where: str) -> tuple[float, float]:
    """Return ``value`` as a pixel (u, v), or raise ``FacePoserError``."""
    u, v = numbers_from_json(value, 2, where)
    return (u, v)


def anchor_to_json(anchor: SurfacePoint | int) -> dict[str, Any]:
    """Return a vertex index or a surface point as the session file has it."""
    if isinstance(anchor, int):
        return {"vertex": anchor}
    return {"face": anchor.face, "barycentric": list(anchor.barycentric)}


def anchor_from_json(value: Any, where: str) -> SurfacePoint | int:
    """Return the vertex index or surface point that ``value`` describes, or raise ``FacePoserError``."""
    if isinstance(value, dict) and "vertex" in value:
        check_keys(value, {"vertex"}, set(), where)
        return index_from_json(value["vertex"], f"{where}.vertex")
    check_keys(value, {"face", "barycentric"}, set(), where)
    a, b, c = numbers_from_json(value["barycentric"], 3, f"{where}.barycentric")
    if min(a, b, c) < -1e-6 or abs(a + b + c - 1.0) > 1e-4:
        raise FacePoserError(f"{where}.barycentric must be three numbers of at least 0 that sum to 1.")
    return SurfacePoint(index_from_json(value["face"], f"{where}.face"), (a, b, c))


def anchors_from_json(value: Any, where: str, least: int = 1, most: int = _MAX_POINTS) -> list[SurfacePoint | int]:
    """Return the anchors in the list ``value``, from ``least`` to ``most`` of them, or raise ``FacePoserError``."""
    if not isinstance(value, list) or not least <= len(value) <= most:
        count = f"{least}" if least == most else f"{least} to {most}"
        raise FacePoserError(f"{where} must be a list of {count} anchors.")
    return [anchor_from_json(item, f"{where}[{i}]") for i, item in enumerate(value)]


def points_to_json(points: SurfacePoints) -> list[dict[str, Any]]:
    """Return many points as the session file has them."""
    return [anchor_to_json(point) for point in points]


def points_from_json(value: Any, where: str) -> SurfacePoints:
    """Return the points in the list ``value``, or raise ``FacePoserError``."""
    return SurfacePoints.of(anchors_from_json(value, where))


def weights_to_json(weights: NDArray[np.float64]) -> list[float]:
    """Return the weights of shapes, shape (S,), as the session file has them, to a millionth."""
    rounded: list[float] = np.round(weights, 6).tolist()
    return rounded


def weights_from_json(value: Any, where: str) -> NDArray[np.float64]:
    """Return the weights of shapes in the list ``value``, shape (S,), or raise ``FacePoserError``."""
    if not isinstance(value, list) or len(value) > _MAX_POINTS:
        raise FacePoserError(f"{where} must be a list of numbers, one per shape.")
    return np.array(numbers_from_json(value, len(value), where))


def rest_to_json(positions: NDArray[np.float64]) -> list[list[float]]:
    """Return rest positions, shape (n, 3), as the session file has them, to a ten-thousandth of the unit."""
    rounded: list[list[float]] = np.round(positions, 4).tolist()
    return rounded


def rest_from_json(value: Any, where: str) -> NDArray[np.float64]:
    """Return the rest positions in the list ``value``, shape (n, 3), or raise ``FacePoserError``."""
    if not isinstance(value, list) or not 1 <= len(value) <= _MAX_POINTS:
        raise FacePoserError(f"{where} must be a list of positions, one per anchor.")
    return np.array([numbers_from_json(row, 3, f"{where}[{i}]") for i, row in enumerate(value)])


def check_rest(rest: NDArray[np.float64] | None, places: SurfacePoints | None, where: str) -> None:
    """Raise ``FacePoserError`` unless there is a position in ``rest``, shape (n, 3), for all ``places``, or none."""
    count = 0 if places is None else len(places)
    if rest is not None and len(rest) != count:
        raise FacePoserError(f"{where}.rest must be a list of {count} positions, one per anchor.")


def pixels_from_json(value: Any, where: str, least: int) -> tuple[tuple[float, float], ...]:
    """Return the pixels in the list ``value``, at least ``least`` of them, or raise ``FacePoserError``."""
    if not isinstance(value, list) or not least <= len(value) <= _MAX_POINTS:
        raise FacePoserError(f"{where} must be a list of at least {least} pixels [u, v].")
    return tuple(pixel_from_json(item, f"{where}[{i}]") for i, item in enumerate(value))


def name_from_json(value: Any, where: str, names: Sequence[str]) -> str:
    """Return ``value`` if it is one of ``names``, or raise ``FacePoserError``."""
    if not isinstance(value, str) or value not in names:
        raise FacePoserError(f"{where} is {shown(value)}; it must be one of {', '.join(map(repr, names))}.")
    return value


def camera_to_json(camera: Camera) -> dict[str, Any]:
    """Return a camera as the session file has it."""
    data = {
        "rotation": camera.rotation.tolist(),
        "translation": camera.translation.tolist(),
        "focal": float(camera.focal),
        "size": list(camera.size),
    }
    return data if camera.shift == (0.0, 0.0) else data | {"shift": list(camera.shift)}


def camera_from_json(value: Any, where: str) -> Camera:
    """Return the camera that ``value`` describes, or raise ``FacePoserError``."""
    check_keys(value, {"rotation", "translation", "focal", "size"}, {"shift"}, where)
    rows = value["rotation"]
    if not isinstance(rows, list) or len(rows) != 3:
        raise FacePoserError(f"{where}.rotation must be a list of 3 rows.")
    rotation = np.array([numbers_from_json(row, 3, f"{where}.rotation[{i}]") for i, row in enumerate(rows)])
    size = value["size"]
    if not isinstance(size, list) or len(size) != 2:
        raise FacePoserError(f"{where}.size must be a list of 2 whole numbers.")
    width, height = (index_from_json(side, f"{where}.size[{i}]") for i, side in enumerate(size))
    if not (0 < width <= _MAX_PICTURE and 0 < height <= _MAX_PICTURE):
        raise FacePoserError(f"{where}.size must be from 1 to {_MAX_PICTURE} pixels each way.")
    translation = np.array(numbers_from_json(value["translation"], 3, f"{where}.translation"))
    focal = number_from_json(value["focal"], f"{where}.focal", minimum=1e-3)
    shift = pixel_from_json(value.get("shift", [0.0, 0.0]), f"{where}.shift")
    try:
        return Camera(rotation, translation, focal, (width, height), shift)
    except ValueError as error:
        raise FacePoserError(f"{where}: {error}.") from error


def shown(value: Any) -> str:
    """Return ``value`` short enough for a sentence."""
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
