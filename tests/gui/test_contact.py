"""Contact in the window: what is shown is what is exported, and the View panel and its menu turn it off."""

from pathlib import Path

import numpy as np
import pytest

from faceposer.geometry.mesh_io import read_mesh
from faceposer.gui.testing.scripted_user import Robot
from faceposer.interchange.meshes import write_posed_obj
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window()


def test_the_window_shows_contact_and_turns_it_off(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    session = app.session
    pose = session.model.coefficients_of({"eyeBlinkLeft": 1.7, "eyeBlinkRight": 1.7})
    with session.edit("Pose"):
        session.set_start(pose)
    robot.frames(2)
    shown = app.scene.vertices.copy()
    write_posed_obj(tmp_path / "a.obj", session.model, pose)
    np.testing.assert_allclose(read_mesh(tmp_path / "a.obj").vertices, shown, atol=1e-4)
    assert np.abs(shown - session.model.instance(pose)).max() > 0.1
    app.actions["contact"].run()
    robot.frames(2)
    assert not session.document.contact
    np.testing.assert_array_equal(app.scene.vertices, session.model.instance(pose))
    robot.key("Ctrl+Z")
    robot.frames(2)
    np.testing.assert_array_equal(app.scene.vertices, shown)
