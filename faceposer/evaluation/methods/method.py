"""Interface of the techniques of the comparison, from constraints to a face."""

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
    """A technique, prepared for one face.

    Subclasses define their name, the supported constraints, tuned parameters, and the solve. Learning and factorisation
    that do not depend on constraints belong in ``__init__``, since ``solve`` is timed.

    Attributes:
        name: Name in tables and options.
        title: Descriptive name.
        kinds: Supported kinds of constraints.
        parameters: Parameters tuned by ``faceposer evaluate --tune`` on folds of the training take.
        grid: Values of each parameter from which tuning chooses.
        natural_ends: Ends of these grids, by parameter, beyond which no values exist, such as all examples.
        requires: Optional package that it imports, without which a study skips it; None if there is none.
        max_trials: Largest number of trials of a cell, for slow techniques; None for all.
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
        """Prepare the method for ``setting``, with a value for each of the ``parameters``."""
        raise NotImplementedError

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the representation of the face found for ``constraints``, which ``vertices`` accepts."""
        raise NotImplementedError

    def vertices(self, found: Array) -> ArrayLike:
        """Return the vertices, shape (N, 3), of the face that ``solve`` returned."""
        raise NotImplementedError


def posed(model: FaceModel, coefficients: Array) -> ArrayLike:
    """Return the vertices, shape (N, 3), by which a pose with ``coefficients``, shape (r,), is evaluated.

    All techniques that find coefficients, and the scripts that study priors, use this function.
    """
    return model.instance(coefficients)


class ModelMethod(Method):
    """A technique that finds coefficients of a face model.

    Attributes:
        model: The face to which the coefficients, shape (r,), apply.
    """

    model: FaceModel

    def vertices(self, found: Array) -> ArrayLike:
        """Return the vertices, shape (N, 3), of the face with the coefficients ``found``, shape (r,)."""
        return posed(self.model, found)


def prepared(kind: type[Method], setting: StudyContext, **changes: Any) -> Method:
    """Return the method ``kind`` prepared for ``setting``, with its tuned parameters except ``changes``."""
    return kind(setting, {**kind.parameters, **changes})
