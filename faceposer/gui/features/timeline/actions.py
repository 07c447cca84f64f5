"""Actions of the timeline; their shortcuts are those of Blender and Maya where these are free."""

from collections.abc import Callable
from dataclasses import replace

from faceposer.gui.actions import Action
from faceposer.gui.features.timeline.editor import TimelineEditor

_MENU = "Animate"


def build_timeline_actions(timeline: TimelineEditor) -> list[Action]:
    """Return the actions of ``timeline`` in menu order."""

    def free() -> bool:
        return timeline.free

    def has_keys() -> bool:
        return bool(timeline.keyframes.keys)

    def loop() -> None:
        keyframes = timeline.keyframes
        timeline.change(replace(keyframes, loop=not keyframes.loop), "Loop", merges=True)

    def change_inbetweens() -> None:
        timeline.set_inbetweens("poses" if timeline.keyframes.inbetweens == "feature points" else "feature points")

    return [
        Action(
            "timeline",
            "Timeline",
            "View",
            timeline.toggle,
            ("A",),
            checked=lambda: timeline.shown,
            separated=True,
            help="Show the keys of the animation below the view",
        ),
        Action(
            "play",
            "Play or stop",
            _MENU,
            timeline.play,
            ("Shift+Space",),
            lambda: timeline.reachable and has_keys() and timeline.keyframes.length > 1,
            lambda: timeline.playing,
            help="Play from the current frame, or stop",
        ),
        Action(
            "loop",
            "Loop",
            _MENU,
            loop,
            (),
            free,
            lambda: timeline.keyframes.loop,
            help="Play the animation in a loop, with a smooth transition from the last key to the first",
        ),
        Action(
            "inbetweens",
            "In-betweens by feature points",
            _MENU,
            change_inbetweens,
            (),
            free,
            lambda: timeline.keyframes.inbetweens == "feature points",
            help="Move between keys along splines of feature points: rounder, but the motion may go beyond the keys",
        ),
        Action(
            "set-key",
            "Set a key",
            _MENU,
            timeline.set_key,
            ("I",),
            free,
            separated=True,
            help="Set a key with this pose at the current frame",
        ),
        Action(
            "auto-key",
            "Auto key",
            _MENU,
            timeline.toggle_auto_key,
            checked=lambda: timeline.context.settings.auto_key,
            help="Set a key after every change of the pose, while the timeline is shown and has a key",
        ),
        Action(
            "delete-keys",
            "Remove keys",
            _MENU,
            lambda: timeline.delete(timeline.targets),
            ("Alt+I",),
            lambda: free() and bool(timeline.targets),
            help="Remove the selected keys, or the key at the current frame",
        ),
        Action(
            "copy-keys",
            "Copy keys",
            _MENU,
            timeline.copy,
            ("Ctrl+C",),
            lambda: free() and bool(timeline.targets),
            help="Copy the selected keys, or the key at the current frame",
        ),
        Action(
            "paste-keys",
            "Paste keys",
            _MENU,
            timeline.paste,
            ("Ctrl+V",),
            lambda: free() and timeline.can_paste,
            help="Paste the copied keys, starting at the current frame",
        ),
        Action(
            "select-keys", "Select all keys", _MENU, timeline.select_all, ("Ctrl+A",), lambda: free() and has_keys()
        ),
        *_frame_actions(timeline, has_keys),
    ]


def _frame_actions(timeline: TimelineEditor, has_keys: Callable[[], bool]) -> list[Action]:
    def reachable() -> bool:
        return timeline.reachable

    def to_key(after: bool) -> None:
        keyframes, frame = timeline.keyframes, timeline.animation.frame
        timeline.go_to(keyframes.next_frame(frame) if after else keyframes.previous_frame(frame))

    return [
        Action(
            "first-frame",
            "First frame",
            _MENU,
            lambda: timeline.go_to(0),
            ("Home",),
            reachable,
            separated=True,
        ),
        Action(
            "previous-key",
            "Previous key",
            _MENU,
            lambda: to_key(False),
            (",",),
            lambda: reachable() and has_keys(),
            repeats=True,
        ),
        Action(
            "previous-frame", "Previous frame", _MENU, lambda: timeline.step(-1), ("Alt+,",), reachable, repeats=True
        ),
        Action("next-frame", "Next frame", _MENU, lambda: timeline.step(1), ("Alt+.",), reachable, repeats=True),
        Action(
            "next-key",
            "Next key",
            _MENU,
            lambda: to_key(True),
            (".",),
            lambda: reachable() and has_keys(),
            repeats=True,
        ),
        Action(
            "last-frame",
            "Last frame",
            _MENU,
            lambda: timeline.go_to(timeline.keyframes.length - 1),
            ("End",),
            reachable,
        ),
    ]
