"""Identity of a character's mesh, by which a file notices that the character has changed since."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity, determines_rotation, rigid_alignment
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.subject import Subject
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
    def of(cls, subject: Subject) -> "CharacterVersion":
        """Return the version of ``subject`` that is loaded."""
        return _version_of(subject)

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

    @classmethod
    def from_json(cls, data: Any, where: str) -> "CharacterVersion":
        """Return the version that ``data`` at ``where`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong kind, naming its place.
        """
        keys = {"vertices", "triangles", "faces", "parts", "feature_points", "box", "shapes"}
        codec.check_keys(data, keys, set(), where)
        shapes = data["shapes"]
        if not isinstance(shapes, list) or len(shapes) > _MOST_NAMES or not all(isinstance(n, str) for n in shapes):
            raise FacePoserError(f"{where}.shapes must be a list of names.")
        if not isinstance(data["faces"], str):
            raise FacePoserError(f"{where}.faces must be the SHA-256 of the triangles.")
        box = data["box"]
        if not isinstance(box, list) or len(box) != 2:
            raise FacePoserError(f"{where}.box must be a list of 2 positions.")
        low, high = (_place_from_json(end, f"{where}.box[{i}]") for i, end in enumerate(box))
        return cls(
            codec.index_from_json(data["vertices"], f"{where}.vertices"),
            codec.index_from_json(data["triangles"], f"{where}.triangles"),
            data["faces"],
            {name: _runs_from_json(runs, f"{where}.parts.{name}") for name, runs in _named(data, "parts", where)},
            {
                name: _place_from_json(place, f"{where}.feature_points.{name}")
                for name, place in _named(data, "feature_points", where)
            },
            (low, high),
            tuple(shapes),
        )

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


def _named(data: dict[str, Any], key: str, where: str) -> list[tuple[str, Any]]:
    entries = data[key]
    if not isinstance(entries, dict) or len(entries) > _MOST_NAMES:
        raise FacePoserError(f"{where}.{key} must be an object.")
    return list(entries.items())


def _place_from_json(value: Any, where: str) -> Place:
    x, y, z = codec.numbers_from_json(value, 3, where)
    return (x, y, z)


def _runs_from_json(value: Any, where: str) -> PartRuns:
    codec.check_keys(value, {"triangles", "vertices"}, set(), where)
    runs = []
    for key in ("triangles", "vertices"):
        if not isinstance(value[key], list) or len(value[key]) != 2:
            raise FacePoserError(f"{where}.{key} must be a list of 2 numbers.")
        first, last = (codec.index_from_json(end, f"{where}.{key}[{i}]") for i, end in enumerate(value[key]))
        runs.append((first, last))
    return PartRuns(*runs)


def _aligns(here: Array, there: Array) -> bool:
    return len(here) >= 3 and bool(determines_rotation(here) & determines_rotation(there))


@lru_cache(maxsize=4)
def _version_of(subject: Subject) -> CharacterVersion:
    faces = hashlib.sha256(np.ascontiguousarray(subject.triangles, dtype="<i4").tobytes()).hexdigest()
    ends = subject.vertices.min(axis=0), subject.vertices.max(axis=0)
    return CharacterVersion(
        len(subject.vertices),
        len(subject.triangles),
        faces,
        {part.name: PartRuns(subject.part_triangles(part), part.vertices) for part in subject.parts},
        {name: _place(subject.vertices[vertex]) for name, vertex in subject.feature_points.items()},
        (_place(ends[0]), _place(ends[1])),
        tuple(subject.shape_names),
    )


def _place(position: NDArray[np.float32]) -> Place:
    x, y, z = (round(float(value), 4) for value in position)
    return (x, y, z)
