"""The topology of all heads of the model: the skin of the built-in man.

Its 17,259 vertices are one step of Catmull and Clark's subdivision of a control mesh of 4,326 vertices, a part of
MakeHuman's base mesh. The model stores control vertices, a quarter of the memory: x = M c with a sparse matrix M, which
follows from the quads alone. The first vertices of the skin are those of the control mesh, moved by the smoothing.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from faceposer.geometry.mirror import SurfaceMirror
from faceposer.geometry.subdivision import Subdivision, catmull_clark
from faceposer.model.character_file import load_character

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

Array = NDArray[np.float64]

# Distance in centimetres within which the man's halves match.
_MIRROR_TOLERANCE = 1e-3
# λ of smoothed offsets: the gain is one half where the Laplacian's eigenvalue is 0.24, waves of about 13 edges.
_SMOOTHNESS = 300.0


@dataclass(frozen=True, eq=False)
class HeadTemplate:
    """A subdivided skin.

    Attributes:
        control_quads: Quads of the control mesh, shape (F, 4).
        fine: One step of subdivision.
        rest: The skin of the built-in man, in centimetres, shape (N, 3).
    """

    control_quads: NDArray[np.int32]
    fine: Subdivision
    rest: Array

    @property
    def n_control(self) -> int:
        """Number C of control vertices."""
        return self.matrix.shape[1]

    @property
    def n_skin(self) -> int:
        """Number N of vertices of the skin."""
        return self.matrix.shape[0]

    @property
    def matrix(self) -> sparse.csr_array:
        """M of shape (N, C): skin = M @ control."""
        return self.fine.matrix

    @property
    def quads(self) -> NDArray[np.int32]:
        """Quads of the skin, shape (4 F, 4)."""
        return self.fine.quads

    @cached_property
    def triangles(self) -> NDArray[np.int32]:
        """Triangles of the skin, shape (8 F, 3)."""
        return self.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)

    @cached_property
    def mirror(self) -> NDArray[np.int64]:
        """The skin vertex opposite each in x, shape (N,); the first C are control vertices opposite each other."""
        return SurfaceMirror(self.rest, self.triangles, _MIRROR_TOLERANCE).vertices

    @cached_property
    def _normal_matrix(self) -> "SuperLU":
        from scipy.sparse import linalg

        return linalg.splu((self.matrix.T @ self.matrix).tocsc())

    def skin(self, control: Array) -> Array:
        """Return the skin, (N, ...), of ``control``, (C, ...): positions, or offsets."""
        flat = np.asarray(control, dtype=np.float64).reshape(self.n_control, -1)
        return np.asarray(self.matrix @ flat).reshape(self.n_skin, *np.shape(control)[1:])

    def control(self, skin: Array) -> Array:
        """Return the control vertices, (C, k), whose subdivision is nearest to ``skin``, (N, k), by least squares."""
        result: Array = self._normal_matrix.solve(np.asarray(self.matrix.T @ np.asarray(skin, dtype=np.float64)))
        return result

    def mirrored(self, control: Array) -> Array:
        """Return the mirror image of ``control``, (C, 3)."""
        return control[self.mirror[: self.n_control]] * np.array([-1.0, 1.0, 1.0])

    def smoothed(self, control: Array) -> Array:
        """Return offsets of control vertices, (C, 3), without what changes over less than about 13 edges.

        They minimise ‖y - x‖² + λ ‖L y‖² with the graph's Laplacian L.
        """
        result: Array = self._smoothing.solve(np.asarray(control, dtype=np.float64))
        return result

    @cached_property
    def _smoothing(self) -> "SuperLU":
        from scipy.sparse import linalg

        n, start, end = self.n_control, self.control_quads.ravel(), np.roll(self.control_quads, -1, axis=1).ravel()
        adjacent = sparse.coo_array((np.ones(len(start)), (start, end)), shape=(n, n)).tocsr()
        adjacent = ((adjacent + adjacent.T) > 0).astype(np.float64)
        laplacian = sparse.diags_array(adjacent.sum(axis=1)) - adjacent
        return linalg.splu((sparse.eye_array(n) + _SMOOTHNESS * (laplacian @ laplacian)).tocsc())


@lru_cache(maxsize=1)
def head_template() -> HeadTemplate:
    """Return the topology of the built-in man.

    Raises:
        FacePoserError: If his file is missing or damaged.
    """
    man = load_character("man")
    part = man.parts[0]
    quads = man.polygons[slice(*part.polygons)]
    # Each old quad is four new ones in a row, each of which starts at an old corner.
    control = np.ascontiguousarray(quads[:, 0].reshape(-1, 4))
    return HeadTemplate(
        control, catmull_clark(control, int(control.max()) + 1), man.vertices[slice(*part.vertices)].astype(np.float64)
    )
