"""Files of characters for the tests, made from the program's own head of few triangles."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.polygon_mesh import Group, MorphMesh, PolygonMesh
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from tests.rigs import with_wholes

BASE = "low"
Array = NDArray[np.float64]


@lru_cache(maxsize=1)
def base() -> Character:
    """The head with ARKit's 52 shapes, as most rigs have them."""
    return with_wholes(load_character(BASE))


def rotation(seed: int) -> Array:
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return turn * np.linalg.det(turn)


def morph_mesh(turn: Array | None = None, scale: float = 1.0, shift: Array | None = None) -> MorphMesh:
    """The head as a rig, turned, scaled and shifted."""
    face = base()
    turn = np.eye(3) if turn is None else turn
    shift = np.zeros(3) if shift is None else shift
    vertices = scale * face.vertices.astype(np.float64) @ turn.T + shift
    targets = {
        name: (scale * shape @ turn.T).astype(np.float32)
        for name, shape in zip(face.shape_names, face.shapes, strict=True)
    }
    groups = tuple(Group(part.name, part.polygons, part.material) for part in face.parts)
    mesh = PolygonMesh(vertices, face.polygons, face.uv.astype(np.float64), face.polygon_uvs, groups=groups)
    return MorphMesh(mesh, targets)


def poses(count: int, seed: int = 0) -> NDArray[np.float32]:
    """Expressions of the head, (count, N, 3), of a few shapes each."""
    face = base()
    rng = np.random.default_rng(seed)
    looks = np.array([name.startswith("eyeLook") or name in ("tongueOut", "mouthClose") for name in face.shape_names])
    weights = rng.uniform(0.0, 1.0, (count, len(face.shape_names))) * (rng.random((count, len(looks))) < 0.2) * ~looks
    return face.vertices + np.tensordot(weights.astype(np.float32), face.shapes, axes=1)


def write_examples(
    folder: Path, count: int, seed: int = 0, turn: Array | None = None, scale: float = 1.0, shake: float = 0.2
) -> list[Path]:
    """Write a neutral and ``count`` expressions as OBJ, each with a head motion of its own."""
    face = base()
    rng = np.random.default_rng(seed + 100)
    turn = np.eye(3) if turn is None else turn
    groups = [Group(part.name, part.polygons, part.material) for part in face.parts]
    written = []
    for i, vertices in enumerate([face.vertices, *poses(count, seed)]):
        angle = shake * rng.uniform(-1.0, 1.0) * (i > 0)
        nod = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
        moved = scale * (vertices @ nod.T + shake * rng.standard_normal(3) * (i > 0)) @ turn.T
        path = folder / ("neutral.obj" if i == 0 else f"frame{i}.obj")
        write_obj(path, moved, face.polygons, face.uv, face.polygon_uvs, groups=groups)
        written.append(path)
    return written
