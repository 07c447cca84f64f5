"""Films that several tests share."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.model.face_model import FaceModel
from tests.film.films import Pixels, speaking_face

#: Weights of the jaw in the frames of the film.
JAW = tuple((0.25 * (1.0 - np.cos(2.0 * np.pi * np.arange(9) / 8.0))).round(3).tolist())


@pytest.fixture(scope="session")
def speaking(woman: FaceModel) -> list[Pixels]:
    """Frames of the woman, who opens and closes her mouth."""
    return speaking_face(woman, JAW)


@pytest.fixture(scope="session")
def frames_folder(speaking: list[Pixels], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The frames as a folder of pictures, for which PyAV is not needed."""
    folder = tmp_path_factory.mktemp("speaking")
    for k, pixels in enumerate(speaking):
        Image.fromarray(pixels).save(folder / f"{k:03}.png")
    return folder
