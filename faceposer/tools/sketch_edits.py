"""Edits of sketches: a stroke that becomes a feature, another feature for it, and both on the other side, too."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, reduce

import numpy as np

from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.strokes import smoothed
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import feature_curves
from faceposer.model.framing import face_view
from faceposer.session.document import Document
from faceposer.session.session import Session
from faceposer.session.sketching import session_sketcher, sketch_of
from faceposer.sketch.combining import combined
from faceposer.sketch.recognition import Candidate, DrawnStroke
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.tools.symmetry import Symmetry, image_of
from faceposer.tools.tool import ToolContext


def depicting(sketch: SketchConstraint, candidate: Candidate) -> SketchConstraint:
    """Return ``sketch`` with the feature and the matched points of ``candidate``."""
    matched = tuple((point.feature_point, point.pixel) for point in candidate.points)
    return replace(sketch, feature=candidate.feature, matched=matched, traced=None)


def with_sketch(
    session: Session, document: Document, sketch: SketchConstraint, symmetric: bool
) -> tuple[Document, int, tuple[SketchConstraint, ...]]:
    """Return ``document`` with the new ``sketch``, with its mirror image if ``symmetric``.

    Sketches of the same parts of the features are replaced; other parts add up.

    Returns:
        The document, the index of the sketch in it, and the sketches that were replaced.

    Raises:
        ValueError: If the stroke does not meet the feature.
    """
    sketch = sketch.resolved(session.model, session.coefficients)
    image = image_of(sketch, session) if symmetric else None
    before = document.constraints
    constraints = combined(before, sketch)
    if isinstance(image, SketchConstraint):
        constraints = combined(constraints, image)
    kept = {id(constraint) for constraint in constraints}
    replaced = tuple(c for c in before if isinstance(c, SketchConstraint) and id(c) not in kept)
    index = next(i for i, constraint in enumerate(constraints) if constraint is sketch)
    return replace(document, constraints=tuple(constraints)), index, replaced


def with_feature(
    session: Session,
    index: int,
    changed: SketchConstraint,
    restored: Sequence[SketchConstraint],
    symmetry: Symmetry,
) -> tuple[Document, int, tuple[SketchConstraint, ...]]:
    """Return the document with sketch ``index`` changed to ``changed``, and with symmetry also its mirror partner.

    The sketches ``restored``, which it had replaced as another feature, return.

    Returns:
        As of ``with_sketch``.
    """
    document = session.document
    removed = symmetry.with_partners(session, {index})
    kept = tuple(c for i, c in enumerate(document.constraints) if i not in removed)
    for sketch in restored:
        if sketch not in kept:
            # What is left of it in parts makes place for the whole.
            kept = combined(kept, sketch)
    return with_sketch(session, replace(document, constraints=kept), changed, symmetry.on)


def prepare_recognition(model: FaceModel) -> None:
    """Fit the recogniser of ``model``, and use it once: later strokes do not wait for what is made when needed."""
    character = model.character
    camera = face_view(character).camera((800, 800))
    for curves in feature_curves(character).values():
        places = curves[0].points.positions(character.vertices, character.triangles)
        stroke = DrawnStroke(smoothed(camera.project(places)), camera)
        best = session_sketcher(model).recognise(stroke, model.neutral()).best
        if best is not None:
            sketch_of(stroke, best).resolved(model, model.neutral())
            return


@lru_cache(maxsize=2)
def drawable_points(character: Character) -> SurfacePoints:
    """Return points along the features that can be drawn on ``character``."""
    chains = [curve.points for curves in feature_curves(character).values() for curve in curves]
    return reduce(SurfacePoints.joined, chains)


def inside(box: tuple[float, float, float, float] | None, position: tuple[float, float]) -> bool:
    """Return True if ``position`` is in the ``box`` of left, top, right and bottom."""
    return box is not None and box[0] <= position[0] < box[2] and box[1] <= position[1] < box[3]


def drawn_in(sketch: SketchConstraint, context: ToolContext) -> bool:
    """Return True if the view is the one in which ``sketch`` was drawn."""
    return sketch.camera.same_viewpoint(context.camera)


def length(path: Sequence[tuple[float, float]]) -> float:
    """Return the length of ``path``."""
    return float(np.hypot(*np.diff(np.array(path), axis=0).T).sum()) if len(path) > 1 else 0.0
