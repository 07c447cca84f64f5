"""Tooltips cover nothing that can be pressed: the place of one, and all those of panels and dialogs."""

import math
from pathlib import Path

import pytest
from imgui_bundle import imgui

from faceposer.gui.features.export.feature import ExportFeature
from faceposer.gui.features.import_character.feature import ImportCharacterFeature
from faceposer.gui.features.photo_head.feature import PhotoHeadFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.tooltips import tooltip_place
from faceposer.gui.widgets.widget_rects import Rectangle, overlap
from tests.windows import OpenWindow

VIEW = (1000.0, 800.0)
TEXT = 300.0 * 20.0


def measured(width: float) -> tuple[float, float]:
    """Return the size of a text of 20 lines of height 15 at 20 pixels width, as if it wrapped anywhere."""
    wide = min(width, 300.0)
    return (wide, TEXT / wide)


def place(item: Rectangle, window: Rectangle, obstacles: list[Rectangle], near: float = math.inf) -> Rectangle | None:
    found = tooltip_place(item, window, VIEW, obstacles, measured, 15.0, near)
    if found is None:
        return None
    (left, top), width = found
    wide, tall = measured(width)
    return (left, top, left + wide, top + tall)


def test_beside_the_window_on_the_nearer_side() -> None:
    window = (350.0, 200.0, 650.0, 600.0)
    near_left = place((360.0, 300.0, 400.0, 320.0), window, [])
    near_right = place((600.0, 300.0, 640.0, 320.0), window, [])
    assert near_left is not None
    assert near_right is not None
    assert near_left[2] < window[0]
    assert near_right[0] > window[2]


def test_beside_a_window_whose_edge_is_far_only_if_there_is_no_other_place() -> None:
    window, item = (350.0, 200.0, 650.0, 600.0), (460.0, 300.0, 490.0, 320.0)
    near = place(item, window, [], near=60.0)
    assert near is not None
    assert near[1] == item[3] + 6.0, "below the widget"
    around = [(350.0, 200.0, 650.0, 298.0), (350.0, 322.0, 650.0, 600.0)]
    around += [(350.0, 298.0, 458.0, 322.0), (492.0, 298.0, 650.0, 322.0)]
    far = place(item, window, around, near=60.0)
    assert far is not None
    assert far[2] < window[0]
    edge = place((360.0, 300.0, 390.0, 320.0), window, [], near=60.0)
    assert edge is not None
    assert edge[2] < window[0]


def test_above_or_below_the_widget_where_nothing_is_in_the_way() -> None:
    window, item = (0.0, 0.0, 1000.0, 800.0), (300.0, 300.0, 400.0, 320.0)
    below, above = (250.0, 322.0, 600.0, 400.0), (250.0, 250.0, 600.0, 298.0)
    free = place(item, window, [])
    assert free is not None
    assert free[1] > item[3]
    over = place(item, window, [below])
    assert over is not None
    assert over[3] < item[1]
    beside = place(item, window, [below, above])
    assert beside is not None
    assert beside[0] > item[2]
    left, right = (0.0, 200.0, 298.0, 700.0), (402.0, 200.0, 1000.0, 700.0)
    assert place(item, window, [below, above, left, right]) is None


class Tooltips:
    """Boxes of the tooltips of the last frames."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.boxes: list[Rectangle] = []
        end = imgui.end_tooltip

        def recorded() -> None:
            low, size = imgui.get_window_pos(), imgui.get_window_size()
            # In its first frame the size of a window is not known.
            if size.x > 40.0:
                self.boxes.append((low.x, low.y, low.x + size.x, low.y + size.y))
            end()

        monkeypatch.setattr(imgui, "end_tooltip", recorded)

    def over(self, robot: Robot, name: str) -> Rectangle | None:
        robot.move(robot.app.widget_rects.center(name))
        self.boxes.clear()
        robot.frames(4)
        return self.boxes[-1] if self.boxes else None


@pytest.fixture
def tooltips(monkeypatch: pytest.MonkeyPatch) -> Tooltips:
    return Tooltips(monkeypatch)


def at_once() -> None:
    style = imgui.get_style()
    style.hover_stationary_delay = style.hover_delay_normal = 0.0


def covered(robot: Robot, box: Rectangle, prefix: str) -> list[str]:
    seen = robot.app.widget_rects._visible.items()
    return [name for name, (_, rect) in seen if name.startswith(prefix) and overlap(box, rect)]


@pytest.mark.parametrize(("size", "scale"), [((1360, 860), 1.0), ((700, 700), 1.0), ((900, 600), 2.0)])
@pytest.mark.parametrize("dialog", ["import", "transfer", "export-other", "preferences"])
def test_in_dialogs(
    dialog: str, size: tuple[int, int], scale: float, open_window: OpenWindow, tooltips: Tooltips
) -> None:
    robot = open_window("low", size, ui_scale=scale)
    robot.app.actions[dialog].run()
    if dialog == "import":
        robot.app.features[ImportCharacterFeature].form.captures = ["/a/take.csv"]
    if dialog == "export-other":
        # Films have the most options.
        robot.app.features[ExportFeature].form.suffix = ".mp4"
    robot.frames(8)
    at_once()
    prefix = {"export-other": "export"}.get(dialog, dialog)
    seen = 0
    for name in [name for name in robot.app.widget_rects if name.startswith(f"{prefix}:")]:
        if name in robot.app.widget_rects._visible and (box := tooltips.over(robot, name)) is not None:
            seen += 1
            assert not covered(robot, box, f"{prefix}:"), name
    if dialog == "export-other":
        # The size and the duration of a film; a small window has no room for either.
        assert seen == (2 if scale == 1.0 else 0)
    else:
        assert seen >= 6


@pytest.mark.parametrize(("size", "scale"), [((1360, 860), 1.0), ((900, 600), 2.0)])
def test_in_the_window(size: tuple[int, int], scale: float, open_window: OpenWindow, tooltips: Tooltips) -> None:
    robot = open_window("low", size, ui_scale=scale)
    app = robot.app
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 8, y - 10))
    robot.key("I")
    robot.frames(4)
    at_once()
    seen = 0
    for name in [name for name in app.widget_rects if name != "view" and not name.startswith("menu:")]:
        if name in app.widget_rects._visible and (box := tooltips.over(robot, name)) is not None:
            seen += 1
            assert not covered(robot, box, ""), name
    assert seen > 10


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_beside_the_button_that_removes_a_photo(scale: float, open_window: OpenWindow, tooltips: Tooltips) -> None:
    robot = open_window("low", (1280, 720), ui_scale=scale)
    head = robot.app.features[PhotoHeadFeature]
    head.show()
    for name in ("one", "two"):
        head.add(Path(f"/somewhere/{name}.jpg"))
    robot.frames(8)
    at_once()
    for i in range(2):
        box = tooltips.over(robot, f"photo-head:{i}:remove")
        assert box is not None
        left, top, right, bottom = robot.app.widget_rects[f"photo-head:{i}:remove"]
        gap = max(left - box[2], box[0] - right, top - box[3], box[1] - bottom)
        assert gap < 20.0 * scale
        assert not covered(robot, box, "photo-head:")
