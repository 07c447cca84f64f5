"""Prior of a character from performances captured with a phone: statistics of the ARKit weights."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.model.character_file import load_character
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.face_model import gram_of_weights
from faceposer.progress import Progress
from faceposer.training.capture import Capture, missing_shapes
from faceposer.training.expressions import Recipe, augment, clean, learn, shapes_of
from faceposer.training.mfa import convergence_recorded
from faceposer.training.recordings import read_recording
from faceposer.training.selection import Choice, Fold, choose_mixture

Array = NDArray[np.float64]

# Sizes are compared on fewer examples than the fit uses, which gives the same ranking in less time.
_EXAMPLES_TO_CHOOSE = 3000
_BLOCKS = 3
_FRAMES_LEFT_OUT = 400
_FEWEST_FRAMES = 100


@dataclass(frozen=True, eq=False)
class LearnedStatistics:
    """Statistics learned from performances.

    Attributes:
        statistics: Statistics for the character.
        choice: The size of the mixture.
        takes: Name and number of frames of each take.
        missing: ARKit's shapes without a channel in any take.
        lost: Number of frames without a face in each take, which were ignored.
        assumptions: What was assumed of the weights of takes, one sentence each.
    """

    statistics: ExpressionStatistics
    choice: Choice
    takes: tuple[tuple[str, int], ...]
    missing: tuple[str, ...]
    lost: tuple[int, ...] = ()
    assumptions: tuple[str, ...] = ()

    @property
    def warnings(self) -> list[str]:
        """Shortcomings of the takes and of the choice, one sentence each."""
        lost = [
            f"The capture '{name}' has {counted(count, 'frame')} without a face, which were left out."
            for (name, _), count in zip(self.takes, self.lost, strict=False)
            if count
        ]
        return [*lost, *self.assumptions, *self.choice.warnings]

    def as_json(self) -> dict[str, Any]:
        """Return the JSON form for the summary of a character."""
        return {
            "from": "captures",
            "takes": [{"file": name, "frames": frames} for name, frames in self.takes],
            "missing_channels": list(self.missing),
            **self.choice.as_json(),
        }


def learn_from_captures(
    paths: Sequence[Path], n_components: int | None, n_factors: int | None, progress: Progress
) -> LearnedStatistics:
    """Learn statistics from the performances in the files ``paths``.

    Args:
        paths: Files of performances.
        n_components: Number of factor analyzers, chosen by cross-validation if None.
        n_factors: Number of factors of each, chosen by cross-validation if None.
        progress: Progress to update.

    Raises:
        FacePoserError: If a file cannot be used.
    """
    captures = []
    for i, path in enumerate(paths):
        progress.at("Reading the performances", i / len(paths))
        captures.append(read_recording(path))
        if len(captures[-1].weights) < _FEWEST_FRAMES:
            found = counted(len(captures[-1].weights), "frame")
            raise FacePoserError(
                f"The capture '{path}' has {found} with a face, too few to learn from; record at least "
                f"{_FEWEST_FRAMES} frames."
            )
    names = shapes_of(captures)
    recipe = Recipe()
    choice = choose_mixture(_folds(captures, names, recipe), progress, n_components, n_factors, recipe.fit_shrinkage)
    progress.at("Learning the prior", 0.0)
    recipe = replace(
        recipe, n_components=choice.n_components, n_factors=choice.n_factors, blend=max(choice.blend, recipe.blend)
    )
    with convergence_recorded() as messages:
        statistics = learn(captures, recipe, "Learned from the user's performances.", _metric(names))
    takes = tuple((path.name, len(capture.weights)) for path, capture in zip(paths, captures, strict=True))
    lost = tuple(capture.lost for capture in captures)
    assumptions = tuple(
        f"Capture '{path.name}': {note}"
        for path, capture in zip(paths, captures, strict=True)
        for note in capture.notes
    )
    return LearnedStatistics(
        statistics, replace(choice, converged=not messages), takes, missing_shapes(captures), lost, assumptions
    )


def _metric(names: Sequence[str]) -> Array:
    """Return the inner products of the man's shapes ``names``, so that errors count by the motion that they cause."""
    return gram_of_weights(load_character("man"), names)


def _folds(captures: Sequence[Capture], names: Sequence[str], recipe: Recipe) -> list[Fold]:
    """Return folds that each hold out one take, or a third of a single take."""
    cleaned = [clean(capture.with_shapes(names), recipe) for capture in captures]
    pieces = cleaned if len(cleaned) > 1 else np.array_split(cleaned[0], _BLOCKS)
    fewer = replace(recipe, n_examples=_EXAMPLES_TO_CHOOSE)
    folds = []
    for i, left_out in enumerate(pieces[:_BLOCKS]):
        rest = np.concatenate([piece for j, piece in enumerate(pieces) if j != i])
        if len(rest) and len(left_out):
            step = max(1, len(left_out) // _FRAMES_LEFT_OUT)
            folds.append((augment(rest, names, fewer), left_out[::step]))
    return folds
