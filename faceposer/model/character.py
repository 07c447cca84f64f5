"""Characters: a polygon mesh in named parts with facial shapes, textures, regions and feature points."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character_checks import SEE_THROUGH, check_character, damaged_textures
from faceposer.model.character_data import CharacterData, Floats, Ints, Part

__all__ = ["ARKIT_SHAPES", "Character", "Floats", "Ints", "Part"]

#: The 52 facial action shapes of Apple's ARKit, in the order of its documentation.
ARKIT_SHAPES: tuple[str, ...] = (
    *(f"eye{action}Left" for action in ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")),
    *(f"eye{action}Right" for action in ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")),
    *("jawForward", "jawLeft", "jawRight", "jawOpen"),
    *("mouthClose", "mouthFunnel", "mouthPucker", "mouthLeft", "mouthRight"),
    *("mouthSmileLeft", "mouthSmileRight", "mouthFrownLeft", "mouthFrownRight"),
    *("mouthDimpleLeft", "mouthDimpleRight", "mouthStretchLeft", "mouthStretchRight"),
    *("mouthRollLower", "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper"),
    *("mouthPressLeft", "mouthPressRight", "mouthLowerDownLeft", "mouthLowerDownRight"),
    *("mouthUpperUpLeft", "mouthUpperUpRight"),
    *("browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight"),
    *("cheekPuff", "cheekSquintLeft", "cheekSquintRight", "noseSneerLeft", "noseSneerRight", "tongueOut"),
)


@dataclass(frozen=True, eq=False, repr=False)
class Character(CharacterData):
    """A character that can be posed: data that were checked, and what is computed from them.

    Raises:
        ValueError: If the arrays are inconsistent.
    """

    def __post_init__(self) -> None:
        if not self.shape_limits.size:
            unit = np.tile(np.array([0.0, 1.0], dtype=np.float32), (len(self.shape_names), 1))
            object.__setattr__(self, "shape_limits", unit)
        check_character(self)

    def set_title(self, title: str) -> None:
        """Change the title, after it has been changed in the file; nothing that was computed depends on it."""
        object.__setattr__(self, "title", title)

    @cached_property
    def structure(self) -> str:
        """Digest of polygons, parts and names of shapes, which heads made after one another have in common."""
        parts = ["{} {} {}:{} {}:{}".format(p.name, p.material, *p.polygons, *p.vertices) for p in self.parts]
        lines = "\n".join([*parts, *self.shape_names])
        digest = hashlib.blake2b(lines.encode("utf-8", "surrogatepass"), digest_size=16)
        digest.update(np.ascontiguousarray(self.polygons, dtype="<i4").tobytes())
        return digest.hexdigest()

    @cached_property
    def triangles(self) -> Ints:
        """Vertex ids of all triangles, shape (T, 3); a quad (a, b, c, d) is split into (a, b, c) and (a, c, d)."""
        return self._split(self.polygons)

    @cached_property
    def triangle_uvs(self) -> Ints:
        """Indices into ``uv`` per corner of ``triangles``, shape (T, 3)."""
        return self._split(self.polygon_uvs)

    @cached_property
    def triangle_polygons(self) -> Ints:
        """Index of the polygon of each triangle, shape (T,)."""
        return np.repeat(np.arange(len(self.polygons), dtype=np.int32), 1 + self._is_quad)

    @cached_property
    def damaged_textures(self) -> dict[str, str]:
        """Why each texture that cannot be decoded is unusable, as a clause, by its name in ``textures``."""
        return damaged_textures(self)

    @property
    def label(self) -> str:
        """Title, with the name that commands take where it is another word: "Goblin ('creature')"."""
        return self.title if self.title.casefold() == self.name.casefold() else f"{self.title} ('{self.name}')"

    @property
    def height(self) -> float:
        """Height from the bottom of the chin to the crown, in centimetres; of the whole mesh if these are unknown."""
        y = self.vertices[:, 1]
        if {"2.1", "11.4"} <= self.feature_points.keys():
            return float(y[self.feature_points["11.4"]] - y[self.feature_points["2.1"]])
        return float(np.ptp(y))

    def part(self, name: str) -> Part:
        """Return the part named ``name``.

        Raises:
            KeyError: If there is no such part.
        """
        for part in self.parts:
            if part.name == name:
                return part
        raise KeyError(name)

    def part_triangles(self, part: Part) -> tuple[int, int]:
        """Return the half-open range of triangles (first, end) of ``part``."""
        first = np.concatenate([[0], np.cumsum(1 + self._is_quad)])
        return int(first[part.polygons[0]]), int(first[part.polygons[1]])

    @cached_property
    def solid_triangles(self) -> NDArray[np.intp]:
        """Indices of the triangles that picking can hit: those of all parts except lashes and films."""
        runs = [self.part_triangles(part) for part in self.parts if part.material not in SEE_THROUGH]
        return np.concatenate([np.arange(*run) for run in runs]) if runs else np.zeros(0, dtype=np.intp)

    @property
    def _is_quad(self) -> NDArray[np.bool_]:
        is_quad: NDArray[np.bool_] = self.polygons[:, 3] >= 0
        return is_quad

    def _split(self, corners: Ints) -> Ints:
        both = np.stack([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]], axis=1)
        keep = np.stack([np.ones(len(corners), dtype=bool), self._is_quad], axis=1)
        return np.ascontiguousarray(both[keep])
