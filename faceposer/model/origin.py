"""How the file that a character came from has it, so that it goes back as it came."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.polygon_mesh import Group


@dataclass(frozen=True, eq=False)
class Origin:
    """A character's mesh in its own file's unit, axes and order.

    A character is in centimetres, upright, and has neither vertices twice at seams nor faces of many corners.

    Attributes:
        linear: What turns displacements of the character into those of the file, shape (3, 3).
        neutral: The file's neutral vertices, shape (M, 3).
        vertex_ids: The character's vertex that each vertex of the file is, shape (M,); -1 for one that no face uses.
        polygons: The file's faces, shape (F, K), padded with -1.
        uv: The file's texture coordinates, shape (U, 2); empty if it has none.
        polygon_uvs: Indices into ``uv``, of the shape of ``polygons``; shape (0, 3) if there are none.
        groups: The file's groups of faces.

    Raises:
        ValueError: If the arrays do not fit together.
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
            and np.isfinite(self.linear).all()
            and np.isfinite(self.neutral).all()
        )
        if not fits:
            raise ValueError("the record of its original file does not fit together")

    def vertices_of(self, moved: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the file's vertices, (M, 3), of a face whose character's vertices ``moved`` by (N, 3)."""
        vertices = self.neutral.copy()
        used = self.vertex_ids >= 0
        vertices[used] += moved[self.vertex_ids[used]] @ self.linear.T
        return vertices

    def normals_of(self, normals: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the file's unit normals, (M, 3), from those of the character, (N, 3); +z for a vertex of no face."""
        rotation = self.linear / np.cbrt(np.linalg.det(self.linear))
        result = np.tile([0.0, 0.0, 1.0], (len(self.neutral), 1))
        used = self.vertex_ids >= 0
        result[used] = normals[self.vertex_ids[used]] @ rotation.T
        return result

    def character_vertices(self, vertices: NDArray[np.floating], n_vertices: int) -> NDArray[np.float64]:
        """Return how far the character's ``n_vertices`` vertices moved, (N, 3), for the file's ``vertices``, (M, 3)."""
        moved = np.zeros((n_vertices, 3))
        used = self.vertex_ids >= 0
        moved[self.vertex_ids[used]] = (vertices - self.neutral)[used] @ np.linalg.inv(self.linear).T
        return moved

    def as_members(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return what JSON holds of it, and its arrays."""
        names = ("linear", "neutral", "vertex_ids", "polygons", "uv", "polygon_uvs")
        groups = [[group.name, *group.polygons, group.material] for group in self.groups]
        return {"groups": groups}, {name: getattr(self, name) for name in names}

    @classmethod
    def of_members(cls, texts: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Self:
        """Return the origin that ``as_members`` gave.

        Raises:
            KeyError: If something is missing.
            ValueError: If it does not fit together.
        """
        members: dict[str, Any] = {name: arrays[name].astype(np.float64) for name in ("linear", "neutral", "uv")}
        members |= {name: arrays[name].astype(np.int32) for name in ("vertex_ids", "polygons", "polygon_uvs")}
        groups = tuple(
            Group(str(name), (int(first), int(last)), str(material)) for name, first, last, material in texts["groups"]
        )
        return cls(groups=groups, **members)
