"""Photos in a document: what goes along when a camera is found anew, and the expression that pins tell."""

from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import Any

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.photo.photo import Photo
from faceposer.photo.places import anchor_of
from faceposer.photo.posing import expression_constraints
from faceposer.session.document import Document
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint


def with_photo(document: Document, index: int, photo: Photo) -> Document:
    """Return ``document`` with photo ``index`` exchanged; what was drawn through its camera goes along with it."""
    before, after = document.photos[index].camera, photo.camera
    photos = (*document.photos[:index], photo, *document.photos[index + 1 :])
    constraints = document.constraints
    if before is not None and after is not None and before != after:
        constraints = tuple(_followed(constraint, before, after) for constraint in constraints)
    return replace(document, photos=photos, constraints=constraints)


def _followed(constraint: Constraint, before: Camera, after: Camera) -> Constraint:
    """Return ``constraint`` under ``after`` if it was drawn under ``before``: on the photo it stays."""
    camera = constraint.camera
    if camera is None or not camera.same_viewpoint(before):
        return constraint
    focal = camera.focal * after.focal / before.focal
    drawn: Any = constraint
    moved = replace(camera, rotation=after.rotation, translation=after.translation, focal=focal)
    followed: Constraint = replace(drawn, camera=moved)
    return followed


def with_expression(document: Document, model: FaceModel, photo: Photo) -> Document:
    """Return ``document`` with what the pins of ``photo`` tell of the expression instead of what they told before.

    Raises:
        ValueError: If the photo has no camera yet.
    """
    pinned = {anchor_of(pin.place, model.character) for pin in photo.pins}
    told = expression_constraints(photo, model, document.start, document.prior_weight, document.prior, document.spread)
    kept = [constraint for constraint in document.constraints if not _told(constraint, photo, pinned)]
    # The eyes look one way.
    if any(isinstance(constraint, GazeConstraint) for constraint in kept if constraint.locked):
        told = tuple(constraint for constraint in told if not isinstance(constraint, GazeConstraint))
    elif any(isinstance(constraint, GazeConstraint) for constraint in told):
        kept = [constraint for constraint in kept if not isinstance(constraint, GazeConstraint)]
    return replace(document, constraints=(*kept, *told))


def _told(constraint: Constraint, photo: Photo, pinned: AbstractSet[object]) -> bool:
    """Whether ``constraint`` came from a pin of ``photo``: it was drawn through its camera, at ``pinned`` places."""
    if isinstance(constraint, PointConstraint):
        anchors: tuple[object, ...] = (constraint.anchor,)
    elif isinstance(constraint, DistanceConstraint):
        anchors = constraint.anchors
    else:
        return False
    through = photo.camera is not None and constraint.camera.same_viewpoint(photo.camera)
    return through and not constraint.locked and pinned >= set(anchors)
