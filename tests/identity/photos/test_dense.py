"""Heads from colours of photos."""

import numpy as np
import pytest

from faceposer.geometry.camera import Camera
from faceposer.identity.photos import skin_light
from faceposer.identity.photos.dense_term import DensePhoto
from faceposer.identity.photos.face_camera import N_CAMERA, FaceCamera, rotation_of
from faceposer.identity.photos.face_places import FacePlaces
from faceposer.identity.photos.harmonics import fitted_light, harmonic_slopes, harmonics
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.skin_light import SkinLight
from faceposer.identity.photos.skin_samples import SkinSamples, shipped_samples
from faceposer.identity.photos.unknowns import FitState, Layout, NormalEquations, ViewState
from faceposer.landmarks.drawing import visible_triangles

LIGHT = SkinLight(
    np.concatenate([np.full((1, 3), 0.4), np.zeros((8, 3))]),
    np.array([0.8, 0.75, 0.7]),
    np.array([0.6, -0.4, -np.sqrt(1.0 - 0.52)]),
    float(np.log(0.05)),
    float(np.log(12.0)),
)


@pytest.fixture(scope="module")
def samples(basis: HeadBasis, places: FacePlaces) -> SkinSamples:
    return shipped_samples(basis, places)


def _normals(n: int) -> np.ndarray:
    given = np.random.default_rng(0).standard_normal((n, 3))
    return given / np.linalg.norm(given, axis=1, keepdims=True)


def test_slopes_of_harmonics_match_finite_differences() -> None:
    normals = _normals(30)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        slope = (harmonics(normals + step) - harmonics(normals - step)) / 2e-6
        np.testing.assert_allclose(harmonic_slopes(normals)[:, :, axis], slope, atol=1e-6)


def test_light_is_recovered_in_spite_of_strange_colours() -> None:
    rng = np.random.default_rng(1)
    normals = _normals(4000)
    normals[:, 2] = -np.abs(normals[:, 2])
    light = np.zeros((9, 3))
    light[:4] = [[0.9, 0.85, 0.8], [-0.2, -0.2, -0.1], [-0.15, -0.1, -0.1], [0.1, 0.1, 0.1]]
    albedo = rng.uniform(0.3, 0.8, (4000, 3))
    colours = albedo * (harmonics(normals) @ light)
    # A tenth of the face is covered by something dark.
    colours[:400] = 0.05
    found = fitted_light(colours, albedo, normals, np.ones(4000))
    shade, true = harmonics(normals[400:]) @ found, harmonics(normals[400:]) @ light
    assert np.abs(shade - true).mean() < 0.03


def test_derivatives_match_finite_differences(basis: HeadBasis, samples: SkinSamples, face_camera: FaceCamera) -> None:
    width, height = face_camera.size
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    # Interpolated exactly, and with exact differences.
    image = np.stack([0.3 + 0.001 * columns, 0.5 - 0.0008 * rows, 0.2 + 0.0005 * columns + 0.0004 * rows], axis=2)
    photo = DensePhoto(image, samples, 0.03, 50)
    rng = np.random.default_rng(2)
    view = ViewState(0.05 * rng.standard_normal(basis.model.n_coefficients), face_camera, np.zeros(0))
    state = FitState(
        0.5 * rng.standard_normal(basis.n_identity), 0.5 * rng.standard_normal(len(samples.colours)), (view,)
    )
    chosen = rng.choice(len(samples.faces), 40, replace=False)
    found = photo.residual(state, 0, chosen)
    slopes = photo.derivatives(state, 0, found)
    layout = Layout.of(state)
    assert layout.size == slopes.shape[2]
    camera = list(range(layout.size - N_CAMERA, layout.size))
    for number in [0, 3, 40, 101, 105, 120, 150, *camera]:
        step = 1e-5 * np.eye(layout.size)[number]
        ahead, behind = (
            photo.residual(state.moved(layout, way * step), 0, chosen, found.lit.light).values for way in (1.0, -1.0)
        )
        np.testing.assert_allclose(slopes[:, :, number], (ahead - behind) / 2e-5, atol=2e-5, rtol=1e-3)


@pytest.fixture(scope="module")
def painted(basis: HeadBasis, samples: SkinSamples) -> tuple[np.ndarray, FitState, SkinLight]:
    """A picture of a head of the model, with one colour for each triangle, its truth and its light."""
    rotation = rotation_of(np.array([0.1, -0.35, 0.05])) @ np.diag([1.0, -1.0, -1.0])
    middle = np.array([0.0, 0.0, 7.0])
    camera = FaceCamera.of(
        Camera(rotation, np.array([0.5, -0.8, 60.0]) - rotation @ middle, 800.0, (320, 340), (6.0, -4.0)), middle
    )
    rng = np.random.default_rng(3)
    shape = 0.9 * rng.standard_normal(basis.n_identity) * (np.arange(basis.n_identity) < 20)
    texture = 0.5 * rng.standard_normal(len(samples.colours))
    view = ViewState(np.zeros(basis.model.n_coefficients), camera, np.zeros(0))
    state = FitState(shape, texture, (view,))
    photo = DensePhoto(np.zeros((340, 320, 3)), samples, 0.25, 2500)
    everything = np.arange(len(samples.faces))
    found = photo.residual(state, 0, everything, LIGHT)
    local = camera.local(samples.places(shape, view.pose))
    depth = local[:, 2] + np.exp(camera.log_depth)
    faces, _ = visible_triangles(camera.pixels(local), depth, samples.triangles, camera.size)
    image = np.full((340 * 320, 3), 0.5)
    image[faces >= 0] = found.lit.colours[faces[faces >= 0]]
    return image.reshape(340, 320, 3), state, LIGHT


def test_colours_bring_a_head_back_with_its_light(
    basis: HeadBasis, samples: SkinSamples, painted: tuple[np.ndarray, FitState, SkinLight]
) -> None:
    image, truth, light = painted
    photo = DensePhoto(image, samples, 0.25, 800)
    state = FitState(np.zeros(basis.n_identity), np.zeros(len(samples.colours)), truth.views)
    rng = np.random.default_rng(4)
    layout = Layout.of(state)
    # Neutral and seen by a known camera.
    fixed = np.r_[layout.size - N_CAMERA - basis.model.n_coefficients : layout.size]
    skin = basis.character.vertices[: basis.n_skin].astype(np.float64)
    seen = photo.visible(state, 0, skin, basis.editor.template.triangles)
    for _ in range(8):
        equations = NormalEquations(layout)
        equations.add_block(layout.shape, state.shape, 1.0)
        equations.add_block(layout.texture, state.texture, 1.0)
        photo.add(state, 0, photo.chosen(state, 0, seen, rng), equations)
        equations.matrix[fixed] = equations.matrix[:, fixed] = 0.0
        equations.matrix[fixed, fixed], equations.slope[fixed] = 1.0, 0.0
        state = state.moved(layout, equations.step(0.01))
    pose = truth.views[0].pose
    first, last, true = (samples.places(b, pose) for b in (np.zeros(basis.n_identity), state.shape, truth.shape))
    before, after = (np.linalg.norm(places - true, axis=1).mean() for places in (first, last))
    assert after < 0.4 * before
    assert photo.light is not None
    assert photo.light.towards @ light.towards > 0.9
    assert photo.sigma < 0.03


def test_the_slope_of_the_cost_under_the_best_light_matches_finite_differences(
    samples: SkinSamples, painted: tuple[np.ndarray, FitState, SkinLight], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, truth, _ = painted
    # Its derivative by the mean of the normals is left out.
    monkeypatch.setattr(skin_light, "_EXPOSURE_SPREAD", 1e3)
    columns, rows = np.meshgrid(np.arange(320) + 0.5, np.arange(340) + 0.5)
    image = np.stack([0.3 + 0.001 * columns, 0.5 - 0.0008 * rows, 0.2 + 0.0005 * columns + 0.0004 * rows], axis=2)
    photo = DensePhoto(image, samples, 0.25, 200)
    chosen = np.random.default_rng(6).choice(len(samples.faces), 200, replace=False)
    photo.noise = 0.1
    # Light and noise settle.
    for _ in range(25):
        photo.lit(truth, 0, chosen)
    equations = NormalEquations(Layout.of(truth))
    photo.add(truth, 0, chosen, equations)
    best = photo.light
    for number in (0, 5, 40, 100, 101, equations.layout.size - 6, equations.layout.size - 2):
        step = 5e-3 * np.eye(equations.layout.size)[number]
        costs = []
        for way in (1.0, -1.0):
            photo.light = best
            costs.append(photo.cost(truth.moved(equations.layout, way * step), 0, chosen))
        slope = (costs[0] - costs[1]) / 1e-2
        assert equations.slope[number] == pytest.approx(slope, rel=0.05, abs=0.05), number


def test_equations_of_any_picture_are_finite_and_convex(
    basis: HeadBasis, samples: SkinSamples, face_camera: FaceCamera
) -> None:
    width, height = face_camera.size
    image = np.full((height, width, 3), 0.5)
    photo = DensePhoto(image, samples, 0.03, 500)
    rng = np.random.default_rng(3)
    view = ViewState(np.zeros(basis.model.n_coefficients), face_camera, np.zeros(0))
    state = FitState(np.zeros(basis.n_identity), np.zeros(len(samples.colours)), (view,))
    seen = photo.visible(
        state, 0, basis.character.vertices[: basis.n_skin].astype(np.float64), basis.editor.template.triangles
    )
    assert 0.3 < len(seen) / len(samples.faces) < 1.0
    chosen = photo.chosen(state, 0, seen, rng)
    assert len(chosen) == 500
    equations = NormalEquations(Layout.of(state))
    photo.add(state, 0, chosen, equations)
    assert np.isfinite(equations.matrix).all()
    assert np.linalg.eigvalsh(equations.matrix).min() > -1e-6 * np.abs(equations.matrix).max()
