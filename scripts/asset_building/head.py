"""Cuts the head out of the base mesh and subdivides it."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from faceposer.model.subject import Part
from scripts.asset_building.source import BaseMesh
from scripts.asset_building.subdivision import catmull_clark, linear_split

#: An edge at the front of the neck; the edge loop through it, which rises slightly to the back, is the mesh's border.
_NECK_EDGE_START = 1521

_PARTS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("skin", "skin", ("body",)),
    ("eye_left", "eye", ("helper-l-eye",)),
    ("eye_right", "eye", ("helper-r-eye",)),
    ("teeth_upper", "teeth", ("helper-upper-teeth",)),
    ("teeth_lower", "teeth", ("helper-lower-teeth",)),
    ("tongue", "tongue", ("helper-tongue",)),
    ("lashes_left", "lashes", ("helper-l-eyelashes-1", "helper-l-eyelashes-2")),
    ("lashes_right", "lashes", ("helper-r-eyelashes-1", "helper-r-eyelashes-2")),
)


@dataclass(frozen=True)
class Head:
    """The topology of the head, before and after subdivision.

    Attributes:
        base_vertices: Ids into the base mesh of the control mesh's vertices, shape (C,).
        base_quads: Quads of the control mesh, shape (F, 4).
        parts: The parts of the subdivided mesh.
        matrix: Subdivided positions = matrix @ control positions, shape (N, C).
        quads: Subdivided quads, shape (4 F, 4).
        uv: Texture coordinates of the subdivided mesh, shape (U, 2).
        quad_uvs: Ids into ``uv``, shape (4 F, 4).
    """

    base_vertices: NDArray[np.int32]
    base_quads: NDArray[np.int32]
    parts: tuple[Part, ...]
    matrix: sparse.csr_array
    quads: NDArray[np.int32]
    uv: NDArray[np.float64]
    quad_uvs: NDArray[np.int32]


def cut_head(base: BaseMesh) -> Head:
    """Take the parts of the head from ``base`` and subdivide each once."""
    ids, control_quads, matrices, quads, uvs, quad_uvs, parts = [], [], [], [], [], [], []
    n_control = n_quads = n_vertices = n_uv = 0
    for name, material, groups in _PARTS:
        chosen = _above_neck(base) if name == "skin" else np.flatnonzero(np.isin(base.groups, groups))
        used, local = _compact(base.quads[chosen])
        used_uv, local_uv = _compact(base.quad_uvs[chosen])
        fine = catmull_clark(local, len(used))
        fine_uv = linear_split(local_uv, len(used_uv))
        ids.append(used)
        control_quads.append(local + n_control)
        matrices.append(fine.matrix)
        quads.append(fine.quads + n_vertices)
        uvs.append(fine_uv.matrix @ base.uv[used_uv])
        quad_uvs.append(fine_uv.quads + n_uv)
        stop_quads, stop_vertices = n_quads + len(fine.quads), n_vertices + fine.matrix.shape[0]
        parts.append(Part(name, material, (n_quads, stop_quads), (n_vertices, stop_vertices)))
        n_control += len(used)
        n_quads, n_vertices, n_uv = stop_quads, stop_vertices, n_uv + len(uvs[-1])
    return Head(
        np.concatenate(ids).astype(np.int32),
        np.concatenate(control_quads),
        tuple(parts),
        sparse.csr_array(sparse.block_diag(matrices)),
        np.concatenate(quads),
        np.concatenate(uvs),
        np.concatenate(quad_uvs),
    )


def _compact(faces: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the sorted ids that ``faces`` use, and the faces in terms of positions in that list."""
    used, local = np.unique(faces, return_inverse=True)
    return used, local.reshape(faces.shape).astype(np.int32)


def _above_neck(base: BaseMesh) -> NDArray[np.intp]:
    """Return the quads of the body above the edge loop around the neck, shape (F,)."""
    body = np.flatnonzero(base.groups == "body")
    faces_at: dict[frozenset[int], list[int]] = defaultdict(list)
    for face in body:
        corners = base.quads[face].tolist()
        for edge in zip(corners, corners[1:] + corners[:1], strict=True):
            faces_at[frozenset(edge)].append(int(face))
    loop = _edge_loop(faces_at, base)
    fence = {frozenset(edge) for edge in zip(loop, loop[1:] + loop[:1], strict=True)}
    crown = base.vertices[base.quads[body], 1].mean(axis=1).argmax()
    reached, front = {int(body[crown])}, [int(body[crown])]
    while front:
        corners = base.quads[front.pop()].tolist()
        for edge in map(frozenset, zip(corners, corners[1:] + corners[:1], strict=True)):
            for face in faces_at[edge] if edge not in fence else ():
                if face not in reached:
                    reached.add(face)
                    front.append(face)
    return np.array(sorted(reached))


def _edge_loop(faces_at: dict[frozenset[int], list[int]], base: BaseMesh) -> list[int]:
    """Follow the edges straight through vertices of four edges, from the neck's front around to where it began."""
    edges_at: dict[int, list[frozenset[int]]] = defaultdict(list)
    for edge in faces_at:
        for vertex in edge:
            edges_at[vertex].append(edge)

    def is_sideways(edge: frozenset[int]) -> bool:
        a, b = edge
        along = np.abs(base.vertices[a] - base.vertices[b])
        return bool(along[0] > along[1])

    edge = next(edge for edge in edges_at[_NECK_EDGE_START] if is_sideways(edge))
    loop = [_NECK_EDGE_START]
    vertex = _NECK_EDGE_START
    while True:
        (vertex,) = edge - {vertex}
        if vertex == loop[0]:
            return loop
        loop.append(vertex)
        beside = set(faces_at[edge])
        (edge,) = (other for other in edges_at[vertex] if beside.isdisjoint(faces_at[other]))
