"""A tool that is added to the toolbox works in strip, menu, list of constraints and history with no other change."""

import pytest

from faceposer.gui.testing.scripted_user import Robot
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings
from faceposer.tools.toolbox import Toolbox
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


class CountTool(PosingTool):
    """Counts clicks on the face; undo takes one away, Enter ends the count."""

    name = "count"
    label = "Count"
    key = "Z"
    help = "Count clicks"
    empty_text = "Click on the face to count."
    clicks = 0

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        return context.pick(event.position) is not None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        self.clicks += 1
        while event.kind != "release":
            event = yield

    @property
    def can_step_back(self) -> bool:
        return self.clicks > 0

    def step_back(self) -> bool:
        self.clicks -= 1
        return True

    @property
    def can_accept(self) -> bool:
        return self.clicks > 0

    def accept(self, context: ToolContext) -> bool:
        self.clicks = 0
        return True

    def hint(self, context: ToolContext) -> str:
        return "Click: count"


@pytest.fixture
def robot(open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch) -> Robot:
    build = Toolbox.__init__

    def build_with_count(self: Toolbox, context: ToolContext, settings: ToolSettings | None = None) -> None:
        build(self, context, settings)
        self.tools[CountTool.name] = CountTool(self.tool_settings)

    monkeypatch.setattr(Toolbox, "__init__", build_with_count)
    return open_window("low", (900, 700))


def test_it_is_chosen_used_undone_and_accepted(robot: Robot) -> None:
    app = robot.app
    robot.key("Z")
    tool = app.toolbox.chosen
    assert isinstance(tool, CountTool)
    for _ in range(3):
        robot.click(robot.at("9.3"))
    assert tool.clicks == 3
    assert app.actions["undo"].enabled()
    robot.key("Ctrl+Z")
    assert tool.clicks == 2
    assert app.actions["apply"].enabled()
    robot.key("Enter")
    assert tool.clicks == 0
    assert not app.actions["undo"].enabled()
    robot.click_widget("tool-point")
    robot.click_widget("tool-count")
    assert app.toolbox.chosen is tool


def test_a_tool_that_does_not_apply_to_the_character_is_not_offered(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(CountTool, "usable", lambda self, character: False)
    robot.frames(2)
    assert "tool-count" not in robot.app.widget_rects
    assert not robot.app.actions["tool-count"].enabled()
