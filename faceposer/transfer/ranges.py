"""Natural ranges of the distances on a face, and the scaling of distances from one face to another.

"Since the meshes are different for the two subjects, we scale the target distances between subjects by measuring the
minimum and maximum of key features of the face" (Lau et al. 2009, section 7).
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.sized_cache import weak_cache
from faceposer.transfer.pairs import PAPER_PAIRS, Pair
from faceposer.transfer.terms import PairPoints

Array = NDArray[np.float64]

#: Kind of the scaling: two straight lines that meet at the neutral face, or one, as in the paper.
Scaling = Literal["neutral", "paper"]
SCALINGS: tuple[Scaling, ...] = get_args(Scaling)

# Percentage of draws ignored at each end, because extremes of thousands of draws are random.
_PERCENT = 0.5
# Share of the whole range added to each side before they are compared: a side to which a distance hardly moves, such as
# the closing of a closed mouth, says little about the scale.
_WHOLE = 0.25
#: Shrinkage, 0 to 1, of the log scale of each distance towards the median of all. Ranges are as uncertain as the data
#: that they are measured on, from thirty examples to thousands of frames; ranges of the same expressions need none.
LEAN = 0.5
# A distance that falls below this share of its neutral value closes, as an eye does, and must close on both faces.
_CLOSED = 0.25
# A distance that falls below this share of its maximum opens and closes.
_OPENS = 0.25
# Lips and lids closer than their minimum by more than this share of their range have passed through each other.
_PASSED = 0.1


@dataclass(frozen=True, eq=False)
class Ranges:
    """Distances of one face, for n pairs, in the unit of its mesh.

    Attributes:
        least: Minimum natural distances, shape (n,).
        neutral: Distances of the neutral face, shape (n,).
        greatest: Maximum natural distances, shape (n,).
        of_gaze: Mask of the pairs that depend on the gaze, shape (n,).
        axes: Axes along which opening pairs are measured, shape (n, 3), zeros for the others.
    """

    least: Array
    neutral: Array
    greatest: Array
    of_gaze: NDArray[np.bool_]
    axes: Array

    @property
    def sides(self) -> tuple[Array, Array]:
        """Ranges below and above the neutral distances, with a share of the whole range, each of shape (n,)."""
        share = _WHOLE * self.widths
        return self.neutral - self.least + share, self.greatest - self.neutral + share

    @property
    def closes(self) -> NDArray[np.bool_]:
        """Mask of the distances that close, shape (n,)."""
        closes: NDArray[np.bool_] = self.least < _CLOSED * self.neutral
        return closes

    @property
    def widths(self) -> Array:
        """Ranges from minimum to maximum, shape (n,)."""
        return self.greatest - self.least


def measure_ranges(model: FaceModel, pairs: tuple[Pair, ...]) -> Ranges:
    """Return the ranges of ``pairs`` over natural expressions of ``model``; the last few results are cached.

    Natural expressions are draws from the model's density, with a fixed seed and within the rig's limits, and each
    shape of the rig at its limits.
    """
    return _ranges_of_ends(model, tuple((pair.first, pair.second) for pair in pairs))


@weak_cache(16)
def _ranges_of_ends(model: FaceModel, ends: tuple[tuple[str, str], ...]) -> Ranges:
    pairs = [Pair("", *pair) for pair in ends]
    density = model.rig_density
    limits = model.character.shape_limits.astype(np.float64)
    drawn = density.draws @ density.projection.T
    single = np.concatenate([np.diag(side) for side in limits.T]) @ model.subspace.projection.T
    axes = _axes(PairPoints(model, pairs), drawn)
    points = PairPoints(model, pairs, axes)
    neutral = points.distances(model.neutral()[None])[0]
    least, greatest = np.percentile(points.distances(drawn), [_PERCENT, 100.0 - _PERCENT], axis=0)
    singly = points.distances(np.vstack([model.neutral(), single[_without_passing(model, drawn, single)]]))
    least, greatest = np.minimum(least, singly.min(axis=0)), np.maximum(greatest, singly.max(axis=0))
    of_gaze = np.array([pair.of_gaze for pair in pairs], dtype=bool)
    return Ranges(np.minimum(least, neutral), neutral, np.maximum(greatest, neutral), of_gaze, axes)


def _axes(points: PairPoints, drawn: Array) -> Array:
    """Return the mean direction of each pair when widest, shape (n, 3), zeros for pairs that do not close."""
    offsets = points.offsets(drawn)
    lengths = np.linalg.norm(offsets, axis=2)
    least, wide = np.percentile(lengths, [_PERCENT, 99.0], axis=0)
    widest = np.einsum("mn,mnd->nd", (lengths >= wide).astype(np.float64), offsets)
    axes = widest / np.maximum(np.linalg.norm(widest, axis=1), 1e-12)[:, None]
    opens = least < _OPENS * wide
    return np.where(opens[:, None], axes, 0.0)


def _without_passing(model: FaceModel, drawn: Array, single: Array) -> NDArray[np.bool_]:
    """Return a mask of the poses ``single``, (m, r), without lips or lids that pass through each other, shape (m,).

    Some shapes are meaningful only with others: ARKit's mouthClose closes a mouth that the jaw has opened.
    """
    pairs = [pair for pair in PAPER_PAIRS if pair.measurable(model.character)]
    if not pairs:
        return np.ones(len(single), dtype=bool)
    points = PairPoints(model, pairs, _axes(PairPoints(model, pairs), drawn))
    least, greatest = np.percentile(points.distances(drawn), [_PERCENT, 100.0 - _PERCENT], axis=0)
    nearest = np.minimum(least, points.distances(model.neutral()[None])[0]) - _PASSED * (greatest - least)
    valid: NDArray[np.bool_] = np.all(points.distances(single) > nearest, axis=1)
    return valid


def scaled(distances: Array, source: Ranges, target: Ranges, scaling: Scaling = "neutral", lean: float = LEAN) -> Array:
    """Return ``distances`` of the source, shape (m, n), scaled to the target, shape (m, n).

    The paper's single line maps minimum to minimum and maximum to maximum. The source's relaxed face then becomes a
    face that is not relaxed, unless both are at the same share of their ranges. Two lines that meet at the neutral
    faces map the relaxed face to the relaxed face. Both extrapolate linearly beyond the ranges.

    Args:
        distances: Distances of the source.
        source: Ranges of the source.
        target: Ranges of the target, for the same pairs.
        scaling: "neutral" for two lines, "paper" for one.
        lean: Shrinkage of the scales of each distance towards the median scale, 0 to 1; not applied to gaze, because
            the turn of an eye does not depend on the size of other features.
    """
    if scaling == "paper":
        share = (distances - source.least) / np.maximum(source.widths, 1e-12)
        return target.least + share * target.widths
    offsets = distances - source.neutral
    median = np.median(np.log(target.widths.clip(1e-12) / source.widths.clip(1e-12)))
    share = np.where(target.of_gaze, 0.0, lean)
    below, above = (
        np.exp(share * median + (1.0 - share) * np.log(target_side.clip(1e-12) / source_side.clip(1e-12)))
        for source_side, target_side in zip(source.sides, target.sides, strict=True)
    )
    exact = (target.neutral - target.least) / np.maximum(source.neutral - source.least, 1e-12)
    below = np.where(source.closes & target.closes, exact, below)
    result: Array = target.neutral + np.where(offsets < 0, below, above) * offsets
    return result
