"""The person in a film: head, skin, focal length and errors of the landmarks, from a few good frames."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.film.film import Film, Span
from faceposer.film.tracking import Track
from faceposer.identity.identity import Identity
from faceposer.identity.photos.dense_fit import DenseFitter, DenseSettings
from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.face_places import INNER_LIPS, LIDS, FacePlaces, LandmarkErrors, load_face_places
from faceposer.identity.photos.head_basis import ExpressionPrior, FacePoints, HeadBasis, head_basis
from faceposer.identity.photos.head_from_photos import MOST_YAW, turn_of
from faceposer.identity.photos.landmark_fit import PhotoFace, first_camera, fit_landmarks, fit_points
from faceposer.identity.photos.skin_samples import SkinSamples, shipped_samples
from faceposer.identity.photos.terms import upright
from faceposer.landmarks.points import N_POINTS, Landmarks
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.photo.reading import FOCAL_SPREAD, LIKELY_FOCAL_MM, focal_in_pixels
from faceposer.progress import Progress

Array = NDArray[np.float64]

# Frames of which the head is made, and frames among which they are chosen.
_GOOD, _CANDIDATES = 5, 40
# Turn of the head, in radians, that counts as much as an opening of the mouth by this share of the face's height.
_TURN, _OPENING = 0.25, 0.12
# Least distance of these frames from each other in this measure.
_DISTINCT = 0.2
# Standard deviation of the logarithm of the focal length once it is known from all good frames.
_SHARED_FOCAL = 0.02
# Correlation of the expressions in two of these frames.
_ALIKE = 0.9
# Standard deviation of landmarks, in centimetres, apart from their constant errors: alone, and beside colours.
_DEVIATION, _BESIDE_COLOURS = 0.45, 0.7
# Those of the lids and of the inner edge of the lips, at most: they move by less than others err.
_LIDS, _INNER_LIPS = 0.2, 0.4
# Weight of the density of expressions where constant errors are looked for.
_WEAK = 0.1
# Points on the lips, and on top of the face and the chin, whose distances tell an open mouth.
_LIPS, _BROW_CHIN = (13, 14), (10, 152)


@dataclass(frozen=True, eq=False)
class Person:
    """What is the same in all frames of a film.

    Attributes:
        model: Face model of the person's own character.
        points: Landmarks and pupils of the person with expressions.
        prior: Density of the expressions.
        skin: Triangles of the face with the person's colours, or None without colours.
        errors: Errors of the landmarks.
        log_focal: Logarithm of the focal length in pixels of the frames.
        middle: Middle of the face, shape (3,).
        good: Frames of which the head was made.
    """

    model: FaceModel
    points: FacePoints
    prior: ExpressionPrior
    skin: SkinSamples | None
    errors: LandmarkErrors
    log_focal: float
    middle: Array
    good: tuple[int, ...]

    def camera_of(self, face: Landmarks, size: tuple[int, int]) -> FaceCamera:
        """Return a first camera of ``face`` in a frame of ``size``, with the focal length of the film."""
        focal = math.exp(self.log_focal)
        camera = first_camera(PhotoFace(face, size, focal, _SHARED_FOCAL), self.points.mean)
        return replace(camera, middle=self.middle, log_depth=self.log_focal - camera.log_scale)


def find_person(film: Film, span: Span, track: Track, colours: bool = True, progress: Progress | None = None) -> Person:
    """Return the person whose face is followed by ``track``.

    Args:
        film: The film.
        span: The part of it that was read.
        track: The face in each frame.
        colours: Refine the head by the colours of the frames.
        progress: Progress to update.

    Raises:
        FacePoserError: If the face is always turned too far to a side.
    """
    progress = progress or Progress()
    progress.at("Preparing the model of heads")
    basis, places = head_basis(), load_face_places()
    progress.check()
    good = _good_frames(film, track, basis, places)
    progress.at("Fitting the head")
    images = {}
    for frame in film.frames(span, max(track.size)):
        progress.check()
        if frame.number in good:
            images[frame.number] = frame.pixels
        if len(images) == len(good):
            break
    at = {int(number): k for k, number in enumerate(track.numbers)}
    faces = [track.faces[at[number]] for number in good]
    focal = focal_in_pixels(LIKELY_FOCAL_MM, track.size)
    photos = [PhotoFace(face, track.size, focal, FOCAL_SPREAD) for face in faces if face is not None]
    first = fit_landmarks(photos, basis, places, 1.0, progress.part(0.0, 0.1), _ALIKE)
    shared = float(np.median([view.camera.log_focal for view in first.state.views]))
    photos = [replace(photo, focal=math.exp(shared), focal_spread=_SHARED_FOCAL) for photo in photos]
    crops = [FaceCrop.of(photo, images[number]) for photo, number in zip(photos, good, strict=True)]
    fit = fit_landmarks([crop.face for crop in crops], basis, places, 1.0, progress.part(0.1, 0.2), _ALIKE)
    samples = shipped_samples(basis, places) if colours else None
    rows = np.tile(fit.state.shape, (len(basis.editor.segment_names), 1))
    texture = None
    if samples is not None:
        dense = DenseFitter(crops, fit, basis, samples, DenseSettings(segment_steps=0)).fit(progress.part(0.2, 0.9))
        rows = dense.rows
        texture = dense.state.texture if dense.refined else None
    progress.at("Preparing the head", 0.9)
    model = build_face_model(basis.editor.with_head(Identity.of(rows)))
    points = basis.landmarks_of(model, places)
    prior = ExpressionPrior.of(model)
    skin = None if samples is None or texture is None else _skin_of(samples, model, texture)
    errors = _errors_of(photos, points, prior, places, _DEVIATION if skin is None else _BESIDE_COLOURS, progress)
    middle = fit.state.views[0].camera.middle
    return Person(model, points, prior, skin, errors, shared, middle, tuple(good))


def _good_frames(film: Film, track: Track, basis: HeadBasis, places: FacePlaces) -> list[int]:
    """Return frames with distinct faces that differ most in turn and mouth, the most frontal one first."""
    seen = np.flatnonzero(track.seen)
    chosen = seen[np.unique(np.linspace(0, len(seen) - 1, min(_CANDIDATES, len(seen))).round().astype(int))]
    mean = basis.landmarks(places).mean
    focal = focal_in_pixels(LIKELY_FOCAL_MM, track.size)
    features, logits, yaws = [], [], []
    for k in chosen:
        face = track.faces[k]
        assert face is not None
        rotation = first_camera(PhotoFace(face, track.size, focal, FOCAL_SPREAD), mean).rotation
        yaw, pitch = turn_of(rotation), float(np.arcsin(np.clip((rotation @ (0.0, 0.0, 1.0))[1], -1.0, 1.0)))
        lips, tall = (_distance(face, *pair) for pair in (_LIPS, _BROW_CHIN))
        features.append((yaw / _TURN, pitch / _TURN, lips / max(tall, 1.0) / _OPENING))
        logits.append(face.logit)
        yaws.append(abs(yaw))
    values, turned = np.array(features), np.array(yaws)
    usable = np.flatnonzero((turned < MOST_YAW) & (np.array(logits) >= 0.6 * np.median(logits)))
    if not len(usable):
        raise FacePoserError(
            f"The face in '{film.path}' is turned by more than {np.degrees(MOST_YAW):.0f} degrees in all frames; use a "
            "film in which it is seen more from the front."
        )
    picked = [int(usable[np.argmin(np.linalg.norm(values[usable], axis=1))])]
    while len(picked) < min(_GOOD, len(usable)):
        apart = np.linalg.norm(values[usable, None] - values[picked][None], axis=2).min(axis=1)
        # Neither the strongest turn nor the widest mouth is best seen.
        apart = np.where(turned[usable] < 0.7 * MOST_YAW, apart, 0.0)
        best = int(usable[np.argmax(apart)])
        if best in picked or apart.max() < _DISTINCT:
            break
        picked.append(best)
    return [int(track.numbers[chosen[k]]) for k in picked]


def _distance(face: Landmarks, one: int, other: int) -> float:
    return float(np.linalg.norm(face.points[one, :2] - face.points[other, :2]))


def _skin_of(samples: SkinSamples, model: FaceModel, texture: Array) -> SkinSamples:
    """Return the triangles of the face of one person, whose head and colours are known."""
    vertices = samples.vertices
    expression = model.basis.reshape(model.n_coefficients, -1, 3)[:, vertices].astype(np.float64)
    mean = model.character.vertices[vertices].astype(np.float64)
    none = np.zeros((0, len(vertices), 3))
    return replace(
        samples,
        points=FacePoints(mean, none, expression),
        colour=samples.colour + np.tensordot(texture, samples.colours, 1),
        colours=np.zeros((0, *samples.colour.shape)),
    )


def _errors_of(
    photos: Sequence[PhotoFace],
    points: FacePoints,
    prior: ExpressionPrior,
    places: FacePlaces,
    deviation: float,
    progress: Progress,
) -> LandmarkErrors:
    """Return the errors of the landmarks: the networks err alike in all frames of a face, but for a ``deviation``."""
    # What the prior takes from an expression is no error of the networks.
    weak = replace(prior, precision=_WEAK * prior.precision)
    shifts = []
    for photo in photos:
        progress.check()
        fit = fit_points([photo], points, weak, places)
        view = fit.state.views[0]
        off = photo.landmarks.points[:N_POINTS, :2] - view.camera.project(points.at(np.zeros(0), view.pose))[:N_POINTS]
        shifts.append(off @ upright(photo.landmarks) / math.exp(view.camera.log_scale))
    # A landmark is the place on the face plus its error; `LandmarkErrors` are added to the places.
    mean = np.median(shifts, axis=0) * len(shifts) / (len(shifts) + 1.0)
    deviations = LandmarkErrors.plain(deviation).deviations
    deviations[list(LIDS)] = _LIDS
    deviations[list(INNER_LIPS)] = min(deviation, _INNER_LIPS)
    return LandmarkErrors(mean, np.zeros((0, *mean.shape)), deviations)
