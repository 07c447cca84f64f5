"""As-rigid-as-possible deformation (Sorkine and Alexa 2007) by libigl, with the same handles.

The method uses the surface only, no expressions. A handle is the vertex closest to a point; its target is on the ray
through the pixel, at the depth of the point on the neutral face. Vertices that no shape moves much (border of the neck,
scalp, back of the head) are fixed, so that the head neither drifts nor turns.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from faceposer.evaluation.methods.handles import Handles, missing_package
from faceposer.evaluation.methods.method import Array, Method, Parameters
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.trials import skin_vertices
from faceposer.geometry.alignment import rigid_alignment
from faceposer.solve.constraints.registry import Constraint


class Arap(Method):
    """Deformation of the skin with minimal local stretching and shearing.

    The other parts have no handles. Eyeballs do not move, since closing lids would drag them along. Each other part
    (lashes, gums with teeth, tongue) moves rigidly with the skin vertices closest to it on the neutral face, or not at
    all without ``follow``.

    Vertices are fixed if no shape moves them by more than the share ``still`` of the largest motion of any vertex.

    Each solve factorises its set of handles, as adding a pin requires. ``factorised`` and ``deformed`` are the two
    steps; only the second is needed while pins are dragged.
    """

    name = "arap"
    title = "As-rigid-as-possible deformation (libigl)"
    kinds = ("point",)
    parameters = {"iterations": 10, "energy": "SPOKES_AND_RIMS", "follow": False, "still": 0.05}
    grid = {
        "still": (0.001, 0.02, 0.05, 0.1, 0.2, 0.4),
        "follow": (False, True),
        "energy": ("SPOKES", "SPOKES_AND_RIMS", "ELEMENTS"),
        "iterations": (3, 10, 30, 100),
    }
    requires: ClassVar[str | None] = "igl"
    max_trials: ClassVar[int | None] = 60

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Extract the skin of the face and its fixed vertices.

        Raises:
            FacePoserError: If libigl is not installed.
        """
        try:
            import igl
        except ImportError as error:
            raise missing_package(self.name, "libigl") from error
        self._igl: Any = igl
        self._character = character = setting.character
        self._skin = skin_vertices(character)
        self._vertices = np.ascontiguousarray(character.vertices[self._skin], dtype=np.float64)
        # Index of each vertex among those of the skin, -1 for the others.
        self._skin_index = np.full(len(character.vertices), -1, dtype=np.int64)
        self._skin_index[self._skin] = np.arange(len(self._skin))
        triangles = self._skin_index[character.triangles]
        self._triangles = np.ascontiguousarray(triangles[(triangles >= 0).all(axis=1)])
        motion = np.linalg.norm(character.shapes[:, self._skin].astype(np.float64), axis=2).max(axis=0)
        still = motion <= parameters["still"] * motion.max()
        self._fixed = np.flatnonzero(still | self._unanchored(still))
        self._iterations = int(parameters["iterations"])
        self._energy = getattr(igl.ARAPEnergyType, f"ARAP_ENERGY_TYPE_{parameters['energy']}")
        self._followers: list[tuple[slice, NDArray[np.intp]]] = []
        if parameters["follow"]:
            nearest = cKDTree(self._vertices)
            for part in character.parts:
                if part.material not in ("skin", "eye"):
                    run = slice(*part.vertices)
                    ids = np.unique(nearest.query(character.vertices[run])[1]).astype(np.intp)
                    if len(ids) >= 3:
                        self._followers.append((run, ids))

    def _unanchored(self, still: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the mask of skin vertices, shape (n,), on components, except the largest, without ``still`` vertices.

        Such components (modelled brows and teeth, for example) may have no handle either, which would leave their
        place undefined.
        """
        edges = self._triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        n = len(self._vertices)
        graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
        n_components, labels = connected_components(graph, directed=False)
        free = np.bincount(labels, still, n_components) == 0
        free[np.bincount(labels, minlength=n_components).argmax()] = False
        unanchored: NDArray[np.bool_] = free[labels]
        return unanchored

    def held(self, handles: Handles) -> tuple[NDArray[np.int32], Array]:
        """Return the skin vertices that are fixed or moved, shape (b,), and their targets, (b, 3).

        Several handles at the same vertex move it to the mean of their targets.
        """
        moved, inverse, counts = np.unique(self._skin_index[handles.vertices], return_inverse=True, return_counts=True)
        sums = np.zeros((len(moved), 3))
        np.add.at(sums, inverse, handles.displacements())
        fixed = np.setdiff1d(self._fixed, moved)
        ids = np.concatenate([moved, fixed])
        targets = self._vertices[ids]
        targets[: len(moved)] += sums / counts[:, None]
        return ids.astype(np.int32), targets

    def factorised(self, ids: NDArray[np.int32]) -> Any:
        """Return libigl's precomputed data for the skin with constrained vertices ``ids``, shape (b,)."""
        data = self._igl.ARAPData()
        data.energy = self._energy
        data.max_iter = self._iterations
        self._igl.arap_precomputation(self._vertices, self._triangles, 3, ids, data)
        return data

    def deformed(self, data: Any, targets: Array) -> Array:
        """Return the skin's vertices, (n, 3), with the constrained vertices of ``data`` at ``targets``, (b, 3)."""
        vertices: Array = self._igl.arap_solve(targets, data, self._vertices)
        return vertices

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Deform the skin of the neutral face and return its vertices, shape (n, 3)."""
        ids, targets = self.held(Handles.of(self._character, constraints))
        return self.deformed(self.factorised(ids), targets)

    def vertices(self, found: Array) -> ArrayLike:
        """Return the vertices, shape (N, 3), of the face with the skin ``found``, shape (n, 3)."""
        vertices = self._character.vertices.astype(np.float64)
        vertices[self._skin] = found
        for run, ids in self._followers:
            vertices[run] = rigid_alignment(self._vertices[ids], found[ids]).apply(vertices[run])
        return vertices
