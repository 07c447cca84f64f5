"""Lamps and highlights on skin."""

import numpy as np

from faceposer.identity.photos.skin_light import N_UNKNOWN, SkinLight, prior_of

_STEP = 1e-5


def _light() -> SkinLight:
    around = np.concatenate([np.full((1, 3), 0.4), 0.1 * np.random.default_rng(0).standard_normal((8, 3))])
    towards = np.array([0.5, 0.3, -0.8])
    return SkinLight(around, np.array([0.5, 0.6, 0.7]), towards / np.linalg.norm(towards), -2.0, 2.3)


def _skin() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    normals = rng.standard_normal((60, 3))
    normals[:, 2] = -np.abs(normals[:, 2])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return rng.uniform(0.2, 0.8, (60, 3)), normals, rng.normal(0.0, 5.0, (60, 3)) + (0.0, 0.0, 60.0)


def test_derivatives_by_the_light_match_finite_differences() -> None:
    light, skin = _light(), _skin()
    rows = light.lit(*skin).by_light()
    for number in range(N_UNKNOWN):
        step = _STEP * np.eye(N_UNKNOWN)[number]
        ahead, behind = (light.moved(way * step).lit(*skin).colours for way in (1.0, -1.0))
        np.testing.assert_allclose(rows[:, :, number], (ahead - behind) / (2.0 * _STEP), atol=1e-6)


def test_derivatives_by_normals_and_places_match_finite_differences() -> None:
    light, (albedo, normals, middles) = _light(), _skin()
    lit = light.lit(albedo, normals, middles)
    for axis in range(3):
        step = _STEP * np.eye(3)[axis]
        slope = light.lit(albedo, normals + step, middles).colours - light.lit(albedo, normals - step, middles).colours
        np.testing.assert_allclose(lit.by_normal()[:, :, axis], slope / (2.0 * _STEP), atol=1e-6)
        slope = light.lit(albedo, normals, middles + step).colours - light.lit(albedo, normals, middles - step).colours
        np.testing.assert_allclose(lit.by_middle()[:, :, axis], slope / (2.0 * _STEP), atol=1e-6)


def test_derivatives_by_the_logarithm_of_the_albedo_match_finite_differences() -> None:
    light, (albedo, normals, middles) = _light(), _skin()
    ahead, behind = (light.lit(albedo * np.exp(way * _STEP), normals, middles).colours for way in (1.0, -1.0))
    slope = (ahead - behind) / (2.0 * _STEP)
    np.testing.assert_allclose(light.lit(albedo, normals, middles).by_log_albedo, slope, atol=1e-6)


def test_derivatives_of_the_prior_match_finite_differences() -> None:
    light, mean = _light(), np.linspace(0.2, 1.0, 10)
    values, rows = prior_of(light, mean)
    assert rows.shape == (len(values), N_UNKNOWN)
    for number in range(N_UNKNOWN):
        step = _STEP * np.eye(N_UNKNOWN)[number]
        ahead, behind = (prior_of(light.moved(way * step), mean)[0] for way in (1.0, -1.0))
        np.testing.assert_allclose(rows[:, number], (ahead - behind) / (2.0 * _STEP), atol=1e-5)


def test_a_highlight_is_where_the_lamp_is_mirrored() -> None:
    light = _light()
    towards_camera = np.array([0.0, 0.0, -1.0])
    half = light.towards + towards_camera
    normals = np.array([half / np.linalg.norm(half), towards_camera, -towards_camera])
    lit = light.lit(np.full((3, 3), 0.5), normals, np.tile(-60.0 * towards_camera, (3, 1)))
    np.testing.assert_allclose(lit.gloss[0], np.exp(light.log_gloss))
    assert lit.gloss[1] < lit.gloss[0]
    assert lit.gloss[2] == 0.0
