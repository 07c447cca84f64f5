"""Lights and the rival of the study of photos."""

import numpy as np
import pytest

from scripts.identity_study.eos_fit import LinearEos, has_eos
from scripts.photo_study.lights import ManyLights, PhongLight


def test_colours_of_a_surface_before_and_behind_a_lamp() -> None:
    towards = np.array([[0.0, 0.0, -1.0]])
    for lamp, lit in (((0.0, 0.0, -1.0), 0.5**2.2 * 0.8 + 0.1), ((0.0, 0.6, 0.8), 0.5**2.2 * 0.2)):
        light = PhongLight(np.array(lamp), np.full(3, 0.2), np.full(3, 0.6), 0.1)
        np.testing.assert_allclose(light.colours(np.full((1, 3), 0.5), towards, towards)[0], lit ** (1 / 2.2))


def test_other_lights_keep_the_lamp_and_are_brighter_from_above() -> None:
    light = PhongLight(np.array([0.0, 0.0, -1.0]), np.full(3, 0.4), np.zeros(3), 0.0)
    many = ManyLights.about(light, np.random.default_rng(0))
    np.testing.assert_array_equal(many.lamps[0], light.lamp)
    np.testing.assert_allclose(np.linalg.norm(many.lamps, axis=1), 1.0)
    up_and_down = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    found = many.colours(np.full((2, 3), 0.5), up_and_down, np.tile(light.lamp, (2, 1)))
    assert (found[0] > found[1] + 0.1).all()


@pytest.mark.skipif(not has_eos(), reason="eos is not installed: faceposer[bench]")
def test_eos_recovers_coefficients_of_points_seen_from_the_side() -> None:
    rng = np.random.default_rng(0)
    mean, modes = 5.0 * rng.standard_normal((300, 3)), rng.standard_normal((4, 300, 3))
    truth = np.array([1.0, -0.5, 0.7, 0.2])
    turned = np.array([[0.9, 0.0, 0.4], [0.0, -1.0, 0.0]])
    seen = (mean + np.tensordot(truth, modes, 1)) @ turned.T + (3.0, 4.0)
    eos = LinearEos(mean, modes, np.arange(300).reshape(-1, 3))
    np.testing.assert_allclose(eos.coefficients(np.arange(300), seen, 0.1), truth, atol=0.05)
