"""Heads from colours of photos."""

import numpy as np
import pytest

from faceposer.identity.photos.dense_term import DensePhoto
from faceposer.identity.photos.face_camera import N_CAMERA, FaceCamera
from faceposer.identity.photos.face_places import FacePlaces
from faceposer.identity.photos.harmonics import fitted_light, harmonic_slopes, harmonics
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.skin_samples import SkinSamples, shipped_samples
from faceposer.identity.photos.unknowns import FitState, Layout, NormalEquations, ViewState


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
            photo.residual(state.moved(layout, way * step), 0, chosen, found.light).values for way in (1.0, -1.0)
        )
        np.testing.assert_allclose(slopes[:, :, number], (ahead - behind) / 2e-5, atol=2e-5, rtol=1e-3)


def test_colours_move_a_wrong_head_towards_the_true_one(
    basis: HeadBasis, samples: SkinSamples, face_camera: FaceCamera
) -> None:
    """The colours of the face itself, put where it is seen, have no slope at the truth and pull elsewhere."""
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
    assert np.linalg.eigvalsh(equations.matrix).min() > -1e-6
