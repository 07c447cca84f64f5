"""Strokes that become sketches of a session: recognised, and combined with what has been drawn before."""

from collections.abc import Sequence
from dataclasses import replace

from faceposer.errors import FacePoserError
from faceposer.model.character import Character
from faceposer.model.feature_curves import drawable_features
from faceposer.progress import Progress
from faceposer.session.effort import check_effort, check_room
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

    Raises:
        FacePoserError: If no feature can be drawn on the character, or the session would have too many strokes.
    """
    # Imported late: it loads all that recognises.
    from faceposer.sketch.sketcher import DEFAULT_RECOGNITION

    model, document = session.model, session.document
    _check_drawable(model.character)
    method = DEFAULT_RECOGNITION if recognition is None else recognition
    found = session_sketcher(model).recognise(
        stroke, session.coefficients, drawn_strokes(document.constraints), stroke.feature, method
    )
    # A feature that was given need not be probable.
    best = found.best if stroke.feature is None else next(iter(found.candidates), None)
    if best is None or not best.points:
        return replace(found, accepted=False), None
    try:
        sketch = sketch_of(stroke, best, weight).resolved(model, session.coefficients)
    except ValueError as error:
        return replace(found, accepted=False, reason=str(error)), None
    constraints = combined(document.constraints, sketch)
    check_effort(constraints)
    with session.edit(f"Sketch the {best.feature}"):
        session.replace(replace(document, constraints=constraints))
    return replace(found, accepted=True), sketch


def add_strokes(
    session: Session,
    strokes: Sequence[DrawnStroke],
    recognition: str | None = None,
    progress: Progress | None = None,
) -> tuple[Recognition, ...]:
    """Recognise ``strokes`` and add them to the constraints one by one; the face follows after each.

    Raises:
        FacePoserError: If no feature can be drawn on the character, the session has no room for the strokes, or the
            constraints have no solution.
    """
    _check_drawable(session.model.character)
    check_room(session.document.constraints, len(strokes))
    progress = progress or Progress()
    found = []
    for i, stroke in enumerate(strokes):
        progress.at("Sketching", i / len(strokes))
        found.append(add_stroke(session, stroke, recognition)[0])
        session.wait()
    return tuple(found)


def _check_drawable(character: Character) -> None:
    """Raise a FacePoserError if the ``character`` has no feature that can be drawn."""
    if not drawable_features(character):
        raise FacePoserError(
            f"No feature can be drawn on '{character.title}', since it lacks the feature points of brows, eyes, mouth, "
            "nose and jaw; import it again from a rig with ARKit's shape names, or with its textures, which show them."
        )
