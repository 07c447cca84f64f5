"""JSON report of a solve."""

from typing import Any

from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.solve.map_solver import Solution
from faceposer.solve.weight_fit import fit_weights


def solve_report(model: FaceModel, document: Document, solution: Solution) -> dict[str, Any]:
    """Return the report of ``solution`` for ``document``, ready for JSON (docs/session-format.md)."""
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
