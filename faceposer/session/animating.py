"""The animation of a session: the current frame, and automatic keys.

Changing the frame is not an edit: nothing is lost and nothing has to be saved. The exception is a pose that the
animation cannot reproduce, because it is constrained or has no key; leaving it is a step that undo reverts.
"""

from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.animation.keyframes import LONGEST, Keyframes
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.session.document import Document

Array = NDArray[np.float64]
Shown = Literal["unkeyed", "key", "between", "changed"]

# Poses with rig weights closer than this are taken as equal: the difference is invisible.
_SAME_WEIGHT = 1e-4


class AnimatedSession(Protocol):
    """What a session has for its animation."""

    revision: int

    @property
    def document(self) -> Document:
        """The document."""
        ...

    @property
    def editing(self) -> bool:
        """True if an edit is open."""
        ...

    @property
    def solving(self) -> bool:
        """True if a solve is queued or running."""
        ...

    @property
    def model(self) -> FaceModel:
        """The face."""
        ...

    def edit(self, label: str, merges: bool = False) -> AbstractContextManager[None]:
        """Make all changes inside the block one step of the history."""
        ...

    def wait(self) -> object:
        """Wait for the solve."""
        ...

    def set_without_history(self, document: Document) -> None:
        """Replace the document, within an edit or outside."""


class AnimationController:
    """Frame changes and key edits of one session.

    Attributes:
        auto_key: True if a changed pose becomes a key automatically, provided that the animation has a key. If False, a
            pose changed between two keys is lost with the next frame change, a frequent loss in animation programs. A
            face without keys gets none, so that no animation starts unasked.
    """

    def __init__(self, session: AnimatedSession) -> None:
        """Control the animation of ``session``."""
        self._session = session
        self.auto_key = False
        self._performance: tuple[Keyframes, Performance] | None = None
        self._shown: tuple[int, Shown] | None = None

    # State

    @property
    def keyframes(self) -> Keyframes:
        """The animation, without keys if the document has none."""
        return self._session.document.keyframes or Keyframes()

    @property
    def frame(self) -> int:
        """The current frame, counted from 0."""
        return self._session.document.frame

    @property
    def performance(self) -> Performance | None:
        """The motion frame by frame, or None without keys."""
        keyframes = self.keyframes
        if not keyframes.keys:
            return None
        if self._performance is None or self._performance[0] is not keyframes:
            self._performance = (keyframes, keyframes.performance(self._session.model))
        return self._performance[1]

    @property
    def shown(self) -> Shown:
        """State of the displayed pose: on a "key", "between" keys, "changed" without a key, or "unkeyed"."""
        if self._shown is None or self._shown[0] != self._session.revision:
            self._shown = (self._session.revision, self._classify(self._session.document))
        return self._shown[1]

    def _classify(self, document: Document) -> Shown:
        if document.keyframes is None or not document.keyframes.keys:
            return "unkeyed"
        if not self._same_pose(self._pose_of(document), self._pose_at(document.keyframes, document.frame)):
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

    def _same_pose(self, one: Array, other: Array) -> bool:
        return bool(np.abs(self._session.model.weights_of(one - other)).max() < _SAME_WEIGHT)

    # Frames

    def go_to(self, frame: int) -> bool:
        """Show ``frame``, clipped to the valid range; return True if a pose was left that only undo restores.

        Raises:
            RuntimeError: If an edit is open.
            FacePoserError: If a running solve does not end.
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
        target = document.with_animation_frame(frame, self._pose_at(document.keyframes, frame))
        if document.animated:
            session.set_without_history(target)
            return False
        lost = self.shown == "changed"
        with session.edit("Go to another frame"):
            session.set_without_history(target)
        return lost

    # Keys

    def set_key(self) -> None:
        """Set a key with the displayed pose at the current frame, as one step."""
        document = self._session.document
        keyframes = self.keyframes.with_key(document.frame, self._pose_of(document))
        with self._session.edit("Set a key"):
            self._session.set_without_history(replace(document, keyframes=keyframes, animated=not document.constraints))

    def change(self, keyframes: Keyframes, label: str, merges: bool = False) -> None:
        """Replace the animation as one step and update the pose, unless the pose was changed and has no key.

        With ``merges``, the step is merged with the previous one if that has the same label.
        """
        document = self._session.document
        if keyframes.same(document.keyframes):
            return
        follows = self.shown in ("key", "between") or document.animated
        changed = replace(document, keyframes=keyframes, animated=document.animated and bool(keyframes.keys))
        if follows and keyframes.keys:
            pose = self._pose_at(keyframes, document.frame)
            if not self._same_pose(pose, self._pose_of(document)):
                changed = changed.with_animation_frame(document.frame, pose)
        with self._session.edit(label, merges):
            self._session.set_without_history(changed)

    def load(self, keyframes: Keyframes, label: str, frame: int = 0) -> None:
        """Replace the animation as one step and show ``frame`` of it, whatever was displayed before."""
        document = replace(self._session.document, keyframes=keyframes)
        with self._session.edit(label):
            self._session.set_without_history(document.with_animation_frame(frame, self._pose_at(keyframes, frame)))

    def with_auto_key(self, document: Document) -> Document:
        """Return ``document`` after a change of its pose, with a key for the pose if ``auto_key`` is set."""
        keyframes = document.keyframes
        if keyframes is None or not keyframes.keys or not document.solved:
            return document
        unconstrained = not document.constraints
        pose = self._pose_of(document)
        if self._same_pose(pose, self._pose_at(keyframes, document.frame)):
            return replace(document, animated=unconstrained)
        if not self.auto_key:
            return document
        return replace(document, keyframes=keyframes.with_key(document.frame, pose), animated=unconstrained)

    def as_opened(self, document: Document) -> Document:
        """Return ``document`` as it is opened: its pose belongs to the animation if it is that of its frame."""
        if document.keyframes is None or document.coefficients is None:
            return document
        return self.with_auto_key(document)
