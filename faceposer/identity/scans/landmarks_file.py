"""Landmarks of a scan from the file that ``faceposer landmarks`` writes (docs/landmarks.md), as it is or edited."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import JsonDocument, JsonObject, check_header, convert, read_json
from faceposer.geometry.alignment import determines_rotation
from faceposer.geometry.mesh import FARTHEST
from faceposer.identity.registration import align
from faceposer.identity.scans.scan import ScanLandmarks
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.feature_points import bent
from faceposer.landmarks.on_meshes import MeshLandmarks
from faceposer.landmarks.points import N_POINTS
from faceposer.landmarks.reference import reference
from faceposer.landmarks.report import FORMAT, VERSION
from faceposer.model.character_file import load_character

Array = NDArray[np.float64]

_MAX_BYTES = 16 << 20
# Distance in centimetres from the place that the 468 points imply, from which a feature point counts as moved by hand.
_MOVED = 0.1
# Distance of a point from the middle of the face in median distances, beyond which it is a mistake.
_FARTHEST = 100.0
# Extent below which points are at one place: scaled to a head, other coordinates would have no finite squares.
_SMALLEST = 1.0 / FARTHEST
_Number = Annotated[float, msgspec.Meta(ge=-FARTHEST, le=FARTHEST)]
_Place = Annotated[list[_Number], msgspec.Meta(min_length=3, max_length=3)]


class _Feature(JsonObject):
    place: _Place
    title: str | msgspec.UnsetType = msgspec.UNSET
    vertex: int | msgspec.UnsetType = msgspec.UNSET
    extrapolated: bool | msgspec.UnsetType = msgspec.UNSET


class _LandmarksFile(JsonDocument):
    points: Annotated[list[_Place | None], msgspec.Meta(min_length=N_POINTS, max_length=N_POINTS)]
    feature_points: dict[str, _Feature] = msgspec.field(default_factory=dict)
    spread: list[_Number | None] | msgspec.UnsetType = msgspec.UNSET
    source: str | msgspec.UnsetType = msgspec.UNSET
    kind: str | msgspec.UnsetType = msgspec.UNSET
    score: float | msgspec.UnsetType = msgspec.UNSET
    frame: Any = None
    pupils: Any = None


def read_scan_landmarks(path: Path) -> ScanLandmarks:
    """Return the landmarks in the file ``path``; feature points moved by hand have the last word.

    Raises:
        FacePoserError: If the file cannot be read, is not of a mesh, or has too few points.
    """
    return replace(read_json(path, "file of landmarks", _landmarks_of, _MAX_BYTES), path=str(path))


def _landmarks_of(data: Any) -> ScanLandmarks:
    check_header(data, FORMAT, VERSION)
    if isinstance(data, Mapping) and data.get("kind") != "mesh":
        raise FacePoserError("it has the landmarks of a photo; make it with 'faceposer landmarks' of the scan.")
    content = convert(data, _LandmarksFile)
    points = np.array([[np.nan] * 3 if place is None else place for place in content.points], dtype=np.float64)
    spread = np.zeros(N_POINTS)
    if isinstance(content.spread, list) and len(content.spread) == N_POINTS:
        spread = np.array([0.0 if value is None else max(value, 0.0) for value in content.spread])
    features = {name: np.array(feature.place) for name, feature in content.feature_points.items()}
    known: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(axis=1))
    _check_near({f"points[{index}]": points[index] for index in np.flatnonzero(known)}, points[known])
    if not determines_rotation(points[known]) or np.ptp(points[known], axis=0).max() < _SMALLEST:
        raise FacePoserError("it has fewer than three points that are not on a line; find the landmarks again.")
    _check_near({f"feature_points.{name}.place": place for name, place in features.items()}, points[known])
    return ScanLandmarks(points, spread, _moved(points, spread, known, features))


def _check_near(places: Mapping[str, Array], points: Array) -> None:
    """Check that ``places``, by the name of their keys, are where most of the ``points`` of the face are.

    Raises:
        FacePoserError: If one is not; the message names it.
    """
    if not len(points):
        return
    middle = np.median(points, axis=0)
    usual = float(np.median(np.linalg.norm(points - middle, axis=1)))
    for key, place in places.items():
        if np.linalg.norm(place - middle) > _FARTHEST * usual > 0.0:
            raise FacePoserError(f"{key} is far away from the other points; move it to the face, or remove it.")


def _moved(points: Array, spread: Array, known: NDArray[np.bool_], features: dict[str, Array]) -> dict[str, Array]:
    """Return the ``features`` that do not lie where the ``points`` imply."""
    landmarks = ScanLandmarks(points, spread, {})
    implied = implied_features(landmarks, features)
    scale = float(align(points[known], reference().places[known]).scale)
    return {
        name: features[name]
        for name, place in implied.items()
        if scale * np.linalg.norm(features[name] - place) > _MOVED
    }


def implied_features(landmarks: ScanLandmarks, names: Iterable[str]) -> dict[str, Array]:
    """Return where the 468 points imply that the feature points ``names`` are, by name, in the scan's unit and axes.

    Names that the built-in man does not have are left out.
    """
    man = load_character("man")
    listed = [name for name in names if name in man.feature_points]
    if not listed:
        return {}
    points = landmarks.points
    known: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(axis=1))
    frame = align(points[known], reference().places[known])
    nothing = PaintedMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    pupils = np.full((2, 3), np.nan)
    found = MeshLandmarks(nothing, points, np.asarray(known, dtype=np.int64), landmarks.spread, pupils, 1.0, frame, ())
    places = bent(found, man.vertices[[man.feature_points[name] for name in listed]].astype(np.float64))
    return dict(zip(listed, places, strict=True))
