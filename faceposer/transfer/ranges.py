"""How far each key feature of a face goes, and how a distance of one face is said on another.

"Since the meshes are different for the two subjects, we scale the target distances between subjects by measuring the
minimum and maximum of key features of the face" (Lau et al. 2009, section 7).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.transfer.pairs import PAPER_PAIRS, Pair
from faceposer.transfer.terms import PairPoints

Array = NDArray[np.float64]

#: How distances are scaled: by two straight lines that meet at the neutral face, or by one, as the paper says.
Scaling = Literal["neutral", "paper"]
SCALINGS: tuple[Scaling, ...] = get_args(Scaling)

# The most extreme of thousands of draws is chance; so many percent of them are left out at each end.
_PERCENT = 0.5
# Where a feature hardly moves to one side of the neutral face, such as a closed mouth that cannot close further, that
# side says little of how it scales: this share of the whole range is added to each side before they are compared.
_WHOLE = 0.25
#: Ranges are as uncertain as what they are measured on, thousands of frames or thirty examples: so much of a scale, as
#: a power, is what most features have in common. Where both are measured on the same expressions, nothing need be.
LEAN = 0.5
# What is open and can become so small a share of itself closes, as an eye does: closed is then closed on both faces.
_CLOSED = 0.25
# What can become so small a share of its greatest length opens and closes.
_OPENS = 0.25
# Lips and lids that come nearer to each other than ever by more than this share of their range have passed each other.
_PASSED = 0.1


@dataclass(frozen=True, eq=False)
class Ranges:
    """Distances of one face, for n pairs, in the unit of its mesh.

    Attributes:
        least: Least natural distances, shape (n,).
        neutral: Those of the neutral face, shape (n,).
        greatest: Greatest natural distances, shape (n,).
        of_gaze: Which of the pairs tell where an eye looks, shape (n,).
        axes: Along which the pairs that open are measured, shape (n, 3), zeros for the others.
    """

    least: Array
    neutral: Array
    greatest: Array
    of_gaze: NDArray[np.bool_]
    axes: Array

    @property
    def sides(self) -> tuple[Array, Array]:
        """How far they go below and above the neutral ones, with a share of both, each of shape (n,)."""
        both = _WHOLE * self.widths
        return self.neutral - self.least + both, self.greatest - self.neutral + both

    @property
    def closes(self) -> NDArray[np.bool_]:
        """Which of them close, shape (n,)."""
        closes: NDArray[np.bool_] = self.least < _CLOSED * self.neutral
        return closes

    @property
    def widths(self) -> Array:
        """Greatest less least, shape (n,)."""
        return self.greatest - self.least


def measure_ranges(model: FaceModel, pairs: tuple[Pair, ...]) -> Ranges:
    """Return the ranges of ``pairs`` over natural expressions of ``model``, remembered for the last few.

    Natural is what the model's own density gives, drawn with a fixed seed and kept within the rig's limits, and each
    shape of the rig at its limits.
    """
    return _measured(model, tuple((pair.first, pair.second) for pair in pairs))


@lru_cache(maxsize=16)
def _measured(model: FaceModel, ends: tuple[tuple[str, str], ...]) -> Ranges:
    pairs = [Pair("", *pair) for pair in ends]
    density = model.rig_density
    limits = model.character.shape_limits.astype(np.float64)
    drawn = density.draws @ density.projection.T
    single = np.concatenate([np.diag(side) for side in limits.T]) @ model.subspace.projection.T
    axes = _axes(PairPoints(model, pairs), drawn)
    points = PairPoints(model, pairs, axes)
    neutral = points.distances(model.neutral()[None])[0]
    least, greatest = np.percentile(points.distances(drawn), [_PERCENT, 100.0 - _PERCENT], axis=0)
    singly = points.distances(np.vstack([model.neutral(), single[_sound(model, drawn, single)]]))
    least, greatest = np.minimum(least, singly.min(axis=0)), np.maximum(greatest, singly.max(axis=0))
    of_gaze = np.array([pair.of_gaze for pair in pairs], dtype=bool)
    return Ranges(np.minimum(least, neutral), neutral, np.maximum(greatest, neutral), of_gaze, axes)


def _axes(points: PairPoints, drawn: Array) -> Array:
    """Return the mean direction of each pair where it is widest, shape (n, 3), zeros for pairs that never close."""
    offsets = points.offsets(drawn)
    lengths = np.linalg.norm(offsets, axis=2)
    least, wide = np.percentile(lengths, [_PERCENT, 99.0], axis=0)
    widest = np.einsum("mn,mnd->nd", (lengths >= wide).astype(np.float64), offsets)
    axes = widest / np.maximum(np.linalg.norm(widest, axis=1), 1e-12)[:, None]
    opens = least < _OPENS * wide
    return np.where(opens[:, None], axes, 0.0)


def _sound(model: FaceModel, drawn: Array, single: Array) -> NDArray[np.bool_]:
    """Return which of the poses ``single``, (m, r), pass neither the lips nor the lids through each other, shape (m,).

    Some shapes mean something only together with others: ARKit's mouthClose closes a mouth that the jaw opens.
    """
    pairs = [pair for pair in PAPER_PAIRS if pair.measurable(model.character)]
    if not pairs:
        return np.ones(len(single), dtype=bool)
    points = PairPoints(model, pairs, _axes(PairPoints(model, pairs), drawn))
    least, greatest = np.percentile(points.distances(drawn), [_PERCENT, 100.0 - _PERCENT], axis=0)
    nearest = np.minimum(least, points.distances(model.neutral()[None])[0]) - _PASSED * (greatest - least)
    sound: NDArray[np.bool_] = np.all(points.distances(single) > nearest, axis=1)
    return sound


def scaled(distances: Array, source: Ranges, target: Ranges, scaling: Scaling = "neutral", lean: float = LEAN) -> Array:
    """Return what ``distances`` of the source's face, shape (m, n), are on the target's, shape (m, n).

    The paper's one straight line takes minimum to minimum and maximum to maximum. The source's relaxed face then
    becomes a face that is not relaxed, unless both lie at the same share of their ranges. Two lines that meet at the
    neutral faces take the relaxed face to the relaxed face. Beyond the ranges the lines go on.

    Args:
        distances: Of the source's faces.
        source: Ranges of the source.
        target: Ranges of the target, for the same pairs.
        scaling: By two lines or by the paper's one.
        lean: How far the two lines of each feature lean on what most features have in common, 0 to 1; where an eye
            looks stays out of it, since eyes turn as far as they turn.
    """
    if scaling == "paper":
        share = (distances - source.least) / np.maximum(source.widths, 1e-12)
        return target.least + share * target.widths
    offsets = distances - source.neutral
    usual = np.median(np.log(target.widths.clip(1e-12) / source.widths.clip(1e-12)))
    share = np.where(target.of_gaze, 0.0, lean)
    below, above = (
        np.exp(share * usual + (1.0 - share) * np.log(theirs.clip(1e-12) / ours.clip(1e-12)))
        for ours, theirs in zip(source.sides, target.sides, strict=True)
    )
    exact = (target.neutral - target.least) / np.maximum(source.neutral - source.least, 1e-12)
    below = np.where(source.closes & target.closes, exact, below)
    moved: Array = target.neutral + np.where(offsets < 0, below, above) * offsets
    return moved
