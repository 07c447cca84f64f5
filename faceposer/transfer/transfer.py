"""Poses and performances carried from one face to another, by either way."""

from collections.abc import Sequence
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.transfer.distances import DistanceTransfer
from faceposer.transfer.pairs import DEFAULT_PAIRS, Pair
from faceposer.transfer.ranges import Scaling
from faceposer.transfer.weights import WeightTransfer

Array = NDArray[np.float64]

#: By distances between feature points, or by the weights of ARKit's shapes.
Method = Literal["distances", "weights"]
METHODS: tuple[Method, ...] = get_args(Method)


class Transfer(Protocol):
    """A way from the poses of one face to those of another."""

    def pose(self, coefficients: Array, previous: Array | None = None) -> Array:
        """Return the target's coefficients, shape (r',), for the source's, shape (r,)."""
        ...


def make_transfer(
    source: FaceModel,
    target: FaceModel,
    method: Method = "distances",
    pairs: Sequence[Pair] = DEFAULT_PAIRS,
    scaling: Scaling = "neutral",
) -> Transfer:
    """Return the way of ``method`` from ``source`` to ``target``; ``pairs`` and ``scaling`` are those of distances.

    Raises:
        FacePoserError: If the two characters do not have what it needs.
    """
    if method == "weights":
        return WeightTransfer(source, target)
    return DistanceTransfer(source, target, pairs, scaling)


def transfer_performance(
    transfer: Transfer,
    performance: Performance,
    progress: Progress | None = None,
) -> Performance:
    """Return ``performance`` on the target's face, each frame searched from the one before.

    Args:
        transfer: The way from one face to the other.
        performance: Of the source's face.
        progress: Reported to after each frame.

    Raises:
        CancelledError: If the progress was cancelled.
    """
    progress = progress or Progress()
    poses: list[Array] = []
    for frame in performance.coefficients:
        progress.check()
        poses.append(transfer.pose(frame, poses[-1] if poses else None))
        progress.at("Transferring", len(poses) / len(performance))
    return Performance(np.array(poses), performance.rate)
