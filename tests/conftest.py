"""Fixtures that all tests share."""

import pytest

from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.subject_file import load_subject


@pytest.fixture(scope="session")
def model() -> FaceModel:
    """The shipped man with the shipped prior."""
    return build_face_model(load_subject("man"))
