"""Transfer of poses and performances from one character to another."""

from collections.abc import Sequence
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.transfer.distances import DistanceTransfer
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.pairs import DEFAULT_PAIRS, Pair
from faceposer.transfer.ranges import Scaling
from faceposer.transfer.weights import WeightTransfer

Array = NDArray[np.float64]

#: Method of a transfer: by distances between feature points, by weights of ARKit's shapes, or by pairs of key poses.
Method = Literal["distances", "weights", "examples"]
METHODS: tuple[Method, ...] = get_args(Method)


class Transfer(Protocol):
    """A map from the poses of one character to those of another."""

    def pose(self, coefficients: Array, previous: Array | None = None) -> Array:
        """Return the target's coefficients, shape (r',), for the source's, shape (r,)."""
        ...


def make_transfer(
    source: FaceModel,
    target: FaceModel,
    method: Method = "distances",
    pairs: Sequence[Pair] = DEFAULT_PAIRS,
    scaling: Scaling = "neutral",
    keys: Sequence[KeyPair] = (),
) -> Transfer:
    """Return the transfer from ``source`` to ``target``.

    Args:
        source: The face that plays.
        target: The face that follows.
        method: How expressions are transferred.
        pairs: Distances of the method "distances".
        scaling: Their scaling.
        keys: Key poses of the method "examples".

    Raises:
        FacePoserError: If one of the characters does not have the data required by the method.
    """
    if method == "examples":
        return ExampleTransfer(source, target, keys)
    if method == "weights":
        return WeightTransfer(source, target)
    return DistanceTransfer(source, target, pairs, scaling)


def transfer_performance(
    transfer: Transfer,
    performance: Performance,
    progress: Progress | None = None,
) -> Performance:
    """Return ``performance`` transferred to the target, with each frame initialised by the previous one.

    Args:
        transfer: Transfer between the characters.
        performance: Performance of the source.
        progress: Receives a report after each frame.

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
