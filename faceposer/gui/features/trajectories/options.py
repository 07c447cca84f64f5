"""Options of drawn trajectories, and what is shown of them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from faceposer.tools.trajectory_tool import DrawnTrajectory, TrajectoryTool

Timing = Literal["pen", "even"]


@dataclass
class TrajectoryOptions:
    """Options of drawn trajectories.

    Attributes:
        timing: "pen" to move at the speed of drawing, "even" to move at constant speed.
        frames: Number of frames at constant speed, at least 2.
        smoothness: Weight of changes of velocity.
        few_keys: True to leave out keys that interpolation reproduces.
    """

    timing: Timing = "pen"
    frames: int = 30
    smoothness: float = 1.0
    few_keys: bool = True


@dataclass(frozen=True, eq=False)
class ShownTrajectories:
    """The drawn trajectories as panel and overlay show them.

    Attributes:
        tool: The tool that has drawn them.
        options: Their options.
        first: Frame of the timeline at which they begin.
        rate: Frames per second.
        positions: Returns the places of a trajectory at each frame, in pixels of its view, shape (F, 2).
    """

    tool: "TrajectoryTool"
    options: TrajectoryOptions
    first: int
    rate: float
    positions: "Callable[[DrawnTrajectory], NDArray[np.float64]]"
