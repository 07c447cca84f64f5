"""Photos with clear rights that come with packages of the tests."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image


def grace_hopper() -> NDArray[np.uint8]:
    """Return the photo of Grace Hopper that comes with matplotlib (US Navy, public domain), 512 x 600."""
    spec = importlib.util.find_spec("matplotlib")
    path = Path(spec.origin).parent / "mpl-data" / "sample_data" / "grace_hopper.jpg" if spec and spec.origin else None
    if path is None or not path.is_file():
        pytest.skip("needs matplotlib, of the extra 'plots', for its sample photo")
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def astronaut() -> NDArray[np.uint8]:
    """Return the photo of Eileen Collins that comes with scikit-image (NASA, public domain), 512 x 512."""
    if importlib.util.find_spec("skimage") is None:
        pytest.skip("needs scikit-image, of the extra 'dev', for its sample photo")
    import skimage.data

    return np.asarray(skimage.data.astronaut())
