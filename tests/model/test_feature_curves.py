"""Curves of features follow the surface through their feature points, on every character."""

import numpy as np
import pytest

from faceposer.model.character_file import load_character
from faceposer.model.feature_curves import FEATURES, feature_curves


def test_features_pair_left_and_right() -> None:
    for name, feature in FEATURES.items():
        assert feature.name == name
        assert FEATURES[feature.mirror].mirror == name
        assert all(set(FEATURES[part].points) <= set(feature.points) for part in feature.components)


@pytest.mark.parametrize("name", ["man", "woman", "low", "creature"])
def test_curves_pass_through_their_feature_points(name: str) -> None:
    character = load_character(name)
    curves = feature_curves(character)
    assert list(curves) == list(FEATURES)
    for feature, of_chains in curves.items():
        for curve in of_chains:
            places = curve.points.positions(character.vertices, character.triangles)
            knots = character.vertices[[character.feature_points[point] for point in curve.names]]
            assert np.abs(places[curve.knots] - knots).max() < 0.004 * character.height, feature
            steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
            assert steps.max() < 0.02 * character.height, feature
            # No detours: hardly longer than the chain of its points, which a lip's curve exceeds a little.
            assert steps.sum() < 1.5 * np.linalg.norm(np.diff(knots, axis=0), axis=1).sum(), feature


@pytest.mark.parametrize("name", ["man", "woman", "low"])
def test_curves_stay_on_one_lip(name: str) -> None:
    # The shape that opens the jaw moves the lower lip only.
    character = load_character(name)
    opened = character.vertices + character.shapes[character.shape_names.index("jawOpen")]
    curves = feature_curves(character)
    upper, lower = (
        curves[feature][0].points.positions(opened, character.triangles)[:, 1].copy()
        for feature in ("inner upper lip", "inner lower lip")
    )
    middle = slice(len(upper) // 4, -(len(upper) // 4))
    assert upper[middle].min() > lower[len(lower) // 4 : -(len(lower) // 4)].max()
