"""Heads with expressions as one linear model: x = S̄ + B b + E p.

S̄ is the average head as a character, B the modes of people and E the expressions of the average head, whose
coefficients p have the density of the pose solver. What differs between the expressions of people is left out until the
head is known; then its own character is used.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.editing import HeadEditor, head_editor
from faceposer.identity.photos.face_places import FacePlaces
from faceposer.landmarks.points import EYE_CORNERS, N_POINTS
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.solve.priors import WeightBounds

Array = NDArray[np.float64]

#: The character whose topology, parts and shapes heads from photos get.
BASE = "man"
#: Feature points on the right and on the left pupil.
PUPILS = ("3.6", "3.5")
# Weight of the limits of shapes: half the squared excess, in their standard deviations.
_BOUNDS = 0.5


@dataclass(frozen=True, eq=False)
class FacePoints:
    """Points of heads with expressions, x = mean + B b + E p.

    Attributes:
        mean: Shape (n, 3).
        identity: B, shape (K, n, 3); K = 0 for a given head.
        expression: E, shape (r, n, 3).
    """

    mean: Array
    identity: Array
    expression: Array

    def at(self, b: Array, p: Array) -> Array:
        """Return the points of a head with coefficients ``b``, (K,), in the pose ``p``, (r,), shape (n, 3)."""
        result: Array = self.mean + np.tensordot(b, self.identity, 1) + np.tensordot(p, self.expression, 1)
        return result


@dataclass(frozen=True, eq=False)
class ExpressionPrior:
    """The density of poses about the neutral face, -ln p = p' P p / 2 and the limits of the shapes.

    Attributes:
        precision: P, shape (r, r).
        bounds: Limits of the weights.
    """

    precision: Array
    bounds: WeightBounds

    @classmethod
    def of(cls, model: FaceModel) -> "ExpressionPrior":
        """Return the prior of a face ``model``."""
        density = model.rig_density
        usual = density.conditioned_on(model.neutral()).usual()
        return cls(usual.precisions[0], WeightBounds(density.directions, density.limits, _BOUNDS))

    def cost(self, p: Array) -> float:
        """Return -ln p of the pose ``p``, (r,), up to a constant."""
        return 0.5 * float(p @ self.precision @ p) + self.bounds.evaluate(p)[0]

    def slope_and_curvature(self, p: Array) -> tuple[Array, Array]:
        """Return the derivatives of `cost`, shapes (r,) and (r, r)."""
        _, slope, _, curvature = self.bounds.evaluate(p)
        return self.precision @ p + slope, self.precision + curvature


class HeadBasis:
    """The linear model of heads.

    Attributes:
        editor: Editor of the head of the base character.
        character: The base character with the average head.
        model: Its face model, whose coefficients are p.
        prior: The density of p.
    """

    def __init__(self, editor: HeadEditor) -> None:
        """Prepare the model with the heads of ``editor``."""
        self.editor = editor
        self.character = editor.with_head(editor.average)
        self.model = build_face_model(self.character)
        self.prior = ExpressionPrior.of(self.model)

    @property
    def n_identity(self) -> int:
        """Number K of coefficients of a head."""
        return self.editor.model.n_coefficients

    @property
    def n_skin(self) -> int:
        """Number of vertices of the skin, which come first."""
        return self.editor.template.n_skin

    @cached_property
    def control_basis(self) -> Array:
        """Offsets of control vertices per coefficient, in the frame of the character, shape (C, K, 3)."""
        return np.ascontiguousarray((self.editor.model.basis @ self.editor.rotation.T).transpose(1, 0, 2))

    def identity_rows(self, vertices: NDArray[np.integer]) -> Array:
        """Return B at ``vertices`` of the skin, (n,), shape (K, n, 3)."""
        control = self.control_basis
        rows = self.editor.template.matrix[vertices] @ control.reshape(len(control), -1)
        return np.ascontiguousarray(np.asarray(rows).reshape(len(vertices), -1, 3).transpose(1, 0, 2))

    def landmarks(self, places: FacePlaces) -> FacePoints:
        """Return the 468 landmarks and both pupils, the right one first, shape (470, 3)."""
        points = places.points
        corners = points.corners(self.model.triangles)
        used, inverse = np.unique(corners, return_inverse=True)
        rows = self.identity_rows(used)[:, inverse.reshape(corners.shape)]
        identity = np.zeros((len(rows), N_POINTS + 2, 3))
        identity[:, :N_POINTS] = np.einsum("nc,kncd->knd", points.barycentric, rows, optimize=True)
        for number, eye in enumerate(EYE_CORNERS):
            # Eyeballs go where the corners of the lids go.
            identity[:, N_POINTS + number] = identity[:, list(eye)].mean(axis=1)
        mean, expression = self._posed(self.model, places)
        return FacePoints(mean, identity, expression)

    def landmarks_of(self, model: FaceModel, places: FacePlaces) -> FacePoints:
        """Return the points of one head, which has the topology of the base, with its own expressions."""
        mean, expression = self._posed(model, places)
        return FacePoints(mean, np.zeros((0, *mean.shape)), expression)

    @staticmethod
    def _posed(model: FaceModel, places: FacePlaces) -> tuple[Array, Array]:
        """Return the neutral points of a head, (470, 3), and their offsets by its expressions, (r, 470, 3)."""
        pupils = SurfacePoints.at_vertices([int(model.character.feature_points[name]) for name in PUPILS])
        rows, neutral = model.rows_of(places.points.joined(pupils))
        return neutral, np.ascontiguousarray(rows.transpose(2, 0, 1))


@lru_cache(maxsize=1)
def head_basis() -> HeadBasis:
    """Return the linear model with the shipped heads, prepared at the first call."""
    return HeadBasis(head_editor(base_character()))


@lru_cache(maxsize=1)
def base_character() -> Character:
    """Return the base character."""
    return load_character(BASE)
