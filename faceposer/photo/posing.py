"""The expression of a photo, as constraints from its pins, with allowance for the person's build.

A person's mouth may be lower, or the brows higher, than the character's. A single photo cannot separate this from an
expression, so each group of features may be offset as a whole, at a cost, and each pin weighs less than one that was
dragged on the face of the character (Lau et al. 2009, section 7: photos allow for quick prototyping, not for a detailed
correspondence).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.photo.aligning import pinned
from faceposer.photo.photo import Photo
from faceposer.photo.places import GROUPS, OPENINGS, PUPILS, anchor_of, rigidity
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.gaze import MOST_PITCH, MOST_YAW, GazeConstraint
from faceposer.solve.constraints.point import SIGMA_PX, PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import solve
from faceposer.solve.priors import Prior
from faceposer.solve.problem import SPREAD, PoseProblem

Array = NDArray[np.float64]

# Height of the head in pixels in an ordinary view: pins weigh as much as if they had been set there.
_HEAD_PX = 540.0
# Variation between people, as shares of the head's height: of a feature in its group, and of the group.
_FEATURE_SPREAD = 0.004
_GROUP_SPREAD = 0.018
# Of openings, in pixels of an ordinary view: they vary little between people.
_OPENING_SPREAD_PX = 4.0
_ROUNDS = 8
_GAZE_ROUNDS = 5


def constraint_camera(photo: Photo, model: FaceModel) -> Camera:
    """Return the photo's camera with the resolution of an ordinary view.

    Raises:
        ValueError: If the photo has no camera yet.
    """
    camera = photo.camera
    if camera is None:
        raise ValueError("the photo has no camera yet")
    middle = model.character.vertices.mean(axis=0, dtype=np.float64)
    depth = float((camera.rotation @ middle + camera.translation)[2])
    scale = _HEAD_PX / model.character.height * depth / camera.focal
    size = (max(round(camera.size[0] * scale), 1), max(round(camera.size[1] * scale), 1))
    centre = camera.principal_point * scale
    shift = (float(centre[0]) - size[0] / 2.0, float(centre[1]) - size[1] / 2.0)
    return replace(camera, focal=camera.focal * scale, size=size, shift=shift)


def expression_constraints(
    photo: Photo,
    model: FaceModel,
    start: ArrayLike | None = None,
    prior_weight: float = 1.0,
    prior: Prior = "regions",
    spread: float = SPREAD,
) -> tuple[Constraint, ...]:
    """Return constraints for the expression of ``photo``: points and distances under the photo's camera.

    Args:
        photo: Photo with its camera.
        model: The face model.
        start: Pose without constraints, shape (r,); None for the neutral face.
        prior_weight: Weight of the prior in the session.
        prior: Kind of the prior in the session.
        spread: Spread in the session.

    Raises:
        ValueError: If the photo has no camera yet.
    """
    camera = constraint_camera(photo, model)
    scale = camera.focal / photo.camera.focal if photo.camera is not None else 1.0
    pixels = {}
    for i in pinned(photo, model)[0]:
        pin = photo.pins[i]
        pixels[pin.place] = np.asarray(pin.pixel) * scale
    variance = SIGMA_PX**2 + (_FEATURE_SPREAD * _HEAD_PX) ** 2
    weight = SIGMA_PX**2 / variance
    pupils = {pupil for pupil, _ in PUPILS}
    places = [place for place in pixels if place not in pupils and rigidity(place, model) < 0.3]
    points = [
        PointConstraint(anchor, (float(pixels[place][0]), float(pixels[place][1])), camera, weight=weight)
        for place in places
        if (anchor := anchor_of(place, model.character)) is not None and not isinstance(anchor, str)
    ]
    named = {place: pixel for place, pixel in pixels.items() if isinstance(place, str)}
    others = [*_openings(model, camera, named), *_gaze(model, camera, named)]
    groups = [[i for i, place in enumerate(places) if place in group] for group in GROUPS]
    targets = np.array([point.target for point in points]).reshape(-1, 2)
    shifted = list(points)
    p: Array | None = None
    group_variance = (_GROUP_SPREAD * _HEAD_PX) ** 2
    for _ in range(_ROUNDS):
        problem = PoseProblem(model, [*shifted, *others], start, prior_weight, prior=prior, spread=spread)
        p = solve(problem, p).coefficients
        errors = [targets[i] - camera.project(model.positions_at(point.points, p))[0] for i, point in enumerate(points)]
        for group in groups:
            if not group:
                continue
            mean_error = np.mean([errors[i] for i in group], axis=0)
            offset = mean_error * group_variance / (group_variance + variance / len(group))
            for i in group:
                u, v = (targets[i] - offset).tolist()
                shifted[i] = replace(points[i], target=(u, v))
    return (*shifted, *others)


def _gaze(model: FaceModel, camera: Camera, pixels: Mapping[str, Array]) -> list[Constraint]:
    """Return a gaze constraint for pins of pupils at ``pixels`` of ``camera``, (2,) each, if there are any.

    It matches the position of each pupil between the corners of its eye, relative to the width of the eye.
    """
    character = model.character
    vertices, targets = [], []
    for pupil, corners in PUPILS:
        if not all(name in pixels and name in character.feature_points for name in (pupil, *corners)):
            continue
        own_corners = camera.project(character.vertices[[int(character.feature_points[name]) for name in corners]])
        photo_corners = np.array([pixels[name] for name in corners])
        width = float(np.linalg.norm(photo_corners[0] - photo_corners[1]))
        if width > 1e-6:
            scale = float(np.linalg.norm(own_corners[0] - own_corners[1])) / width
            vertices.append(int(character.feature_points[pupil]))
            targets.append(own_corners.mean(axis=0) + scale * (pixels[pupil] - photo_corners.mean(axis=0)))
    if not vertices or not any(name.startswith("eyeLook") for name in character.shape_names):
        return []
    points = SurfacePoints.at_vertices(vertices)

    def project_pupils(angles: Array) -> Array:
        pose = GazeConstraint((float(angles[0]), float(angles[1]))).offset_start(model, model.neutral())
        return camera.project(model.positions_at(points, pose)).ravel()

    most = np.array([MOST_YAW, MOST_PITCH])
    angles: Array = np.zeros(2)
    for _ in range(_GAZE_ROUNDS):
        # Differences towards the middle, because an eye does not turn beyond its limits.
        signs = np.where(angles > 0.0, -1.0, 1.0)
        pupils = project_pupils(angles)
        slopes = [(project_pupils(angles + signs * axis) - pupils) * (signs @ axis) for axis in np.eye(2)]
        step = np.linalg.lstsq(np.stack(slopes, axis=1), np.ravel(targets) - pupils, rcond=1e-6)[0]
        angles = np.clip(angles + step, -most, most)
    return [GazeConstraint((float(angles[0]), float(angles[1])))]


def _openings(model: FaceModel, camera: Camera, pixels: Mapping[str, Array]) -> list[Constraint]:
    """Return distance constraints for the openings of mouth and eyes, for ``pixels`` of ``camera``, (2,) each."""
    character = model.character
    found: list[Constraint] = []
    for pair in OPENINGS:
        if not all(name in pixels and name in character.feature_points for name in (*pair.ends, *pair.measure)):
            continue
        vertices = [int(character.feature_points[name]) for name in (*pair.ends, *pair.measure)]
        neutral = camera.project(character.vertices[vertices[2:]].astype(np.float64))
        own_measure = float(np.hypot(*(neutral[0] - neutral[1])))
        photo_measure = float(np.hypot(*(pixels[pair.measure[0]] - pixels[pair.measure[1]])))
        distance = float(np.hypot(*(pixels[pair.ends[0]] - pixels[pair.ends[1]])))
        weight = SIGMA_PX**2 / _OPENING_SPREAD_PX**2
        if photo_measure > 1e-6:
            anchors = (vertices[0], vertices[1])
            found.append(DistanceConstraint(anchors, distance * own_measure / photo_measure, camera, weight=weight))
    return found
