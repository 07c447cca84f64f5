"""The data of a character: its arrays and names, which the class Character checks and adds to."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.origin import Origin

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Part:
    """A named part of a character, such as an eye: one material, and contiguous ranges of polygons and vertices.

    Attributes:
        name: Name such as "skin" or "eye_left".
        material: "skin", "eye", "teeth", "gums", "tongue", "lashes", or "film" for transparent shells over an eye,
            which are exported but not drawn.
        polygons: Half-open range of polygons (first, end).
        vertices: Half-open range of vertices (first, end).
    """

    name: str
    material: str
    polygons: tuple[int, int]
    vertices: tuple[int, int]


@dataclass(frozen=True, eq=False, repr=False)
class CharacterData:
    """A neutral mesh with shapes, textures and names.

    Units are centimetres; y is up, the face looks along +z, the character's left is +x, x = 0 is the plane of symmetry.

    Attributes:
        name: Short name for commands and files.
        title: Display name.
        vertices: Neutral positions, shape (N, 3).
        polygons: Vertex ids of quads, shape (F, 4), counter-clockwise seen from outside; triangles end in -1.
        uv: Texture coordinates, v up as in OBJ, shape (U, 2).
        polygon_uvs: Indices into ``uv`` per polygon corner, shape (F, 4); -1 where ``polygons`` has -1.
        parts: The parts in order; their ranges of polygons and vertices cover the whole mesh.
        regions: Vertex ids by region name ("mouth", "brow_left", ...).
        feature_points: Vertex id by MPEG-4 feature point ("8.3", ...).
        feature_titles: Readable name of each feature point ("left mouth corner").
        shape_names: Names of the S shapes.
        shapes: Offsets from neutral, shape (S, N, 3); all zero for a shape that the character lacks. They are a rig's
            shapes, or the principal modes of example meshes.
        shape_limits: Least and greatest natural weight of each shape, shape (S, 2); 0 to 1 if empty.
        textures: Encoded images (PNG or JPEG) by material, or by part name for a texture of one part.
        credits: Source of the data and its licence.
        statistics: Statistics of the shapes' weights; None for the shipped ones of ARKit's shapes.
        origin: The mesh as in the source file; None if it does not differ.
        summary: JSON object that reports the training and its quality.
    """

    name: str
    title: str
    vertices: Floats
    polygons: Ints
    uv: Floats
    polygon_uvs: Ints
    parts: tuple[Part, ...]
    shape_names: tuple[str, ...]
    shapes: Floats
    regions: Mapping[str, Ints] = field(default_factory=dict)
    feature_points: Mapping[str, int] = field(default_factory=dict)
    feature_titles: Mapping[str, str] = field(default_factory=dict)
    textures: Mapping[str, bytes] = field(default_factory=dict)
    credits: str = ""
    shape_limits: Floats = field(default_factory=lambda: np.zeros((0, 2), dtype=np.float32))
    statistics: ExpressionStatistics | None = None
    origin: Origin | None = None
    summary: Mapping[str, Any] = field(default_factory=dict)
