"""Reading of faces with morph targets from glTF 2.0: .glb, .gltf, and avatars in .vrm."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.geometry.gltf_expressions import Bind, read_expressions, spelling_key
from faceposer.geometry.gltf_file import GltfFile, GltfObject
from faceposer.geometry.gltf_materials import (
    Material,
    material_names,
    read_material,
    read_textures,
    texture_coordinates,
)
from faceposer.geometry.gltf_nodes import Placement, Scene, place, read_scene
from faceposer.geometry.mesh import first_unusable
from faceposer.geometry.polygon_mesh import Group, MorphMesh, PolygonMesh, no_polygons

GLTF_SUFFIXES = (".glb", ".gltf", ".vrm")
#: Limits on a face: far more than any has, and less than would exhaust memory.
MAX_VERTICES = 5_000_000
MAX_OFFSET_BYTES = 2 << 30
# Rigs of games and films have up to about a thousand.
_MOST_TARGETS = 4_000
_MAX_TRIANGLES = 20_000_000
_MAX_PIECES = 10_000
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


@dataclass(eq=False)
class _Part:
    """Vertices shared by one or more primitives of a mesh in the scene.

    Attributes:
        node: Index of the node.
        mesh: Index of the mesh.
        primitive: The first primitive.
        material: Its material.
        vertices: Range of its vertices among those of all parts.
        names: Unique names of its targets.
        repeats: Name in the file of targets whose name an earlier one has, with an error message, by the unique name.
        placement: Its transform.
    """

    node: int
    mesh: int
    primitive: GltfObject
    material: Material
    vertices: slice
    names: list[str]
    repeats: dict[str, tuple[str, str]]
    placement: Placement | None = None


@dataclass(frozen=True, eq=False)
class _Piece:
    """A primitive of a mesh in the scene."""

    name: str
    primitive: GltfObject
    material: str
    part: _Part


def read_gltf(path: Path, weights_range: float | None = None) -> MorphMesh:
    """Read all meshes of the default scene as one mesh, with their morph targets combined by name.

    Nodes are in the file's order. Each primitive is a group named after its node or mesh, numbered if there are
    several; primitives that share vertices in the file share them in the result. Positions are in world space and the
    file's unit (metres by the standard; avatars of VRM 0.x look along -z), with skinned meshes transformed by their
    joints at rest. Default weights of targets, normals and vertex colours are not read. Targets without a name are
    named "target 1" and so on; expressions of avatars are added unless a target has the same name.

    Args:
        path: Path of a .glb, .gltf or .vrm file of at most 1 GB.
        weights_range: Full weight of an avatar's expressions, 1 or 100; None to infer it.

    Raises:
        FacePoserError: If it cannot be read, is invalid or compressed, or has no faces.
    """
    try:
        file = GltfFile(path)
    except OSError as error:
        raise FacePoserError(f"The rig '{path}' cannot be read: {error.strerror}.") from error
    scene = read_scene(file)
    pieces, parts = _plan(file, scene)
    count = parts[-1].vertices.stop if parts else 0
    if not count:
        raise FacePoserError(f"The scene of the rig '{path}' has no mesh with faces; add the face to its scene.")
    names = dict.fromkeys(name for part in parts for name in part.names)
    if len(names) > _MOST_TARGETS:
        raise FacePoserError(
            f"The rig '{path}' has {len(names)} morph targets; at most {_MOST_TARGETS} are read. Export the face only."
        )
    expressions = _new_expressions(file, parts, list(names), weights_range)
    n_targets = len(names) + len(expressions.shares)
    size = n_targets * count * 12
    if size > MAX_OFFSET_BYTES:
        raise FacePoserError(
            f"The rig '{path}' has {counted(n_targets, 'target')} of {counted(count, 'vertex', 'vertices')}, "
            f"which would take "
            f"{size >> 20} MB; choose a rig that takes less than {MAX_OFFSET_BYTES >> 20} MB."
        )
    vertices = np.empty((count, 3))
    uvs: list[NDArray[np.float64] | None] = []
    for part in parts:
        part.placement = place(file, scene, part.node, part.primitive)
        vertices[part.vertices] = _positions(file, part)
        uvs.append(_uv(file, part))
    targets: dict[str, NDArray[np.float32]] = {name: np.zeros((count, 3), dtype=np.float32) for name in names}
    for part in parts:
        for target, name in zip(part.primitive.children("targets"), part.names, strict=True):
            targets[name][part.vertices] = _offsets(file, part, target, name)
    for name, shares in expressions.shares.items():
        blend = np.zeros((count, 3), dtype=np.float32)
        for part, number, weight in shares:
            blend[part.vertices] += weight * targets[part.names[number]][part.vertices]
        targets[name] = blend
    unusable = _resolve_repeats(parts, targets)
    polygons, groups = _faces(file, pieces)
    uv, polygon_uvs = np.zeros((0, 2)), no_polygons()
    if any(part_uv is not None for part_uv in uvs):
        lengths = [part.vertices.stop - part.vertices.start for part in parts]
        uv = np.concatenate([np.zeros((n, 2)) if u is None else u for u, n in zip(uvs, lengths, strict=True)])
        polygon_uvs = polygons
    mesh = PolygonMesh(vertices, polygons, uv, polygon_uvs, groups=groups)
    textures, notes = read_textures(file, material_names(file), {group.material for group in groups})
    return MorphMesh(mesh, targets, textures, (*notes, *expressions.notes), unusable)


def _resolve_repeats(parts: list[_Part], targets: dict[str, NDArray[np.float32]]) -> dict[str, str]:
    """Remove ``targets`` that repeat another one of their name; return errors by name for those that differ from it."""
    unusable = {}
    for repeat, (name, message) in {k: v for part in parts for k, v in part.repeats.items()}.items():
        if repeat in targets and np.array_equal(targets[repeat], targets[name]):
            del targets[repeat]
        else:
            unusable[name] = message
    return unusable


def _plan(file: GltfFile, scene: Scene) -> tuple[list[_Piece], list[_Part]]:
    """Return the primitives to read and the vertices that they share, without reading any data."""
    pieces: list[_Piece] = []
    parts: dict[tuple[object, ...], _Part] = {}
    named = material_names(file)
    count = 0
    for index in scene.shown:
        node = scene.nodes[index]
        if node.data.get("mesh") is None:
            continue
        mesh = file.get("meshes", node, "mesh")
        number = node.integer("mesh")
        primitives = mesh.children("primitives")
        name = node.name() or mesh.name() or f"mesh {number + 1}"
        for i, primitive in enumerate(primitives):
            attributes = primitive.child("attributes")
            if primitive.integer("mode", _TRIANGLES) < _TRIANGLES or attributes.data.get("POSITION") is None:
                continue
            _refuse_draco(file, primitive)
            vertices = file.count(attributes, "POSITION")
            if not vertices:
                continue
            material = read_material(file, named, primitive)
            key = (index, *_sharing_key(primitive), material.channel, str(material.transform))
            if key not in parts:
                names, repeats = _target_names(file, mesh, primitive)
                parts[key] = _Part(index, number, primitive, material, slice(count, count + vertices), names, repeats)
                count += vertices
            title = name if len(primitives) == 1 else f"{name} {i + 1}"
            pieces.append(_Piece(title, primitive, material.name, parts[key]))
            if count > MAX_VERTICES or len(pieces) > _MAX_PIECES:
                raise FacePoserError(
                    f"The rig '{file.path}' has more than {MAX_VERTICES} vertices or {_MAX_PIECES} meshes; export "
                    "the face only."
                )
    _strip_deformers([part for part in parts.values() if part.names])
    return pieces, list(parts.values())


def _strip_deformers(parts: list[_Part]) -> None:
    """Remove the deformer's name from target names if it differs between meshes.

    Maya names the same shape blendShape1.jawOpen in the head and blendShape2.jawOpen in the lashes.
    """
    deformers = [{name.rpartition(".")[0] for name in part.names} for part in parts]
    if all(len(names) == 1 for names in deformers) and len(set.union(set(), *deformers)) > 1:
        for part in parts:
            part.names = [name.rpartition(".")[2] or name for name in part.names]


def _sharing_key(primitive: GltfObject) -> tuple[str, ...]:
    """Return a key that is equal for primitives of a node with the same vertices and targets."""
    unread = ("NORMAL", "TANGENT", "COLOR_0")
    attributes = {k: v for k, v in primitive.child("attributes").data.items() if k not in unread}
    targets = [target.data.get("POSITION") for target in primitive.children("targets")]
    return str(sorted(attributes.items())), str(targets)


def _refuse_draco(file: GltfFile, primitive: GltfObject) -> None:
    compressed = primitive.child("extensions").data.get("KHR_draco_mesh_compression") is not None
    accessor = file.get("accessors", primitive.child("attributes"), "POSITION")
    if compressed and accessor.data.get("bufferView") is None:
        raise FacePoserError(
            f"The rig '{file.path}' is compressed with Draco, which cannot be read; export it without compression."
        )


def _target_names(
    file: GltfFile, mesh: GltfObject, primitive: GltfObject
) -> tuple[list[str], dict[str, tuple[str, str]]]:
    """Return the unique names of the morph targets of ``primitive``, and its repeated names (see ``_Part``).

    The standard has no names: most exporters write ``extras.targetNames`` to the mesh or to the primitive; others name
    the accessors.
    """
    targets = primitive.children("targets")
    names = mesh.child("extras").names("targetNames") or primitive.child("extras").names("targetNames")
    if not names:
        accessors = [file.get("accessors", t, "POSITION") for t in targets if t.data.get("POSITION") is not None]
        names = [accessor.name() for accessor in accessors]
        if len(set(names)) < len(targets) or not all(names):
            names = []
    names = names[: len(targets)] + [""] * (len(targets) - len(names))
    names = [name or f"target {i + 1}" for i, name in enumerate(names)]
    first: dict[str, int] = {}
    repeats: dict[str, tuple[str, str]] = {}
    for i, name in enumerate(names):
        if name in first:
            names[i] = f"{name} (target {i + 1})"
            message = (
                f"The rig '{file.path}' has two targets named '{name[:60]}' in its mesh '{mesh.name()[:60]}', "
                f"numbers {first[name] + 1} and {i + 1}; rename one of them."
            )
            repeats[names[i]] = name, message
        first.setdefault(names[i], i)
    return names, repeats


@dataclass(frozen=True, eq=False)
class _Expressions:
    """Expressions of an avatar.

    Attributes:
        shares: Parts, target indices and weights, by name.
        notes: Findings for the user.
    """

    shares: dict[str, list[tuple[_Part, int, float]]]
    notes: tuple[str, ...]


def _new_expressions(file: GltfFile, parts: list[_Part], names: list[str], weights_range: float | None) -> _Expressions:
    """Return the expressions without a target of the same name."""
    taken = {spelling_key(name) for name in names}
    expressions: dict[str, list[tuple[_Part, int, float]]] = {}
    read, notes = read_expressions(file, weights_range)
    for name, binds in read.items():
        shares = [
            (part, bind.target, bind.weight)
            for bind in binds
            for part in parts
            if _holds(part, bind) and bind.target < len(part.names)
        ]
        if shares and spelling_key(name) not in taken:
            expressions[name] = shares
            taken.add(spelling_key(name))
    return _Expressions(expressions, notes if expressions else ())


def _holds(part: _Part, bind: Bind) -> bool:
    return bind.index == (part.node if bind.holder == "nodes" else part.mesh)


def _positions(file: GltfFile, part: _Part) -> NDArray[np.float64]:
    attributes = part.primitive.child("attributes")
    assert part.placement is not None
    raw = file.floats(attributes, "POSITION", "VEC3")
    if len(part.placement.matrices) not in (1, len(raw)):
        raise attributes.error(
            f"it has joints for {len(part.placement.matrices)} of {counted(len(raw), 'vertex', 'vertices')}"
        )
    points = part.placement.points(raw)
    _require_finite(points, attributes, "the position")
    return points


def _offsets(file: GltfFile, part: _Part, target: GltfObject, name: str) -> NDArray[np.float32]:
    count = part.vertices.stop - part.vertices.start
    if target.data.get("POSITION") is None:
        return np.zeros((count, 3), dtype=np.float32)
    if (found := file.count(target, "POSITION")) != count:
        raise target.error(f"the target '{name}' has {found} vertices, its mesh {count}")
    assert part.placement is not None
    with np.errstate(over="ignore"):
        offsets = part.placement.offsets(file.floats(target, "POSITION", "VEC3")).astype(np.float32)
    _require_finite(offsets, target, f"the offset in the target '{name}'")
    return offsets


def _require_finite(values: NDArray[np.floating], by: GltfObject, noun: str) -> None:
    if (row := first_unusable(values)) is not None:
        problem = "too far away" if np.isfinite(values[row]).all() else "not finite"
        raise by.error(f"{noun} of vertex {row + 1} is {problem}")


def _uv(file: GltfFile, part: _Part) -> NDArray[np.float64] | None:
    count = part.vertices.stop - part.vertices.start
    return texture_coordinates(file, part.material, part.primitive.child("attributes"), count)


def _faces(file: GltfFile, pieces: list[_Piece]) -> tuple[NDArray[np.int32], tuple[Group, ...]]:
    """Return the triangles of all pieces, and their groups."""
    faces: list[NDArray[np.int32]] = []
    groups = []
    done = 0
    for piece in pieces:
        triangles = _triangles(file, piece)
        if not len(triangles):
            continue
        faces.append(triangles)
        groups.append(Group(piece.name, (done, done + len(triangles)), piece.material))
        done += len(triangles)
        if done > _MAX_TRIANGLES:
            raise FacePoserError(
                f"The rig '{file.path}' has more than {_MAX_TRIANGLES} triangles; export the face only."
            )
    if not faces:
        raise FacePoserError(f"The scene of the rig '{file.path}' has no mesh with faces; add the face to its scene.")
    return np.concatenate(faces), tuple(groups)


def _triangles(file: GltfFile, piece: _Piece) -> NDArray[np.int32]:
    """Return the triangles of a primitive, shape (T, 3), counter-clockwise seen from outside (3.7.2.1)."""
    primitive, vertices = piece.primitive, piece.part.vertices
    count = vertices.stop - vertices.start
    if primitive.data.get("indices") is None:
        index = np.arange(count)
    else:
        if file.count(primitive, "indices") > 3 * _MAX_TRIANGLES:
            raise primitive.error(f"it has more than {_MAX_TRIANGLES} triangles")
        index = file.integers(primitive, "indices", "SCALAR")[:, 0]
        if len(index) and (int(index.max()) >= count or int(index.min()) < 0):
            wrong = int(np.argmax((index >= count) | (index < 0)))
            raise primitive.error(f"its index {wrong + 1} is vertex {index[wrong]} of {count}")
    mode = primitive.integer("mode", _TRIANGLES, high=_FAN)
    if mode == _TRIANGLES:
        if len(index) % 3:
            raise primitive.error(f"its number of indices, {len(index)}, is not a multiple of 3")
        triangles = index.reshape(-1, 3)
    else:
        i = np.arange(max(len(index) - 2, 0))
        if mode == _STRIP:
            triangles = np.stack([index[i], index[i + 1 + i % 2], index[i + 2 - i % 2]], axis=1)
        else:
            triangles = np.stack([index[i + 1], index[i + 2], np.broadcast_to(index[:1], i.shape)], axis=1)
        # Strips are joined by degenerate triangles.
        a, b, c = triangles.T
        triangles = triangles[(a != b) & (b != c) & (c != a)]
    assert piece.part.placement is not None
    if piece.part.placement.mirrors:
        triangles = triangles[:, [0, 2, 1]]
    return (triangles + vertices.start).astype(np.int32)
