"""What must hold of a subject for the rest of the program to rely on it."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from faceposer.model.subject import Subject

MATERIALS = ("skin", "eye", "teeth", "gums", "tongue", "lashes", "film")
#: Materials that are drawn over others, and that pointers pass through.
SEE_THROUGH = ("lashes", "film")


def check_subject(subject: "Subject") -> None:
    """Check that the arrays, parts and names of ``subject`` fit together.

    Raises:
        ValueError: Saying what does not.
    """
    _check_arrays(subject)
    _check_parts(subject)
    _check_names(subject)


def _require(condition: Any, message: str) -> None:
    if not condition:
        raise ValueError(message)


def _check_arrays(subject: "Subject") -> None:
    """Check shapes, finiteness and index ranges of the mesh."""
    count = len(subject.vertices)
    for name, columns in (("vertices", 3), ("polygons", 4), ("uv", 2), ("polygon_uvs", 4)):
        array = getattr(subject, name)
        _require(array.ndim == 2 and array.shape[1] == columns and len(array), f"{name} has the shape {array.shape}")
    expected = (len(subject.shape_names), count, 3)
    _require(subject.shapes.shape == expected, f"shapes has the shape {subject.shapes.shape}, not {expected}")
    limits = subject.shape_limits
    _require(limits.shape == (expected[0], 2), f"shape_limits has the shape {limits.shape}, not {(expected[0], 2)}")
    _require((limits[:, 0] <= limits[:, 1]).all(), "a shape's least weight exceeds its greatest")
    for name in ("vertices", "uv", "shapes", "shape_limits"):
        _require(np.isfinite(getattr(subject, name)).all(), f"{name} contains numbers that are not finite")
    _require(subject.polygons.shape == subject.polygon_uvs.shape, "polygons and polygon_uvs differ in length")
    is_triangle = subject.polygons[:, 3] < 0
    for name, limit in (("polygons", count), ("polygon_uvs", len(subject.uv))):
        array = getattr(subject, name)
        _require(
            (array[:, :3] >= 0).all() and (array[:, 3] >= -1).all() and array.max() < limit,
            f"{name} names corners that do not exist",
        )
        _require(((array[:, 3] < 0) == is_triangle).all(), "polygons and polygon_uvs disagree about triangles")


def _check_parts(subject: "Subject") -> None:
    """Check that the parts run through all polygons and vertices in order, and own the vertices they use."""
    polygon = vertex = 0
    for part in subject.parts:
        _require(part.material in MATERIALS, f"part '{part.name}' has the unknown material '{part.material}'")
        _require(
            part.polygons[0] == polygon < part.polygons[1] <= len(subject.polygons)
            and part.vertices[0] == vertex < part.vertices[1] <= len(subject.vertices),
            f"part '{part.name}' does not follow on the part before it",
        )
        polygon, vertex = part.polygons[1], part.vertices[1]
        used = subject.polygons[slice(*part.polygons)]
        used = used[used >= 0]
        _require(
            part.vertices[0] <= used.min() and used.max() < vertex,
            f"part '{part.name}' uses vertices of another part",
        )
    _require(polygon == len(subject.polygons) and vertex == len(subject.vertices), "the parts do not cover the mesh")
    _require(len({part.name for part in subject.parts}) == len(subject.parts), "two parts have the same name")


def _check_names(subject: "Subject") -> None:
    """Check shapes' names, regions, feature points and textures."""
    count = len(subject.vertices)
    _require(len(set(subject.shape_names)) == len(subject.shape_names), "two shapes have the same name")
    statistics = subject.statistics
    _require(
        statistics is None or any(name in statistics.shape_names for name in subject.shape_names),
        "its statistics speak of none of its shapes",
    )
    _require(
        subject.origin is None or subject.origin.vertex_ids.max(initial=-1) < count,
        "the record of its original file names vertices that do not exist",
    )
    for name, ids in subject.regions.items():
        _require(
            ids.ndim == 1 and (not ids.size or (ids.min() >= 0 and ids.max() < count)),
            f"region '{name}' names vertices that do not exist",
        )
    for name, vertex in subject.feature_points.items():
        _require(0 <= vertex < count, f"feature point '{name}' names a vertex that does not exist")
    _require(subject.feature_titles.keys() <= subject.feature_points.keys(), "there are titles without feature points")
    owners = {*MATERIALS, *(part.name for part in subject.parts)}
    for name in subject.textures:
        _require(name in owners, f"texture '{name}' belongs to no material and no part")
