"""Symmetry: edits on one side of the face are mirrored on the other; existing asymmetry is kept."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mirror import SurfaceMirror
from faceposer.model.character_mirror import TOLERANCE, character_mirror
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES, MIRRORED_POINTS
from faceposer.session.document import Document
from faceposer.session.session import Session
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint

# Least distance of a constraint from the middle to have a partner, as a share of the head's height.
_MIDDLE = 0.02


def surface_mirror(model: FaceModel) -> SurfaceMirror:
    """Return the mirror correspondence of the neutral face of ``model``."""
    return character_mirror(model.character)


@dataclass
class Symmetry:
    """Setting for mirrored gestures.

    Attributes:
        on: True if gestures are mirrored.
    """

    on: bool = False

    def partner(self, document: Document, index: int, model: FaceModel) -> int | None:
        """Return the index of the mirror partner of constraint ``index``, or None."""
        constraint = document.constraints[index]
        if isinstance(constraint, SketchConstraint):
            return _partner_of_sketch(document, index, constraint)
        image = _image_positions(constraint, model)
        if image is None:
            return None
        for i, other in enumerate(document.constraints):
            if i != index and other.kind == constraint.kind and len(other.points) == len(image):
                places = other.points.positions(model.character.vertices, model.triangles)
                if np.abs(places - image).max() <= 2.0 * TOLERANCE * model.character.height:
                    return i
        return None

    def with_partners(self, session: Session, indices: set[int]) -> set[int]:
        """Return ``indices`` with their mirror partners if symmetry is on, except locked ones."""
        if not self.on:
            return indices
        document = session.document
        partners = {self.partner(document, i, session.model) for i in indices}
        return indices | {i for i in partners if i is not None and not document.constraints[i].locked}


class Mirroring:
    """Mirrors the constraints changed by one gesture; created at its start and used at every move.

    Differences between the two sides at the start of the gesture are kept.
    """

    def __init__(self, symmetry: Symmetry, session: Session) -> None:
        """Start with the present state of ``session``."""
        self._symmetry = symmetry
        self._model = session.model
        self._pose: NDArray[np.float64] = session.coefficients
        self._partners: dict[int, int | None] = {}

    def partner(self, document: Document, index: int) -> int | None:
        """Return the mirror partner of constraint ``index`` of ``document``, determined once for the whole gesture.

        A gesture that changes the points of a constraint must call this first.
        """
        if self._symmetry.on and index not in self._partners:
            self._partners[index] = self._symmetry.partner(document, index, self._model)
        return self._partners.get(index)

    def with_images(self, document: Document, indices: list[int]) -> Document:
        """Return ``document`` with the mirror images of its constraints ``indices`` updated or added."""
        if not self._symmetry.on:
            return document
        for index in indices:
            constraint = document.constraints[index]
            if not _is_on_one_side(constraint, self._model):
                continue
            partner = self.partner(document, index)
            if partner in indices:
                continue
            image = constraint.mirrored(surface_mirror(self._model), self._model, self._pose)
            if image is None:
                continue
            if partner is None:
                self._partners[index] = len(document.constraints)
                document = replace(document, constraints=(*document.constraints, image))
            elif partner < len(document.constraints) and not document.constraints[partner].locked:
                document = document.with_constraint(partner, image)
            elif partner == len(document.constraints):
                document = replace(document, constraints=(*document.constraints, image))
        return document


def _is_on_one_side(constraint: Constraint, model: FaceModel) -> bool:
    """Return True if ``constraint`` has a mirror image, other than itself."""
    if isinstance(constraint, SketchConstraint):
        names = {name for name, _ in constraint.matched}
        sided = {name for name in names if MIRRORED_POINTS[name] != name}
        return bool(sided) and not any(MIRRORED_POINTS[name] in names for name in sided)
    return _image_positions(constraint, model) is not None


def _partner_of_sketch(document: Document, index: int, sketch: SketchConstraint) -> int | None:
    """Return the index of the sketch of the mirrored feature points, the newest one, or None."""
    image = {MIRRORED_POINTS[name] for name, _ in sketch.matched}
    for i, other in reversed(list(enumerate(document.constraints))):
        if i == index or not isinstance(other, SketchConstraint):
            continue
        if other.feature == FEATURES[sketch.feature].mirror and {name for name, _ in other.matched} == image:
            return i
    return None


def image_of(constraint: Constraint, session: Session) -> Constraint | None:
    """Return the mirror image of ``constraint`` for the present pose of ``session``, or None if it has none."""
    if not _is_on_one_side(constraint, session.model):
        return None
    image: Constraint | None = constraint.mirrored(surface_mirror(session.model), session.model, session.coefficients)
    return image


def _image_positions(constraint: Constraint, model: FaceModel) -> NDArray[np.float64] | None:
    """Return the image of the points of ``constraint`` on the neutral face, or None if it is in the middle."""
    if not len(constraint.points):
        return None
    points = surface_mirror(model).points(constraint.points)
    if points is None:
        return None
    places = points.positions(model.character.vertices, model.triangles)
    off_middle = abs(float(places[:, 0].mean()))
    return places if off_middle > _MIDDLE * model.character.height else None
