"""Whatever a user does in whatever order, the window goes on, and its document and history stay sound."""

import json

import numpy as np
import pytest

from faceposer.gui.app import App
from faceposer.gui.testing.random_user import RandomUser
from faceposer.session.document import Document
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

EVENTS = 2500


@pytest.fixture
def app(open_window: OpenWindow) -> App:
    return open_window("man", (700, 520)).app


@pytest.mark.slow
def test_random_events_leave_everything_sound(app: App, capsys: pytest.CaptureFixture[str]) -> None:
    user = RandomUser(app, seed=2)
    for _ in range(4):
        user.step()
    for _ in range(EVENTS):
        user.next()
        assert not app.dialogs.waiting, app.dialogs.waiting[0].text
        assert np.isfinite(app.session.coefficients).all()
    user.rest()
    app.toolbox.cancel()
    app.session.wait()
    assert not app.busy
    assert not app.closing
    assert capsys.readouterr().err == ""
    assert len(user.seen) >= 5, "most kinds of constraints were made"

    session = app.session
    end = session.document
    end.resolved(session.model)
    again = Document.from_json(json.loads(json.dumps(end.to_json()))).resolved(session.model)
    assert again.constraints == end.constraints
    assert again.prior_weight == end.prior_weight
    assert (again.keyframes is None) == (end.keyframes is None)
    assert again.keyframes is None or again.keyframes.same(end.keyframes)
    np.testing.assert_array_equal(again.coefficients, end.coefficients)

    session.mode = "apply"
    steps = 0
    while session.can_undo:
        session.undo()
        steps += 1
    assert steps > 50
    assert session.document.constraints == ()
    np.testing.assert_allclose(session.coefficients, session.model.neutral(), atol=1e-12)
    for _ in range(steps):
        session.redo()
    assert session.document.same_input(end)
    session.animation.go_to(end.frame)
    assert not session.can_redo
    np.testing.assert_allclose(session.coefficients, end.coefficients, atol=1e-9)
