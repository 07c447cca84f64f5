"""Editing and playback of the keys: the state that the timeline's track, panel and actions share."""

import math
from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING

from faceposer.animation.keyframes import LONGEST, Key, Keyframes
from faceposer.gui.context import EditorContext
from faceposer.sketch.inbetweens import Inbetweens

if TYPE_CHECKING:
    from faceposer.session.animating import AnimationController


class TimelineEditor:
    """Selection, clipboard, playback and key commands of the timeline.

    Attributes:
        context: The editor that the timeline belongs to.
        shown: True if the timeline is visible. It opens by itself with the first key.
        dragging: True while keys are dragged or box-selected on the track.
    """

    def __init__(self, context: EditorContext) -> None:
        self.context = context
        self.shown = False
        self.dragging = False
        self._selected: frozenset[int] = frozenset()
        self._clipboard: tuple[Key, ...] = ()
        self._had_keys = False
        # Time on the window's clock and frame at which playback started; None while it is stopped.
        self._playback_start: tuple[float, int] | None = None
        self._selected_constraints: frozenset[int] = frozenset()

    # The animation

    @property
    def animation(self) -> "AnimationController":
        """The animation controller of the current session."""
        return self.context.session.animation

    @property
    def keyframes(self) -> Keyframes:
        """The keys; an empty animation if there are none."""
        return self.animation.keyframes

    @property
    def free(self) -> bool:
        """True if the keys can be edited: nothing is dragged or played."""
        return not (self.context.busy or self.dragging)

    @property
    def reachable(self) -> bool:
        """True if the current frame can be changed. Changing it also stops playback."""
        return not (self.context.toolbox.active or self.context.session.editing)

    def reset(self) -> None:
        """Show the animation of a new session, if it has one."""
        self._playback_start = None
        self._selected = frozenset()
        self._clipboard = ()
        self.shown = self._had_keys = bool(self.keyframes.keys)

    def update(self) -> None:
        """Show the frame that is due, and open the timeline with the first key."""
        context = self.context
        has_keys = bool(self.keyframes.keys)
        if has_keys and not self._had_keys:
            self.shown = True
        self._had_keys = has_keys
        self.animation.auto_key = context.settings.auto_key and self.shown
        previous, self._selected_constraints = self._selected_constraints, context.toolbox.selection
        if context.toolbox.selection - previous:
            self._selected = frozenset()
        if self.playing:
            self._show_due_frame()

    # Playback

    @property
    def playing(self) -> bool:
        """True while the animation plays."""
        return self._playback_start is not None

    @property
    def seconds_to_next_frame(self) -> float:
        """Seconds until the next frame is due; infinite while nothing plays."""
        if self._playback_start is None:
            return math.inf
        started, _first = self._playback_start
        keyframes, elapsed = self.keyframes, self.context.clock() - started
        passed = math.floor(elapsed * keyframes.rate)
        return max((passed + 1) / keyframes.rate - elapsed, 0.0)

    def play(self) -> None:
        """Play from the current frame, or from the first if the last is shown; stop if the animation plays."""
        if self.playing:
            self.stop()
            return
        last = self.keyframes.length - 1
        if not (self.reachable and self.keyframes.keys) or last == 0:
            return
        if self.animation.frame >= last:
            self.go_to(0)
        self.context.comparing = False
        self._playback_start = (self.context.clock(), self.animation.frame)
        self.context.redraw()

    def stop(self) -> None:
        """Stop playback at the current frame."""
        if self.playing:
            self._playback_start = None
            self.context.redraw()

    def _show_due_frame(self) -> None:
        assert self._playback_start is not None
        context = self.context
        if context.toolbox.posing or context.session.editing or not self.keyframes.keys or context.is_modal:
            self.stop()
            return
        started, first = self._playback_start
        keyframes = self.keyframes
        frame = first + math.floor((self.context.clock() - started) * keyframes.rate)
        if frame >= keyframes.length:
            if keyframes.loop:
                frame %= keyframes.length
            else:
                frame = keyframes.length - 1
                self.stop()
        self._show(frame)

    # Frames

    def go_to(self, frame: int | None) -> None:
        """Show ``frame``, clamped to the first. Do nothing for None or while something is dragged."""
        self.stop()
        self.context.slider_edit.let_go()
        if frame is None or not self.reachable:
            return
        self.context.comparing = False
        previous = self.animation.frame
        if self._show(frame):
            undo = self.context.actions["undo"].shortcut
            self.context.notify(f"The pose at frame {previous + 1} had no key and was discarded; {undo} restores it")

    def _show(self, frame: int) -> bool:
        """Show ``frame`` and return True if a pose without a key was lost."""
        if frame == self.animation.frame:
            return False
        lost = self.animation.go_to(frame)
        self.context.redraw()
        return lost

    def step(self, by: int) -> None:
        """Advance by ``by`` frames within the animation."""
        self.go_to(min(max(self.animation.frame + by, 0), self.keyframes.length - 1))

    # Keys

    @property
    def selected(self) -> frozenset[int]:
        """Frames of the selected keys that still exist; undo may have removed some."""
        return self._selected.intersection(self.keyframes.frames)

    def select(self, frames: Collection[int]) -> None:
        """Select the keys at ``frames``, and deselect all constraints."""
        self._selected = frozenset(frames)
        if self._selected:
            self.context.toolbox.tool_settings.selection.set()
            self._selected_constraints = frozenset()
        self.context.redraw()

    @property
    def targets(self) -> frozenset[int]:
        """Frames of the keys that commands act on: the selected ones, or else the key at the current frame."""
        return self.selected or frozenset({self.animation.frame}).intersection(self.keyframes.frames)

    def set_key(self) -> None:
        """Set a key with the current pose at the current frame."""
        self.stop()
        self.shown = True
        self.animation.set_key()
        self.context.redraw()

    def delete(self, frames: Collection[int]) -> None:
        """Remove the keys at ``frames``."""
        if frames:
            self.change(self.keyframes.without(frames), f"Remove {counted(frames)}")

    def move(self, frames: Collection[int], by: int) -> None:
        """Move the keys at ``frames`` by ``by`` frames, and keep them selected."""
        self.change(self.keyframes.moved(frames, by), f"Move {counted(frames)}")
        self.select({frame + by for frame in frames})

    def duplicate(self, frames: Collection[int], by: int) -> None:
        """Copy the keys at ``frames`` to frames ``by`` later, and select the copies."""
        self.change(self.keyframes.copied(frames, by), f"Copy {counted(frames)}")
        self.select({frame + by for frame in frames})

    @property
    def can_paste(self) -> bool:
        """True if the clipboard holds keys."""
        return bool(self._clipboard)

    def copy(self) -> None:
        """Copy the selected keys, or the key at the current frame, to the clipboard."""
        frames = self.targets
        self._clipboard = tuple(key for key in self.keyframes.keys if key.frame in frames)
        self.context.notify(f"Copied {counted(frames)}")

    def paste(self) -> None:
        """Paste the copied keys, the first of them at the current frame."""
        by = self.animation.frame - self._clipboard[0].frame
        keys = [Key(key.frame + by, key.pose) for key in self._clipboard if key.frame + by < LONGEST]
        self.change(self.keyframes.with_keys(keys), f"Paste {counted(keys)}")
        self.select({key.frame for key in keys})

    def select_all(self) -> None:
        """Select all keys."""
        self.select(self.keyframes.frames)

    def set_inbetweens(self, inbetweens: Inbetweens) -> None:
        """Change how the poses between keys are found, as one step."""
        self.change(replace(self.keyframes, inbetweens=inbetweens), "Change the in-betweens")

    def change(self, keyframes: Keyframes, label: str, merges: bool = False) -> None:
        """Replace the animation as one step of the history, unless something is dragged.

        See ``AnimationController.change``.
        """
        self.stop()
        self.context.slider_edit.let_go()
        if self.reachable:
            self.animation.change(keyframes, label, merges)
            self.context.redraw()

    # Visibility

    def toggle_auto_key(self) -> None:
        """Turn automatic keys on or off."""
        self.context.settings.auto_key = not self.context.settings.auto_key
        self.context.redraw()

    def present(self) -> None:
        """Show the timeline with nothing selected."""
        self.stop()
        self.shown = True
        self._selected = frozenset()
        self.context.redraw()

    def toggle(self) -> None:
        """Show or hide the timeline."""
        self.stop()
        self.shown = not self.shown
        self.context.redraw()


def counted(keys: Collection[object]) -> str:
    """Return the number of ``keys`` in words."""
    return "a key" if len(keys) == 1 else f"{len(keys)} keys"
