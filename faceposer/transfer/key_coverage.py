"""Coverage of the expressions of a source by keys: how far frames are from all keys, and which frames would help.

The limit that Pyun et al. state, "when it falls too far outside from the basis of the constructed source key-models",
and the selection of keys from the frames of the source, which they propose.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.progress import Progress
from faceposer.transfer.examples import NEUTRAL, ExampleTransfer, KeyPair, least_apart
from faceposer.transfer.key_parameters import Regions, parameter_points, point_rows

Array = NDArray[np.float64]

#: Distance of a frame from all keys, as a share of the height of the head, above which it is outside of them; and the
#: same for its strengths.
OUTSIDE, STRONG = 0.005, 3.0
# Frames that are chosen before the directions of the keys are found anew.
_ROUND = 16
# Frames whose weights are computed at once.
_BLOCK = 2048
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


def coverage(transfer: ExampleTransfer, poses: Array, progress: Progress | None = None) -> Coverage:
    """Return the coverage of the source's ``poses``, (m, r), by the keys of ``transfer``.

    Raises:
        CancelledError: If the ``progress`` was cancelled.
    """
    parts = []
    for part in _blocks(len(poses)):
        (progress or Progress()).check()
        parts.append(_coverage(transfer, poses[part]))
    return Coverage(
        np.concatenate([part.distances for part in parts]),
        np.concatenate([part.motions for part in parts]),
        np.concatenate([part.strengths for part in parts]),
    )


def _blocks(count: int) -> list[slice]:
    """Return blocks of ``count`` frames, one at least, so that all weights of a long animation need little memory."""
    return [slice(first, first + _BLOCK) for first in range(0, max(count, 1), _BLOCK)]


def _coverage(transfer: ExampleTransfer, poses: Array) -> Coverage:
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
    transfer: ExampleTransfer,
    poses: Array,
    count: int,
    left_out: Sequence[int] = (),
    progress: Progress | None = None,
) -> list[HelpfulFrame]:
    """Return up to ``count`` of the source's ``poses``, (m, r), that help most as keys, the best first.

    Each one is the frame with which, together with all keys and the frames before it, most of the motion of all frames
    is a combination of keys, in the least squares of the feature points. The search ends when nothing is missed.

    Args:
        transfer: Transfer with the present keys.
        poses: The source's frames.
        count: Number of frames to find.
        left_out: Frames that are keys already.
        progress: May cancel the search.

    Raises:
        CancelledError: If the progress was cancelled.
    """
    progress, blocks = progress or Progress(), _blocks(len(poses))
    missed = [np.empty((len(poses), len(region.rows))) for region in transfer.regions]
    total = 0.0
    for part in blocks:
        progress.check()
        moved = transfer.displacements(poses[part])
        total += sum(_square(block) for block in moved)
        for whole, block in zip(missed, _residuals(transfer, moved), strict=True):
            whole[part] = block
    found: list[HelpfulFrame] = []
    left = sum(_square(whole[part]) for whole in missed for part in blocks)
    while len(found) < count and left > _NOTHING * total:
        gains = np.zeros(len(poses))
        for whole in missed:
            squares = np.einsum("mn,mn->m", whole, whole)
            together, least = whole.T @ whole, _NOTHING * max(squares.max(), 1e-300)
            for part in blocks:
                progress.check()
                along = np.einsum("mn,mn->m", whole[part] @ together, whole[part])
                gains[part] += np.where(squares[part] > least, along / np.maximum(squares[part], 1e-300), 0.0)
        gains[list(left_out)] = -1.0
        best = int(np.argmax(gains))
        if gains[best] <= 0.0:
            break
        for whole in missed:
            direction = whole[best].copy()
            for part in blocks:
                whole[part] = _without(whole[part], direction)
        left = sum(_square(whole[part]) for whole in missed for part in blocks)
        found.append(HelpfulFrame(best, left / total))
    return found


def _square(block: Array) -> float:
    return float(np.einsum("mn,mn->", block, block))


def chosen_frames(
    source: FaceModel,
    keys: Array,
    poses: Array,
    count: int,
    points: Sequence[str] | None = None,
    regions: Regions = "whole",
    threshold: float | None = None,
    base: Array | None = None,
) -> list[HelpfulFrame]:
    """Return up to ``count`` of the source's ``poses``, (m, r), as further keys, the best first.

    The first ones are those that add most to the combinations of keys. They are chosen in rounds, since keys determine
    the directions in which they count, and begin with the frame that is farthest from the base if there is no key. When
    the combinations have nearly all of the motion, each further one is the frame that is farthest from all keys, since
    between keys the target does what is no combination of them. Frames that are the expression of a key are left out.

    Args:
        source: The face that plays.
        keys: Coefficients of its present keys, shape (K, r); may be empty.
        poses: Its frames.
        count: Number of frames to find.
        points: Feature points that give the parameters; None for all that move.
        regions: Regions that are cloned separately.
        threshold: Share of the largest variance of the keys below which directions are dropped; None to damp them.
        base: Coefficients of the base of the keys; None for the neutral face.
    """
    base = source.neutral() if base is None else base
    chosen: list[HelpfulFrame] = []
    present = list(keys)
    names = parameter_points(source.character, points)
    rows = point_rows(source, names)
    least = least_apart(source, names)

    def is_new(pose: Array) -> bool:
        return bool(np.linalg.norm((np.array([base, *present]) - pose) @ rows.T, axis=1).min() > least)

    if not present:
        first = int(np.argmax((((poses - base) @ rows.T) ** 2).sum(axis=1)))
        if not is_new(poses[first]):
            return []
        present.append(poses[first])
        chosen.append(HelpfulFrame(first, 1.0))
    covered = False
    while len(chosen) < count and not covered:
        pairs = [KeyPair(NEUTRAL, base, base), *(KeyPair(str(i), key, key) for i, key in enumerate(present))]
        transfer = ExampleTransfer(source, source, pairs, points, regions, threshold)
        if len(chosen) == 1 and not len(keys):
            chosen = [HelpfulFrame(chosen[0].frame, coverage(transfer, poses).missed)]
        taken = [helpful.frame for helpful in chosen]
        found = helpful_frames(transfer, poses, min(_ROUND, count - len(chosen)), taken)
        enough = next((i for i, helpful in enumerate(found) if helpful.missed < _COVERED), len(found))
        covered = enough < _ROUND
        before = len(chosen)
        for helpful in found[: enough + 1]:
            if is_new(poses[helpful.frame]):
                chosen.append(helpful)
                present.append(poses[helpful.frame])
        covered = covered or len(chosen) == before
    return chosen + _far_frames(poses @ rows.T, np.array([base, *present]) @ rows.T, count - len(chosen), source)


def _far_frames(moved: Array, keys: Array, count: int, source: FaceModel) -> list[HelpfulFrame]:
    """Return up to ``count`` frames, each the farthest from all keys, and from those before.

    Args:
        moved: Displacements of the feature points in the frames, shape (m, 3 n).
        keys: The same of the keys, the base first, shape (K, 3 n).
        count: Number of frames to find.
        source: The face that plays.
    """
    moved, places = moved - keys[0], keys - keys[0]
    total = float((moved**2).sum())
    distances = np.min([np.linalg.norm(moved - place, axis=1) for place in places], axis=0)
    least = _NEAR * source.character.height * np.sqrt(moved.shape[1] / 3.0)
    _, sizes, axes = np.linalg.svd(places, full_matrices=False)
    axes = axes[sizes > np.sqrt(_NOTHING) * sizes[0]]
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
