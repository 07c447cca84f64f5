"""Face models: a character with the subspace of its expressions and the density over it, the input of a solve."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import vertex_areas
from faceposer.geometry.picking import SurfacePoints, pick_pixels
from faceposer.model.character import Character, Part
from faceposer.model.expression_statistics import ExpressionStatistics, load_expression_statistics
from faceposer.model.local_moments import RigDensity
from faceposer.model.mixture import GaussianMixture
from faceposer.model.motion_samples import MotionSamples, largest_motions, sample_motion
from faceposer.model.muscles import co_contraction, independence, mirror_images
from faceposer.model.pca import RigSubspace, reconstruction_error, rig_pca, smallest_reaching
from faceposer.model.shape_names import half_shapes_of, weight_map
from faceposer.model.split_shapes import split_to_match
from faceposer.sized_cache import SizedCache, without_owner

if TYPE_CHECKING:
    from faceposer.model.contact.step import ContactStep

Array = NDArray[np.float64]

# The subspace grows until each shape (gaze excepted) loses at most this share of its displacement.
LEAVE_AT_MOST = 0.10
# An eye that turns by less than this, in radians, for every coefficient of 1 is fixed or painted on.
_TURNS = 1e-4
# The PCA weighs motion relative to the total motion of its place; this floor, in centimetres, keeps nearly motionless
# places from counting.
_STILL_MOTION = 0.117
# Largest memory in bytes and number of the cached derivatives of points, and of their products. The points of a brush
# take megabytes, one that is dragged a kilobyte.
_MOST_ROWS, _MOST_GRAMS = (64 << 20, 256), (8 << 20, 64)
# Points whose derivatives are gathered at a time.
_BATCH = 1024


@dataclass(frozen=True, eq=False)
class FaceModel:
    """x = neutral + B p with a density over p (Lau et al. 2009, eqs. (1) and (18)).

    The paper adds B p to the mean face. Here p = 0 is exactly the neutral face, and the means of the mixture are
    shifted accordingly: the set of faces is the same, apart from directions outside the subspace.

    Attributes:
        character: The face, in its unit of length.
        basis: B transposed, shape (r, 3 N), single precision. Its rows are orthonormal in the metric of the PCA.
        mixture: The density of natural expressions over p.
        subspace: The same subspace in terms of the character's rig weights.
        gram: Inner products of the character's shapes in its unit squared, summed over vertices, shape (S, S).
        rig_density: The density over the weights of the shapes that move the face.
    """

    character: Character
    basis: NDArray[np.float32]
    mixture: GaussianMixture
    subspace: RigSubspace
    gram: Array
    rig_density: RigDensity

    @property
    def n_coefficients(self) -> int:
        """The number r of coefficients."""
        return len(self.basis)

    @property
    def triangles(self) -> NDArray[np.int32]:
        """The character's triangles, shape (T, 3)."""
        return self.character.triangles

    @cached_property
    def _flat_neutral(self) -> NDArray[np.float32]:
        return np.ascontiguousarray(self.character.vertices, dtype=np.float32).ravel()

    @cached_property
    def motion_samples(self) -> MotionSamples:
        """Samples of the skin that measure the motion of the whole face."""
        return sample_motion(self.character, self.rig_density)

    @cached_property
    def eye_turns(self) -> Array:
        """Rotation vector of each eye per coefficient, in radians, shape (2, 3, r), the left eye first.

        The displacements of an eyeball's vertices are fitted, by least squares and to first order, by a rotation about
        its centre. Empty, shape (0, 3, r), if the character does not have two eyes that turn.
        """
        eyes = [part for part in self.character.parts if part.material == "eye"]
        eyes.sort(key=lambda part: -float(self.character.vertices[slice(*part.vertices), 0].mean()))
        turns = [self._turn(part) for part in eyes]
        if len(turns) != 2 or max(np.abs(turn).max() for turn in turns) < _TURNS:
            return np.zeros((0, 3, self.n_coefficients))
        return np.stack(turns)

    def _turn(self, part: Part) -> Array:
        run = slice(*part.vertices)
        offsets = self.character.vertices[run].astype(np.float64)
        offsets -= offsets.mean(axis=0)
        # w x v = -[v] w, with the cross product's matrix [v].
        crossed = -np.cross(offsets[:, None, :], np.eye(3)[None]).transpose(0, 2, 1).reshape(-1, 3)
        moved = self.basis.reshape(self.n_coefficients, -1, 3)[:, run].astype(np.float64)
        moved -= moved.mean(axis=1, keepdims=True)
        turn = np.linalg.lstsq(crossed, moved.reshape(self.n_coefficients, -1).T, rcond=None)[0]
        return np.asarray(turn, dtype=np.float64)

    def with_character(self, character: Character) -> "FaceModel":
        """Return the model of another ``character`` with the same shapes, in the same subspace with the same density.

        The coefficients of a pose mean the same weights on both, as while the head of a character is edited.
        ``build_face_model`` gives a character its own subspace instead.

        Raises:
            ValueError: If the characters do not have the same shapes, in the same order.
        """
        if character.shape_names != self.character.shape_names:
            raise ValueError("the characters do not have the same shapes")
        flat = np.ascontiguousarray(character.shapes, dtype=np.float32).reshape(len(character.shapes), -1)
        density = self.rig_density
        return replace(
            self,
            character=character,
            basis=self.subspace.directions.T.astype(np.float32) @ flat,
            gram=gram_of_shapes(character),
            rig_density=replace(density, largest=largest_motions(character, density.shape_rows)),
        )

    def neutral(self) -> Array:
        """Return the coefficients of the neutral face: zeros, shape (r,)."""
        return np.zeros(self.n_coefficients)

    def instance(self, p: ArrayLike) -> NDArray[np.float32]:
        """Return the vertices, shape (N, 3), of the face with coefficients ``p`` of shape (r,)."""
        flat = np.asarray(p, dtype=np.float32) @ self.basis
        flat += self._flat_neutral
        return flat.reshape(-1, 3)

    def surface(self, p: ArrayLike, contact: bool = True) -> NDArray[np.float32]:
        """Return the vertices, shape (N, 3), of the face ``p``, (r,), as shown and exported.

        They are those of ``instance``, which solves and constraints use, corrected by the contact step if ``contact``
        is True.
        """
        vertices = self.instance(p)
        return self.contact.apply(vertices) if contact else vertices

    @cached_property
    def contact(self) -> "ContactStep":
        """The contact step of the character (docs/contact.md)."""
        # Imported late to shorten the start of the window.
        from faceposer.model.contact.step import ContactStep

        return ContactStep.of(self.character)

    def jacobian_at(self, points: SurfacePoints) -> tuple[Array, Array]:
        """Return the derivatives of ``points`` with respect to p, (n, 3, r), and their neutral positions, (n, 3).

        Results are cached: while a point is dragged or a stroke is redrawn, its place on the face remains the same.

        Raises:
            ValueError: If a point is not on the face's surface.
        """
        return self._gathered(points)

    def rows_of(self, points: SurfacePoints) -> tuple[Array, Array]:
        """Return the same as ``jacobian_at`` without caching, for points that are used once, as under the pointer."""
        return self._gather(points)

    def jacobian_gram_at(self, points: SurfacePoints) -> Array:
        """Return the inner products of the columns of ``jacobian_at(points)``, shape (r, r), cached likewise."""
        return self._grams(points)

    @cached_property
    def _gathered(self) -> SizedCache[SurfacePoints, tuple[Array, Array]]:
        gather = without_owner(self._gather)
        return SizedCache(gather, lambda rows, points: sum(a.nbytes for a in rows) + points.nbytes, *_MOST_ROWS)

    @cached_property
    def _grams(self) -> SizedCache[SurfacePoints, Array]:
        return SizedCache(without_owner(self._gram), lambda gram, points: gram.nbytes + points.nbytes, *_MOST_GRAMS)

    def _gather(self, points: SurfacePoints) -> tuple[Array, Array]:
        points.check(self.triangles)
        corners = points.corners(self.triangles)
        basis = self.basis.reshape(self.n_coefficients, -1, 3)
        rows = np.empty((len(points), 3, self.n_coefficients))
        for batch in (slice(begin, begin + _BATCH) for begin in range(0, len(points), _BATCH)):
            if np.all(points.faces[batch] < 0):
                rows[batch] = basis[:, corners[batch, 0]].transpose(1, 2, 0)
            else:
                weights, fields = points.barycentric[batch], basis[:, corners[batch]]
                rows[batch] = np.einsum("nk,rnkd->ndr", weights, fields, optimize=True)
        return rows, points.positions(self.character.vertices, self.triangles)

    def _gram(self, points: SurfacePoints) -> Array:
        rows = self.jacobian_at(points)[0].reshape(-1, self.n_coefficients)
        gram: Array = rows.T @ rows
        return gram

    def positions_at(self, points: SurfacePoints, p: ArrayLike) -> Array:
        """Return the positions of ``points``, shape (n, 3), on the face with coefficients ``p`` of shape (r,)."""
        rows, neutral = self.jacobian_at(points)
        positions: Array = neutral + rows @ np.asarray(p, dtype=np.float64)
        return positions

    def pick(self, p: ArrayLike, camera: Camera, pixels: ArrayLike) -> tuple[SurfacePoints, NDArray[np.bool_]]:
        """Return the visible points of the face ``p`` under ``pixels``, (n, 2), and the mask of pixels on it, (n,).

        Lashes are ignored: picking on them returns the lid behind.
        """
        solid = self.character.solid_triangles
        points, met = pick_pixels(self.instance(p), self.triangles[solid], camera, pixels)
        return SurfacePoints(solid[points.faces], points.barycentric), met

    def weights_of(self, p: ArrayLike) -> Array:
        """Return the rig weights, shape (S,), of the face ``p`` of shape (r,); they are not confined to 0 to 1."""
        return self.subspace.directions @ np.asarray(p, dtype=np.float64)

    def coefficients_of(self, weights: ArrayLike | Mapping[str, float]) -> Array:
        """Return the coefficients, shape (r,), nearest to the face with the rig ``weights``.

        Args:
            weights: Shape (S,) in the order of the character's shapes, or values by name, with 0 for all others. The
                name of a shape that the character has in halves, such as browInnerUp, sets both halves.

        Raises:
            KeyError: If a name is not one of the character's shapes.
        """
        if isinstance(weights, Mapping):
            vector = np.zeros(len(self.character.shape_names))
            for name, value in weights.items():
                targets = [name] if name in self.character.shape_names else half_shapes_of(name)
                if not targets or any(shape not in self.character.shape_names for shape in targets):
                    raise KeyError(name)
                vector[[self.character.shape_names.index(shape) for shape in targets]] += value
        else:
            vector = np.asarray(weights, dtype=np.float64)
        coefficients: Array = self.subspace.projection @ vector
        return coefficients

    def reconstruction_error(self) -> dict[str, float]:
        """Return the relative reconstruction error of each shape in the subspace, by shape name."""
        share = reconstruction_error(self.subspace.directions, self.gram)
        return dict(zip(self.character.shape_names, share.tolist(), strict=True))


def build_face_model(
    character: Character,
    statistics: ExpressionStatistics | None = None,
    n_components: int | None = None,
    metric: Literal["local", "plain"] = "local",
) -> FaceModel:
    """Build the model of a ``character`` from statistics of its shapes' weights.

    Args:
        character: The face with its shapes.
        statistics: Statistics of the weights; if None, the character's own, or the shipped ones for ARKit's weights.
        n_components: Dimensions of the subspace; if None, the fewest that lose at most ``LEAVE_AT_MOST`` of the
            displacement of every shape (gaze excepted).
        metric: Metric of the PCA: motion relative to the total motion of its place ("local"), or plain squared
            distances as in the paper ("plain").

    Raises:
        FacePoserError: If the character has none of the shapes in the statistics, or none of them moves a vertex.
    """
    statistics = statistics or character.statistics or load_expression_statistics()
    statistics = split_to_match(statistics, character.shape_names)
    names = [name for name in character.shape_names if name in statistics.shape_names]
    if not names:
        raise FacePoserError(
            f"The character '{character.name}' has none of ARKit's 52 shapes; rename its shapes to pose it."
        )
    columns = [statistics.shape_names.index(name) for name in names]
    rows = [character.shape_names.index(name) for name in names]
    shapes = np.ascontiguousarray(character.shapes, dtype=np.float32)
    flat = shapes.reshape(len(shapes), -1)
    plain_gram = gram_of_shapes(character)
    metric_gram = plain_gram
    if metric == "local":
        weighted = (shapes * np.sqrt(_vertex_metric(character))[None, :, None]).reshape(len(shapes), -1)
        metric_gram = (weighted @ weighted.T).astype(np.float64)

    # Shapes without statistics are left out of the subspace.
    lift = np.zeros((len(shapes), len(statistics.shape_names)))
    lift[rows, columns] = 1.0
    known = (lift.sum(axis=1) > 0).astype(np.float64)
    covariance = lift @ statistics.covariance @ lift.T
    subspace = rig_pca(metric_gram * np.outer(known, known), covariance)
    if n_components is None:
        required = np.array([r for r in rows if not character.shape_names[r].startswith("eyeLook")], dtype=np.intp)
        subspace = smallest_reaching(subspace, plain_gram, required, LEAVE_AT_MOST)
    else:
        subspace = subspace.truncated(n_components)
    mixture = GaussianMixture(statistics.weights, statistics.means, statistics.covariances)
    moving = [(row, column) for row, column in zip(rows, columns, strict=True) if plain_gram[row, row] > 0]
    if not moving:
        raise FacePoserError(
            f"No shape of the character '{character.name}' moves a vertex; import the character again from its file."
        )
    moving_rows, kept = (np.array(indices, dtype=np.intp) for indices in zip(*moving, strict=True))
    kept_names = [character.shape_names[row] for row in moving_rows]
    rig_density = RigDensity(
        GaussianMixture(statistics.weights, statistics.means[:, kept], statistics.covariances[:, kept[:, None], kept]),
        subspace.directions[moving_rows],
        subspace.projection[:, moving_rows],
        character.shape_limits[moving_rows].astype(np.float64),
        moving_rows,
        tuple(statistics.regions[column] for column in kept),
        statistics.factors[np.ix_(kept, kept)] * independence(kept_names),
        co_contraction(kept_names),
        largest_motions(character, moving_rows),
        None if statistics.examples is None else statistics.examples[:, kept],
        statistics.factors[np.ix_(kept, kept)] * independence(kept_names, sides=False),
        mirror_images(kept_names),
    )
    return FaceModel(
        character,
        np.ascontiguousarray(subspace.directions.T.astype(np.float32) @ flat),
        mixture.transformed(subspace.projection @ lift),
        subspace,
        plain_gram,
        rig_density,
    )


def gram_of_shapes(character: Character) -> Array:
    """Return the inner products of the ``character``'s shapes over all vertices, in its unit squared, shape (S, S)."""
    flat = np.ascontiguousarray(character.shapes, dtype=np.float32).reshape(len(character.shapes), -1)
    gram: Array = (flat @ flat.T).astype(np.float64)
    return gram


def gram_of_weights(character: Character, names: Sequence[str]) -> Array:
    """Return the inner products of the ``character``'s shapes ``names``, shape (S', S').

    The character may have the halves of a shape that ``names`` has whole.
    """
    lift = weight_map(character.shape_names, names)
    gram: Array = lift.T @ gram_of_shapes(character) @ lift
    return gram


def _vertex_metric(character: Character) -> NDArray[np.float32]:
    """Return the weight of each vertex in the PCA, shape (N,): its area over its mean squared displacement.

    In the plain metric the jaw and the eyeballs have nearly all the variance, and the brows are dropped as noise
    (Blanz and Vetter weight segments for the same reason).
    """
    area = vertex_areas(character.vertices, character.triangles)
    motion = np.einsum("snd,snd->n", character.shapes, character.shapes) / len(character.shapes)
    weights = area / (motion + _STILL_MOTION**2)
    metric: NDArray[np.float32] = (weights / weights.sum()).astype(np.float32)
    return metric
