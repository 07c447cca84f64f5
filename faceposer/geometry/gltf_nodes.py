"""World transforms of the meshes of a glTF file: transforms of nodes, and of skins at rest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.gltf_file import GltfFile, GltfObject

#: Tolerance of the components of equal transforms, relative to the largest.
_TOLERANCE = 1e-5


@dataclass(frozen=True, eq=False)
class Placement:
    """Transforms from a mesh's coordinates to world space.

    Attributes:
        matrices: Homogeneous matrices for column vectors: one for all vertices, (1, 4, 4), or one each, (N, 4, 4).
    """

    matrices: NDArray[np.float64]

    @property
    def mirrors(self) -> bool:
        """True if the transform is a reflection, so that the orientation of faces must be reversed."""
        return bool(np.linalg.det(self.matrices[0, :3, :3]) < 0)

    def points(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return ``points``, shape (N, 3), transformed."""
        if np.array_equal(self.matrices[0], np.eye(4)) and len(self.matrices) == 1:
            return points.astype(np.float64)
        return self.offsets(points) + self.matrices[:, :3, 3]

    def offsets(self, offsets: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return ``offsets``, shape (N, 3), transformed by the linear part."""
        # Callers report values that are not finite, with their place.
        with np.errstate(over="ignore", invalid="ignore"):
            if len(self.matrices) == 1:
                return offsets.astype(np.float64) @ self.matrices[0, :3, :3].T
            return np.einsum("nij,nj->ni", self.matrices[:, :3, :3], offsets.astype(np.float64))


@dataclass(frozen=True, eq=False)
class Scene:
    """The nodes of a file.

    Attributes:
        nodes: All nodes.
        shown: Indices of the nodes in the default scene, ascending; of all nodes if there is no default scene.
        worlds: Homogeneous world transform of each node, shape (nodes, 4, 4).
    """

    nodes: list[GltfObject]
    shown: list[int]
    worlds: NDArray[np.float64]


def read_scene(file: GltfFile) -> Scene:
    """Read the nodes with their transforms (3.5.2, 3.5.3).

    Raises:
        FacePoserError: If a node is its own ancestor, has two parents, or has an invalid transform.
    """
    nodes = file.all("nodes")
    children = [node.integers("children", high=len(nodes) - 1) for node in nodes]
    parents = [-1] * len(nodes)
    for index, child_ids in enumerate(children):
        for child in child_ids:
            if parents[child] >= 0:
                raise nodes[child].error(f"it is the child of two nodes, {parents[child]} and {index}")
            parents[child] = index
    worlds = np.empty((len(nodes), 4, 4))
    order = [i for i, parent in enumerate(parents) if parent < 0]
    with np.errstate(over="ignore", invalid="ignore"):
        for index in order:
            local = _local(nodes[index])
            worlds[index] = worlds[parents[index]] @ local if parents[index] >= 0 else local
            order += children[index]
    if len(order) < len(nodes):
        cyclic = min(set(range(len(nodes))).difference(order))
        raise nodes[cyclic].error("it is an ancestor of itself")
    finite = np.isfinite(worlds).all(axis=(1, 2))
    if not finite.all():
        raise nodes[int(np.argmin(finite))].error("its world transform is not finite")
    if file.root.data.get("scene") is None:
        return Scene(nodes, list(range(len(nodes))), worlds)
    reached = file.get("scenes", file.root, "scene").integers("nodes", high=len(nodes) - 1)
    visited = set(reached)
    for index in reached:
        reached += [child for child in children[index] if child not in visited]
        visited.update(children[index])
    return Scene(nodes, sorted(visited), worlds)


def _local(node: GltfObject) -> NDArray[np.float64]:
    """Return a node's local transform from its matrix or T R S (3.5.3)."""
    if node.data.get("matrix") is not None:
        return node.numbers("matrix", np.eye(4).ravel().tolist()).reshape(4, 4).T
    x, y, z, w = node.numbers("rotation", [0, 0, 0, 1])
    norm = x * x + y * y + z * z + w * w
    s = 2 / norm if norm > 0 else 0.0
    rotation = np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )
    local = np.eye(4)
    local[:3, :3] = rotation * node.numbers("scale", [1, 1, 1])
    local[:3, 3] = node.numbers("translation", [0, 0, 0])
    return local


def place(file: GltfFile, scene: Scene, index: int, primitive: GltfObject) -> Placement:
    """Return the world transform of the vertices of ``primitive`` in the node ``index``.

    A skinned mesh is transformed by its joints at rest, and the transform of its node is ignored (3.7.3.3): vertex i by
    the weighted mean of world transform times inverse bind matrix of its joints. If these products are equal for all
    joints, as in a file in its bind pose, a single transform is used, which is usually the identity.
    """
    node = scene.nodes[index]
    attributes = primitive.child("attributes")
    sets = [k for k in range(4) if attributes.data.get(f"JOINTS_{k}") is not None]
    if node.data.get("skin") is None or not sets:
        return Placement(scene.worlds[index][None])
    skin = file.get("skins", node, "skin")
    joints = skin.integers("joints", high=len(scene.nodes) - 1)
    if not joints:
        raise skin.error("it has no joints")
    matrices = scene.worlds[joints]
    if skin.data.get("inverseBindMatrices") is not None:
        bind = file.floats(skin, "inverseBindMatrices", "MAT4")
        if len(bind) < len(joints):
            raise skin.error(f"it has {len(joints)} joints, but {len(bind)} inverse bind matrices")
        with np.errstate(over="ignore", invalid="ignore"):
            matrices = matrices @ bind[: len(joints)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    if not np.isfinite(matrices).all():
        raise skin.error("the transform of a joint is not finite")
    if _nearly_equal(matrices, matrices[:1]):
        return Placement(np.eye(4)[None] if _nearly_equal(matrices[:1], np.eye(4)[None]) else matrices[:1])
    if len({file.count(attributes, f"{kind}_{k}") for k in sets for kind in ("JOINTS", "WEIGHTS")}) > 1:
        raise attributes.error("joints and weights differ in number")
    numbers = np.hstack([file.integers(attributes, f"JOINTS_{k}", "VEC4") for k in sets])
    weights = np.hstack([file.floats(attributes, f"WEIGHTS_{k}", "VEC4").astype(np.float64) for k in sets])
    if not np.isfinite(weights).all():
        raise attributes.error("a weight of a joint is not finite")
    if numbers.max(initial=0) >= len(joints):
        raise attributes.error(f"a vertex refers to joint {numbers.max()} of {len(joints)}")
    weights[weights.sum(axis=1) <= 0, 0] = 1
    weights /= weights.sum(axis=1, keepdims=True)
    blended = np.zeros((len(numbers), 4, 4))
    for k in range(numbers.shape[1]):
        blended += weights[:, k, None, None] * matrices[numbers[:, k]]
    return Placement(blended)


def _nearly_equal(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    return bool(np.abs(a - b).max() <= _TOLERANCE * max(1.0, float(np.abs(b).max())))
