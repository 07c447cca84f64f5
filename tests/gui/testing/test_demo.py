"""The demo plays through the real program, and what it leaves is sound."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.gui.testing.demo import DemoFiles, run
from faceposer.session.opening import open_session

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> DemoFiles:
    return run(tmp_path_factory.mktemp("demo") / "new" / "folder", progress=lambda text: None)


@pytest.mark.slow
def test_pictures_show_the_face_change(demo: DemoFiles) -> None:
    assert len(demo.frames) > 50
    first, last = (np.asarray(Image.open(demo.frames[i])).astype(int) for i in (0, -1))
    assert first.shape == last.shape
    assert np.abs(first - last).mean() > 1.0
    with Image.open(demo.animation) as animation:
        assert animation.n_frames > 50  # type: ignore[attr-defined]
    assert demo.animation.stat().st_size < 4 * 2**20
    with Image.open(demo.image) as picture:
        assert picture.size == first.shape[1::-1]


def test_mesh_and_session_hold_the_same_smile(demo: DemoFiles) -> None:
    session = open_session(str(demo.session))
    model = session.model
    mesh = read_mesh(demo.mesh)
    solved = model.surface(session.coefficients)
    assert np.abs(mesh.vertices - solved).max() < 1e-5 * np.ptp(model.character.vertices[:, 1])
    weights = dict(zip(model.character.shape_names, model.weights_of(session.coefficients), strict=True))
    assert min(weights["mouthSmileLeft"], weights["mouthSmileRight"]) > 0.3
    assert max(weights["browInnerUpLeft"], weights["browInnerUpRight"]) > 0.3
    assert max(session.residuals_px) < 5.0
    assert len(session.document.constraints) == 5


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FacePoserError, match=r"The folder '.*file/demo' cannot be written"):
        run(tmp_path / "file" / "demo")
