"""A head from photos of one person: identity, texture, character; pose, camera and light of each photo."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.geometry.camera import Camera
from faceposer.identity.editing import textures_of
from faceposer.identity.eye_colour import eye_texture
from faceposer.identity.identity import Identity, SkinTexture
from faceposer.identity.model import IdentityModel
from faceposer.identity.photos.dense_fit import DenseFit, DenseFitter, DenseSettings
from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.face_places import FacePlaces, load_face_places
from faceposer.identity.photos.face_texels import SIDE
from faceposer.identity.photos.fit_so_far import FitSoFar, Watch, unwatched
from faceposer.identity.photos.hair_colour import hair_colour_of
from faceposer.identity.photos.head_basis import ExpressionPrior, HeadBasis, head_basis
from faceposer.identity.photos.iris_colour import eye_colour_of, whites_of
from faceposer.identity.photos.landmark_fit import LandmarkFit, PhotoFace, fit_landmarks, fit_points
from faceposer.identity.photos.painted_light import painted_light
from faceposer.identity.photos.photo_texture import Zones, seen_skin
from faceposer.identity.photos.skin_light import SkinLight
from faceposer.identity.photos.skin_samples import shipped_samples
from faceposer.identity.photos.unknowns import ViewState
from faceposer.identity.photos.unlit_colours import LitPhoto
from faceposer.identity.skin_layers import Colour, SkinLayers
from faceposer.identity.texture_model import LIMIT, load_texture_model
from faceposer.model.character import Character
from faceposer.model.character_names import joined_credits
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.progress import Progress

Array = NDArray[np.float64]

#: Largest turn of a face to a side, in radians, at which its points are still found.
MOST_YAW = 1.05
# Height of the face, in pixels, in the crop from which the texture is taken.
_TEXTURE_HEIGHT = 900.0
_DIGITS = 4
# Shares of the work at which its stages begin and end.
_STAGES = {
    "prepare": (0.02, 0.14),
    "landmarks": (0.14, 0.2),
    "colours": (0.2, 0.5),
    "character": (0.5, 0.6),
    "skin": (0.6, 1.0),
}
#: Weight of the density of heads for paintings, whose features are a painter's.
PAINTED = 2.0
# Style and density of brows that photos do not show.
_LOST_BROWS, _LOST_DENSITY = "straight", 0.7
# How much more colours of a painted face may differ than those of skin under one light.
_TOLERANCE = 1.2


@dataclass(frozen=True, eq=False)
class HeadFromPhotos:
    """A head from photos.

    Attributes:
        identity: Its identity; the character also has the colours of the photos.
        model: Face model of its character.
        poses: Its pose in each photo, shape (r,) each.
        cameras: The camera of each photo, in pixels of the images given.
        lights: The light in each photo in the axes of its camera, (9, 3) each.
        report: What was measured, as JSON.
    """

    identity: Identity
    model: FaceModel
    poses: tuple[Array, ...]
    cameras: tuple[Camera, ...]
    lights: tuple[Array, ...]
    report: dict[str, Any]

    @property
    def character(self) -> Character:
        """The character with this head."""
        return self.model.character


def head_from_photos(
    faces: Sequence[PhotoFace],
    images: Sequence[NDArray[np.uint8]],
    names: Sequence[str],
    *,
    name: str,
    title: str,
    likelihood: float = 1.0,
    dense: bool = True,
    painting: bool = False,
    settings: DenseSettings | None = None,
    progress: Progress | None = None,
    watch: Watch = unwatched,
) -> HeadFromPhotos:
    """Return the head of the person whom photos show.

    Args:
        faces: The face in each photo.
        images: The pixels of each photo, shape (h, w, 3) each.
        names: Names of the photos for messages.
        name: Short name of the character.
        title: Its display name.
        likelihood: Weight of the density of heads (`LIKELIHOODS`): below 1 for likeness, above 1 for a likely head.
        dense: Refine the head by the colours of the photos, and take them over.
        painting: The photos are paintings or drawings: the likelihood counts twice, segments get no coefficients of
            their own, and the skin keeps the painter's colours, light and all that is not a slope of brightness.
        settings: Settings of the refinement.
        progress: Progress to update.
        watch: Called with the fit after each step.

    Raises:
        FacePoserError: If a face is turned too far.
        CancelledError: If the user has cancelled the work.
    """
    begun = time.perf_counter()
    progress = progress or Progress()
    progress.at("Preparing the model of heads", _STAGES["prepare"][0])
    basis, places = head_basis(), load_face_places()
    crops = [FaceCrop.of(face, image) for face, image in zip(faces, images, strict=True)]
    strength = likelihood * (PAINTED if painting else 1.0)
    fit = fit_landmarks([crop.face for crop in crops], basis, places, strength, progress.part(*_STAGES["landmarks"]))
    check_turns(fit, names)
    n_segments = len(basis.editor.segment_names)
    watch(FitSoFar(basis, np.tile(fit.state.shape, (n_segments, 1)), fit.state.views, crops))
    found: DenseFit | None = None
    if dense:
        if painting:
            settings = replace(settings or DenseSettings(), segment_steps=0)
        fitter = DenseFitter(crops, fit, basis, shipped_samples(basis, places), settings)
        found = fitter.fit(
            progress.part(*_STAGES["colours"]),
            lambda state: watch(FitSoFar(basis, fitter.rows(state), state.views, crops)),
        )
    rows = np.tile(fit.state.shape, (n_segments, 1)) if found is None else found.rows
    identity = Identity.of(rows)
    line = None if found is None or painting else found.state.texture
    lamps = () if found is None or painting else found.lamps
    if dense:
        identity = replace(identity, texture=_skin_texture(line, basis, identity, eye_colour_of(crops, lamps)))
    making = progress.part(*_STAGES["character"])
    making.at("Making the character")
    model = build_face_model(_named(basis.editor.with_head(identity), basis.editor.model, name, title, len(faces)))
    making.at("Making the character", 0.5)
    views = [_view(crop, number, fit, found, model, basis, places) for number, crop in enumerate(crops)]
    seen = [ViewState(pose, camera, np.zeros(0)) for pose, camera in views]
    watch(FitSoFar(basis, rows, seen, crops, model))
    lights: tuple[Array, ...] = () if found is None else found.lights
    if dense and painting:
        lights = tuple(
            painted_light(crop.image, camera, model.surface(pose).astype(np.float64), shipped_samples(basis, places))
            for crop, (pose, camera) in zip(crops, views, strict=True)
        )
    if identity.texture is not None:
        taking = progress.part(*_STAGES["skin"])
        taking.at("Taking the colours of the photos")

        def lit() -> Iterator[LitPhoto]:
            # One at a time: they are large.
            for number, (crop, (pose, camera)) in enumerate(zip(crops, views, strict=True)):
                taking.at("Taking the colours of the photos", (number + 0.5) / (len(crops) + 1))
                vertices = model.surface(pose).astype(np.float64)
                lamp = lamps[number] if lamps else None
                yield _lit_photo(crop, faces[number], images[number], camera, vertices, lights[number], lamp)

        textures = dict(model.character.textures)
        texture, textures["skin"] = _skin_of(identity.texture, lit, basis, places, painting)
        identity = replace(identity, texture=texture)
        if texture.eyes is not None:
            textures["eye"] = eye_texture(texture.eyes, whites_of(crops, lamps))
        model = model.with_character(replace(model.character, textures=textures))
    cameras = tuple(crop.whole(camera.camera) for crop, (_, camera) in zip(crops, views, strict=True))
    report = _report(names, crops, fit, found, lights, cameras, basis)
    report["seconds"] = round(time.perf_counter() - begun, 2)
    return HeadFromPhotos(identity, model, tuple(pose for pose, _ in views), cameras, lights, report)


def check_turns(fit: LandmarkFit, names: Sequence[str]) -> None:
    """Raise FacePoserError if a face is turned too far to a side, where its points are guesses."""
    for view, photo in zip(fit.state.views, names, strict=True):
        yaw = turn_of(view.camera.rotation)
        if abs(yaw) > MOST_YAW:
            raise FacePoserError(
                f"The face in '{photo}' is turned by more than {np.degrees(MOST_YAW):.0f} degrees (about "
                f"{np.degrees(abs(yaw)):.0f}); use a photo more from the front."
            )


def turn_of(rotation: Array) -> float:
    """Return the angle between the face and the camera about the vertical axis, from a world-to-camera rotation."""
    facing = rotation @ (0.0, 0.0, 1.0)
    return float(np.arctan2(facing[0], -facing[2]))


def camera_json(camera: Camera) -> dict[str, Any]:
    """Return a camera for a report."""
    return {
        "focal_px": round(camera.focal, 2),
        "size": list(camera.size),
        "rotation": camera.rotation.round(6).tolist(),
        "translation": camera.translation.round(_DIGITS).tolist(),
        "yaw_degrees": round(float(np.degrees(turn_of(camera.rotation))), 2),
    }


def _view(
    crop: FaceCrop,
    number: int,
    fit: LandmarkFit,
    found: DenseFit | None,
    model: FaceModel,
    basis: HeadBasis,
    places: FacePlaces,
) -> tuple[Array, FaceCamera]:
    """Return the pose and the camera of photo ``number`` for the character made."""
    if found is not None and found.refined:
        view = found.state.views[number]
        weights = basis.model.weights_of(view.pose)
        lower, upper = model.character.shape_limits.T.astype(np.float64)
        return model.coefficients_of(np.where(upper > lower, np.clip(weights, lower, upper), weights)), view.camera
    posed = fit_points([crop.face], basis.landmarks_of(model, places), ExpressionPrior.of(model), places)
    return posed.state.views[0].pose, posed.state.views[0].camera


def _lit_photo(
    crop: FaceCrop,
    face: PhotoFace,
    image: NDArray[np.uint8],
    camera: FaceCamera,
    vertices: Array,
    light: Array,
    lamp: SkinLight | None,
) -> LitPhoto:
    """Return the photo at the size at which its colours are taken."""
    large = FaceCrop.of(face, image, _TEXTURE_HEIGHT)
    x, y = ((there - here) * crop.factor for there, here in zip(large.corner, crop.corner, strict=True))
    size = (large.image.shape[1], large.image.shape[0])
    seen_by = camera.scaled(large.factor / crop.factor, (x, y), size)
    return LitPhoto(large.image.astype(np.float32), seen_by, vertices, light, lamp)


def _skin_of(
    texture: SkinTexture,
    photos: Callable[[], Iterator[LitPhoto]],
    basis: HeadBasis,
    places: FacePlaces,
    painting: bool,
) -> tuple[SkinTexture, bytes]:
    """Return the texture with the layers that photos leave, and its encoded image with what they show."""
    model, style = load_texture_model(), texture.layers.hair
    zones = Zones.of(model, style)
    samples = shipped_samples(basis, places)
    modes = samples.colours[: model.n_coefficients].mean(axis=1)
    skin = np.exp(samples.colour.mean(axis=0) + np.array(texture.coefficients) @ modes)
    hair = hair_colour_of(photos(), model.layer(f"hair.{style}", SIDE), skin, basis)
    if hair is not None:
        texture = replace(texture, layers=replace(texture.layers, hair_colour=hair))
    # The brows are those of the photos, if they show them.
    under = textures_of(replace(texture, layers=replace(texture.layers, brows="none")))["skin"]
    seen = seen_skin(photos(), under, basis, places, zones, _TOLERANCE if painting else 1.0, painting)
    if seen.brows_lost:
        layers = replace(texture.layers, brows=_LOST_BROWS, brow_colour=seen.brow_colour, brow_strength=_LOST_DENSITY)
        texture, seen = replace(texture, layers=layers), seen.without_brows()
        under = textures_of(texture)["skin"]
    return texture, seen.over(under)


def _skin_texture(line: Array | None, basis: HeadBasis, identity: Identity, eyes: Colour | None) -> SkinTexture:
    """Return the texture of the model with the coefficients of ``line``, or the average, with usual layers."""
    model = load_texture_model()
    coefficients = np.zeros(model.n_coefficients)
    if line is not None:
        coefficients = np.clip(model.of_line(line[: model.n_coefficients]), -LIMIT, LIMIT)
    female = basis.editor.measure(identity)["gender"] > 0.0
    layers = SkinLayers(hair="combed" if female else "short", brows="arched" if female else "straight")
    return SkinTexture(tuple(coefficients.tolist()), layers, eyes)


def _report(
    names: Sequence[str],
    crops: Sequence[FaceCrop],
    fit: LandmarkFit,
    found: DenseFit | None,
    lights: tuple[Array, ...],
    cameras: Sequence[Camera],
    basis: HeadBasis,
) -> dict[str, Any]:
    photos = []
    for number, (photo, crop, camera) in enumerate(zip(names, crops, cameras, strict=True)):
        entry: dict[str, Any] = {
            "photo": photo,
            "landmark_px": round(fit.landmark_px(number) / crop.factor, 2),
            "residual": None if found is None else round(found.residuals[number], _DIGITS),
            "camera": camera_json(camera),
            "light": lights[number].round(_DIGITS).tolist() if lights else None,
        }
        photos.append(entry)
    rows = fit.state.shape[None] if found is None else found.rows
    return {
        "photos": photos,
        "refined": found is not None and found.refined,
        "likelihood": round(basis.editor.model.commonness(rows), _DIGITS),
    }


def _named(character: Character, model: IdentityModel, name: str, title: str, n_photos: int) -> Character:
    made = f"Head made from {counted(n_photos, 'photo')} with a morphable model."
    credits = joined_credits(made, model.credits, load_texture_model().credits, character.credits)
    return replace(character, name=name, title=title, credits=credits)
