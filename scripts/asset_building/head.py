"""Cut the skin of head and neck out of the base mesh and find the loops around the eyes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.subdivision import Subdivision, catmull_clark, linear_split
from faceposer.identity.anatomy.loops import LASH_RING, edge_loop, faces_at_edges, rings
from scripts.asset_building.piece import Ints
from scripts.asset_building.source import BaseMesh

#: A vertex in the middle of the neck's front; the edge loop through it is the mesh's border.
_NECK_FRONT = 811
#: A vertex in the middle of the loop where the lips touch.
_LIP_CONTACT = 474
#: The vertex at the back of the left eye's socket, from which the rings around the eye are counted outwards.
_SOCKET_LEFT = 8020
#: v of the base mesh's layout below which is the chart of the mouth's inside; all other skin is above.
_MOUTH_CHART_TOP = 0.145


@dataclass(frozen=True)
class Skin:
    """Topology of the skin.

    Attributes:
        base_ids: Ids in the base mesh of the control mesh's vertices, shape (C,).
        quads: Quads of the control mesh, shape (F, 4).
        base_uv: The base mesh's texture coordinates that it uses, shape (U, 2).
        base_quad_uvs: Ids into ``base_uv``, shape (F, 4).
        fine: The subdivided mesh; its first C vertices are the control mesh's.
        border: The control vertices of the neck's end, in order, shape (L,).
        lip_contact: Those of the loop around the mouth along which the lips touch, in order.
        rings_left: Control vertices around the left eye by distance in the mesh, from the socket's back outwards.
        mirror: The control vertex opposite each in x, shape (C,).
        in_mouth: Mask of the control quads that line the inside of the mouth, shape (F,).
    """

    base_ids: Ints
    quads: Ints
    base_uv: NDArray[np.float64]
    base_quad_uvs: Ints
    fine: Subdivision
    border: Ints
    lip_contact: Ints
    rings_left: tuple[Ints, ...]
    mirror: Ints
    in_mouth: NDArray[np.bool_]

    def local(self, base_id: int) -> int:
        """Return the control vertex of vertex ``base_id`` of the base mesh."""
        index = int(np.searchsorted(self.base_ids, base_id))
        if index == len(self.base_ids) or self.base_ids[index] != base_id:
            raise KeyError(base_id)
        return index


def cut_skin(base: BaseMesh, base_mirror: Ints) -> Skin:
    """Take the body above the edge loop around the neck from ``base`` and subdivide it once."""
    faces_at = faces_at_edges(base.quads, np.flatnonzero(base.groups == "body").tolist())
    border = edge_loop(faces_at, base.vertices, _NECK_FRONT)
    lips = edge_loop(faces_at, base.vertices, _LIP_CONTACT)
    faces = _above(base, faces_at, border)
    ids, quads = compact(base.quads[faces])
    uv_ids, quad_uvs = compact(base.quad_uvs[faces])
    index = np.full(len(base.vertices), -1, dtype=np.int32)
    index[ids] = np.arange(len(ids))
    return Skin(
        base_ids=ids,
        quads=quads,
        base_uv=base.uv[uv_ids],
        base_quad_uvs=quad_uvs,
        fine=catmull_clark(quads, len(ids)),
        border=index[border],
        lip_contact=index[lips],
        rings_left=tuple(rings(quads, int(index[_SOCKET_LEFT]), LASH_RING + 6)),
        mirror=index[base_mirror[ids]],
        in_mouth=(base.uv[base.quad_uvs[faces]] @ [0.0, 1.0]).max(axis=1) < _MOUTH_CHART_TOP,
    )


def split_uv(uv: NDArray[np.float64], quad_uvs: Ints) -> tuple[NDArray[np.float64], Ints]:
    """Return texture coordinates for a subdivided mesh, without smoothing them, so that seams are preserved."""
    split = linear_split(quad_uvs, len(uv))
    return split.matrix @ uv, split.quads


def compact(faces: Ints) -> tuple[Ints, Ints]:
    """Return the sorted ids that ``faces`` use, and the faces in terms of positions in that list."""
    used, local = np.unique(faces, return_inverse=True)
    return used.astype(np.int32), local.reshape(faces.shape).astype(np.int32)


def _above(base: BaseMesh, faces_at: dict[frozenset[int], list[int]], loop: list[int]) -> NDArray[np.intp]:
    """Return the quads that can be reached from the highest one without crossing ``loop``, shape (F,)."""
    faces = sorted({face for adjacent in faces_at.values() for face in adjacent})
    fence = {frozenset(edge) for edge in zip(loop, loop[1:] + loop[:1], strict=True)}
    crown = faces[int(base.vertices[base.quads[faces], 1].mean(axis=1).argmax())]
    reached, front = {crown}, [crown]
    while front:
        corners = base.quads[front.pop()].tolist()
        for edge in map(frozenset, zip(corners, corners[1:] + corners[:1], strict=True)):
            for face in faces_at[edge] if edge not in fence else ():
                if face not in reached:
                    reached.add(face)
                    front.append(face)
    return np.array(sorted(reached))
