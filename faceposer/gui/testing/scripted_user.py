"""A scripted user for tests and the demo, with events that take the path of real ones."""

from collections.abc import Callable, Sequence

from faceposer.gui.actions import parsed_key
from faceposer.gui.app import App
from faceposer.gui.events import Modifiers
from faceposer.tools.tool import Button

Position = tuple[float, float]


class Robot:
    """A scripted user; every event is followed by a frame."""

    def __init__(self, app: App, after_frame: Callable[["Robot"], None] | None = None) -> None:
        """Use ``app`` and call ``after_frame`` with the robot after each frame, for example to record it."""
        self.app = app
        self.position: Position = (0.0, 0.0)
        self.pressed: Button | None = None
        self._after_frame = after_frame
        self._frames = 0
        app.window.clock = self.time
        self.frames(2)

    def time(self) -> float:
        """Return the simulated time in seconds, at 60 frames per second."""
        return self._frames / 60.0

    def frames(self, count: int = 1) -> None:
        """Draw ``count`` frames."""
        for _ in range(count):
            self._frames += 1
            self.app.window.wait(0.0)
            self.app.step(force=True)
            if self._after_frame is not None:
                self._after_frame(self)

    def move(self, position: Position, steps: int = 1, ease: bool = False) -> None:
        """Move the pointer in ``steps`` to ``position`` in the window; with ``ease``, start and end slowly."""
        begin = self.position
        for step in range(1, steps + 1):
            share = step / steps
            share = share * share * (3.0 - 2.0 * share) if ease else share
            x, y = (begin[i] + share * (position[i] - begin[i]) for i in range(2))
            self.position = (x, y)
            self.app.window.play_move(x, y)
            self.frames()

    def press(self, button: Button = "left", modifiers: Modifiers = frozenset()) -> None:
        """Press ``button``."""
        self.pressed = button
        self.app.window.play_button(button, True, modifiers)
        self.frames()

    def release(self, button: Button = "left", modifiers: Modifiers = frozenset()) -> None:
        """Release ``button``."""
        self.pressed = None
        self.app.window.play_button(button, False, modifiers)
        self.frames(2)

    def click(self, position: Position, button: Button = "left", modifiers: Modifiers = frozenset()) -> None:
        """Click at ``position``."""
        self.move(position)
        self.press(button, modifiers)
        self.release(button, modifiers)

    def drag(
        self,
        begin: Position,
        end: Position,
        steps: int = 8,
        button: Button = "left",
        modifiers: Modifiers = frozenset(),
        ease: bool = False,
    ) -> None:
        """Drag from ``begin`` to ``end``."""
        self.move(begin)
        self.press(button, modifiers)
        self.move(end, steps, ease)
        self.release(button, modifiers)

    def draw(self, way: Sequence[Position], release: bool = True, ease: int = 1) -> None:
        """Draw along ``way``, with ``ease`` steps to its begin; the button stays pressed without ``release``."""
        self.move(way[0], ease, ease > 1)
        self.press()
        for position in way[1:]:
            self.move(position)
        if release:
            self.release()

    def wheel(self, notches: float) -> None:
        """Turn the wheel."""
        self.app.window.play_wheel(notches)
        self.frames(2)

    def key(self, text: str) -> None:
        """Tap a key with its modifiers, such as "Ctrl+Z"."""
        self.key_down(text)
        self.key_up(text)

    def key_down(self, text: str) -> None:
        """Press a key with its modifiers and hold it."""
        modifiers, name = parsed_key(text)
        self.app.window.play_key(name, "press", modifiers)
        self.frames(2)

    def key_up(self, text: str) -> None:
        """Release a key."""
        modifiers, name = parsed_key(text)
        self.app.window.play_key(name, "release", modifiers)
        self.frames(2)

    def type(self, text: str) -> None:
        """Type ``text``."""
        self.app.window.play_text(text)
        self.frames(2)

    def click_widget(self, name: str) -> None:
        """Click on the widget ``name`` of a panel, menu or dialog.

        Raises:
            KeyError: If it is not visible.
        """
        self.click(self.app.widget_rects.center(name))
        self.frames(2)

    # Points of the face

    def at(self, feature: str) -> Position:
        """Return the position in the window of the feature point ``feature``, hidden or not."""
        app = self.app
        vertex = app.session.model.character.feature_points[feature]
        u, v = app.viewport.camera.project(app.scene.vertices[[vertex]])[0].tolist()
        return (u + app.viewport.origin[0], v + app.viewport.origin[1])
