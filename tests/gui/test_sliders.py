"""Sliders: the number is never under the handle, and nothing appears or moves under the pointer."""

import pytest
from imgui_bundle import imgui

from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.sliders import handle_share, number_left
from tests.windows import OpenWindow


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("low", (1000, 900))


def pull(robot: Robot) -> None:
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 8, y - 10))


def slide(robot: Robot, name: str, share: float) -> None:
    left, top, right, bottom = robot.app.widget_rects[name]
    middle = 0.5 * (top + bottom)
    robot.drag((left + 0.3 * (right - left), middle), (left + share * (right - left), middle))


@pytest.mark.parametrize("share", [0.0, 0.2, 0.49, 0.5, 0.51, 0.8, 1.0])
def test_the_number_is_beside_the_handle(robot: Robot, share: float) -> None:
    width, text, margin = 120.0, 34.0, 6.0
    left = number_left(share, width, text, margin)
    grab = imgui.get_style().grab_min_size
    handle = share * (width - grab)
    assert left >= 0.0
    assert left + text <= width
    assert left + text <= handle + 2.0 or left >= handle + grab - 2.0


def test_shares_of_a_logarithmic_slider() -> None:
    assert handle_share(0.0, 0.0, 100.0, 2) == 0.0
    assert handle_share(1.0, 0.0, 100.0, 2) == pytest.approx(0.5)
    assert handle_share(100.0, 0.0, 100.0, 2) == 1.0
    assert handle_share(25.0, 0.0, 100.0, None) == 0.25
    assert handle_share(2.0, 0.0, 1.0, None) == 1.0


def test_the_handle_is_where_the_number_supposes_it(robot: Robot) -> None:
    """A slider is set by a click to the place that ``handle_share`` returns for its new value."""
    for name, high, decimals in (("spread", 1.0, None), ("weight", 10.0, 2)):
        left, top, right, bottom = robot.app.widget_rects[name]
        for share in (0.3, 0.7):
            robot.click((left + share * (right - left), 0.5 * (top + bottom)))
            document = robot.app.session.document
            value = document.spread if name == "spread" else document.prior_weight
            assert handle_share(value, 0.0, high, decimals) == pytest.approx(share, abs=0.05)


def test_sliders_keep_their_width(robot: Robot) -> None:
    rects = robot.app.widget_rects
    pull(robot)
    names = ("spread", "weight", "detail:weight")
    before = {name: rects[name] for name in names}
    for name in names:
        assert f"{name}:reset" in rects
        slide(robot, name, 0.8)
    robot.frames(3)
    assert {name: rects[name] for name in names} == before
    assert len({rect[2] for rect in before.values()}) == 1


def test_every_weight_can_be_reset(robot: Robot) -> None:
    app = robot.app
    pull(robot)
    slide(robot, "detail:weight", 0.9)
    assert app.session.document.constraints[0].weight > 2.0
    robot.click_widget("detail:weight:reset")
    assert app.session.document.constraints[0].weight == 1.0
    robot.key("Ctrl+Z")
    assert app.session.document.constraints[0].weight > 2.0
    robot.key("H")
    robot.click_widget("hold:Nose")
    slide(robot, "hold-weight", 0.9)
    assert app.session.document.constraints[-1].weight > 2.0
    robot.click_widget("hold-weight:reset")
    assert app.session.document.constraints[-1].weight == 1.0
