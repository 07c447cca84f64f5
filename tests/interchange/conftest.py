"""Fixtures of the tests of files."""

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.performance import Performance
from faceposer.model.subject_file import load_subject


@pytest.fixture(scope="session")
def low() -> FaceModel:
    """The head of few triangles, which is quick to write."""
    return build_face_model(load_subject("low"))


@pytest.fixture(scope="session")
def performance(low: FaceModel) -> Performance:
    """Nine frames of natural expressions, which leave 0 to 1 in places."""
    rng = np.random.default_rng(5)
    return Performance(1.5 * rng.standard_normal((9, low.n_coefficients)) * np.sqrt(low.subspace.variances), 24.0)
