"""The timeline: keys of the animation, playback and the current frame."""

from collections.abc import Sequence

from faceposer.animation.keyframes import Keyframes
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.timeline.actions import build_timeline_actions
from faceposer.gui.features.timeline.editor import TimelineEditor
from faceposer.gui.features.timeline.panel import draw_timeline, timeline_height
from faceposer.gui.features.timeline.track import Track


class TimelineFeature(Feature):
    """The strip below the view, and its menu entries.

    Attributes:
        editor: Commands and state of the timeline.
        track: The ruler and the keys.
    """

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self.editor = TimelineEditor(context)
        self.track = Track(self.editor)

    # Called by other features

    @property
    def keyframes(self) -> Keyframes:
        """The keys; an empty animation if there are none."""
        return self.editor.keyframes

    @property
    def free(self) -> bool:
        """True if the keys can be edited: nothing is dragged or played."""
        return self.editor.free

    def go_to(self, frame: int) -> None:
        """Show ``frame``, clamped to the first. Do nothing while something is dragged."""
        self.editor.go_to(frame)

    def stop(self) -> None:
        """Stop playback at the current frame."""
        self.editor.stop()

    def change(self, keyframes: Keyframes, label: str) -> None:
        """Replace the animation as the step ``label`` of the history, unless something is dragged."""
        self.editor.change(keyframes, label)

    def present(self) -> None:
        """Show all frames of another animation, with nothing selected."""
        self.editor.present()
        self.track.reset()

    # Called by the window

    @property
    def busy(self) -> bool:
        """True while the animation plays."""
        return self.editor.playing

    @property
    def patience(self) -> float:
        """Seconds until the next frame is due."""
        return self.editor.seconds_to_next_frame

    @property
    def hint(self) -> str:
        """Description of the mouse buttons on the track, or while the animation plays."""
        if self.editor.playing:
            orbit = "middle drag" if self.context.viewport.navigation == "blender" else "Alt+left drag"
            return f"Press on the view: stop   ·   {orbit}: orbit"
        return self.track.hint if self.editor.shown else ""

    @property
    def strip_height(self) -> float:
        """Height of the strip, or 0 while it is hidden."""
        return timeline_height() if self.editor.shown else 0.0

    @property
    def selects(self) -> bool:
        """True if keys are selected."""
        return bool(self.editor.selected)

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the menu "Animate" and the switch in "View"."""
        return build_timeline_actions(self.editor)

    def delete_selected(self) -> None:
        """Delete the selected keys."""
        self.editor.delete(self.editor.selected)

    def session_changed(self) -> None:
        """Show the animation of the new session, if it has one."""
        self.editor.reset()
        self.track.reset()

    def before_press(self) -> None:
        """Stop playback: a press on the view edits the current frame."""
        self.editor.stop()

    def update(self) -> None:
        """Show the frame that is due."""
        self.editor.update()

    def draw_strip(self) -> None:
        """Draw the strip."""
        draw_timeline(self.editor, self.track)
