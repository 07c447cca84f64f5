"""As-rigid-as-possible deformation (Sorkine and Alexa 2007) by libigl, with the same handles: an outside peer.

It knows the surface and no expressions. A handle is the vertex nearest to a point; its target lies on the ray through
the pixel, as far from the picture's plane as the point is on the neutral face. What no shape moves much (the neck's
edge, the scalp, the back of the head) is held in place, so that the head neither drifts nor turns.
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
    """The skin with as little local stretching and shearing as the handles allow.

    The other parts have no handles. Eyeballs stay, for lids that close would drag them along; each other part (lashes,
    gums with their teeth, tongue) follows as a rigid piece the skin vertices that are nearest to its own at rest, or
    stays where ``follow`` is off.

    Held is what no shape moves by more than the share ``still`` of the greatest motion of any vertex.

    A set of handles is factorised anew for each solve, as a new pin asks for; ``factorised`` and ``deformed`` are the
    two halves, the second being what remains while pins are dragged.
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
        """Take the skin of the ``setting``'s face, and find what is held.

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
        # The number of each vertex among those of the skin, -1 of the others.
        self._among_skin = np.full(len(character.vertices), -1, dtype=np.int64)
        self._among_skin[self._skin] = np.arange(len(self._skin))
        triangles = self._among_skin[character.triangles]
        self._triangles = np.ascontiguousarray(triangles[(triangles >= 0).all(axis=1)])
        motion = np.linalg.norm(character.shapes[:, self._skin].astype(np.float64), axis=2).max(axis=0)
        still = motion <= parameters["still"] * motion.max()
        self._still = np.flatnonzero(still | self._adrift(still))
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

    def _adrift(self, still: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which vertices of the skin, shape (n,), lie on pieces, but the largest, of which nothing is ``still``.

        With no handle on them either, nothing would say where they are: modelled brows and teeth are such pieces.
        """
        edges = self._triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        n = len(self._vertices)
        graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
        pieces, of = connected_components(graph, directed=False)
        free = np.bincount(of, still, pieces) == 0
        free[np.bincount(of, minlength=pieces).argmax()] = False
        adrift: NDArray[np.bool_] = free[of]
        return adrift

    def held(self, handles: Handles) -> tuple[NDArray[np.int32], Array]:
        """Return the skin vertices that are held or moved, shape (b,), and where they go, (b, 3).

        Handles that fall on one vertex take it to the mean of where they want it.
        """
        moved, which, counts = np.unique(self._among_skin[handles.vertices], return_inverse=True, return_counts=True)
        sums = np.zeros((len(moved), 3))
        np.add.at(sums, which, handles.displacements())
        still = np.setdiff1d(self._still, moved)
        ids = np.concatenate([moved, still])
        targets = self._vertices[ids]
        targets[: len(moved)] += sums / counts[:, None]
        return ids.astype(np.int32), targets

    def factorised(self, ids: NDArray[np.int32]) -> Any:
        """Return libigl's data for the skin with the vertices ``ids``, shape (b,), held."""
        data = self._igl.ARAPData()
        data.energy = self._energy
        data.max_iter = self._iterations
        self._igl.arap_precomputation(self._vertices, self._triangles, 3, ids, data)
        return data

    def deformed(self, data: Any, targets: Array) -> Array:
        """Return the skin's vertices, shape (n, 3), with those that ``data`` was made for at ``targets``, (b, 3)."""
        vertices: Array = self._igl.arap_solve(targets, data, self._vertices)
        return vertices

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the deformed skin's vertices, shape (n, 3), from the neutral face."""
        ids, targets = self.held(Handles.of(self._character, constraints))
        return self.deformed(self.factorised(ids), targets)

    def vertices(self, found: Array) -> ArrayLike:
        """Return the vertices, shape (N, 3), of the face with the skin ``found``, shape (n, 3)."""
        vertices = self._character.vertices.astype(np.float64)
        vertices[self._skin] = found
        for run, ids in self._followers:
            vertices[run] = rigid_alignment(self._vertices[ids], found[ids]).apply(vertices[run])
        return vertices
