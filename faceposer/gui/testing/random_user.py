"""Plays a user without a plan, but with a seed: random events, for tests that last."""

import numpy as np

from faceposer.gui.actions import parsed_key
from faceposer.gui.app import App
from faceposer.gui.testing.scripted_user import Position
from faceposer.tools.tool import Button

# Events after which the next tool is taken up.
_TURN = 50
# Widgets that edit the session or its tools; others open files, menus or dialogs.
_WIDGETS = (
    *("tool-", "symmetry", "point:", "detail:", "hold", "measure:", "shape", "weight", "prior:", "mode:", "tab:"),
    *("sketch-method", "sketch-name", "sketch:", "feature:"),
    *("fix", "brush", "energy:", "curve:", "redraw", "stroke-energy:", "delete", "clear", "its-view"),
    *("track", "play", "set-key", "next-key", "loop", "auto-key", "length", "timing", "follow"),
)
_MODIFIERS: tuple[frozenset[str], ...] = (
    *(frozenset() for _ in range(9)),
    frozenset({"shift"}),
    frozenset({"ctrl"}),
    frozenset({"alt"}),
)
_BUTTONS: tuple[Button, ...] = ("left", "left", "left", "left", "left", "middle", "right")


class RandomUser:
    """A user who moves, clicks, drags, scrolls and presses keys at random.

    Attributes:
        rng: Decides what is done.
        seen: Kinds of constraints that there were.
        done: Number of events so far.
    """

    def __init__(self, app: App, seed: int | list[int]) -> None:
        """Use ``app``, whose clock follows the frames from now on."""
        self.app = app
        self.rng = np.random.default_rng(seed)
        self.held: Button | None = None
        self.time = 0.0
        self.seen: set[str] = set()
        self.done = 0
        app.window.clock = self.clock
        # Menus, dialogs and files are left alone; without a photo its keys do nothing.
        left_out = {"preferences", "photo-pin", "photo-skip", "photo-shown"}
        self.keys = [
            key
            for action in app.actions
            if action.menu not in {"File", "Help"} and action.name not in left_out
            for key in action.keys
            # Going to another frame takes the constraints away.
            for _ in range(1 if action.menu == "Animate" else 4)
        ]

    def clock(self) -> float:
        """Return the seconds since the start: 60 frames are one."""
        return self.time

    def step(self) -> None:
        """Let a frame pass."""
        self.time += 1.0 / 60.0
        self.app.window.wait(0.0)
        self.app.step()
        self.seen |= {constraint.kind for constraint in self.app.session.document.constraints}

    def place(self) -> Position:
        """Return a place to go to: mostly on the face, sometimes anywhere in the view, or on a widget."""
        app, rng = self.app, self.rng
        share = rng.random()
        left, top, right, bottom = app.widget_rects["view"]
        if share < 0.6:
            return (float(rng.normal((left + right) / 2, 45)), float(rng.normal((top + bottom) / 2 + 15, 50)))
        if share < 0.7:
            return (float(rng.uniform(left, right)), float(rng.uniform(top, bottom)))
        names = sorted(name for name in app.widget_rects if name.startswith(_WIDGETS))
        if not names:
            return ((left + right) / 2, (top + bottom) / 2)
        name = names[int(rng.integers(len(names)))]
        left, top, right, bottom = app.widget_rects[name]
        # What is scrolled away lies under other things, which may be left alone for good reasons.
        in_panel = "save" in app.widget_rects and right > app.widget_rects["save"][0]
        if in_panel and bottom > app.widget_rects["save"][1] - 4:
            return self.place()
        return (float(rng.uniform(left, right)), float(rng.uniform(top, bottom)))

    def next(self) -> None:
        """Do the next thing; take up one tool after the other."""
        tools = list(self.app.toolbox.tools)
        if self.done % _TURN == 0:
            self.take_up(tools[self.done // _TURN % len(tools)])
        self.done += 1
        self.act()

    def act(self) -> None:
        """Do one thing."""
        app, rng = self.app, self.rng
        share = rng.random()
        modifiers = _MODIFIERS[int(rng.integers(len(_MODIFIERS)))]
        if self.held is not None and share < 0.3:
            app.window.play_button(self.held, False, modifiers)
            self.held = None
        elif self.held is None and share < 0.4:
            app.window.play_move(*self.place())
            self.step()
            self.held = _BUTTONS[int(rng.integers(len(_BUTTONS)))]
            app.window.play_button(self.held, True, modifiers)
        elif share < 0.8:
            app.window.play_move(*self.place())
        elif share < 0.84:
            app.window.play_wheel(float(rng.integers(-2, 3)))
        else:
            held, name = parsed_key(self.keys[int(rng.integers(len(self.keys)))])
            for kind in ("press", "release"):
                app.window.play_key(name, kind, held)
        self.step()

    def take_up(self, tool: str) -> None:
        """Choose ``tool`` and look at the face from the front again."""
        self.rest()
        self.app.actions["view-front"].run()
        self.app.actions["frame"].run()
        if not self.app.panel_shown:
            self.app.actions["panel"].run()
        self.app.actions[f"tool-{tool}"].run()
        self.step()
        if tool == "curve":
            self.draw_curve()
        if tool == "sketch":
            self.draw_brow()

    def draw_curve(self) -> None:
        """Click the points of a curve over the face and accept it, which chance seldom brings together."""
        left, top, right, bottom = self.app.widget_rects["view"]
        for across in (-30.0, 0.0, 30.0):
            self.app.window.play_move(
                (left + right) / 2 + across, (top + bottom) / 2 + float(self.rng.uniform(-20, 60))
            )
            self.step()
            for down in (True, False):
                self.app.window.play_button("left", down, frozenset())
                self.step()
            self.time += 1.0
        for kind in ("press", "release"):
            self.app.window.play_key("Enter", kind, frozenset())
            self.step()

    def draw_brow(self) -> None:
        """Draw a brow, higher or lower than it is, since chance seldom draws a feature."""
        app = self.app
        ids = app.session.model.character.feature_points
        names = [name for name in ("4.1", "4.3", "4.5") if name in ids]
        (x, y), offset = app.viewport.origin, float(self.rng.uniform(-12, 8))
        places = app.viewport.camera.project(app.scene.vertices[[ids[name] for name in names]]) + (x, y + offset)
        for i, (u, v) in enumerate(places.tolist()):
            app.window.play_move(u, v)
            self.step()
            if i == 0:
                app.window.play_button("left", True, frozenset())
                self.step()
        app.window.play_button("left", False, frozenset())
        self.step()

    def rest(self) -> None:
        """Let go of everything."""
        if self.held is not None:
            self.app.window.play_button(self.held, False, frozenset())
            self.held = None
        for _ in range(4):
            self.step()
