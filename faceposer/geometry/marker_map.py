"""Which marker sits where on a mesh: a JSON file written by hand."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh import Floats, Ints
from faceposer.geometry.mirror import nearest_on_triangles
from faceposer.geometry.picking import SurfacePoints

FORMAT = "faceposer.marker-map"
VERSION = 1

_MAX_BYTES = 16 * 2**20
# A position farther than this share of the mesh's diagonal from its surface is in other units, or of another mesh.
_NEAR = 0.05
_CANDIDATES = 64
_FARTHEST = 1e9

#: A vertex id, the name of a feature point, or a position.
Place = int | str | tuple[float, float, float]


@dataclass(frozen=True)
class MarkerMap:
    """Where markers sit on a mesh.

    Attributes:
        places: By the marker's name: a vertex id, the name of an MPEG-4 feature point ("8.3"), or a position in the
            mesh's space, near its surface.
        fixed: Names of markers that do not move against the skull, on the mesh or not; () if none are known.
        neutral_frame: The frame with a relaxed face, counted from 0, or None for the first with all markers.
        source: The file, for messages.
    """

    places: Mapping[str, Place]
    fixed: tuple[str, ...] = ()
    neutral_frame: int | None = None
    source: Path = Path("marker map")

    def subset(self, names: Sequence[str]) -> "MarkerMap":
        """Return the map of the markers ``names`` alone, in this order."""
        return replace(self, places={name: self.places[name] for name in names})

    def surface_points(
        self, vertices: Floats, triangles: Ints, feature_points: Mapping[str, int] | None = None
    ) -> SurfacePoints:
        """Return the markers' points, in the order of ``places``, on a mesh of (N, 3) vertices and (T, 3) triangles.

        Args:
            vertices: The mesh at rest.
            triangles: Its vertex ids.
            feature_points: Vertex id by feature point.

        Raises:
            FacePoserError: If a vertex or feature point does not exist, or a position is far from the surface.
        """
        positions = np.asarray(vertices, dtype=np.float64)
        features = feature_points or {}
        faces = np.zeros(len(self.places), dtype=np.int64)
        weights = np.tile([1.0, 0.0, 0.0], (len(self.places), 1))
        for row, (name, place) in enumerate(self.places.items()):
            if isinstance(place, tuple):
                faces[row], weights[row] = self._nearest(name, place, positions, triangles)
                continue
            if isinstance(place, str) and place not in features:
                raise self._refusal(
                    f"marker {name} is at feature point {place}, which the mesh does not have", "give a vertex"
                )
            vertex = features[place] if isinstance(place, str) else place
            if not 0 <= vertex < len(vertices):
                raise self._refusal(
                    f"marker {name} is at vertex {vertex}, but the mesh has {len(vertices)}", "count vertices from 0"
                )
            faces[row] = -1 - vertex
        return SurfacePoints(faces, weights)

    def _nearest(
        self, name: str, position: tuple[float, float, float], vertices: NDArray[np.float64], triangles: Ints
    ) -> tuple[int, NDArray[np.float64]]:
        corners = vertices[triangles]
        to_centres = np.linalg.norm(corners.mean(axis=1) - position, axis=1)
        candidates = np.argsort(to_centres)[:_CANDIDATES]
        weights, distances = nearest_on_triangles(corners[None, candidates], np.array([position]))
        best = int(np.argmin(distances[0]))
        if not distances[0, best] <= _NEAR * float(np.linalg.norm(np.ptp(vertices, axis=0))):
            where = ", ".join(f"{x:g}" for x in position)
            raise self._refusal(
                f"marker {name} at ({where}) is far from the mesh", "give positions in the mesh's own space"
            )
        return int(candidates[best]), weights[0, best]

    def _refusal(self, reason: str, remedy: str) -> FacePoserError:
        return _refusal(self.source, reason, remedy)


def read_marker_map(path: Path) -> MarkerMap:
    """Return the marker map in the file ``path``; docs/training.md describes its form.

    Raises:
        FacePoserError: If it cannot be read, is no marker map, or says something that cannot be meant.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise _refusal(path, "it is too large", "give the map of one face")
        data = json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_without_repetition)
    except OSError as error:
        raise _refusal(path, f"it cannot be read ({error.strerror or error})", "check the path") from None
    except json.JSONDecodeError as error:
        raise _refusal(path, f"line {error.lineno} is not JSON ({error.msg})", "mend it") from None
    except (ValueError, RecursionError) as error:
        raise _refusal(path, str(error), "mend it") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise _refusal(path, f'it has no "format": "{FORMAT}"', "give a marker map")
    if data.get("version") != VERSION:
        raise _refusal(path, f"it has version {data.get('version')!r}", f"this program reads version {VERSION}")
    markers = data.get("markers")
    if not isinstance(markers, dict) or not markers:
        raise _refusal(path, '"markers" is not an object with a place for each marker', "see docs/training.md")
    fixed = data.get("fixed", [])
    if not isinstance(fixed, list) or not all(isinstance(name, str) for name in fixed):
        raise _refusal(path, '"fixed" is not a list of names of markers', "mend or remove it")
    if fixed and len(set(fixed)) < 3:
        raise _refusal(path, '"fixed" names fewer than three markers', "name more, or remove it to have them found")
    neutral = data.get("neutral_frame")
    if neutral is not None and not (_is_index(neutral) and neutral >= 0):
        raise _refusal(path, '"neutral_frame" is not the number of a frame, counted from 0', "mend or remove it")
    places = {name: _place(path, name, entry) for name, entry in markers.items()}
    return MarkerMap(places, tuple(dict.fromkeys(fixed)), neutral, path)


def _place(path: Path, name: str, entry: Any) -> Place:
    kind: str = ""
    value: Any = None
    if isinstance(entry, dict) and len(entry) == 1:
        kind, value = next(iter(entry.items()))
    if kind == "vertex" and _is_index(value):
        return int(value)
    if kind == "feature" and isinstance(value, str):
        return value
    if kind == "position" and isinstance(value, list) and len(value) == 3 and all(_is_coordinate(x) for x in value):
        return float(value[0]), float(value[1]), float(value[2])
    raise _refusal(
        path,
        f"the place of marker {name} is not understood",
        'give {"vertex": 12}, {"feature": "8.3"} or {"position": [1.0, 2.0, 3.0]}',
    )


def _is_coordinate(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _FARTHEST


def _is_index(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _without_repetition(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f'"{next(name for name in names if names.count(name) > 1)}" is there twice')
    return result


def _refusal(path: Path, reason: str, remedy: str) -> FacePoserError:
    return FacePoserError(f"The marker map '{path}' cannot be used: {reason}; {remedy}.")
