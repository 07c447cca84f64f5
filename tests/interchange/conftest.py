"""Fixtures of the tests of files."""

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance


@pytest.fixture(scope="session")
def performance(low: FaceModel) -> Performance:
    """Nine frames of natural expressions, which leave 0 to 1 in places."""
    rng = np.random.default_rng(5)
    return Performance(1.5 * rng.standard_normal((9, low.n_coefficients)) * np.sqrt(low.subspace.variances), 24.0)
