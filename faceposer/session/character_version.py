"""Identity of a character's mesh, by which a file notices that the character has changed since."""

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
# Feature points off by more than so many times the median were put elsewhere, and do not count in an alignment.
_OUTLIER = 4.0


@dataclass(frozen=True)
class PartRuns:
    """The triangles and the vertices of a part: the first of each, and the one after the last."""

    triangles: tuple[int, int]
    vertices: tuple[int, int]


class _RunsJson(JsonObject):
    triangles: tuple[codec.Index, codec.Index]
    vertices: tuple[codec.Index, codec.Index]


class CharacterVersionJson(JsonObject):
    """The version in a session's file; see ``CharacterVersion``."""

    vertices: codec.Index
    triangles: codec.Index
    faces: Annotated[str, Meta(description="the SHA-256 of the triangles")]
    parts: Annotated[dict[str, _RunsJson], Meta(max_length=_MOST_NAMES)]
    feature_points: Annotated[dict[str, codec.Position], Meta(max_length=_MOST_NAMES)]
    box: tuple[codec.Position, codec.Position]
    shapes: Annotated[tuple[str, ...], Meta(max_length=_MOST_NAMES, description="a list of names")]

    def version(self) -> "CharacterVersion":
        """Return the version."""
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
    """What a session stores of the mesh that its constraints were made on.

    Attributes:
        vertices: Number of vertices.
        triangles: Number of triangles.
        faces: SHA-256 of the vertex ids of all triangles, in hexadecimal digits.
        parts: Runs of each part, by its name.
        feature_points: Rest position of each feature point, in the character's unit, by its MPEG-4 name.
        box: Least and greatest rest coordinates.
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
        """Return the version of ``character`` that is loaded."""
        return _version_of(character)

    def to_json(self) -> dict[str, Any]:
        """Return the version as a session's file has it."""
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
        """Whether vertices and triangles are numbered alike in both, so that places can be taken over by number."""
        mine = (self.vertices, self.triangles, self.faces, dict(self.parts))
        return mine == (other.vertices, other.triangles, other.faces, dict(other.parts))

    def parts_of(self, points: SurfacePoints) -> list[str | None]:
        """Return the name of the part that each of ``points`` lies on, or None."""
        names: list[str | None] = [None] * len(points)
        for name, runs in self.parts.items():
            vertices = -1 - points.faces
            on_part = (points.faces >= runs.triangles[0]) & (points.faces < runs.triangles[1])
            on_part |= (vertices >= runs.vertices[0]) & (vertices < runs.vertices[1])
            for i in np.flatnonzero(on_part):
                names[i] = name
        return names

    def alignment_to(self, other: "CharacterVersion") -> Similarity:
        """Return the turn, scale and shift that lay this version on ``other``.

        They are fitted to the feature points that both have, without those that were put elsewhere in between; where
        these are too few, the boxes around both are laid on each other.
        """
        names = sorted(self.feature_points.keys() & other.feature_points.keys())
        here = np.array([self.feature_points[name] for name in names]).reshape(-1, 3)
        there = np.array([other.feature_points[name] for name in names]).reshape(-1, 3)
        if np.array_equal(here, there) and self.box == other.box:
            return Similarity(np.eye(3), np.zeros(3), np.asarray(1.0))
        if not _aligns(here, there):
            return self._box_alignment(other)
        found = rigid_alignment(here, there, scale=True)
        off = np.linalg.norm(found.apply(here) - there, axis=1)
        kept = off <= _OUTLIER * np.median(off) + 1e-9
        return rigid_alignment(here[kept], there[kept], scale=True) if _aligns(here[kept], there[kept]) else found

    def _box_alignment(self, other: "CharacterVersion") -> Similarity:
        (low, high), (other_low, other_high) = np.array(self.box), np.array(other.box)
        size = float(np.linalg.norm(high - low))
        scale = float(np.linalg.norm(other_high - other_low)) / size if size > 0.0 else 1.0
        return Similarity(np.eye(3), (other_low + other_high - scale * (low + high)) / 2.0, np.asarray(scale))


def _aligns(here: Array, there: Array) -> bool:
    return len(here) >= 3 and bool(determines_rotation(here) & determines_rotation(there))


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
