"""The animation of a session: which frame is shown, and how poses become keys.

Going to another frame is no edit: nothing is lost by it and nothing needs to be saved. It is one only where the face
that is left would not come back by itself, since constraints pull at it or since it has no key; undo then brings it
back.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.animation.keyframes import LONGEST, Keyframes
from faceposer.model.performance import Performance
from faceposer.session.document import Document

if TYPE_CHECKING:
    from faceposer.session.session import Session

Array = NDArray[np.float64]
Shown = Literal["unkeyed", "key", "between", "changed"]

# Two poses whose rig weights differ by less are the same: nobody sees it.
_SAME_WEIGHT = 1e-4


class AnimationController:
    """What panels and files do with the animation of one session.

    Attributes:
        auto_key: Whether a pose that is changed becomes a key by itself, once there is any key. Without that, a pose
            that was changed between two keys is gone as soon as another frame is shown, which is the most frequent
            loss in programs that work so; on a face that has no key yet, it would start animations nobody asked for.
    """

    def __init__(self, session: "Session") -> None:
        """Serve ``session``."""
        self._session = session
        self.auto_key = False
        self._performance: tuple[Keyframes, Performance] | None = None
        self._shown: tuple[int, Shown] | None = None

    # What there is

    @property
    def keyframes(self) -> Keyframes:
        """The animation; one without keys if the document has none."""
        return self._session.document.keyframes or Keyframes()

    @property
    def frame(self) -> int:
        """The frame that is shown, counted from 0."""
        return self._session.document.frame

    @property
    def performance(self) -> Performance | None:
        """The motion, frame by frame, or None without keys."""
        keyframes = self.keyframes
        if not keyframes.keys:
            return None
        if self._performance is None or self._performance[0] is not keyframes:
            self._performance = (keyframes, keyframes.performance(self._session.model))
        return self._performance[1]

    @property
    def shown(self) -> Shown:
        """What the face on the screen is: a "key", "between" keys, "changed" without a key, or "unkeyed" altogether."""
        if self._shown is None or self._shown[0] != self._session.revision:
            self._shown = (self._session.revision, self._judged(self._session.document))
        return self._shown[1]

    def _judged(self, document: Document) -> Shown:
        if document.keyframes is None or not document.keyframes.keys:
            return "unkeyed"
        if not self._near(self._pose_of(document), self._pose_at(document.keyframes, document.frame)):
            return "changed"
        return "between" if document.keyframes.at(document.frame) is None else "key"

    def _pose_of(self, document: Document) -> Array:
        return self._session.model.neutral() if document.coefficients is None else document.coefficients

    def _pose_at(self, keyframes: Keyframes, frame: int) -> Array:
        performance = self.performance if keyframes is self.keyframes else None
        if performance is not None and frame < len(performance):
            return performance.coefficients[frame]
        pose: Array = keyframes.sampled(self._session.model, [frame])[0]
        return pose

    def _near(self, one: Array, other: Array) -> bool:
        return bool(np.abs(self._session.model.weights_of(one - other)).max() < _SAME_WEIGHT)

    # Frames

    def go_to(self, frame: int) -> bool:
        """Show ``frame``, or the nearest that there may be; return whether a pose was left that only undo brings back.

        Raises:
            RuntimeError: If an edit is open.
            FacePoserError: If a solve does not end.
        """
        session = self._session
        if session.editing:
            raise RuntimeError("an edit is open")
        frame = min(max(frame, 0), LONGEST - 1)
        if frame == self.frame:
            return False
        if session.solving:
            session.wait()
        document = session.document
        if document.keyframes is None or not document.keyframes.keys:
            session.set_without_history(replace(document, frame=frame))
            return False
        there = document.animated_at(frame, self._pose_at(document.keyframes, frame))
        if document.animated:
            session.set_without_history(there)
            return False
        lost = self.shown == "changed"
        with session.edit("Go to another frame"):
            session.set_without_history(there)
        return lost

    # Keys

    def set_key(self) -> None:
        """Make the face on the screen the key at the frame that is shown, as one step."""
        document = self._session.document
        keyframes = self.keyframes.with_key(document.frame, self._pose_of(document))
        with self._session.edit("Set a key"):
            self._session.set_without_history(replace(document, keyframes=keyframes, animated=not document.constraints))

    def change(self, keyframes: Keyframes, label: str, merges: bool = False) -> None:
        """Exchange the animation as one step; the face follows, unless it has been changed and has no key.

        With ``merges`` it joins the step before, if that has the same label.
        """
        document = self._session.document
        if keyframes.same(document.keyframes):
            return
        follows = self.shown in ("key", "between") or document.animated
        changed = replace(document, keyframes=keyframes, animated=document.animated and bool(keyframes.keys))
        if follows and keyframes.keys:
            pose = self._pose_at(keyframes, document.frame)
            if not self._near(pose, self._pose_of(document)):
                changed = changed.animated_at(document.frame, pose)
        with self._session.edit(label, merges):
            self._session.set_without_history(changed)

    def load(self, keyframes: Keyframes, label: str, frame: int = 0) -> None:
        """Exchange the animation as one step and show ``frame`` of it, whatever was on the screen."""
        document = replace(self._session.document, keyframes=keyframes)
        with self._session.edit(label):
            self._session.set_without_history(document.animated_at(frame, self._pose_at(keyframes, frame)))

    def with_auto_key(self, document: Document) -> Document:
        """Return ``document``, whose pose has changed, as it is to be kept: with a key, if poses become keys."""
        keyframes = document.keyframes
        if keyframes is None or not keyframes.keys or not document.solved:
            return document
        alone = not document.constraints
        pose = self._pose_of(document)
        if self._near(pose, self._pose_at(keyframes, document.frame)):
            return replace(document, animated=alone)
        if not self.auto_key:
            return document
        return replace(document, keyframes=keyframes.with_key(document.frame, pose), animated=alone)
