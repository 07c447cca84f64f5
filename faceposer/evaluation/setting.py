"""Input common to all methods of a study: a face, a camera, and the performances to learn from."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera, OrbitView
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.character_file import load_character
from faceposer.model.contact.step import ContactStep
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.face_model import FaceModel, build_face_model, gram_of_weights
from faceposer.model.shape_names import weight_map
from faceposer.training.capture import Capture
from faceposer.training.expressions import Recipe, augment, clean, fit_statistics, learn

Array = NDArray[np.float64]

#: Width and height of the image in which constraints are given, in pixels.
SIZE = (800, 800)


@dataclass(frozen=True, eq=False)
class StudyContext:
    """A face, a camera, and the training data.

    Attributes:
        character: The face to pose; its shapes have ARKit's names.
        captures: Performances to learn from.
        recipe: Recipe by which the shipped prior is learned from them.
        camera: Camera of all constraints.
        performers: Name of the performer of each of the ``captures``.
        contact: True if faces, both of techniques and true ones, are measured after the contact step.
    """

    character: Character
    captures: tuple[Capture, ...]
    recipe: Recipe
    camera: Camera
    performers: tuple[str, ...]
    contact: bool = False

    @classmethod
    def of(
        cls,
        character: Character,
        captures: Sequence[Capture],
        recipe: Recipe | None = None,
        performers: Sequence[str] = (),
    ) -> "StudyContext":
        """Return the setting with a front view of the whole ``character``.

        Args:
            character: The face.
            captures: Performances to learn from.
            recipe: Recipe; that of the shipped prior if None.
            performers: Name of the performer of each of the ``captures``; empty if all are of one performer.

        Raises:
            FacePoserError: If the character has none of ARKit's shapes.
        """
        if not set(character.shape_names) & set(ARKIT_SHAPES):
            raise FacePoserError(
                f"The character '{character.name}' has none of the 52 ARKit shapes, which captures require; choose a "
                "character that has them."
            )
        vertices = character.vertices
        camera = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera(SIZE)
        performers = tuple(performers) or ("",) * len(captures)
        return cls(character, tuple(captures), recipe or Recipe(), camera, performers)

    @cached_property
    def frames(self) -> Array:
        """Cleaned training frames, weights of ``ARKIT_SHAPES``, shape (F, 52)."""
        return np.concatenate([clean(capture, self.recipe) for capture in self.captures])

    @cached_property
    def frames_by_performer(self) -> dict[str, Array]:
        """Cleaned frames of each performer, in the order of the captures, each of shape (F, 52)."""
        frames: dict[str, list[Array]] = {name: [] for name in self.performers}
        for capture, name in zip(self.captures, self.performers, strict=True):
            frames[name].append(clean(capture, self.recipe))
        return {name: np.concatenate(parts) for name, parts in frames.items()}

    @cached_property
    def examples(self) -> Array:
        """Augmented examples to which the shipped prior is fitted, shape (n, 52)."""
        return augment(self.frames, ARKIT_SHAPES, self.recipe)

    @cached_property
    def statistics(self) -> ExpressionStatistics:
        """Statistics that the recipe of the shipped prior learns from the captures of all performers."""
        takes: dict[str, list[Capture]] = {name: [] for name in self.performers}
        for capture, name in zip(self.captures, self.performers, strict=True):
            takes[name].append(capture)
        first, *others = takes.values()
        metric = gram_of_weights(load_character("man"), ARKIT_SHAPES)
        return learn(first, self.recipe, metric=metric, others=others)

    @cached_property
    def model(self) -> FaceModel:
        """The face with a prior like the shipped one, but learned from ``captures`` only."""
        return build_face_model(self.character, self.statistics)

    @cached_property
    def full(self) -> FaceModel:
        """The face in all its dimensions, ordered as principal components of plain squared distance."""
        return build_face_model(self.character, self.plain(self.frames), len(self.character.shape_names), "plain")

    def shown(self, vertices: ArrayLike) -> NDArray[np.float32]:
        """Return ``vertices``, shape (N, 3), as they are measured: after the contact step if ``contact`` is True."""
        copy = np.array(vertices, dtype=np.float32)
        return self._contact_step.apply(copy) if self.contact else copy

    @cached_property
    def _contact_step(self) -> ContactStep:
        return ContactStep.of(self.character)

    def plain(self, examples: Array) -> ExpressionStatistics:
        """Return the moments of ``examples``, shape (n, 52), with a single Gaussian as density."""
        covariance = np.cov(examples.T) + 1e-8 * np.eye(examples.shape[1])
        mean = examples.mean(axis=0)
        one = np.ones(1)
        return ExpressionStatistics(ARKIT_SHAPES, one, mean[None], covariance[None], mean, covariance, "")

    def by_likelihood(self, examples: Array, n_components: int, n_factors: int) -> ExpressionStatistics:
        """Fit the paper's mixture of factor analyzers (section 5) to ``examples`` by plain maximum likelihood.

        A fit takes half a minute and is cached, since most parameters of the methods do not change it.
        """
        key = (id(examples), n_components, n_factors)
        if key not in self._fits:
            recipe = replace(self.recipe, n_components=n_components, n_factors=n_factors, fit_shrinkage=0.0, blend=0.0)
            # Keeping the examples with their fit ensures that their id is not reused.
            self._fits[key] = (examples, fit_statistics(examples, ARKIT_SHAPES, recipe, ""))
        return self._fits[key][1]

    @cached_property
    def _fits(self) -> dict[tuple[int, int, int], tuple[Array, ExpressionStatistics]]:
        return {}

    def rig_weights(self, frames: Array) -> Array:
        """Convert ``frames`` of ARKit weights, shape (F, 52), to weights of the character's shapes, (F, S)."""
        weights: Array = frames @ weight_map(self.character.shape_names, ARKIT_SHAPES).T
        return weights

    def vertices_of(self, weights: Array) -> NDArray[np.float32]:
        """Return the vertices, (N, 3), of the face with the rig ``weights``, shape (S,)."""
        character = self.character
        shapes = np.ascontiguousarray(character.shapes, dtype=np.float32).reshape(len(character.shapes), -1)
        offsets = weights.astype(np.float32) @ shapes
        vertices: NDArray[np.float32] = character.vertices + offsets.reshape(-1, 3)
        return vertices
