"""Transfer by distances between feature points and the prior of the target (Lau et al. 2009, section 7)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.model.face_model import FaceModel
from faceposer.transfer.pairs import DEFAULT_PAIRS, Pair, shared_pairs
from faceposer.transfer.ranges import LEAN, Scaling, measure_ranges, scaled
from faceposer.transfer.terms import PairPoints, RigWeightTerm, SpaceDistanceTerm
from faceposer.transfer.weights import arkit_rows

Array = NDArray[np.float64]

#: Standard deviation of a distance, as a share of its range.
SIGMA = 0.04
#: Weight of the target's prior.
PRIOR_WEIGHT = 1.0
# Standard deviation of a rig weight of gaze.
_GAZE_SIGMA = 0.01
# A distance that varies less than this share of the head's height on either face is ignored.
_STILL = 5e-4


class DistanceTransfer:
    """Transfer of poses by distances between feature points, each scaled to the target's range.

    If both rigs have ARKit's eyeLook shapes, gaze is transferred separately by their weights, unaffected by the prior.

    Attributes:
        pairs: Pairs in use.
        still: Pairs that exist on both faces but hardly move on one of them.
    """

    def __init__(
        self,
        source: FaceModel,
        target: FaceModel,
        pairs: Sequence[Pair] = DEFAULT_PAIRS,
        scaling: Scaling = "neutral",
        prior_weight: float = PRIOR_WEIGHT,
        sigma: float = SIGMA,
    ) -> None:
        """Measure the ranges of both faces.

        Raises:
            FacePoserError: If no pair can be measured on both.
        """
        self.source, self.target = source, target
        self._scaling, self._prior_weight = scaling, prior_weight
        source_rows, target_rows = arkit_rows(source.character), arkit_rows(target.character)
        looks = [name for name in target_rows if name.startswith("eyeLook") and name in source_rows]
        self._looks = [(source_rows[name], target_rows[name]) for name in looks] if len(looks) == 8 else []
        # Rigs with the same shapes are measured on the same expressions.
        common = len(source_rows.keys() & target_rows.keys())
        same_shapes = 2 * common > max(len(source.character.shape_names), len(target.character.shape_names))
        self._lean = 0.0 if same_shapes else LEAN
        shared = shared_pairs(pairs, source.character, target.character)
        candidates = tuple(pair for pair in shared if not (self._looks and pair.of_gaze))
        moving = np.ones(len(candidates), dtype=bool)
        for model in (source, target):
            moving &= measure_ranges(model, candidates).widths > _STILL * model.character.height
        self.pairs = tuple(pair for pair, moves in zip(candidates, moving, strict=True) if moves)
        self.still = tuple(pair for pair, moves in zip(candidates, moving, strict=True) if not moves)
        self._source_ranges, self._target_ranges = (measure_ranges(model, self.pairs) for model in (source, target))
        self._source_points = PairPoints(source, self.pairs, self._source_ranges.axes)
        self._target_points = PairPoints(target, self.pairs, self._target_ranges.axes)
        factors = np.array([pair.weight for pair in self.pairs])
        self._weights = factors / (sigma * self._target_ranges.widths) ** 2

    def distances(self, poses: ArrayLike) -> Array:
        """Return the distances of the source's ``poses``, (m, r), scaled to the target, (m, n)."""
        distances = self._source_points.distances(poses)
        return scaled(distances, self._source_ranges, self._target_ranges, self._scaling, self._lean)

    def reached(self, poses: ArrayLike) -> Array:
        """Return the distances of the target's ``poses``, (m, r'), shape (m, n)."""
        return self._target_points.distances(poses)

    @property
    def widths(self) -> Array:
        """Range of each distance of the target, shape (n,)."""
        return self._target_ranges.widths

    def pose(self, coefficients: Array, previous: Array | None = None) -> Array:
        """Return the target's coefficients, shape (r',), for the source's, shape (r,).

        Args:
            coefficients: Coefficients of the source.
            previous: The target's pose of the previous frame as the initial pose; None to search from several starts.
        """
        from faceposer.solve.map_solver import solve
        from faceposer.solve.problem import RECORDED_SPREAD, PoseProblem

        term = SpaceDistanceTerm(self._target_points, self.distances(coefficients[None])[0], self._weights)
        gaze_terms: list[RigWeightTerm] = []
        offset: Array | None = None
        if self._looks:
            weights = self.source.weights_of(coefficients)
            gaze = np.zeros(len(self.target.character.shape_names))
            lower, upper = self.target.character.shape_limits.T.astype(np.float64)
            rows = [target_row for _, target_row in self._looks]
            for source_row, target_row in self._looks:
                gaze[target_row] = np.clip(weights[source_row], lower[target_row], upper[target_row])
            gaze_terms = [RigWeightTerm(self.target, rows, gaze[rows], 1.0 / _GAZE_SIGMA**2)]
            offset = self.target.coefficients_of(gaze)
        problem = PoseProblem(
            self.target,
            (),
            prior_weight=self._prior_weight,
            extra_terms=[term],
            passive_terms=gaze_terms,
            offset=offset,
            spread=RECORDED_SPREAD,
        )
        return solve(problem, previous).coefficients
