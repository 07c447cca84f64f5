"""Conversion of a file's mesh to parts of one material each, with seams welded and faces of three or four corners."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from faceposer.geometry.polygon_mesh import Group, PolygonMesh
from faceposer.model.character import Part
from faceposer.training.mouth_parts import find_mouth

Array = NDArray[np.float64]
Ints = NDArray[np.int32]

_MATERIALS = (
    ("lashes", ("lash",)),
    ("teeth", ("teeth", "tooth", "denture")),
    ("gums", ("gum",)),
    ("tongue", ("tongue",)),
    # The lining of the mouth; lips belong to the face.
    ("skin", ("lip",)),
    ("gums", ("mouth", "oral", "palate")),
    ("film", ("occlusion", "tear", "lacrimal", "eyeblend", "eye_blend", "eyeshell", "eye_shell", "eyewet", "wetness")),
    ("skin", ("brow", "eyelid", "lid_", "eyeliner", "caruncle")),
    ("eye", ("eye", "iris", "cornea", "sclera", "pupil")),
)
_SMALLEST_MOTION = 1e-200


@dataclass(frozen=True, eq=False)
class PartedMesh:
    """The parts of a file's mesh.

    Attributes:
        vertex_ids: Vertex id of each of the file's M vertices, shape (M,); -1 if no face uses it.
        file_ids: One of the file's vertices for each vertex, shape (N,).
        polygons: Vertex ids, shape (F, 4); a triangle ends in -1.
        corner_uvs: Index of the file's texture coordinates per corner, shape (F, 4), -1 for a missing corner; all zero
            if the file has none.
        parts: The parts in order, covering all faces.
        materials: Material of each part in the file, "" if it has none.
    """

    vertex_ids: Ints
    file_ids: Ints
    polygons: Ints
    corner_uvs: Ints
    parts: tuple[Part, ...]
    materials: tuple[str, ...]


def split_into_parts(mesh: PolygonMesh, vertices: Array, motion: Array) -> PartedMesh:
    """Split ``mesh`` into parts.

    Groups of faces that share vertices become one part. Coincident vertices of a group with the same motion are welded,
    since formats such as glTF and STL duplicate them at seams, where shading would show an edge. Two eyes in one mesh
    become two parts. Rows of teeth in a mesh of skin become a separate part, and so does the inside of the mouth.

    Args:
        mesh: The mesh as in the file.
        vertices: Its vertices, upright with the left at +x, shape (M, 3).
        motion: Motion fingerprint of each vertex, shape (M, k).
    """
    polygons, corner_uvs, owners = _small_polygons(mesh)
    groups = _groups_of(mesh)
    welded = _welded(polygons, owners, groups, mesh.vertices, motion)
    labels, names, materials, own = _part_of_polygons(welded[polygons.clip(0)], polygons >= 0, owners, groups)
    labels, names, materials, own = _split_eyes(labels, names, materials, own, polygons, welded, vertices)
    labels, names, materials, own = _split_mouth(labels, names, materials, own, polygons, welded, vertices)

    order = np.argsort(labels, kind="stable")
    polygons, corner_uvs, labels = polygons[order], corner_uvs[order], labels[order]
    used = polygons >= 0
    corners = welded[polygons[used]]
    part_of_vertex = np.full(len(vertices), -1, dtype=np.intp)
    part_of_vertex[corners] = np.repeat(labels, used.sum(axis=1))
    kept = np.flatnonzero(part_of_vertex >= 0)
    file_ids = kept[np.argsort(part_of_vertex[kept], kind="stable")]
    new_ids = np.full(len(vertices), -1, dtype=np.int32)
    new_ids[file_ids] = np.arange(len(file_ids), dtype=np.int32)
    renumbered = np.full(polygons.shape, -1, dtype=np.int32)
    renumbered[used] = new_ids[corners]

    in_use = np.zeros(len(vertices), dtype=bool)
    in_use[polygons[used]] = True
    vertex_ids = np.where(in_use, new_ids[welded], -1).astype(np.int32)
    n_parts = len(names)
    polygon_ends = np.concatenate([[0], np.cumsum(np.bincount(labels, minlength=n_parts))]).tolist()
    counts = np.bincount(part_of_vertex[file_ids], minlength=n_parts)
    vertex_ends = np.concatenate([[0], np.cumsum(counts)]).tolist()
    parts = tuple(
        Part(name, material, (polygon_ends[i], polygon_ends[i + 1]), (vertex_ends[i], vertex_ends[i + 1]))
        for i, (name, material) in enumerate(zip(_distinct(names), materials, strict=True))
    )
    return PartedMesh(vertex_ids, file_ids.astype(np.int32), renumbered, corner_uvs, parts, tuple(own))


def material_of(*names: str) -> str:
    """Derive the material of a part from the ``names`` of its groups and materials; "skin" by default."""
    text = " ".join(names).lower()
    return next((material for material, words in _MATERIALS if any(word in text for word in words)), "skin")


def _small_polygons(mesh: PolygonMesh) -> tuple[Ints, Ints, Ints]:
    """Return faces of at most four corners, (F, 4), their texture ids, and the original face of each."""
    columns = mesh.polygons.shape[1]
    corners = mesh.polygons
    uvs = mesh.polygon_uvs if len(mesh.polygon_uvs) else np.where(corners >= 0, 0, -1).astype(np.int32)
    if columns < 4:
        pad = np.full((len(corners), 1), -1, dtype=np.int32)
        corners, uvs = np.hstack([corners, pad]), np.hstack([uvs, pad])
    owners = np.arange(len(corners), dtype=np.int32)
    large = corners[:, 4] >= 0 if columns > 4 else np.zeros(len(corners), dtype=bool)
    pieces = [(corners[~large, :4], uvs[~large, :4], owners[~large])]
    for k in range(1, columns - 1):
        has = large & (corners[:, k + 1] >= 0)
        triangle, none = [0, k, k + 1], np.full((int(has.sum()), 1), -1, dtype=np.int32)
        pieces.append(
            (np.hstack([corners[has][:, triangle], none]), np.hstack([uvs[has][:, triangle], none]), owners[has])
        )
    joined, joined_uvs, joined_owners = (np.concatenate([piece[i] for piece in pieces]) for i in range(3))
    order = np.argsort(joined_owners, kind="stable")
    return joined[order], joined_uvs[order], joined_owners[order]


def _groups_of(mesh: PolygonMesh) -> list[Group]:
    """Return the groups of ``mesh``, with unnamed groups for the faces between them."""
    groups: list[Group] = []
    done = 0
    for group in (*mesh.groups, Group("", (len(mesh.polygons), len(mesh.polygons)))):
        if group.polygons[0] > done:
            groups.append(Group("", (done, group.polygons[0])))
        if group.polygons[1] > group.polygons[0]:
            groups.append(group)
        done = max(done, group.polygons[1])
    return groups


def _group_of_polygons(owners: Ints, groups: list[Group]) -> NDArray[np.intp]:
    sizes = [group.polygons[1] - group.polygons[0] for group in groups]
    index: NDArray[np.intp] = np.repeat(np.arange(len(groups)), sizes)[owners]
    return index


def _same_names(groups: list[Group]) -> NDArray[np.intp]:
    """Return the first group of the same name for each group, since OBJ files may interleave groups."""
    named = [group.name or f"\0{i}" for i, group in enumerate(groups)]
    return np.array([named.index(name) for name in named], dtype=np.intp)


def _welded(polygons: Ints, owners: Ints, groups: list[Group], vertices: Array, motion: Array) -> NDArray[np.intp]:
    """Return the first vertex of the same position, motion and group for each vertex, shape (M,)."""
    group = np.full(len(vertices), -1.0)
    for column in range(polygons.shape[1]):
        has = polygons[:, column] >= 0
        group[polygons[has, column]] = _same_names(groups)[_group_of_polygons(owners, groups)][has]
    size = max(float(np.ptp(vertices, axis=0).max()), np.finfo(float).tiny)
    # The smallest unit is far from the smallest number, so that nothing overflows.
    largest = max(float(np.abs(motion).max(initial=0.0)), _SMALLEST_MOTION)
    moved = np.rint(motion.astype(np.float64) / (1e-5 * largest))
    keys = np.hstack([group[:, None], np.rint(vertices / (1e-7 * size)), moved])
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return first[inverse.ravel()]


def _part_of_polygons(
    corners: NDArray[np.intp], valid: NDArray[np.bool_], owners: Ints, groups: list[Group]
) -> tuple[NDArray[np.intp], list[str], list[str], list[str]]:
    """Return the part of each face, and the name, material and original material of each part, in file order."""
    group_of_polygon = _group_of_polygons(owners, groups)
    rows = np.repeat(group_of_polygon, valid.sum(axis=1))
    ids = corners[valid]
    touches = coo_array((np.ones(len(ids)), (rows, ids)), shape=(len(groups), int(ids.max()) + 1)).tocsr()
    link = coo_array((np.ones(len(groups)), (np.arange(len(groups)), _same_names(groups))), shape=(len(groups),) * 2)
    _, component = connected_components((touches @ touches.T) + link, directed=False)
    firsts = sorted({int(np.flatnonzero(component == c)[0]) for c in np.unique(component)})
    rank = {int(component[first]): i for i, first in enumerate(firsts)}
    names, materials, own = [], [], []
    for first in firsts:
        members = [group for group, c in zip(groups, component.tolist(), strict=True) if c == component[first]]
        names.append(groups[first].name or groups[first].material or "mesh")
        kinds = {material_of(group.name, group.material) for group in members}
        materials.append(kinds.pop() if len(kinds) == 1 else "skin")
        own.append(groups[first].material)
    return np.array([rank[int(c)] for c in component])[group_of_polygon], names, materials, own


def _split_eyes(
    labels: NDArray[np.intp],
    names: list[str],
    materials: list[str],
    own: list[str],
    polygons: Ints,
    welded: NDArray[np.intp],
    vertices: Array,
) -> tuple[NDArray[np.intp], list[str], list[str], list[str]]:
    """Split every part that contains eyes on both sides into two."""
    labels, names, materials, own = labels.copy(), list(names), list(materials), list(own)
    for part in [i for i, material in enumerate(materials) if material == "eye"]:
        faces = np.flatnonzero(labels == part)
        corners = np.where(polygons[faces] >= 0, polygons[faces], polygons[faces, :1])
        a, *others = welded[corners].T
        edges = (np.ones(3 * len(a)), (np.tile(a, 3), np.concatenate(others)))
        _, islands = connected_components(coo_array(edges, shape=(len(vertices),) * 2), directed=False)
        island = islands[a]
        centre = np.bincount(island, vertices[a, 0]) / np.maximum(np.bincount(island), 1)
        on_right = centre[island] < 0.0
        if on_right.any() and not on_right.all():
            labels[faces[on_right]] = len(names)
            names.append(f"{names[part]}_right")
            names[part] = f"{names[part]}_left"
            materials.append("eye")
            own.append(own[part])
    return labels, names, materials, own


def _split_mouth(
    labels: NDArray[np.intp],
    names: list[str],
    materials: list[str],
    own: list[str],
    polygons: Ints,
    welded: NDArray[np.intp],
    vertices: Array,
) -> tuple[NDArray[np.intp], list[str], list[str], list[str]]:
    """Split unconnected teeth and the inside of the mouth from the parts of skin."""
    labels, names, materials, own = labels.copy(), list(names), list(materials), list(own)
    for part in [i for i, material in enumerate(materials) if material == "skin"]:
        faces = np.flatnonzero(labels == part)
        found = find_mouth(welded[polygons[faces, :3]], vertices)
        if found is None:
            continue
        for material, islands in (("teeth", found.teeth), ("gums", found.mouth)):
            chosen = faces[np.isin(found.islands, islands)]
            if len(chosen):
                labels[chosen] = len(names)
                names.append(f"{names[part]}_{'mouth' if material == 'gums' else material}")
                materials.append(material)
                own.append(own[part])
    return labels, names, materials, own


def _distinct(names: list[str]) -> list[str]:
    """Return ``names`` made unique by numbers."""
    result: list[str] = []
    for name in names:
        plain = name.strip() or "mesh"
        candidate, number = plain, 2
        while candidate in result:
            candidate, number = f"{plain}_{number}", number + 1
        result.append(candidate)
    return result
