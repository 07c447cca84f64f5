"""Coverage of the expressions of a source by keys: how far frames are from all keys, and which frames would help.

The limit that Pyun et al. state, "when it falls too far outside from the basis of the constructed source key-models",
and the selection of keys from the frames of the source, which they propose.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.key_parameters import Regions, parameter_points, point_rows

Array = NDArray[np.float64]

#: Distance of a frame from all keys, as a share of the height of the head, above which it is outside of them; and the
#: same for its strengths.
OUTSIDE, STRONG = 0.005, 3.0
# Frames that are chosen before the directions of the keys are found anew.
_ROUND = 16
# Residuals below this share of the motion are rounding errors.
_NOTHING = 1e-12
# Share of the motion that is missed, in squares, below which keys are spread over the frames instead; distance of a
# frame from its nearest key, as a share of the height of the head, below which it needs no key.
_COVERED, _NEAR = 1e-4, 5e-4


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


def reach_of(transfer: ExampleTransfer, pose: Array) -> tuple[float, str]:
    """Return the distance of the source's ``pose``, (r,), from the keys, in its unit, and a sentence if it is large."""
    found = coverage(transfer, pose[None])
    distance, strength = float(found.distances[0]), float(found.strengths[0])
    if distance > OUTSIDE * transfer.source.character.height:
        return distance, (
            f"The pose is outside the keys: its feature points are {10.0 * distance:.1f} mm from the nearest "
            "combination of keys; a key like it would help."
        )
    if strength > STRONG:
        return distance, f"The pose exaggerates a key {strength:.1f} times; a stronger key would help."
    return distance, ""


def helpful_frames(
    transfer: ExampleTransfer, poses: Array, count: int, left_out: Sequence[int] = ()
) -> list[HelpfulFrame]:
    """Return up to ``count`` of the source's ``poses``, (m, r), that help most as keys, the best first.

    Each one is the frame with which, together with all keys and the frames before it, most of the motion of all frames
    is a combination of keys, in the least squares of the feature points. The search ends when nothing is missed.

    Args:
        transfer: Transfer with the present keys.
        poses: The source's frames.
        count: Number of frames to find.
        left_out: Frames that are keys already.
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
        gains[list(left_out)] = -1.0
        best = int(np.argmax(gains))
        if gains[best] <= 0.0:
            break
        missed = [_without(block, block[best]) for block in missed]
        found.append(HelpfulFrame(best, sum(float((block**2).sum()) for block in missed) / total))
    return found


def chosen_frames(
    source: FaceModel,
    keys: Array,
    poses: Array,
    count: int,
    points: Sequence[str] | None = None,
    regions: Regions = "whole",
) -> list[HelpfulFrame]:
    """Return up to ``count`` of the source's ``poses``, (m, r), as further keys, the best first.

    The first ones are those that add most to the combinations of keys. They are chosen in rounds, since keys determine
    the directions in which they count, and begin with the frame that is farthest from the neutral face if there is no
    key. When the combinations have nearly all of the motion, each further one is the frame that is farthest from all
    keys, since between keys the target does what is no combination of them.

    Args:
        source: The face that plays.
        keys: Coefficients of its present keys, shape (K, r); may be empty.
        poses: Its frames.
        count: Number of frames to find.
        points: Feature points that give the parameters; None for all that move.
        regions: Regions that are cloned separately.
    """
    chosen: list[HelpfulFrame] = []
    present = list(keys)
    if not present:
        names = parameter_points(source.character, points)
        first = int(np.argmax(((poses @ point_rows(source, names).T) ** 2).sum(axis=1)))
        present.append(poses[first])
        chosen.append(HelpfulFrame(first, 1.0))
    covered = False
    while len(chosen) < count and not covered:
        pairs = [KeyPair(str(i), key, key) for i, key in enumerate(present)]
        transfer = ExampleTransfer(source, source, pairs, points, regions)
        if len(chosen) == 1 and not len(keys):
            chosen = [HelpfulFrame(chosen[0].frame, coverage(transfer, poses).missed)]
        taken = [helpful.frame for helpful in chosen]
        found = helpful_frames(transfer, poses, min(_ROUND, count - len(chosen)), taken)
        enough = next((i for i, helpful in enumerate(found) if helpful.missed < _COVERED), len(found))
        covered = enough < _ROUND
        chosen += found[: enough + 1]
        present += [poses[helpful.frame] for helpful in found[: enough + 1]]
    return chosen + _far_frames(source, np.array(present), poses, count - len(chosen), points)


def _far_frames(
    source: FaceModel, keys: Array, poses: Array, count: int, points: Sequence[str] | None
) -> list[HelpfulFrame]:
    """Return up to ``count`` of the ``poses``, (m, r), each the farthest from ``keys``, (K, r), and those before."""
    rows = point_rows(source, parameter_points(source.character, points))
    moved = poses @ rows.T
    total = float((moved**2).sum())
    places = np.vstack([np.zeros(moved.shape[1]), keys @ rows.T])
    distances = np.min([np.linalg.norm(moved - place, axis=1) for place in places], axis=0)
    least = _NEAR * source.character.height * np.sqrt(moved.shape[1] / 3.0)
    axes = np.linalg.svd(places, full_matrices=False)[2]
    missed = moved - (moved @ axes.T) @ axes
    found: list[HelpfulFrame] = []
    while len(found) < count:
        best = int(np.argmax(distances))
        if distances[best] < least:
            break
        distances = np.minimum(distances, np.linalg.norm(moved - moved[best], axis=1))
        missed = _without(missed, missed[best])
        found.append(HelpfulFrame(best, float((missed**2).sum()) / total))
    return found


def _residuals(transfer: ExampleTransfer, moved: tuple[Array, ...]) -> list[Array]:
    """Return what no combination of keys has of the displacements ``moved`` of each region."""
    residuals = []
    for region, block in zip(transfer.regions, moved, strict=True):
        residuals.append(block - (block @ region.covered.T) @ region.covered)
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
