"""Coverage of the expressions of a source by keys: how far frames are from all keys, and which frames would help.

The limit that Pyun et al. state, "when it falls too far outside from the basis of the constructed source key-models",
and the selection of keys from the frames of the source, which they propose.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.transfer.examples import ExampleTransfer

Array = NDArray[np.float64]

# Residuals below this share of the motion are rounding errors.
_NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class Coverage:
    """Coverage of m frames by keys.

    Attributes:
        distances: Root mean square distance, over the feature points, between each frame and the nearest combination of
            keys, in the unit of the source, shape (m,).
        motions: The same distance between each frame and the base, shape (m,).
        strengths: Largest weight of a key in each frame, shape (m,); above 1, keys are exaggerated.
    """

    distances: Array
    motions: Array
    strengths: Array

    @property
    def missed(self) -> float:
        """Share of the motion of all frames that no combination of keys has, in squares, 0 to 1."""
        total = float((self.motions**2).sum())
        return float((self.distances**2).sum()) / total if total > 0.0 else 0.0


@dataclass(frozen=True)
class HelpfulFrame:
    """A frame that would help as a key.

    Attributes:
        frame: Its index.
        missed: Share of the motion that is missed with it and all better ones as keys, in squares.
    """

    frame: int
    missed: float


def coverage(transfer: ExampleTransfer, poses: Array) -> Coverage:
    """Return the coverage of the source's ``poses``, (m, r), by the keys of ``transfer``."""
    moved = transfer.displacements(poses)
    missed = _residuals(transfer, moved)
    count = sum(block.shape[1] for block in moved) / 3.0
    strengths = np.max([np.abs(weights[:, 1:]).max(axis=1) for weights in transfer.weights(poses)], axis=0)
    return Coverage(_lengths(missed, count), _lengths(moved, count), strengths)


def helpful_frames(transfer: ExampleTransfer, poses: Array, count: int) -> list[HelpfulFrame]:
    """Return up to ``count`` of the source's ``poses``, (m, r), that help most as keys, the best first.

    Each one is the frame with which, together with all keys and the frames before it, most of the motion of all frames
    is a combination of keys, in the least squares of the feature points. The search ends when nothing is missed.

    Args:
        transfer: Transfer with the present keys.
        poses: The source's frames.
        count: Number of frames to find.
    """
    moved = transfer.displacements(poses)
    missed = _residuals(transfer, moved)
    total = sum(float((block**2).sum()) for block in moved)
    found: list[HelpfulFrame] = []
    for _ in range(count):
        left = sum(float((block**2).sum()) for block in missed)
        if left <= _NOTHING * total:
            break
        gains = np.zeros(len(poses))
        for block in missed:
            squares = np.einsum("mn,mn->m", block, block)
            along = np.einsum("mn,mn->m", block @ (block.T @ block), block)
            gains += np.where(squares > _NOTHING * max(squares.max(), 1e-300), along / np.maximum(squares, 1e-300), 0.0)
        best = int(np.argmax(gains))
        missed = [_without(block, block[best]) for block in missed]
        found.append(HelpfulFrame(best, sum(float((block**2).sum()) for block in missed) / total))
    return found


def _residuals(transfer: ExampleTransfer, moved: tuple[Array, ...]) -> list[Array]:
    """Return what no combination of keys has of the displacements ``moved`` of each region."""
    residuals = []
    for region, block in zip(transfer.regions, moved, strict=True):
        residuals.append(block - (block @ region.matrix.T) @ region.matrix)
    return residuals


def _without(block: Array, direction: Array) -> Array:
    length = np.linalg.norm(direction)
    if length == 0.0:
        return block
    unit = direction / length
    return block - np.outer(block @ unit, unit)


def _lengths(blocks: list[Array] | tuple[Array, ...], count: float) -> Array:
    squares = sum((np.einsum("mn,mn->m", block, block) for block in blocks), start=np.zeros(len(blocks[0])))
    lengths: Array = np.sqrt(squares / count)
    return lengths
