"""Heads from landmarks."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.identity.photos.face_camera import N_CAMERA, FaceCamera
from faceposer.identity.photos.face_places import FacePlaces, LandmarkErrors
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.head_from_photos import check_turns, turn_of
from faceposer.identity.photos.landmark_fit import PhotoFace, fit_landmarks
from faceposer.identity.photos.terms import LandmarkTerm, Priors, upright
from faceposer.identity.photos.unknowns import FitState, Layout, NormalEquations, ViewState
from faceposer.landmarks.points import N_POINTS, Landmarks


def landmarks_at(pixels: np.ndarray) -> Landmarks:
    """Return landmarks at ``pixels``, (470, 2), the last two of which are the pupils."""
    points = np.concatenate([pixels[:N_POINTS], np.zeros((N_POINTS, 1))], axis=1)
    iris = np.zeros((2, 5, 3))
    iris[:, :, :2] = pixels[N_POINTS:, None]
    box = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
    return Landmarks(points, iris, 1.0, box, 20.0)


def test_derivatives_match_finite_differences(basis: HeadBasis, places: FacePlaces, face_camera: FaceCamera) -> None:
    rng = np.random.default_rng(0)
    errors = LandmarkErrors(
        rng.normal(0.0, 0.1, (N_POINTS, 2)), rng.normal(0.0, 0.1, (3, N_POINTS, 2)), np.full(N_POINTS, 0.3)
    )
    points = basis.landmarks(places)
    pose = 0.1 * rng.standard_normal(len(points.expression))
    view = ViewState(pose, face_camera, rng.standard_normal(3))
    state = FitState(rng.standard_normal(basis.n_identity), np.zeros(0), (view,))
    term = LandmarkTerm.of(landmarks_at(face_camera.project(points.mean)), points, errors, 13.0)
    rows = term.derivatives(state, view)
    layout = Layout.of(state)
    assert layout.size == rows.shape[2]
    for number in rng.integers(0, layout.size, 12).tolist() + list(range(154, 154 + N_CAMERA + 3)):
        step = 1e-5 * np.eye(layout.size)[number]
        ahead, behind = state.moved(layout, step), state.moved(layout, -step)
        slope = (term.residual(ahead, ahead.views[0]) - term.residual(behind, behind.views[0])) / 2e-5
        np.testing.assert_allclose(rows[:, :, number], slope, atol=1e-3, rtol=1e-4)


def test_the_slope_of_the_robust_cost_matches_finite_differences(
    basis: HeadBasis, places: FacePlaces, face_camera: FaceCamera
) -> None:
    rng = np.random.default_rng(1)
    points = basis.landmarks(places)
    view = ViewState(np.zeros(len(points.expression)), face_camera, np.zeros(0))
    state = FitState(np.zeros(basis.n_identity), np.zeros(0), (view,))
    pixels = face_camera.project(points.mean) + rng.normal(0.0, 6.0, (len(points.mean), 2))
    term = LandmarkTerm.of(landmarks_at(pixels), points, LandmarkErrors.plain(0.1), 13.0)
    equations = NormalEquations(Layout.of(state))
    term.add(state, 0, equations)
    for number in (0, 7, 60, 110, 155, 158, 159, 160):
        step = 1e-5 * np.eye(equations.layout.size)[number]
        ahead, behind = state.moved(equations.layout, step), state.moved(equations.layout, -step)
        slope = (term.cost(ahead, ahead.views[0]) - term.cost(behind, behind.views[0])) / 2e-5
        assert equations.slope[number] == pytest.approx(slope, rel=1e-3, abs=1e-2)


def test_the_slope_of_priors_of_photos_that_are_alike_matches_finite_differences(
    basis: HeadBasis, face_camera: FaceCamera
) -> None:
    rng = np.random.default_rng(2)
    r = basis.model.n_coefficients
    views = tuple(ViewState(0.3 * rng.standard_normal(r), face_camera, np.zeros(0)) for _ in range(3))
    state = FitState(np.zeros(basis.n_identity), np.zeros(0), views)
    priors = Priors(basis.prior, ((6.5, 0.3),) * 3, 1.0, 0.9)
    equations = NormalEquations(Layout.of(state))
    priors.add(state, equations)
    for number in (100, 116, 170, 240):
        step = 1e-5 * np.eye(equations.layout.size)[number]
        ahead, behind = (priors.cost(state.moved(equations.layout, way)) for way in (step, -step))
        assert equations.slope[number] == pytest.approx((ahead - behind) / 2e-5, rel=1e-3, abs=1e-2)


def test_an_expression_of_photos_that_are_alike_counts_about_once(basis: HeadBasis, face_camera: FaceCamera) -> None:
    smile = basis.model.coefficients_of({"mouthSmileLeft": 0.6, "mouthSmileRight": 0.6})

    def cost(count: int, alike: float) -> float:
        views = (ViewState(smile, face_camera, np.zeros(0)),) * count
        priors = Priors(basis.prior, ((face_camera.log_focal, 0.3),) * count, 1.0, alike)
        return priors.cost(FitState(np.zeros(basis.n_identity), np.zeros(0), views))

    assert cost(5, 0.0) == pytest.approx(5.0 * cost(1, 0.0))
    assert cost(5, 0.9) < 1.2 * cost(1, 0.0)


@pytest.mark.parametrize("strength", [0.25, 1.0, 4.0])
def test_the_slope_of_the_priors_matches_finite_differences(
    basis: HeadBasis, face_camera: FaceCamera, strength: float
) -> None:
    rng = np.random.default_rng(3)
    view = ViewState(0.1 * rng.standard_normal(basis.model.n_coefficients), face_camera, rng.standard_normal(3))
    state = FitState(rng.standard_normal(basis.n_identity), rng.standard_normal(5), (view,))
    priors = Priors(basis.prior, ((face_camera.log_focal + 0.1, 0.3),), strength)
    equations = NormalEquations(Layout.of(state))
    priors.add(state, equations)
    for number in range(0, equations.layout.size, 9):
        step = 1e-5 * np.eye(equations.layout.size)[number]
        ahead, behind = (priors.cost(state.moved(equations.layout, way * step)) for way in (1.0, -1.0))
        assert equations.slope[number] == pytest.approx((ahead - behind) / 2e-5, abs=1e-4, rel=1e-4)


def test_likeness_relaxes_the_broad_modes_and_likelihood_holds_all(basis: HeadBasis) -> None:
    like, usual, likely = (Priors(basis.prior, (), strength) for strength in (0.25, 1.0, 4.0))
    weights = like.shape_weights(100)
    assert weights[0] == pytest.approx(0.25)
    assert np.all(np.diff(weights) > 0.0)
    assert weights[-1] > 0.85
    np.testing.assert_array_equal(usual.shape_weights(100), 1.0)
    np.testing.assert_array_equal(likely.shape_weights(100), 4.0)
    assert (like.texture_weight, usual.texture_weight, likely.texture_weight) == (1.0, 1.0, 4.0)


@pytest.mark.parametrize("n_photos", [1, 2])
def test_a_known_head_is_recovered(
    basis: HeadBasis, places: FacePlaces, face_camera: FaceCamera, n_photos: int
) -> None:
    """Exact landmarks of a head of the model give that head, its expression and its camera back."""
    rng = np.random.default_rng(2)
    exact = replace(places, errors=LandmarkErrors.plain(0.02))
    points = basis.landmarks(exact)
    truth = 0.8 * rng.standard_normal(basis.n_identity) * (np.arange(basis.n_identity) < 30)
    faces, cameras = [], []
    smile = basis.model.coefficients_of({"mouthSmileLeft": 0.6, "mouthSmileRight": 0.6, "jawOpen": 0.2})
    for number in range(n_photos):
        camera = face_camera.moved(np.array([0.0, 0.6 * number, 0.0, 0.0, 0.0, 0.0, 0.0]))
        cameras.append(camera)
        found = landmarks_at(camera.project(points.at(truth, smile)))
        focal = float(np.exp(camera.log_focal))
        faces.append(PhotoFace(found, camera.size, focal, 0.02, camera.principal))
    fit = fit_landmarks(faces, basis, exact)
    off = points.at(fit.state.shape, np.zeros(len(smile))) - points.at(truth, np.zeros(len(smile)))
    off -= off.mean(axis=0)
    unknown = points.at(truth, np.zeros(len(smile))) - points.mean
    unknown -= unknown.mean(axis=0)
    assert (
        np.linalg.norm(off, axis=1).mean() < (0.5 if n_photos == 1 else 0.35) * np.linalg.norm(unknown, axis=1).mean()
    )
    weights = dict(zip(basis.character.shape_names, basis.model.weights_of(fit.state.views[0].pose), strict=True))
    assert weights["mouthSmileLeft"] > 0.3
    for camera, view in zip(cameras, fit.state.views, strict=True):
        assert abs(turn_of(camera.rotation) - turn_of(view.camera.rotation)) < 0.05
    assert fit.landmark_px(0) < 0.5


def test_faces_from_the_side_are_refused(basis: HeadBasis, places: FacePlaces, face_camera: FaceCamera) -> None:
    points = basis.landmarks(places)
    camera = face_camera.moved(np.array([0.0, 0.49, 0.0, 0.0, 0.0, 0.0, 0.0])).moved(
        np.array([0.0, 0.49, 0.0, 0.0, 0.0, 0.0, 0.0])
    )
    camera = camera.moved(np.array([0.0, 0.49, 0.0, 0.0, 0.0, 0.0, 0.0]))
    face = PhotoFace(landmarks_at(camera.project(points.mean)), camera.size, 800.0, 0.1, camera.principal)
    fit = fit_landmarks([face], basis, places)
    with pytest.raises(FacePoserError, match=r"The face in 'x\.jpg' is turned by more than 60 degrees \(about \d+\)"):
        check_turns(fit, ["x.jpg"])


def test_a_turned_picture_is_upright_after_its_rotation() -> None:
    pixels = np.random.default_rng(3).normal(100.0, 20.0, (N_POINTS + 2, 2))
    found = landmarks_at(pixels)
    across = (found.points[263, :2] - found.points[33, :2]) @ upright(found)
    assert across[1] == pytest.approx(0.0, abs=1e-9)
    assert across[0] > 0.0
