"""The factors between regions form a correlation matrix with the intended independence."""

import numpy as np

from faceposer.model.coupling import coupling, region_of_shape


def test_factors_are_a_correlation_matrix_that_parts_the_regions() -> None:
    names = [
        "browInnerUp",
        "browDownLeft",
        "eyeBlinkLeft",
        "eyeLookUpLeft",
        "noseSneerLeft",
        "jawOpen",
        "mouthSmileLeft",
    ]
    matrix = coupling(names)
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9
    pair = {(a, b): matrix[i, j] for i, a in enumerate(names) for j, b in enumerate(names)}
    assert pair["jawOpen", "mouthSmileLeft"] > 0.95
    assert pair["browInnerUp", "mouthSmileLeft"] < pair["noseSneerLeft", "mouthSmileLeft"] < 0.95
    assert abs(pair["eyeLookUpLeft", "browInnerUp"]) < 1e-9


def test_every_shape_has_a_region() -> None:
    assert region_of_shape("eyeLookInLeft") == "gaze"
    assert region_of_shape("eyeSquintRight") == "lids"
    assert region_of_shape("cheekPuff") == "mouth"
