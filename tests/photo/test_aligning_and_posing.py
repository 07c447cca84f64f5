"""Cameras and expressions from pins: of the same face they come back, another person's build stays no expression."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint
from faceposer.model.face_model import FaceModel
from faceposer.photo.aligning import aligned, first_camera, residuals_px
from faceposer.photo.photo import Photo, Pin
from faceposer.photo.places import ALIGNING, GUIDED, guided, rigidity
from faceposer.photo.posing import expression_constraints
from faceposer.photo.reading import LIKELY_FOCAL_MM, focal_in_pixels
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem

SIZE = (1000, 800)
SMILE = {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8, "jawOpen": 0.25}


def taken(yaw: float = 0.35, roll: float = 0.2, mm: float = LIKELY_FOCAL_MM) -> Camera:
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    c, s = math.cos(roll), math.sin(roll)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.diag([1.0, -1.0, -1.0]) @ turn
    return Camera(rotation, np.array([5.0, -8.0, 90.0]), focal_in_pixels(mm, SIZE), SIZE)


def pinned(model: FaceModel, pose: NDArray[np.float64], names: tuple[str, ...], camera: Camera | None = None) -> Photo:
    """A photo of ``model`` itself, with exact pins."""
    camera = taken() if camera is None else camera
    vertices = model.instance(pose)[[model.character.feature_points[name] for name in names]]
    pins = zip(names, camera.project(vertices).tolist(), strict=True)
    return Photo("a.jpg", SIZE, tuple(Pin(name, (u, v)) for name, (u, v) in pins))


def weights(model: FaceModel, photo: Photo) -> dict[str, float]:
    constraints = expression_constraints(photo, model)
    pose = solve(PoseProblem(model, constraints)).coefficients
    return dict(zip(model.character.shape_names, model.weights_of(pose).tolist(), strict=True))


def test_the_camera_of_a_photo_of_the_same_face_comes_back(model: FaceModel) -> None:
    photo = aligned(pinned(model, model.neutral(), ALIGNING), model, model.neutral())
    assert photo.camera is not None
    np.testing.assert_allclose(photo.camera.rotation, taken().rotation, atol=0.01)
    assert max(residuals_px(photo, model, model.neutral()).values()) < 0.5


def test_a_smile_is_not_explained_by_the_camera(model: FaceModel) -> None:
    photo = aligned(pinned(model, model.coefficients_of(SMILE), GUIDED), model, model.neutral())
    assert photo.camera is not None
    np.testing.assert_allclose(photo.camera.rotation, taken().rotation, atol=0.03)
    found = weights(model, photo)
    assert 0.4 < found["mouthSmileLeft"] < 1.0
    assert 0.4 < found["mouthSmileRight"] < 1.0
    assert max(value for name, value in found.items() if "brow" in name) < 0.25


def test_the_face_follows_from_the_first_pin(model: FaceModel) -> None:
    photo = Photo("a.jpg", SIZE)
    start = first_camera(photo, model)
    assert aligned(photo, model, model.neutral()).camera == start
    head = start.project(model.character.vertices)
    assert (head.min(axis=0) > 0.0).all()
    assert (head.max(axis=0) < SIZE).all()
    for count in (1, 2, 3, 4):
        photo = aligned(pinned(model, model.neutral(), ALIGNING[:count]), model, model.neutral())
        assert max(residuals_px(photo, model, model.neutral()).values()) < (30.0 if count == 3 else 3.0)
    known = pinned(model, model.neutral(), ALIGNING)
    found = aligned(Photo(known.path, SIZE, known.pins, focal=900.0), model, model.neutral()).camera
    assert found is not None
    assert found.focal == 900.0


def test_another_persons_build_is_no_expression(model: FaceModel, woman: FaceModel) -> None:
    neutral = aligned(pinned(woman, woman.neutral(), GUIDED), model, model.neutral())
    found = weights(model, neutral)
    assert max(abs(value) for value in found.values()) < 0.45, found
    smiling = aligned(pinned(woman, woman.coefficients_of(SMILE), GUIDED), model, model.neutral())
    smile = weights(model, smiling)
    for side in ("Left", "Right"):
        assert smile[f"mouthSmile{side}"] > found[f"mouthSmile{side}"] + 0.3


def test_openings_are_measured_by_the_persons_own_features(model: FaceModel) -> None:
    photo = aligned(pinned(model, model.coefficients_of({"jawOpen": 0.5}), GUIDED), model, model.neutral())
    distances = [c for c in expression_constraints(photo, model) if c.kind == "distance"]
    assert len(distances) == 3
    closed = aligned(pinned(model, model.neutral(), GUIDED), model, model.neutral())
    shut = [c for c in expression_constraints(closed, model) if c.kind == "distance"]
    assert distances[0].target > shut[0].target + 10.0  # type: ignore[union-attr]
    assert distances[1].target == pytest.approx(shut[1].target, abs=2.0)  # type: ignore[union-attr]


@pytest.mark.parametrize("gaze", [(15.0, 0.0), (-12.0, 8.0), (0.0, -10.0)])
def test_pupils_tell_where_the_eyes_look(model: FaceModel, gaze: tuple[float, float]) -> None:
    pose = GazeConstraint(gaze).offset_start(model, model.neutral())
    photo = aligned(pinned(model, pose, GUIDED), model, model.neutral())
    (found,) = [c for c in expression_constraints(photo, model) if isinstance(c, GazeConstraint)]
    np.testing.assert_allclose(found.direction, gaze, atol=6.0)


def test_places_that_a_face_lacks_are_passed_over(model: FaceModel) -> None:
    photo = pinned(model, model.neutral(), ALIGNING)
    pins = (
        *photo.pins,
        Pin("99.9", (1.0, 1.0)),
        Pin(10**6, (2.0, 2.0)),
        Pin(SurfacePoint(0, (1.0, 0.0, 0.0)), (3.0, 3.0)),
    )
    more = aligned(Photo("a.jpg", SIZE, pins), model, model.neutral())
    assert set(residuals_px(more, model, model.neutral())) == {*range(len(ALIGNING)), len(pins) - 1}
    with pytest.raises(ValueError, match="no camera"):
        expression_constraints(photo, model)
    assert guided(model.character) == list(GUIDED)
    assert rigidity("9.3", model) > rigidity("2.1", model) > rigidity("8.3", model) > 0.0
