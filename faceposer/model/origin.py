"""The mesh of a character as in the file it was imported from, so that exports keep the file's order and axes."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import FARTHEST
from faceposer.geometry.polygon_mesh import Group
from faceposer.model.errors import InconsistentError

# Least ratio of the sizes along the axes after the mapping to a file, which is a similarity.
_LEAST_SIZE = 1e-6


@dataclass(frozen=True, eq=False)
class Origin:
    """A character's mesh in the unit, axes and vertex order of its source file.

    Characters are in centimetres and upright, without duplicate vertices at seams or polygons of more than four
    corners; their source files need not be.

    Attributes:
        linear: Matrix that maps displacements of the character to those of the file, shape (3, 3).
        neutral: The file's neutral vertices, shape (M, 3).
        vertex_ids: Index of the character's vertex for each vertex of the file, shape (M,); -1 for unused vertices.
        polygons: The file's polygons, shape (F, K), padded with -1.
        uv: The file's texture coordinates, shape (U, 2); empty if it has none.
        polygon_uvs: Indices into ``uv``, of the same shape as ``polygons``; shape (0, 3) if there are none.
        groups: The file's polygon groups.

    Raises:
        ValueError: If the arrays are inconsistent.
    """

    linear: NDArray[np.float64]
    neutral: NDArray[np.float64]
    vertex_ids: NDArray[np.int32]
    polygons: NDArray[np.int32]
    uv: NDArray[np.float64]
    polygon_uvs: NDArray[np.int32]
    groups: tuple[Group, ...]

    def __post_init__(self) -> None:
        count = len(self.neutral)
        fits = (
            self.linear.shape == (3, 3)
            and self.neutral.shape == (count, 3)
            and self.vertex_ids.shape == (count,)
            and self.polygons.ndim == 2
            and self.polygons.shape[1] >= 3
            and len(self.polygons) > 0
            and -1 <= self.polygons.min() <= self.polygons.max() < count
            and (self.polygons[:, :3] >= 0).all()
            and self.uv.ndim == 2
            and self.uv.shape[1] == 2
            and (len(self.polygon_uvs) == 0 or self.polygon_uvs.shape == self.polygons.shape)
            and self.polygon_uvs.max(initial=-1) < len(self.uv)
        )
        if not fits:
            raise InconsistentError("the record of its source file is inconsistent")
        for name in ("linear", "neutral", "uv"):
            # Comparisons with NaN are False.
            if not (np.abs(getattr(self, name)) <= FARTHEST).all():
                raise InconsistentError(f"origin.{name} contains numbers that are not finite or beyond {FARTHEST:g}")
        sizes = np.linalg.svd(self.linear, compute_uv=False)
        if not sizes[-1] > _LEAST_SIZE * sizes[0] or sizes[-1] < 1.0 / FARTHEST:
            raise InconsistentError("origin.linear cannot be inverted")

    def vertices_of(self, moved: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the file's vertices, (M, 3), for displacements ``moved`` of the character's vertices, (N, 3)."""
        vertices = self.neutral.copy()
        used = self.vertex_ids >= 0
        vertices[used] += moved[self.vertex_ids[used]] @ self.linear.T
        return vertices

    def normals_of(self, normals: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the file's unit normals, (M, 3), from those of the character, (N, 3); +z for unused vertices."""
        rotation = self.linear / np.cbrt(np.linalg.det(self.linear))
        result = np.tile([0.0, 0.0, 1.0], (len(self.neutral), 1))
        used = self.vertex_ids >= 0
        result[used] = normals[self.vertex_ids[used]] @ rotation.T
        return result

    def character_vertices(self, vertices: NDArray[np.floating], n_vertices: int) -> NDArray[np.float64]:
        """Return the displacements of the character's ``n_vertices`` vertices, (N, 3), for the file's ``vertices``.

        Args:
            vertices: Positions in the file, shape (M, 3).
            n_vertices: Number of vertices N of the character.
        """
        moved = np.zeros((n_vertices, 3))
        used = self.vertex_ids >= 0
        moved[self.vertex_ids[used]] = (vertices - self.neutral)[used] @ np.linalg.inv(self.linear).T
        return moved

    def as_members(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return the values to store as JSON, and the arrays."""
        names = ("linear", "neutral", "vertex_ids", "polygons", "uv", "polygon_uvs")
        groups = [[group.name, *group.polygons, group.material] for group in self.groups]
        return {"groups": groups}, {name: getattr(self, name) for name in names}

    @classmethod
    def of_members(cls, texts: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Self:
        """Return the origin from the members that ``as_members`` returned.

        Raises:
            KeyError: If a member is missing.
            ValueError: If the members are inconsistent.
        """
        members: dict[str, Any] = {name: arrays[name].astype(np.float64) for name in ("linear", "neutral", "uv")}
        members |= {name: arrays[name].astype(np.int32) for name in ("vertex_ids", "polygons", "polygon_uvs")}
        groups = tuple(
            Group(str(name), (int(first), int(last)), str(material)) for name, first, last, material in texts["groups"]
        )
        return cls(groups=groups, **members)
