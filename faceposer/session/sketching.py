"""Sketches of a document: the sketcher of its character, and the problem that its constraints pose to the solver."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import weights_on
from faceposer.poses.library import starter_poses
from faceposer.session.document import Document
from faceposer.sketch.recognition import Candidate, DrawnStroke
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import as_pixels
from faceposer.solve.priors import Prior
from faceposer.solve.problem import PoseProblem

if TYPE_CHECKING:
    from faceposer.sketch.sketcher import Sketcher

Array = NDArray[np.float64]

# Number of strokes that are kept for recognition.
_MOST_STROKES = 500


@dataclass(frozen=True)
class _Matched:
    """What the paper's face depends on in a sketch."""

    camera: Camera
    matched: tuple[tuple[str, tuple[float, float]], ...]


@lru_cache(maxsize=2)
def session_sketcher(model: FaceModel) -> "Sketcher":
    """Return the sketcher of ``model``, which learns from the poses of the program's library, among others.

    The user's own poses are left out, so that strokes are recognised alike on every computer.
    """
    # Imported late to shorten the start of the window.
    from faceposer.sketch.sketcher import sketcher_of

    return sketcher_of(model, library_poses(model))


def library_poses(model: FaceModel) -> tuple[Array, ...]:
    """Return the poses of the program's library that apply to the character, each of shape (r,)."""
    weights = (weights_on(entry.pose, model.character) for entry in starter_poses() if entry.pose is not None)
    return tuple(model.coefficients_of(row) for row in weights if row is not None and row.any())


def active_sketches(document: Document) -> tuple[SketchConstraint, ...]:
    """Return the sketches of ``document`` that act on the face."""
    return _active(document.constraints)


def _active(constraints: Iterable[Constraint]) -> tuple[SketchConstraint, ...]:
    return tuple(c for c in constraints if isinstance(c, SketchConstraint) and c.enabled and c.weight > 0)


@lru_cache(maxsize=_MOST_STROKES)
def drawn_stroke(sketch: SketchConstraint) -> DrawnStroke:
    """Return the stroke of ``sketch`` for recognition, the same object for the same sketch."""
    return DrawnStroke(np.array(sketch.stroke), sketch.camera, sketch.feature)


def drawn_strokes(constraints: Iterable[Constraint]) -> tuple[DrawnStroke, ...]:
    """Return the strokes of the active sketches among ``constraints``, with their features."""
    return tuple(drawn_stroke(sketch) for sketch in _active(constraints))


def solver_input(model: FaceModel, document: Document) -> tuple[tuple[Constraint, ...], Array | None]:
    """Return the constraints of ``document`` for the solver and the start pose, shape (r,), or None for neutral.

    With the method "paper", the start is the paper's face for the active sketches; as constraints, these remain in
    their places in the list, disabled.
    """
    sketches = active_sketches(document)
    if document.sketch_method == "map" or not sketches:
        return document.constraints, document.start
    start = model.neutral() if document.start is None else document.start
    inactive: list[Constraint] = [
        replace(c, enabled=False) if isinstance(c, SketchConstraint) else c for c in document.constraints
    ]
    drawn = tuple(_Matched(sketch.camera, sketch.matched) for sketch in sketches)
    return tuple(inactive), _paper_pose(model, drawn, start.tobytes())


def pose_problem(model: FaceModel, document: Document) -> PoseProblem:
    """Return the problem whose solution is the pose of ``document``."""
    constraints, start = solver_input(model, document)
    prior = prior_of(document)
    return PoseProblem(model, constraints, start, document.prior_weight, prior=prior, spread=document.spread)


def prior_of(document: Document) -> Prior:
    """Return the prior for the solver.

    The plain prior does not depend on the start; where that is the paper's face, the prior by region takes its place.
    """
    if document.prior == "plain" and document.sketch_method == "paper" and active_sketches(document):
        return "regions"
    return document.prior


def sketch_of(stroke: DrawnStroke, candidate: Candidate, weight: float = 1.0) -> SketchConstraint:
    """Return the constraint for ``stroke`` as ``candidate``; it is not resolved to points of the face."""
    matched = tuple((point.feature_point, point.pixel) for point in candidate.points)
    return SketchConstraint(as_pixels(stroke.pixels), stroke.camera, candidate.feature, matched, weight=weight)


@lru_cache(maxsize=2)
def _paper_pose(model: FaceModel, drawn: tuple[_Matched, ...], start: bytes) -> Array:
    """Return the paper's face, shape (r,), cached since the sketches stay while other constraints are dragged."""
    pose = np.array(session_sketcher(model).paper_pose(drawn, np.frombuffer(start)), dtype=np.float64)
    pose.setflags(write=False)
    return pose
