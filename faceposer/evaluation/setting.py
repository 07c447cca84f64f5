"""What all methods of a study share: a face, a camera, and the performances that they may learn from."""

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

#: Pixels of the picture in which constraints are given.
SIZE = (800, 800)


@dataclass(frozen=True, eq=False)
class StudyContext:
    """A face, a camera, and what may be learned from.

    Attributes:
        character: The face to pose; its shapes have ARKit's names.
        captures: Performances to learn from.
        recipe: How the prior that ships is learned from them.
        camera: View in which all constraints are given.
        performers: Name of the performer of each of the ``captures``.
        contact: Whether faces are measured after the contact step, those of techniques and true ones alike.
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
        """Return the setting with a front view of all of the ``character``.

        Args:
            character: The face.
            captures: Performances to learn from.
            recipe: How; that of the shipped prior if None.
            performers: Name of the performer of each of the ``captures``; if left out, all are of one.

        Raises:
            FacePoserError: If the character has none of ARKit's shapes.
        """
        if not set(character.shape_names) & set(ARKIT_SHAPES):
            raise FacePoserError(
                f"The character '{character.name}' has none of the 52 ARKit shapes, which the captures speak of; "
                "evaluate with one that has."
            )
        vertices = character.vertices
        camera = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera(SIZE)
        performers = tuple(performers) or ("",) * len(captures)
        return cls(character, tuple(captures), recipe or Recipe(), camera, performers)

    @cached_property
    def frames(self) -> Array:
        """Cleaned frames to learn from, weights of ``ARKIT_SHAPES``, shape (F, 52)."""
        return np.concatenate([clean(capture, self.recipe) for capture in self.captures])

    @cached_property
    def frames_by_performer(self) -> dict[str, Array]:
        """The cleaned frames of each performer, in the order of the captures, each shape (F, 52)."""
        found: dict[str, list[Array]] = {name: [] for name in self.performers}
        for capture, name in zip(self.captures, self.performers, strict=True):
            found[name].append(clean(capture, self.recipe))
        return {name: np.concatenate(parts) for name, parts in found.items()}

    @cached_property
    def examples(self) -> Array:
        """The augmented examples that the shipped prior is fitted to, shape (n, 52)."""
        return augment(self.frames, ARKIT_SHAPES, self.recipe)

    @cached_property
    def statistics(self) -> ExpressionStatistics:
        """What the recipe of the shipped prior learns from the first performer's captures and the others'."""
        takes: dict[str, list[Capture]] = {name: [] for name in self.performers}
        for capture, name in zip(self.captures, self.performers, strict=True):
            takes[name].append(capture)
        first, *others = takes.values()
        metric = gram_of_weights(load_character("man"), ARKIT_SHAPES)
        return learn(first, self.recipe, metric=metric, others=others)

    @cached_property
    def model(self) -> FaceModel:
        """The face with the prior as it ships, but learned from ``captures`` alone."""
        return build_face_model(self.character, self.statistics)

    @cached_property
    def full(self) -> FaceModel:
        """The face with all its dimensions, principal components of plain squared distance first."""
        return build_face_model(self.character, self.plain(self.frames), len(self.character.shape_names), "plain")

    def shown(self, vertices: ArrayLike) -> NDArray[np.float32]:
        """Return what measures see of ``vertices``, shape (N, 3): they, or what the contact step makes of them."""
        copy = np.array(vertices, dtype=np.float32)
        return self._contact_step.apply(copy) if self.contact else copy

    @cached_property
    def _contact_step(self) -> ContactStep:
        return ContactStep.of(self.character)

    def plain(self, examples: Array) -> ExpressionStatistics:
        """Return the moments of ``examples``, shape (n, 52), with one Gaussian for a density."""
        covariance = np.cov(examples.T) + 1e-8 * np.eye(examples.shape[1])
        mean = examples.mean(axis=0)
        one = np.ones(1)
        return ExpressionStatistics(ARKIT_SHAPES, one, mean[None], covariance[None], mean, covariance, "")

    def by_likelihood(self, examples: Array, n_components: int, n_factors: int) -> ExpressionStatistics:
        """Return the paper's mixture of factor analyzers (section 5): plain maximum likelihood, from ``examples``.

        A fit takes half a minute and is remembered, since most parameters of the methods do not change it.
        """
        key = (id(examples), n_components, n_factors)
        if key not in self._fits:
            recipe = replace(self.recipe, n_components=n_components, n_factors=n_factors, fit_shrinkage=0.0, blend=0.0)
            # The examples are kept beside their fit: no others can have their id then.
            self._fits[key] = (examples, fit_statistics(examples, ARKIT_SHAPES, recipe, ""))
        return self._fits[key][1]

    @cached_property
    def _fits(self) -> dict[tuple[int, int, int], tuple[Array, ExpressionStatistics]]:
        return {}

    def rig_weights(self, frames: Array) -> Array:
        """Return ``frames`` of ARKit's weights, shape (F, 52), as weights of the character's shapes, (F, S)."""
        weights: Array = frames @ weight_map(self.character.shape_names, ARKIT_SHAPES).T
        return weights

    def vertices_of(self, weights: Array) -> NDArray[np.float32]:
        """Return the vertices, (N, 3), of the face with the rig ``weights``, shape (S,)."""
        character = self.character
        shapes = np.ascontiguousarray(character.shapes, dtype=np.float32).reshape(len(character.shapes), -1)
        offsets = weights.astype(np.float32) @ shapes
        moved: NDArray[np.float32] = character.vertices + offsets.reshape(-1, 3)
        return moved
