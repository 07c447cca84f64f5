"""Fingerprint of a character's mesh, which detects that the character has changed since a session was saved."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from faceposer.files.json_documents import JsonObject
from faceposer.geometry.alignment import Similarity, determines_rotation, rigid_alignment
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import Character
from faceposer.solve.constraints import codec

Array = NDArray[np.float64]
Place = tuple[float, float, float]

_MOST_NAMES = 4096
# Feature points with an error above this multiple of the median were moved between versions; the alignment skips them.
_OUTLIER = 4.0


@dataclass(frozen=True)
class PartRuns:
    """Ranges of the triangles and vertices of a part, as (first, one past the last)."""

    triangles: tuple[int, int]
    vertices: tuple[int, int]


class _RunsJson(JsonObject):
    triangles: tuple[codec.Index, codec.Index]
    vertices: tuple[codec.Index, codec.Index]


class CharacterVersionJson(JsonObject):
    """A ``CharacterVersion`` in a session file."""

    vertices: codec.Index
    triangles: codec.Index
    faces: Annotated[str, Meta(description="the SHA-256 of the triangles")]
    parts: Annotated[dict[str, _RunsJson], Meta(max_length=_MOST_NAMES)]
    feature_points: Annotated[dict[str, codec.Position], Meta(max_length=_MOST_NAMES)]
    box: tuple[codec.Position, codec.Position]
    shapes: Annotated[tuple[str, ...], Meta(max_length=_MOST_NAMES, description="a list of names")]

    def version(self) -> "CharacterVersion":
        """Return the parsed version."""
        return CharacterVersion(
            self.vertices,
            self.triangles,
            self.faces,
            {name: PartRuns(runs.triangles, runs.vertices) for name, runs in self.parts.items()},
            self.feature_points,
            self.box,
            self.shapes,
        )


@dataclass(frozen=True)
class CharacterVersion:
    """Fingerprint of the mesh that the constraints of a session refer to.

    Attributes:
        vertices: Number of vertices.
        triangles: Number of triangles.
        faces: SHA-256 of the vertex indices of all triangles, in hexadecimal digits.
        parts: Ranges of each part, by its name.
        feature_points: Rest position of each feature point, in the character's unit, by its MPEG-4 name.
        box: Bounds of the rest mesh, as (minimum, maximum).
        shapes: Names of the shapes, in the order of stored weights.
    """

    vertices: int
    triangles: int
    faces: str
    parts: Mapping[str, PartRuns]
    feature_points: Mapping[str, Place]
    box: tuple[Place, Place]
    shapes: tuple[str, ...]

    @classmethod
    def of(cls, character: Character) -> "CharacterVersion":
        """Return the version of a loaded ``character``."""
        return _version_of(character)

    def to_json(self) -> dict[str, Any]:
        """Return the version as written in a session file."""
        return {
            "vertices": self.vertices,
            "triangles": self.triangles,
            "faces": self.faces,
            "parts": {
                name: {"triangles": list(runs.triangles), "vertices": list(runs.vertices)}
                for name, runs in self.parts.items()
            },
            "feature_points": {name: list(place) for name, place in self.feature_points.items()},
            "box": [list(end) for end in self.box],
            "shapes": list(self.shapes),
        }

    def same_topology(self, other: "CharacterVersion") -> bool:
        """Return True if vertices and triangles have the same numbering, so that surface points stay valid."""
        topology = (self.vertices, self.triangles, self.faces, dict(self.parts))
        return topology == (other.vertices, other.triangles, other.faces, dict(other.parts))

    def parts_of(self, points: SurfacePoints) -> list[str | None]:
        """Return the name of the part that contains each of ``points``, or None."""
        names: list[str | None] = [None] * len(points)
        for name, runs in self.parts.items():
            vertices = -1 - points.faces
            on_part = (points.faces >= runs.triangles[0]) & (points.faces < runs.triangles[1])
            on_part |= (vertices >= runs.vertices[0]) & (vertices < runs.vertices[1])
            for i in np.flatnonzero(on_part):
                names[i] = name
        return names

    def alignment_to(self, other: "CharacterVersion") -> Similarity:
        """Return the similarity transform that aligns this version with ``other``.

        It is fitted to the common feature points, except those that moved between the versions; with too few of them,
        the bounding boxes are aligned.
        """
        names = sorted(self.feature_points.keys() & other.feature_points.keys())
        source = np.array([self.feature_points[name] for name in names]).reshape(-1, 3)
        target = np.array([other.feature_points[name] for name in names]).reshape(-1, 3)
        if np.array_equal(source, target) and self.box == other.box:
            return Similarity(np.eye(3), np.zeros(3), np.asarray(1.0))
        if not _determines_alignment(source, target):
            return self._box_alignment(other)
        fitted = rigid_alignment(source, target, scale=True)
        errors = np.linalg.norm(fitted.apply(source) - target, axis=1)
        kept = errors <= _OUTLIER * np.median(errors) + 1e-9
        if not _determines_alignment(source[kept], target[kept]):
            return fitted
        return rigid_alignment(source[kept], target[kept], scale=True)

    def _box_alignment(self, other: "CharacterVersion") -> Similarity:
        (low, high), (other_low, other_high) = np.array(self.box), np.array(other.box)
        size = float(np.linalg.norm(high - low))
        scale = float(np.linalg.norm(other_high - other_low)) / size if size > 0.0 else 1.0
        return Similarity(np.eye(3), (other_low + other_high - scale * (low + high)) / 2.0, np.asarray(scale))


def _determines_alignment(source: Array, target: Array) -> bool:
    return len(source) >= 3 and bool(determines_rotation(source) & determines_rotation(target))


@lru_cache(maxsize=4)
def _version_of(character: Character) -> CharacterVersion:
    faces = hashlib.sha256(np.ascontiguousarray(character.triangles, dtype="<i4").tobytes()).hexdigest()
    ends = character.vertices.min(axis=0), character.vertices.max(axis=0)
    return CharacterVersion(
        len(character.vertices),
        len(character.triangles),
        faces,
        {part.name: PartRuns(character.part_triangles(part), part.vertices) for part in character.parts},
        {name: _place(character.vertices[vertex]) for name, vertex in character.feature_points.items()},
        (_place(ends[0]), _place(ends[1])),
        tuple(character.shape_names),
    )


def _place(position: NDArray[np.float32]) -> Place:
    x, y, z = (round(float(value), 4) for value in position)
    return (x, y, z)
