"""Edits of a document's photos: constraints that follow a photo's camera, and the expression given by its pins."""

from collections.abc import Set as AbstractSet
from dataclasses import replace
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError
from faceposer.files.paths import same_file
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.photo.photo import Photo
from faceposer.photo.places import anchor_of
from faceposer.photo.posing import expression_constraints
from faceposer.session.document import Document
from faceposer.session.sketching import prior_of, solver_input
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint


def check_no_photo(document: Document, path: Path) -> None:
    """Check that a picture written to ``path`` would not overwrite a photo of ``document``.

    Raises:
        FacePoserError: If it would.
    """
    for photo in document.photos:
        if same_file(path, photo.path):
            raise FacePoserError(f"'{path}' is a photo of the session; give the picture another name.")


def with_photo(document: Document, index: int, photo: Photo) -> Document:
    """Return ``document`` with photo ``index`` replaced; constraints drawn in its view move with its camera."""
    before, after = document.photos[index].camera, photo.camera
    photos = (*document.photos[:index], photo, *document.photos[index + 1 :])
    constraints = document.constraints
    if before is not None and after is not None and before != after:
        constraints = tuple(_moved_with_camera(constraint, before, after) for constraint in constraints)
    return replace(document, photos=photos, constraints=constraints)


def _moved_with_camera(constraint: Constraint, before: Camera, after: Camera) -> Constraint:
    """Return ``constraint`` under the camera ``after`` if it was drawn under ``before``: its pixels are unchanged."""
    camera = constraint.camera
    if camera is None or not camera.same_viewpoint(before):
        return constraint
    focal = camera.focal * after.focal / before.focal
    drawn: Any = constraint
    new_camera = replace(camera, rotation=after.rotation, translation=after.translation, focal=focal)
    moved: Constraint = replace(drawn, camera=new_camera)
    return moved


def pose_from_photo(document: Document, model: FaceModel, photo: Photo) -> Document:
    """Return ``document`` with the constraints given by the pins of ``photo`` in place of their earlier ones.

    Raises:
        ValueError: If the photo has no camera yet.
    """
    pinned = {anchor_of(pin.place, model.character) for pin in photo.pins}
    start = solver_input(model, document)[1]
    added = expression_constraints(photo, model, start, document.prior_weight, prior_of(document), document.spread)
    kept = [constraint for constraint in document.constraints if not _is_from_pin(constraint, photo, pinned)]
    # A document has at most one gaze constraint: a locked one is kept, any other is replaced.
    if any(isinstance(constraint, GazeConstraint) for constraint in kept if constraint.locked):
        added = tuple(constraint for constraint in added if not isinstance(constraint, GazeConstraint))
    elif any(isinstance(constraint, GazeConstraint) for constraint in added):
        kept = [constraint for constraint in kept if not isinstance(constraint, GazeConstraint)]
    return replace(document, constraints=(*kept, *added))


def _is_from_pin(constraint: Constraint, photo: Photo, pinned: AbstractSet[object]) -> bool:
    """Return True if ``constraint`` was made from pins of ``photo``: under its camera, at ``pinned`` places."""
    if isinstance(constraint, PointConstraint):
        anchors: tuple[object, ...] = (constraint.anchor,)
    elif isinstance(constraint, DistanceConstraint):
        anchors = constraint.anchors
    else:
        return False
    in_photo = photo.camera is not None and constraint.camera.same_viewpoint(photo.camera)
    return in_photo and not constraint.locked and pinned >= set(anchors)
