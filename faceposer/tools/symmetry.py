"""Symmetry: what is drawn on one side of the face is drawn on the other too; what is uneven already stays so."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mirror import SurfaceMirror
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.session.session import Session
from faceposer.solve.constraints.registry import Constraint

# Shares of the head's height: how far a point may lie from the image of another, and how far from the middle something
# must lie to have another side.
_TOLERANCE = 0.003
_MIDDLE = 0.02


@lru_cache(maxsize=2)
def mirror_of(model: FaceModel) -> SurfaceMirror:
    """Return the mirror of the neutral face of ``model``."""
    return SurfaceMirror(model.character.vertices, model.triangles, _TOLERANCE * model.character.height)


@dataclass
class Symmetry:
    """Whether gestures are mirrored, and how.

    Attributes:
        on: Whether they are.
    """

    on: bool = False

    def partner(self, document: Document, index: int, model: FaceModel) -> int | None:
        """Return the index of the constraint that lies across from constraint ``index``, or None."""
        constraint = document.constraints[index]
        across = _across(constraint, model)
        if across is None:
            return None
        for i, other in enumerate(document.constraints):
            if i != index and other.kind == constraint.kind and len(other.points) == len(across):
                places = other.points.positions(model.character.vertices, model.triangles)
                if np.abs(places - across).max() <= 2.0 * _TOLERANCE * model.character.height:
                    return i
        return None

    def with_partners(self, session: Session, indices: set[int]) -> set[int]:
        """Return ``indices`` with what lies across from them, if symmetry is on; what is locked is left out."""
        if not self.on:
            return indices
        document = session.document
        partners = {self.partner(document, i, session.model) for i in indices}
        return indices | {i for i in partners if i is not None and not document.constraints[i].locked}


class Mirroring:
    """Mirrors the constraints that one gesture changes: made when it begins, asked at every move.

    Distances that two sides have from being mirror images when the gesture begins are kept.
    """

    def __init__(self, symmetry: Symmetry, session: Session) -> None:
        """Look at ``session`` as it is now."""
        self._symmetry = symmetry
        self._model = session.model
        self._pose: NDArray[np.float64] = session.coefficients
        self._partners: dict[int, int | None] = {}

    def find(self, document: Document, index: int) -> int | None:
        """Return what lies across from constraint ``index`` of ``document``, looked up once for the whole gesture.

        A gesture that changes which points a constraint speaks of asks before it does.
        """
        if self._symmetry.on and index not in self._partners:
            self._partners[index] = self._symmetry.partner(document, index, self._model)
        return self._partners.get(index)

    def applied(self, document: Document, indices: list[int]) -> Document:
        """Return ``document`` with the images of its constraints ``indices`` brought up to date, or added."""
        if not self._symmetry.on:
            return document
        for index in indices:
            constraint = document.constraints[index]
            if _across(constraint, self._model) is None:
                continue
            partner = self.find(document, index)
            if partner in indices:
                continue
            image = constraint.mirrored(mirror_of(self._model), self._model, self._pose)
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


def _across(constraint: Constraint, model: FaceModel) -> NDArray[np.float64] | None:
    """Return where the image of ``constraint`` lies on the neutral face, or None if it has no other side."""
    if not len(constraint.points):
        return None
    points = mirror_of(model).points(constraint.points)
    if points is None:
        return None
    places = points.positions(model.character.vertices, model.triangles)
    off_middle = abs(float(places[:, 0].mean()))
    return places if off_middle > _MIDDLE * model.character.height else None
