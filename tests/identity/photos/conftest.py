"""Fixtures of heads from photos."""

import numpy as np
import pytest

from faceposer.geometry.camera import Camera
from faceposer.identity.photos.face_camera import FaceCamera, rotation_of
from faceposer.identity.photos.face_places import FacePlaces, load_face_places
from faceposer.identity.photos.head_basis import HeadBasis, head_basis
from tests.identity.photos.sitting import Sitting, encoded_skin


@pytest.fixture(scope="session")
def basis() -> HeadBasis:
    """The linear model of heads."""
    return head_basis()


@pytest.fixture(scope="session")
def places() -> FacePlaces:
    """The shipped places of landmarks."""
    return load_face_places()


@pytest.fixture(scope="session")
def under() -> bytes:
    """The texture that the model would give the head of `sitting`, without brows."""
    return encoded_skin("none")


@pytest.fixture(scope="session")
def sitting(basis: HeadBasis) -> Sitting:
    """Photos of the average head."""
    return Sitting(basis)


@pytest.fixture
def face_camera() -> FaceCamera:
    """A camera that sees a face of 250 pixels somewhat from the side."""
    rotation = rotation_of(np.array([0.1, -0.2, 0.05])) @ np.diag([1.0, -1.0, -1.0])
    middle = np.array([0.0, 0.0, 7.0])
    camera = Camera(rotation, np.array([0.5, -0.8, 60.0]) - rotation @ middle, 800.0, (320, 340), (6.0, -4.0))
    return FaceCamera.of(camera, middle)
