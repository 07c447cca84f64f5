"""Whole drawings that become sketches of a session."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.progress import Progress
from faceposer.session.effort import check_room
from faceposer.session.session import Session
from faceposer.session.sketching import session_sketcher, sketch_of
from faceposer.solve.constraints.sketch import SketchConstraint

if TYPE_CHECKING:
    from faceposer.sketch.drawing import RecognisedDrawing

#: Suffix of drawings.
SUFFIX = ".svg"


@dataclass(frozen=True)
class Relative:
    """The neutral face by which drawings are judged.

    Attributes:
        on: False if drawings are taken as they are.
        neutral: A drawing of the same face without an expression, or None to use the layer "neutral" or statistics.
    """

    on: bool = True
    neutral: Path | None = None

    @classmethod
    def of(cls, text: str) -> "Relative":
        """Return the neutral face for "auto", "off" or the path of a drawing."""
        return cls(text != "off", None if text in {"auto", "off"} else Path(text))


def read_drawing(
    model: FaceModel, path: Path, camera: Camera, relative: Relative | None = None, progress: Progress | None = None
) -> "tuple[RecognisedDrawing, tuple[SketchConstraint, ...]]":
    """Return what the SVG file ``path`` depicts, and a sketch for each of its features, resolved.

    Args:
        model: The character.
        path: The drawing.
        camera: The view of the face that it shows.
        relative: The neutral face of the drawing.
        progress: Receives the progress, and may stop the work.

    Raises:
        FacePoserError: If a file cannot be read or shows no face.
    """
    # Imported late to shorten the start of the window.
    from faceposer.sketch.drawing import recognise_drawing
    from faceposer.sketch.svg_file import read_svg

    relative, progress = relative or Relative(), progress or Progress()
    progress.at("Reading the drawing", 0.0)
    drawing = read_svg(path)
    neutral = None if relative.neutral is None else read_svg(relative.neutral)
    try:
        found = recognise_drawing(session_sketcher(model), drawing, camera, relative.on, neutral, progress)
    except FacePoserError as error:
        raise FacePoserError(f"'{path}': {error}") from error
    sketches, strokes = [], []
    for stroke in found.strokes:
        sketch = None
        if stroke.candidate is not None:
            with suppress(ValueError):
                sketch = sketch_of(stroke.stroke, stroke.candidate).resolved(model, model.neutral())
                sketches.append(sketch)
        strokes.append(stroke if sketch is not None else replace(stroke, candidate=None))
    if not sketches:
        raise FacePoserError(f"'{path}': no line of the drawing matches a feature of '{model.character.title}'.")
    return replace(found, strokes=tuple(strokes)), tuple(sketches)


def add_sketches(session: Session, sketches: Sequence[SketchConstraint], name: str) -> None:
    """Replace the sketches of ``session`` by those of the drawing ``name``, as one step; locked ones remain.

    Raises:
        FacePoserError: If the session has no room for the sketches.
    """
    document = session.document
    kept = [c for c in document.constraints if not isinstance(c, SketchConstraint) or c.locked]
    check_room(kept, len(sketches))
    with session.edit(f"Open the drawing {name}"):
        session.replace(replace(document, constraints=(*kept, *sketches)))


def drawing_report(found: "RecognisedDrawing", seconds: float) -> dict[str, Any]:
    """Return the report of a drawing, for JSON (docs/drawings.md), after ``seconds`` of work."""
    strokes = []
    for stroke in found.strokes:
        best, other = stroke.candidate, stroke.runner_up
        strokes.append(
            {
                "name": stroke.name,
                "feature": None if best is None else best.feature,
                "probability": None if best is None else best.probability,
                "runner_up": None if other is None else other.feature,
                "only_aligns": stroke.only_aligns,
                "joined": stroke.joined,
                "points": [
                    {"feature_point": p.feature_point, "pixel": list(p.pixel), "probability": p.probability}
                    for p in (() if best is None else best.points)
                ],
            }
        )
    return {
        "strokes": strokes,
        "alignment": {"scale": found.scale, "rotation_degrees": math.degrees(found.rotation)},
        "relative": found.relative,
        "remarks": list(found.remarks),
        "seconds": seconds,
    }


def summary(found: "RecognisedDrawing") -> str:
    """Return a sentence on what was recognised in a drawing."""
    features = [stroke.candidate.feature for stroke in found.strokes if stroke.candidate is not None]
    joined = sum(stroke.joined is not None for stroke in found.strokes)
    rest = len(found.strokes) - len(features) - joined
    said = f"Recognised {', '.join(features)}"
    if rest:
        said += f"; {rest} {'line is' if rest == 1 else 'lines are'} no such feature"
    return f"{said}{''.join(f'; {remark}' for remark in found.remarks)}"
