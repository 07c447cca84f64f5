"""Marker maps: the places of markers on a mesh, in JSON files written by hand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import UNSET, Meta, Struct, UnsetType, field
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import JsonError, JsonObject, check_header, convert, read_json
from faceposer.geometry.mesh import Floats, Ints
from faceposer.geometry.mirror import nearest_on_triangles
from faceposer.geometry.picking import SurfacePoints

FORMAT = "faceposer.marker-map"
VERSION = 1

_MAX_BYTES = 16 * 2**20
# Largest distance of a position from the surface, as a share of the mesh's diagonal; beyond it the units are wrong.
_NEAR = 0.05
_CANDIDATES = 64
_FARTHEST = 1e9

#: A vertex id, the name of a feature point, or a position.
Place = int | str | tuple[float, float, float]


@dataclass(frozen=True)
class MarkerMap:
    """Places of markers on a mesh.

    Attributes:
        places: Place by marker name: a vertex id, the name of an MPEG-4 feature point ("8.3"), or a position in the
            mesh's space, near its surface.
        fixed: Names of markers, on the mesh or not, that are rigidly attached to the skull; () if unknown.
        neutral_frame: Index of the frame with a relaxed face, from 0; None for the first frame with all markers.
        source: Path of the file, for messages.
    """

    places: Mapping[str, Place]
    fixed: tuple[str, ...] = ()
    neutral_frame: int | None = None
    source: Path = Path("marker map")

    def subset(self, names: Sequence[str]) -> "MarkerMap":
        """Return the map restricted to the markers ``names``, in this order."""
        return replace(self, places={name: self.places[name] for name in names})

    def surface_points(
        self, vertices: Floats, triangles: Ints, feature_points: Mapping[str, int] | None = None
    ) -> SurfacePoints:
        """Return the markers' points on a mesh, in the order of ``places``.

        Args:
            vertices: Vertices of the mesh at rest, shape (N, 3).
            triangles: Vertex ids, shape (T, 3).
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
                    f"marker {name} is at feature point {place}, which the mesh does not have", "specify a vertex"
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
                f"marker {name} at ({where}) is far from the mesh", "specify positions in the mesh's space"
            )
        return int(candidates[best]), weights[0, best]

    def _refusal(self, reason: str, remedy: str) -> FacePoserError:
        return FacePoserError(f"The marker map '{self.source}' cannot be used: {reason}; {remedy}.")


_PLACE = '{"vertex": 12}, {"feature": "8.3"} or {"position": [1.0, 2.0, 3.0]}'
_Distance = Annotated[float, Meta(gt=-_FARTHEST, lt=_FARTHEST)]


class _PlaceJson(JsonObject):
    vertex: int | UnsetType = UNSET
    feature: str | UnsetType = UNSET
    position: tuple[_Distance, _Distance, _Distance] | UnsetType = UNSET

    def __post_init__(self) -> None:
        if [self.vertex, self.feature, self.position].count(UNSET) != 2:
            raise JsonError(f"must be {_PLACE}")

    def place(self) -> Place:
        return next(value for value in (self.vertex, self.feature, self.position) if value is not UNSET)


_Places = dict[str, Annotated[_PlaceJson, Meta(description=_PLACE)]]


class _MarkerMapFile(Struct):
    # Other keys are ignored, for the author's notes.
    markers: Annotated[_Places, Meta(min_length=1, description="an object with a place for each marker")]
    fixed: list[str] = field(default_factory=list)
    neutral_frame: Annotated[int, Meta(ge=0, description="the number of a frame, counted from 0")] | None = None

    def __post_init__(self) -> None:
        if self.fixed and len(set(self.fixed)) < 3:
            raise JsonError("has fewer than three markers; add more, or remove it to detect them", "fixed")


def read_marker_map(path: Path) -> MarkerMap:
    """Read the marker map in the file ``path``; docs/training.md describes the format.

    Raises:
        FacePoserError: If it cannot be read, is not a marker map, or has invalid values.
    """

    def parsed(data: Any) -> MarkerMap:
        check_header(data, FORMAT, VERSION)
        form = convert(data, _MarkerMapFile)
        places = {name: place.place() for name, place in form.markers.items()}
        return MarkerMap(places, tuple(dict.fromkeys(form.fixed)), form.neutral_frame, path)

    return read_json(path, "marker map", parsed, _MAX_BYTES)
