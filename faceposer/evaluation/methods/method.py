"""What a technique of the comparison is: from constraints to a face."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.evaluation.setting import StudyContext
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.registry import Constraint

Array = NDArray[np.float64]
#: Parameters by name.
Parameters = dict[str, Any]

KINDS = ("point", "distance", "stroke")


class Method:
    """A technique, prepared on one face.

    Subclasses say what they are called, what they can be told, which parameters they have been tuned to, and how they
    find a pose. All learning and factoring that does not depend on constraints belongs into ``__init__``: ``solve`` is
    timed.

    Attributes:
        name: As in tables.
        title: In words.
        kinds: The constraints that it understands.
        parameters: What ``faceposer evaluate --tune`` found best on the end of the training take.
        grid: The values of each parameter between which it chose.
        natural_ends: Ends of these grids, by parameter, beyond which there is nothing to offer, such as all examples.
        requires: An optional package that it imports, without which a study passes it over; None if there is none.
        max_trials: So many trials of a cell at most, of a technique too slow for all; None for all.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    kinds: ClassVar[tuple[str, ...]] = KINDS
    parameters: ClassVar[Parameters] = {}
    grid: ClassVar[dict[str, Sequence[Any]]] = {}
    natural_ends: ClassVar[dict[str, Sequence[Any]]] = {}
    requires: ClassVar[str | None] = None
    max_trials: ClassVar[int | None] = None

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Prepare the method for a ``setting``; ``parameters`` are complete."""
        raise NotImplementedError

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return what stands for the face that the method finds for ``constraints``, as ``vertices`` takes it."""
        raise NotImplementedError

    def vertices(self, found: Array) -> ArrayLike:
        """Return the vertices, shape (N, 3), of what ``solve`` returned."""
        raise NotImplementedError


def posed(model: FaceModel, coefficients: Array) -> ArrayLike:
    """Return the vertices, shape (N, 3), by which a pose with ``coefficients``, shape (r,), is judged.

    All techniques that find coefficients, and the scripts that study priors, make vertices here and nowhere else.
    """
    return model.instance(coefficients)


class ModelMethod(Method):
    """A technique that finds coefficients of a face model.

    Attributes:
        model: The face in whose coefficients, shape (r,), the method's answers are.
    """

    model: FaceModel

    def vertices(self, found: Array) -> ArrayLike:
        """Return the vertices, shape (N, 3), of the face with the coefficients ``found``, shape (r,)."""
        return posed(self.model, found)


def prepared(kind: type[Method], setting: StudyContext, **changes: Any) -> Method:
    """Return the method ``kind`` on a ``setting``, with its tuned parameters but for ``changes``."""
    return kind(setting, {**kind.parameters, **changes})
