"""Consistency checks of characters."""

from typing import Any

import numpy as np

from faceposer.geometry.mesh import FARTHEST
from faceposer.geometry.texture_images import UnusableImageError, texture_image
from faceposer.model.character_data import CharacterData
from faceposer.model.errors import InconsistentError

MATERIALS = ("skin", "eye", "teeth", "gums", "tongue", "lashes", "film")
#: Materials drawn over others, which picking ignores.
SEE_THROUGH = ("lashes", "film")
# Least size of a face in centimetres, and least ratio of its second size to its largest.
_SMALLEST, _THINNEST = 1e-6, 1e-6


def check_character(character: CharacterData) -> None:
    """Check that the arrays, parts and names of ``character`` are consistent.

    Raises:
        InconsistentError: If they are not.
    """
    _check_arrays(character)
    _check_parts(character)
    _check_names(character)


def damaged_textures(character: CharacterData) -> dict[str, str]:
    """Return the reason for each texture of ``character`` that cannot be decoded, by material or part, as a clause."""
    found = {}
    for name, data in character.textures.items():
        try:
            kept = texture_image(data) is data
        except UnusableImageError as error:
            found[name] = str(error)
        else:
            if not kept:
                found[name] = "it is neither PNG nor JPEG"
    return found


def _require(condition: Any, message: str) -> None:
    if not condition:
        raise InconsistentError(message)


def _check_arrays(character: CharacterData) -> None:
    """Check shapes, finiteness and index ranges of the mesh."""
    count = len(character.vertices)
    for name, columns in (("vertices", 3), ("polygons", 4), ("uv", 2), ("polygon_uvs", 4)):
        array = getattr(character, name)
        _require(array.ndim == 2 and array.shape[1] == columns and len(array), f"{name} has shape {array.shape}")
    expected = (len(character.shape_names), count, 3)
    _require(character.shapes.shape == expected, f"shapes has shape {character.shapes.shape}, not {expected}")
    limits = character.shape_limits
    _require(limits.shape == (expected[0], 2), f"shape_limits has shape {limits.shape}, not {(expected[0], 2)}")
    _require((limits[:, 0] <= limits[:, 1]).all(), "a shape's least weight exceeds its greatest")
    for name in ("vertices", "uv", "shapes", "shape_limits"):
        array = getattr(character, name)
        # Comparisons with NaN are False.
        if not (np.abs(array) <= FARTHEST).all():
            problem = f"beyond {FARTHEST:g}" if np.isfinite(array).all() else "that are not finite"
            raise InconsistentError(f"{name} contains numbers {problem}")
    _require(character.polygons.shape == character.polygon_uvs.shape, "polygons and polygon_uvs differ in length")
    is_triangle = character.polygons[:, 3] < 0
    for name, limit in (("polygons", count), ("polygon_uvs", len(character.uv))):
        array = getattr(character, name)
        _require(
            (array[:, :3] >= 0).all() and (array[:, 3] >= -1).all() and array.max() < limit,
            f"{name} has indices out of range",
        )
        _require(((array[:, 3] < 0) == is_triangle).all(), "polygons and polygon_uvs disagree about triangles")
    _check_extent(character)


def _check_extent(character: CharacterData) -> None:
    """Check that the mesh is a surface, neither a point nor a line, nor as thin as one."""
    vertices = character.vertices.astype(np.float64)
    size = float(np.ptp(vertices, axis=0).max())
    _require(size > _SMALLEST, "all its vertices lie at one place, within a millionth of a centimetre")
    # Sizes of the face across its longest direction, relative to its length.
    relative = (vertices - vertices.mean(axis=0)) / size
    _, middle, largest = np.sqrt(np.maximum(np.linalg.eigvalsh(relative.T @ relative), 0.0))
    _require(middle > _THINNEST * largest, "all its vertices lie on a line")


def _check_parts(character: CharacterData) -> None:
    """Check that the parts cover all polygons and vertices in order, and use only their own vertices."""
    polygon = vertex = 0
    for part in character.parts:
        _require(part.material in MATERIALS, f"part '{part.name}' has the unknown material '{part.material}'")
        _require(
            part.polygons[0] == polygon < part.polygons[1] <= len(character.polygons)
            and part.vertices[0] == vertex < part.vertices[1] <= len(character.vertices),
            f"part '{part.name}' does not follow the part before it",
        )
        polygon, vertex = part.polygons[1], part.vertices[1]
        used = character.polygons[slice(*part.polygons)]
        used = used[used >= 0]
        _require(
            part.vertices[0] <= used.min() and used.max() < vertex,
            f"part '{part.name}' uses vertices of another part",
        )
    _require(
        polygon == len(character.polygons) and vertex == len(character.vertices), "the parts do not cover the mesh"
    )
    _require(len({part.name for part in character.parts}) == len(character.parts), "two parts have the same name")


def _check_names(character: CharacterData) -> None:
    """Check the names of shapes, and the regions, feature points and textures."""
    count = len(character.vertices)
    _require(len(set(character.shape_names)) == len(character.shape_names), "two shapes have the same name")
    statistics = character.statistics
    _require(
        statistics is None or any(name in statistics.shape_names for name in character.shape_names),
        "its statistics cover none of its shapes",
    )
    _require(
        character.origin is None or character.origin.vertex_ids.max(initial=-1) < count,
        "the record of its source file refers to vertices that do not exist",
    )
    for name, ids in character.regions.items():
        _require(
            ids.ndim == 1 and (not ids.size or (ids.min() >= 0 and ids.max() < count)),
            f"region '{name}' refers to vertices that do not exist",
        )
    for name, vertex in character.feature_points.items():
        _require(0 <= vertex < count, f"feature point '{name}' refers to a vertex that does not exist")
    _require(
        character.feature_titles.keys() <= character.feature_points.keys(), "there are titles without feature points"
    )
    owners = {*MATERIALS, *(part.name for part in character.parts)}
    for name in character.textures:
        _require(name in owners, f"texture '{name}' belongs to no material or part")
