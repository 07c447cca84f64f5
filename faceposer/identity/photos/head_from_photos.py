"""A head from photos of one person: identity, character, and the pose and the camera of each photo."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.identity.identity import Identity
from faceposer.identity.photos.face_places import FacePlaces, load_face_places
from faceposer.identity.photos.head_basis import ExpressionPrior, HeadBasis, head_basis
from faceposer.identity.photos.landmark_fit import LandmarkFit, PhotoFace, fit_landmarks, fit_points
from faceposer.identity.photos.unknowns import FitState
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.progress import Progress

Array = NDArray[np.float64]

#: Largest turn of a face to a side, in radians, at which its points are still found.
MOST_YAW = 1.05
_DIGITS = 4


@dataclass(frozen=True, eq=False)
class HeadFromPhotos:
    """A head from photos.

    Attributes:
        identity: Its identity.
        model: Face model of its character.
        poses: Its pose in each photo, shape (r,) each.
        cameras: The camera of each photo, in pixels of the images given.
        report: What was measured, as JSON.
    """

    identity: Identity
    model: FaceModel
    poses: tuple[Array, ...]
    cameras: tuple[Camera, ...]
    report: dict[str, Any]

    @property
    def character(self) -> Character:
        """The character with this head."""
        return self.model.character


def head_from_photos(
    faces: Sequence[PhotoFace],
    names: Sequence[str],
    *,
    name: str,
    title: str,
    likelihood: float = 1.0,
    progress: Progress | None = None,
) -> HeadFromPhotos:
    """Return the head of the person whom photos show.

    Args:
        faces: The face in each photo.
        names: Names of the photos for messages.
        name: Short name of the character.
        title: Its display name.
        likelihood: Weight of the density of heads: below 1 for more likeness, above 1 for a likelier head.
        progress: Progress to update.

    Raises:
        FacePoserError: If a face is seen from the side.
    """
    begun = time.perf_counter()
    progress = progress or Progress()
    progress.at("Preparing the model of heads")
    basis, places = head_basis(), load_face_places()
    fit = fit_landmarks(faces, basis, places, likelihood, progress)
    check_turns(fit, names)
    identity = identity_of(basis, fit.state)
    progress.at("Making the character")
    model = build_face_model(_named(basis.editor.with_head(identity), name, title, len(faces)))
    posed = [refitted(face, model, basis, places) for face in faces]
    cameras = tuple(one.state.views[0].camera.camera for one in posed)
    report = {
        "photos": [
            {"photo": photo, "landmark_px": round(one.landmark_px(0), 2), "camera": camera_json(camera)}
            for photo, one, camera in zip(names, posed, cameras, strict=True)
        ],
        "likelihood": round(basis.editor.model.commonness(fit.state.shape), _DIGITS),
        "seconds": round(time.perf_counter() - begun, 2),
    }
    return HeadFromPhotos(identity, model, tuple(one.state.views[0].pose for one in posed), cameras, report)


def check_turns(fit: LandmarkFit, names: Sequence[str]) -> None:
    """Raise FacePoserError if a face is seen from the side, where its points are guesses."""
    for view, photo in zip(fit.state.views, names, strict=True):
        yaw = turn_of(view.camera.rotation)
        if abs(yaw) > MOST_YAW:
            raise FacePoserError(
                f"The face in '{photo}' is turned by {np.degrees(abs(yaw)):.0f} degrees, and at most "
                f"{np.degrees(MOST_YAW):.0f} can be used; use a photo more from the front."
            )


def turn_of(rotation: Array) -> float:
    """Return the angle between the face and the camera about the vertical axis, from a world-to-camera rotation."""
    facing = rotation @ (0.0, 0.0, 1.0)
    return float(np.arctan2(facing[0], -facing[2]))


def identity_of(basis: HeadBasis, state: FitState) -> Identity:
    """Return the identity of the head in ``state``, the same coefficients for all segments."""
    return Identity.of(np.tile(state.shape, (len(basis.editor.segment_names), 1)))


def refitted(face: PhotoFace, model: FaceModel, basis: HeadBasis, places: FacePlaces) -> LandmarkFit:
    """Return the pose and the camera of a known head, by its own expressions."""
    return fit_points([face], basis.landmarks_of(model, places), ExpressionPrior.of(model), places)


def camera_json(camera: Camera) -> dict[str, Any]:
    """Return a camera for a report."""
    return {
        "focal_px": round(camera.focal, 2),
        "size": list(camera.size),
        "rotation": camera.rotation.round(6).tolist(),
        "translation": camera.translation.round(_DIGITS).tolist(),
        "yaw_degrees": round(float(np.degrees(turn_of(camera.rotation))), 2),
    }


def _named(character: Character, name: str, title: str, n_photos: int) -> Character:
    from dataclasses import replace

    made = f"Head made from {n_photos} photo{'s' if n_photos > 1 else ''} with a morphable model."
    credits = " ".join(text for text in (made, character.credits) if text)
    return replace(character, name=name, title=title, credits=credits)
