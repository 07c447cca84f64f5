"""Reading of trajectories: JSON, tables of pixels or of positions in space, and C3D; see docs/animation.md."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from faceposer.animation.trajectories import Trajectories
from faceposer.errors import FacePoserError, counted
from faceposer.files.json_documents import JsonDocument, JsonObject, check_header, convert, read_json, shown
from faceposer.files.sample_rates import USUAL_RATE, nearest_known
from faceposer.files.sample_times import assumed_rate
from faceposer.geometry.camera import Camera
from faceposer.geometry.marker_csv import MAX_MARKERS, MarkerTable, parse_marker_csv
from faceposer.geometry.marker_io import MarkerMotion, read_markers
from faceposer.geometry.marker_map import MarkerMap
from faceposer.geometry.marker_meshes import check_names, displacements_of_markers
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.character import Character
from faceposer.solve.camera_io import camera_from_json
from faceposer.solve.constraints import codec

FORMAT = "faceposer.trajectories"
VERSION = 1
SUFFIXES = (".csv", ".json", ".c3d", ".trc")
# Relative rounding of the rates in C3D files.
_ROUNDED = 4e-4

_MAX_BYTES = 2**28
_MAX_FRAMES = 100_000
_SLOWEST, _MAX_RATE = 1e-3, 1_000.0
_MAX_WEIGHT = 1e6
# Minimum number of markers for the search for those that do not move against the skull.
_ENOUGH_TO_FIND_HELD = 20
# Maximum absolute coordinate in pixels or centimetres.
_FARTHEST = 1e6
# Points that start farther from their places on the face than this share of its height are in another space.
_NEAR = 0.15

Array = NDArray[np.float64]


class _PointJson(JsonObject, kw_only=True):
    name: str
    anchor: Any = None
    weight: Annotated[float, Meta(ge=0.0, le=_MAX_WEIGHT)] = 1.0
    # Each has two or three numbers, or is None.
    positions: Annotated[list[Any], Meta(min_length=1, max_length=_MAX_FRAMES)]


class _FeatureJson(JsonObject):
    feature: str


class _TrajectoriesFile(JsonDocument, kw_only=True):
    rate: Annotated[float, Meta(ge=_SLOWEST, le=_MAX_RATE)] | None = None
    # A ``CameraJson`` or a ``_ViewJson``.
    camera: Any = None
    points: Annotated[list[Annotated[_PointJson, Meta(title="points")]], Meta(min_length=1, max_length=MAX_MARKERS)]


@dataclass(frozen=True, eq=False)
class _Options:
    """Arguments of ``read_trajectories``."""

    character: Character
    camera: Camera | None
    marker_map: MarkerMap | None
    points: Sequence[str] | None
    rate: float | None


def read_trajectories(
    path: Path,
    character: Character,
    *,
    camera: Camera | None = None,
    marker_map: MarkerMap | None = None,
    points: Sequence[str] | None = None,
    rate: float | None = None,
) -> Trajectories:
    """Return the trajectories in the file ``path`` for the face of ``character``.

    Args:
        path: JSON, C3D or CSV file.
        character: Character with the feature points, vertices and triangles that the file refers to.
        camera: Camera of a table of pixels; it overrides that of a JSON file.
        marker_map: Places of the points on the face; None if the points are named for feature points or vertices. With
            a map, positions in space are those of a performer and are aligned with the face.
        points: Names of the points to use; None for all of the map or of the file.
        rate: Frames per second, overriding the file.

    Raises:
        FacePoserError: If the file cannot be used; the message names the file, the place and the remedy.
    """
    options = _Options(character, camera, marker_map, points, rate)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise FacePoserError(
            f"Trajectories cannot be read from '{path}'; give a file with the suffix .csv, .json, .c3d or .trc."
        )
    if suffix == ".json":
        if marker_map is not None:
            raise FacePoserError(f"'{path}' contains the places of its points; leave the marker map out.")
        trajectories = read_json(
            path, "trajectories", lambda data: trajectories_from_json(data, character, camera, rate), _MAX_BYTES
        )
        if trajectories.camera is None:
            places = trajectories.points.positions(character.vertices, character.triangles)
            _check_near(
                path, trajectories.positions, places, character, "give the positions in centimetres on the face"
            )
        else:
            _check_in_front(path, trajectories.camera, character)
        return trajectories if points is None else trajectories.subset(_known(points, trajectories.names, path))
    if suffix == ".csv":
        table = _pixel_table(path, rate)
        if table is not None:
            return _trajectories_in_image(path, table, options)
    return _trajectories_in_space(path, read_markers(path, rate), options)


def trajectories_from_json(
    data: Any, character: Character, camera: Camera | None = None, rate: float | None = None
) -> Trajectories:
    """Return the trajectories described by ``data``; ``camera`` and ``rate`` override those in it.

    Raises:
        FacePoserError: If the data is invalid; the message names the place.
    """
    check_header(data, FORMAT, VERSION)
    form = convert(data, _TrajectoriesFile)
    if camera is None and "camera" in data:
        camera = camera_from_json(form.camera, "camera", character)
    names: list[str] = []
    anchors, columns = [], []
    for i, point in enumerate(form.points):
        where = f"points[{i}]"
        if point.name in names:
            raise FacePoserError(f"{where}.name is already the name of another point; choose a unique name.")
        names.append(point.name)
        anchors.append(_anchor(point, where, character))
        columns.append(_column(point.positions, camera is not None, f"{where}.positions"))
        if len(columns[-1]) != len(columns[0]):
            raise FacePoserError(
                f"{where} has {counted(len(columns[-1]), 'position')}, but points[0] has {len(columns[0])}; "
                f"give one or null per "
                "frame."
            )
    positions = np.stack(columns, axis=1)
    if not np.isfinite(positions).any():
        raise FacePoserError("No point has a position in any frame.")
    points = SurfacePoints.of(anchors)
    try:
        points.check(character.triangles)
    except ValueError as error:
        raise FacePoserError(f"points: {error}.") from error
    weights = np.array([point.weight for point in form.points])
    known = rate or form.rate
    notes = () if known is not None or len(positions) < 2 else (assumed_rate("It does not state a rate"),)
    return Trajectories(tuple(names), points, positions, known or USUAL_RATE, camera, weights, notes)


def trajectories_to_json(trajectories: Trajectories) -> dict[str, Any]:
    """Return the trajectories as written in a JSON file; weights per frame are reduced to those of the first frame."""
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "rate": float(trajectories.rate)}
    if trajectories.camera is not None:
        data["camera"] = codec.camera_to_json(trajectories.camera)
    weights = trajectories.weights_at(0)
    data["points"] = [
        {
            "name": name,
            "anchor": codec.anchor_to_json(trajectories.points[i]),
            "weight": float(weights[i]),
            "positions": [
                row.tolist() if seen else None
                for row, seen in zip(trajectories.positions[:, i], trajectories.seen[:, i], strict=True)
            ],
        }
        for i, name in enumerate(trajectories.names)
    ]
    return data


def _anchor(point: _PointJson, where: str, character: Character) -> SurfacePoint | int:
    if point.anchor is None:
        found = _vertex_named(point.name, character)
        if found is None:
            raise FacePoserError(f"{where} has no anchor, and its name is not a feature point of {character.name}.")
        return found
    if isinstance(point.anchor, dict) and "feature" in point.anchor:
        name = convert(point.anchor, _FeatureJson, f"{where}.anchor").feature
        found = _vertex_named(name, character)
        if found is None:
            raise FacePoserError(
                f"{where}.anchor.feature is {shown(name)}, which is not a feature point of {character.name}."
            )
        return found
    return convert(point.anchor, codec.AnchorJson, f"{where}.anchor").anchor()


def _column(positions: list[Any], in_image: bool, where: str) -> NDArray[np.float64]:
    if in_image:
        pixels = convert(positions, list[codec.Pixel | None], where)
        return np.array([(np.nan,) * 2 if row is None else row for row in pixels])
    places = convert(positions, list[codec.Triple | None], where)
    return np.array([(np.nan,) * 3 if row is None else row for row in places])


def _anchor_named(name: str, character: Character, path: Path) -> int:
    vertex = _vertex_named(name, character)
    if vertex is None:
        raise FacePoserError(
            f"'{path}' has the point {name}, which is not a feature point of {character.name}; name points like 8.3, "
            "'left mouth corner' or 'vertex 12', choose points with --points, or give their places with --markers."
        )
    return vertex


def _vertex_named(name: str, character: Character) -> int | None:
    """Return the vertex of the feature point with this number or title, or the vertex with this index."""
    if name in character.feature_points:
        return int(character.feature_points[name])
    for number, title in character.feature_titles.items():
        if title.casefold() == name.strip().casefold() and number in character.feature_points:
            return int(character.feature_points[number])
    match = re.fullmatch(r"v(?:ertex)?[ _]?(\d{1,9})", name.strip(), re.IGNORECASE)
    vertex = int(match[1]) if match else -1
    return vertex if 0 <= vertex < len(character.vertices) else None


def _known(requested: Sequence[str], names: Sequence[str], path: Path) -> tuple[str, ...]:
    for name in requested:
        if name not in names:
            known = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
            raise FacePoserError(f"'{path}' has no point {name}; its points are {known}.")
    return tuple(dict.fromkeys(requested))


def _pixel_table(path: Path, rate: float | None) -> MarkerTable | None:
    """Return the table of pixels in ``path``, or None if its points have three coordinates."""
    table = parse_marker_csv(path, pixels=True, rate=rate)
    return table if table.positions.shape[2] == 2 else None


def _trajectories_in_image(path: Path, table: MarkerTable, options: "_Options") -> Trajectories:
    if options.camera is None:
        raise FacePoserError(f"'{path}' contains pixels; give the camera of the images with --camera.")
    _check_in_front(path, options.camera, options.character)
    names, anchors = _places(path, table.names, options)
    positions = table.positions[:, [table.names.index(name) for name in names]]
    return _checked(path, names, anchors, positions, table, options)


def _trajectories_in_space(path: Path, motion: MarkerMotion, options: "_Options") -> Trajectories:
    if options.marker_map is not None:
        check_names(motion, options.marker_map)
    names, anchors = _places(path, motion.names, options)
    character = options.character
    places = anchors.positions(character.vertices, character.triangles)
    if options.marker_map is None:
        # Without a map, positions are in the space of the face, in centimetres.
        positions = motion.subset(names).positions * (motion.unit_scale or 1.0)
        _check_near(path, positions, places, character, "give a marker map with --markers to align them with it")
    else:
        find_held = len(options.marker_map.places) >= _ENOUGH_TO_FIND_HELD
        mapped = options.marker_map.subset(names)
        displacements, _ = displacements_of_markers(motion, mapped, places, find_held)
        positions = places + displacements
    return _checked(path, names, anchors, positions, motion, replace(options, camera=None))


def _check_in_front(path: Path, camera: Camera, character: Character) -> None:
    if not (camera.to_camera(character.vertices)[:, 2] > 0.0).all():
        raise FacePoserError(
            f"The face of {character.name} is not in front of the camera of '{path}'; check its rotation and "
            "translation."
        )


def _check_near(path: Path, positions: Array, places: Array, character: Character, remedy: str) -> None:
    distances = np.linalg.norm(positions - places, axis=2)
    known = distances[np.isfinite(distances)]
    if known.size and np.median(known) > _NEAR * character.height:
        raise FacePoserError(
            f"The points in '{path}' are {np.median(known):.3g} cm from their places on {character.name}, so they are "
            f"not in its space; {remedy}."
        )


def _places(path: Path, names: Sequence[str], options: "_Options") -> tuple[tuple[str, ...], SurfacePoints]:
    """Return the names of the points to use, and their places on the face."""
    character, marker_map = options.character, options.marker_map
    chosen = tuple(names) if marker_map is None else tuple(marker_map.places)
    if options.points is not None:
        chosen = _known(options.points, chosen, path)
    if marker_map is None:
        return chosen, SurfacePoints.of([_anchor_named(name, character, path) for name in chosen])
    for name in chosen:
        _known([name], names, path)
    chosen_map = marker_map.subset(chosen)
    return chosen, chosen_map.surface_points(character.vertices, character.triangles, character.feature_points)


def _checked(
    path: Path,
    names: tuple[str, ...],
    anchors: SurfacePoints,
    positions: Array,
    source: MarkerTable | MarkerMotion,
    options: "_Options",
) -> Trajectories:
    if len(positions) > _MAX_FRAMES:
        raise FacePoserError(
            f"'{path}' has {counted(len(positions), 'frame')}, more than the maximum of {_MAX_FRAMES}; split it."
        )
    if not np.isfinite(positions).all(axis=2).any():
        raise FacePoserError(f"No point is visible in any frame of '{path}'; check the file.")
    far = np.argwhere(np.abs(positions) > _FARTHEST)
    if len(far):
        frame, point, axis = far[0].tolist()
        raise FacePoserError(
            f"'{path}' has {names[point]} at {positions[frame, point, axis]:.6g} in frame {frame + 1}, beyond the "
            f"limit of {_FARTHEST:.0e}; correct the value or leave the cell blank."
        )
    rate = options.rate or (None if source.rate is None else nearest_known(source.rate, _ROUNDED))
    notes = source.notes
    if rate is None and len(positions) > 1:
        notes = (*notes, assumed_rate("It does not state a rate"))
    if rate is not None and not _SLOWEST <= rate <= _MAX_RATE:
        raise FacePoserError(
            f"The times in '{path}' give {rate:.6g} frames per second; they must be in seconds, or give --rate."
        )
    try:
        return Trajectories(names, anchors, positions, rate or USUAL_RATE, options.camera, notes=notes)
    except ValueError as error:
        raise FacePoserError(f"The trajectories in '{path}' cannot be used: {error}.") from error
