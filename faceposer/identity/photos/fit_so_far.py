"""A fit in progress, for pictures of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.identity.identity import Identity
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.unknowns import ViewState
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.painting import painted_character
from faceposer.model.face_model import FaceModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FitSoFar:
    """A head that is being fitted, or was.

    Attributes:
        basis: The linear model of heads.
        rows: Coefficients of the head, one row per segment, shape (s, K).
        views: Pose and camera in each photo.
        crops: The parts of the photos that are fitted.
        made: The character's face model once it is made, or None.
    """

    basis: HeadBasis
    rows: Array
    views: Sequence[ViewState]
    crops: Sequence[FaceCrop]
    made: FaceModel | None = None

    def camera(self, number: int) -> Camera:
        """Return the camera of photo ``number``, in pixels of the whole photo."""
        return self.crops[number].whole(self.views[number].camera.camera)

    def mesh(self, number: int) -> PaintedMesh:
        """Return the head with the expression of photo ``number``: in the colours of the base until made."""
        pose = self.views[number].pose
        if self.made is not None:
            return painted_character(self.made.character, self.made.surface(pose))
        basis = self.basis
        vertices = basis.editor.preview(basis.model, pose, Identity.of(self.rows)).astype(np.float64)
        triangles, colours = _coarse(basis)
        return PaintedMesh(vertices, triangles, colours)


@lru_cache(maxsize=1)
def _coarse(basis: HeadBasis) -> tuple[NDArray[np.integer], Array]:
    """Return the triangles of the base character without lashes, and colours of its vertices, which are drawn fast."""
    mesh = painted_character(basis.character)
    return mesh.triangles, mesh.vertex_colours


#: Called with the fit after each step; it decides when to draw it.
Watch = Callable[[FitSoFar], None]


def unwatched(_: FitSoFar) -> None:
    """Draw nothing."""
