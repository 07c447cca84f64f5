"""Errors of the constraints at a pose, and JSON reports of a solve and of recognised strokes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.sketch.recognition import DrawnStroke, Recognition
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import Solution


class Residuals:
    """Errors of constraints in pixels, computed once per revision of a session."""

    def __init__(self) -> None:
        self._found: tuple[int, tuple[float, ...]] | None = None

    def at(
        self, revision: int, model: FaceModel, constraints: Sequence[Constraint], pose: NDArray[np.float64]
    ) -> tuple[float, ...]:
        """Return the error of each constraint at the ``pose`` of ``revision``, shape (r,)."""
        if self._found is None or self._found[0] != revision:
            self._found = (revision, tuple(constraint.residual_px(model, pose) for constraint in constraints))
        return self._found[1]

    def keep(self, revision: int, found: tuple[float, ...]) -> None:
        """Keep the errors ``found`` by the solve whose pose is that of ``revision``."""
        self._found = (revision, found)


def solve_report(model: FaceModel, document: Document, solution: Solution) -> dict[str, Any]:
    """Return the report of ``solution`` for ``document``, ready for JSON (docs/session-format.md)."""
    # SciPy's optimisers are slow to import, and sessions are opened at the start of the window.
    from faceposer.solve.weight_fit import fit_weights

    return {
        "energy": solution.energy,
        "iterations": solution.iterations,
        "evaluations": solution.evaluations,
        "seconds": solution.seconds,
        "coefficients": solution.coefficients.tolist(),
        "weights": fit_weights(model, solution.coefficients),
        "constraints": [
            {"type": constraint.kind, "residual_px": residual}
            for constraint, residual in zip(document.constraints, solution.residuals_px, strict=True)
        ],
    }


def sketch_report(strokes: Sequence[DrawnStroke], recognised: Sequence[Recognition], seconds: float) -> dict[str, Any]:
    """Return the report of ``strokes`` as ``recognised`` in ``seconds``, for JSON (docs/sketching-files.md)."""
    pairs = zip(strokes, recognised, strict=True)
    return {"strokes": [_stroke_report(stroke.feature, found) for stroke, found in pairs], "seconds": seconds}


def _stroke_report(named: str | None, found: Recognition) -> dict[str, Any]:
    best, other = found.best, found.runner_up
    nothing = max(0.0, 1.0 - sum(candidate.probability for candidate in found.candidates))
    points = () if best is None else best.points
    if best is not None:
        probability: float | None = best.probability
    else:
        # A stroke whose feature is named depicts that one, even if it cannot be placed.
        probability = nothing if named is None else None
    return {
        "named": named,
        "feature": None if best is None else best.feature,
        "probability": probability,
        "runner_up": None if other is None else other.feature,
        "reason": found.reason or None,
        "points": [
            {"feature_point": point.feature_point, "pixel": list(point.pixel), "probability": point.probability}
            for point in points
        ],
    }
