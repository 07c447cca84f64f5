"""Drawn features from Python: a mixin of ``Face``."""

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from faceposer.api import checks
from faceposer.api.places import Pixels, pixels_of
from faceposer.errors import FacePoserError, article
from faceposer.geometry.camera import Camera
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.model.framing import face_view
from faceposer.session.session import Session
from faceposer.session.sketch_strokes import add_stroke
from faceposer.sketch.recognition import DrawnStroke, Recognition
from faceposer.solve.constraints.base import LARGEST_WEIGHT
from faceposer.solve.constraints.codec import LARGEST_PIXEL
from faceposer.solve.constraints.sketch import MOST_STROKE_POINTS, SKETCH_METHODS, SketchMethod

if TYPE_CHECKING:
    from faceposer.sketch.drawing import RecognisedDrawing


class _Face(Protocol):
    """Members of ``Face`` that this mixin uses."""

    session: Session

    @property
    def model(self) -> FaceModel: ...

    @property
    def character(self) -> Character: ...

    def _checked_camera(self, camera: Camera | None) -> Camera: ...


class SketchingMixin:
    """Methods of ``Face`` for drawn features."""

    session: Session

    def sketch(
        self: _Face,
        stroke: Pixels,
        feature: str | None = None,
        camera: Camera | None = None,
        recognition: str | None = None,
        weight: float = 1.0,
    ) -> Recognition:
        """Add a sketch: the feature that ``stroke`` depicts takes its shape (docs/sketching-files.md).

        An earlier sketch that the stroke covers by more than half is replaced.

        Args:
            stroke: Pixels along the stroke in the order of drawing, shape (n, 2).
            feature: Name of the feature, such as "left brow"; recognised if None.
            camera: The view in which it is drawn.
            recognition: Method that recognises the feature, "ours" or "paper"; the default if None.
            weight: Factor on the energy of the constraint.

        Returns:
            The recognition: ``best`` has the feature and its points, and the constraint is the last of ``constraints``.

        Raises:
            FacePoserError: If the stroke depicts no feature, or the face has too many strokes.
        """
        # Imported late: it loads all that recognises.
        from faceposer.sketch.sketcher import RECOGNISERS

        character = self.model.character
        checks.number(weight, 0.0, LARGEST_WEIGHT, "The weight of a constraint")
        pixels = pixels_of(stroke)
        if not 2 <= len(pixels) <= MOST_STROKE_POINTS:
            raise FacePoserError(f"A stroke must have from 2 to {MOST_STROKE_POINTS} points, not {len(pixels)}.")
        if np.abs(pixels).max() > LARGEST_PIXEL:
            raise FacePoserError(f"The pixels of a stroke must be from {-LARGEST_PIXEL:g} to {LARGEST_PIXEL:g}.")
        if feature is not None:
            checks.one_of(feature, tuple(FEATURES), "A feature")
            missing = [name for name in FEATURES[feature].points if name not in character.feature_points]
            if missing:
                raise FacePoserError(
                    f"'{character.title}' has no {feature}: it lacks the feature points {', '.join(missing)}."
                )
        if recognition is not None:
            checks.one_of(recognition, tuple(RECOGNISERS), "A method of recognition")
        drawn = DrawnStroke(np.array(pixels), self._checked_camera(camera), feature)
        found, sketch = add_stroke(self.session, drawn, recognition, weight)
        if sketch is None and feature is not None:
            why = found.reason or "it does not match its feature points"
            raise FacePoserError(f"The stroke cannot be {article(feature)} {feature}: {why}.")
        if sketch is None:
            guess = f": {found.reason}" if found.reason else ""
            if found.candidates:
                likely = found.candidates[0].feature
                guess = f"; if it is {article(likely)} {likely}, say so with 'feature'"
            raise FacePoserError(f"The stroke depicts no feature of the face{guess}.")
        return found

    def sketch_drawing(
        self: _Face, path: str | Path, camera: Camera | None = None, relative: str | Path = "auto"
    ) -> "RecognisedDrawing":
        """Add the lines of a drawing in SVG as sketches, in place of earlier ones (docs/drawings.md).

        Args:
            path: The SVG file.
            camera: The view of the face that it shows; the front view if None.
            relative: The neutral face by which it is judged: "auto" for its layer "neutral" or an assumed one, "off" to
                take its lines as they are, or the path of a drawing of it.

        Returns:
            What each line depicts; the sketches are the last of ``constraints``.

        Raises:
            FacePoserError: If the file cannot be read or shows no face, or the face has too many strokes.
        """
        # Imported late: it loads all that recognises.
        from faceposer.session.drawings import Relative, add_sketches, read_drawing

        checked = face_view(self.character).camera((960, 960)) if camera is None else self._checked_camera(camera)
        drawing = checks.file_path(path)
        found, sketches = read_drawing(self.model, drawing, checked, Relative.of(str(relative)))
        add_sketches(self.session, sketches, drawing.name)
        return found

    @property
    def sketch_method(self) -> SketchMethod:
        """Way from sketches to the face: "map", constraints of the solve, or "paper", the statistical mapping."""
        return self.session.document.sketch_method

    @sketch_method.setter
    def sketch_method(self, method: SketchMethod) -> None:
        self.session.set_sketch_method(checks.one_of(method, SKETCH_METHODS, "The method of sketches"))
