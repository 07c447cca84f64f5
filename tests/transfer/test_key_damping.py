"""Damping of keys: it follows the error with which keys predict each other."""

import numpy as np

from faceposer.transfer.key_damping import DAMPINGS, chosen_damping, prediction_errors
from faceposer.transfer.key_weights import KeyWeights


def test_the_closed_form_is_the_error_of_fits_without_each_key() -> None:
    rng = np.random.default_rng(0)
    places = rng.normal(size=(12, 5)) * [3.0, 1.0, 0.3, 0.1, 0.03]
    answers = rng.normal(size=(12, 4))
    dampings = (1e-4, 1e-2)
    largest = np.linalg.norm(places - places.mean(axis=0), ord=2) ** 2
    for damping, error in zip(dampings, prediction_errors(places, answers, dampings), strict=True):
        squares = []
        for i in range(len(places)):
            x, y = np.delete(places, i, axis=0), np.delete(answers, i, axis=0)
            centred = x - x.mean(axis=0)
            slopes = np.linalg.solve(
                centred.T @ centred + damping * largest * np.eye(5), centred.T @ (y - y.mean(axis=0))
            )
            squares.append(((y.mean(axis=0) + (places[i] - x.mean(axis=0)) @ slopes - answers[i]) ** 2).sum())
        np.testing.assert_allclose(error, squares, rtol=1e-9)


def test_exact_keys_are_damped_least_and_noisy_ones_most() -> None:
    rng = np.random.default_rng(1)
    places = rng.normal(size=(40, 8)) * np.geomspace(1.0, 1e-3, 8)
    answers = places @ rng.normal(size=(8, 6))
    assert chosen_damping(places, answers) == DAMPINGS[0]
    assert chosen_damping(places, answers + 0.1 * rng.normal(size=answers.shape)) == DAMPINGS[-1]


def test_keys_that_do_not_predict_each_other_are_damped_most() -> None:
    rng = np.random.default_rng(3)
    places = np.vstack([np.zeros(12), np.diag(np.geomspace(1.0, 1e-2, 12))])
    assert chosen_damping(places, rng.normal(size=(13, 6))) == DAMPINGS[-1]


def test_as_many_parameters_as_keys_make_no_rounding_error() -> None:
    rng = np.random.default_rng(2)
    places = rng.normal(size=(10, 30)) * np.geomspace(1.0, 1e-6, 30)
    errors = prediction_errors(places, rng.normal(size=(10, 3)), (1e-12, 1e-6, 1e-3))
    assert np.isfinite(errors).all()
    assert errors[0].mean() > errors[2].mean()


def test_weights_stay_cardinal_with_damping_and_shrink_in_small_directions() -> None:
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.01], [0.2, -0.01]])
    weights = KeyWeights(places, 1e-3)
    np.testing.assert_allclose(weights(places), np.eye(4), atol=1e-9)
    far = np.array([[0.5, 10.0]])
    assert np.abs(weights(far)).max() < 0.5 * np.abs(KeyWeights(places)(far)).max()
    np.testing.assert_allclose(weights(far).sum(), 1.0)
