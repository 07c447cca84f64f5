"""The timeline: keys of the animation, playing it, and going from frame to frame."""

import math
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from faceposer.animation.keyframes import LONGEST, Key, Keyframes
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.timeline.actions import build_timeline_actions
from faceposer.gui.features.timeline.panel import draw_timeline, timeline_height
from faceposer.gui.features.timeline.track import Track

if TYPE_CHECKING:
    from faceposer.session.animating import AnimationController


class TimelineFeature(Feature):
    """The strip beneath the view, and what its menu does.

    Attributes:
        shown: Whether the strip is there; it comes by itself with the first key.
        track: The ruler and the keys as they are drawn.
    """

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``."""
        super().__init__(context)
        self.shown = False
        self.track = Track(self)
        self._selected: frozenset[int] = frozenset()
        self._copied: tuple[Key, ...] = ()
        self._had_keys = False
        # When playing began, on the window's clock, and at which frame; None while it rests.
        self._begun: tuple[float, int] | None = None
        self._pins_selected: frozenset[int] = frozenset()

    # The animation

    @property
    def animation(self) -> "AnimationController":
        """What is done with the keys of the session that is edited."""
        return self.context.session.animation

    @property
    def keyframes(self) -> Keyframes:
        """The keys; an animation without any if there are none yet."""
        return self.animation.keyframes

    @property
    def free(self) -> bool:
        """Whether keys may be changed now: nothing is being dragged, and nothing plays."""
        return not (self.context.busy or self.track.active)

    @property
    def reachable(self) -> bool:
        """Whether another frame may be shown now, which also ends playing."""
        return not (self.context.toolbox.active or self.context.session.editing)

    # The feature

    @property
    def playing(self) -> bool:
        """Whether the animation plays."""
        return self._begun is not None

    @property
    def busy(self) -> bool:
        """Whether the animation plays."""
        return self.playing

    @property
    def patience(self) -> float:
        """Seconds until the next frame is due."""
        if self._begun is None:
            return math.inf
        begun, _first = self._begun
        keyframes, elapsed = self.keyframes, self.context.clock() - begun
        passed = math.floor(elapsed * keyframes.rate)
        return max((passed + 1) / keyframes.rate - elapsed, 0.0)

    @property
    def hint(self) -> str:
        """What the mouse will do on the track, or while the animation plays."""
        if self.playing:
            return "Press on the view: stop   ·   middle drag: turn the view"
        return self.track.hint if self.shown else ""

    @property
    def strip_height(self) -> float:
        """Height of the strip, or 0 while it is hidden."""
        return timeline_height() if self.shown else 0.0

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the menu "Animate" and the switch in "View"."""
        return build_timeline_actions(self)

    def session_changed(self) -> None:
        """Show the animation of the new session, if it has one."""
        self._begun = None
        self._selected = frozenset()
        self._copied = ()
        self.track.reset()
        self.shown = self._had_keys = bool(self.keyframes.keys)

    def before_press(self) -> None:
        """Stop: a press on the view means the face that is there."""
        self.stop()

    def update(self) -> None:
        """Show the frame that is due, and come into sight with the first key."""
        context = self.context
        has_keys = bool(self.keyframes.keys)
        if has_keys and not self._had_keys:
            self.shown = True
        self._had_keys = has_keys
        self.animation.auto_key = context.settings.auto_key and self.shown
        pins, self._pins_selected = self._pins_selected, context.toolbox.selection
        if context.toolbox.selection - pins:
            self._selected = frozenset()
        if self.playing:
            self._follow_clock()

    def draw_strip(self) -> None:
        """Draw the strip."""
        draw_timeline(self)

    # Playing

    def play(self) -> None:
        """Play from here, or from the begin where the end is reached; or stop."""
        if self.playing:
            self.stop()
            return
        last = self.keyframes.length - 1
        if not (self.reachable and self.keyframes.keys) or last == 0:
            return
        if self.animation.frame >= last:
            self.go_to(0)
        self.context.comparing = False
        self._begun = (self.context.clock(), self.animation.frame)
        self.context.redraw()

    def stop(self) -> None:
        """Stay at the frame that is shown."""
        if self.playing:
            self._begun = None
            self.context.redraw()

    def _follow_clock(self) -> None:
        assert self._begun is not None
        context = self.context
        if context.toolbox.posing or context.session.editing or not self.keyframes.keys or context.is_modal:
            self.stop()
            return
        begun, first = self._begun
        keyframes = self.keyframes
        frame = first + math.floor((self.context.clock() - begun) * keyframes.rate)
        if frame >= keyframes.length:
            if keyframes.loop:
                frame %= keyframes.length
            else:
                frame = keyframes.length - 1
                self.stop()
        self._show(frame)

    # Frames

    def go_to(self, frame: int | None) -> None:
        """Show ``frame``, at least the first; nothing happens for None, or while something is dragged."""
        self.stop()
        self.context.slider_edit.let_go()
        if frame is None or not self.reachable:
            return
        self.context.comparing = False
        left = self.animation.frame
        if self._show(frame):
            undo = self.context.actions["undo"].shortcut
            self.context.notify(f"The pose at frame {left + 1} had no key; {undo} brings it back")

    def _show(self, frame: int) -> bool:
        if frame == self.animation.frame:
            return False
        lost = self.animation.go_to(frame)
        self.context.redraw()
        return lost

    def step(self, by: int) -> None:
        """Go ``by`` frames on, within the animation."""
        self.go_to(min(max(self.animation.frame + by, 0), self.keyframes.length - 1))

    # Keys

    @property
    def selected(self) -> frozenset[int]:
        """The frames whose keys are selected: an undo may have taken some away."""
        return self._selected.intersection(self.keyframes.frames)

    def select(self, frames: Collection[int]) -> None:
        """Select the keys at ``frames``, and no constraint any more."""
        self._selected = frozenset(frames)
        if self._selected:
            self.context.toolbox.tool_settings.selection.set()
            self._pins_selected = frozenset()
        self.context.redraw()

    @property
    def selects(self) -> bool:
        """Whether keys are selected."""
        return bool(self.selected)

    @property
    def targets(self) -> frozenset[int]:
        """The frames whose keys a command means: those that are selected, or else that of the frame that is shown."""
        return self.selected or frozenset({self.animation.frame}).intersection(self.keyframes.frames)

    def set_key(self) -> None:
        """Make the face on the screen a key."""
        self.stop()
        self.shown = True
        self.animation.set_key()
        self.context.redraw()

    def delete_selected(self) -> None:
        """Remove the keys that are selected."""
        self.delete(self.selected)

    def delete(self, frames: Collection[int]) -> None:
        """Remove the keys at ``frames``."""
        if frames:
            self.change(self.keyframes.without(frames), f"Delete {counted(frames)}")

    def move(self, frames: Collection[int], by: int) -> None:
        """Move the keys at ``frames`` by frames, and keep them selected."""
        self.change(self.keyframes.moved(frames, by), f"Move {counted(frames)}")
        self.select({frame + by for frame in frames})

    def duplicate(self, frames: Collection[int], by: int) -> None:
        """Copy the keys at ``frames`` to later frames, and select the copies."""
        self.change(self.keyframes.copied(frames, by), f"Copy {counted(frames)}")
        self.select({frame + by for frame in frames})

    @property
    def can_paste(self) -> bool:
        """Whether keys have been copied."""
        return bool(self._copied)

    def copy(self) -> None:
        """Remember the keys that are selected, or the one at the frame that is shown."""
        frames = self.targets
        self._copied = tuple(key for key in self.keyframes.keys if key.frame in frames)
        self.context.notify(f"Copied {counted(frames)}")

    def paste(self) -> None:
        """Add the keys that were copied, the first of them at the frame that is shown."""
        by = self.animation.frame - self._copied[0].frame
        keys = [Key(key.frame + by, key.pose) for key in self._copied if key.frame + by < LONGEST]
        self.change(self.keyframes.with_keys(keys), f"Paste {counted(keys)}")
        self.select({key.frame for key in keys})

    def select_all(self) -> None:
        """Select all keys."""
        self.select(self.keyframes.frames)

    def change(self, keyframes: Keyframes, label: str, merges: bool = False) -> None:
        """Exchange the animation as one step, unless something is being dragged; see ``AnimationController.change``."""
        self.stop()
        self.context.slider_edit.let_go()
        if self.reachable:
            self.animation.change(keyframes, label, merges)
            self.context.redraw()

    # The strip

    def toggle_auto_key(self) -> None:
        """Let changed poses become keys by themselves, or not."""
        self.context.settings.auto_key = not self.context.settings.auto_key
        self.context.redraw()

    def present(self) -> None:
        """Show another animation: the strip, all of its frames, and nothing selected."""
        self.stop()
        self.shown = True
        self._selected = frozenset()
        self.track.reset()
        self.context.redraw()

    def toggle(self) -> None:
        """Show the strip, or hide it."""
        self.stop()
        self.shown = not self.shown
        self.context.redraw()


def counted(keys: Collection[object]) -> str:
    """Return how many ``keys`` there are, in words."""
    return "a key" if len(keys) == 1 else f"{len(keys)} keys"
