"""Strokes that become sketches of a session: recognised, and combined with what has been drawn before."""

from collections.abc import Sequence
from dataclasses import replace

from faceposer.progress import Progress
from faceposer.session.session import Session
from faceposer.session.sketching import drawn_strokes, session_sketcher, sketch_of
from faceposer.sketch.combining import combined
from faceposer.sketch.recognition import DrawnStroke, Recognition
from faceposer.solve.constraints.sketch import SketchConstraint


def add_stroke(
    session: Session, stroke: DrawnStroke, recognition: str | None = None, weight: float = 1.0
) -> tuple[Recognition, SketchConstraint | None]:
    """Recognise ``stroke`` and add it to the constraints, as one step.

    Args:
        session: The session; its pose and sketches are taken into account.
        stroke: The stroke; if it has a feature, only the points of that are matched.
        recognition: Name of the method of recognition, one of ``RECOGNISERS``; the default if None.
        weight: Weight of the constraint.

    Returns:
        The recognition, and the constraint; None if no feature was recognised, and nothing has changed.
    """
    # Imported late: it loads all that recognises.
    from faceposer.sketch.sketcher import DEFAULT_RECOGNITION

    model, document = session.model, session.document
    method = DEFAULT_RECOGNITION if recognition is None else recognition
    found = session_sketcher(model).recognise(
        stroke, session.coefficients, drawn_strokes(document), stroke.feature, method
    )
    # A feature that was given need not be probable.
    best = found.best if stroke.feature is None else next(iter(found.candidates), None)
    if best is None or not best.points:
        return replace(found, accepted=False), None
    try:
        sketch = sketch_of(stroke, best, weight).resolved(model, session.coefficients)
    except ValueError:
        return replace(found, accepted=False), None
    with session.edit(f"Sketch the {best.feature}"):
        session.replace(replace(document, constraints=combined(document.constraints, sketch)))
    return replace(found, accepted=True), sketch


def add_strokes(
    session: Session,
    strokes: Sequence[DrawnStroke],
    recognition: str | None = None,
    progress: Progress | None = None,
) -> tuple[Recognition, ...]:
    """Recognise ``strokes`` and add them to the constraints one by one; the face follows after each.

    Raises:
        FacePoserError: If the constraints have no solution.
    """
    progress = progress or Progress()
    found = []
    for i, stroke in enumerate(strokes):
        progress.at("Sketching", i / len(strokes))
        found.append(add_stroke(session, stroke, recognition)[0])
        session.wait(timeout=600.0)
    return tuple(found)
