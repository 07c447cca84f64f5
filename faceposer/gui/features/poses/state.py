"""The pose of the library that was applied last, and the part of the face that poses affect."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.poses.applying import REGIONS, Blend, Region, Side
from faceposer.poses.pose_file import Pose
from faceposer.session.session import Session

Array = NDArray[np.float64]
Category = Literal["all", "expression", "viseme", "mine"]


@dataclass(frozen=True)
class PoseMask:
    """Part of the face that a pose affects, and how.

    Attributes:
        regions: Affected regions.
        side: Affected side.
        blend: "replace" to replace the pose of the face, "add" to add to it.
    """

    regions: frozenset[Region] = frozenset(REGIONS)
    side: Side = "both"
    blend: Blend = "replace"

    @property
    def description(self) -> str:
        """The affected part in words, or "" for the whole face."""
        regions = [region for region in REGIONS if region in self.regions]
        return ", ".join((*regions * (len(regions) < len(REGIONS)), *[self.side] * (self.side != "both")))


@dataclass(frozen=True, eq=False)
class AppliedPose:
    """The pose that was applied last and can still be adjusted.

    Attributes:
        session: Session that it was applied to.
        pose: The applied pose.
        before: Starting pose of the session before, shape (r,).
        after: Starting pose of the session after, shape (r,). If the session starts from another pose, it has been
            edited since.
        mask: Part of the face that the pose affects, and how.
        strength: Strength of the pose; 1 applies it fully.
    """

    session: Session
    pose: Pose
    before: Array
    after: Array
    mask: PoseMask
    strength: float
