"""The paper's way: distances of the source, scaled, and the prior of the target (Lau et al. 2009, section 7)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.model.face_model import FaceModel
from faceposer.transfer.pairs import DEFAULT_PAIRS, Pair, shared_pairs
from faceposer.transfer.ranges import LEAN, Scaling, measure_ranges, scaled
from faceposer.transfer.terms import PairPoints, RigWeightTerm, SpaceDistanceTerm
from faceposer.transfer.weights import arkit_rows

Array = NDArray[np.float64]

#: How far a distance may be off, as a standard deviation and a share of its range.
SIGMA = 0.04
#: Weight of the target's prior.
PRIOR_WEIGHT = 1.0
# How far a rig weight of gaze may be off, as a standard deviation.
_GAZE_SIGMA = 0.01
# A feature that moves less than this share of the head's height on either face says nothing.
_STILL = 5e-4


class DistanceTransfer:
    """Poses the target so that its key features are where the source's are, each within its own range.

    Gaze is kept apart where both rigs have ARKit's eyeLook shapes: their weights are carried over as they are, and the
    prior is asked nothing of them.

    Attributes:
        pairs: Those that are used.
        still: Those that can be measured but hardly move on one of the faces.
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
        """Measure both faces.

        Raises:
            FacePoserError: If no pair can be measured on both.
        """
        self.source, self.target = source, target
        self._scaling, self._prior_weight = scaling, prior_weight
        ours, theirs = arkit_rows(source.character), arkit_rows(target.character)
        looks = [name for name in theirs if name.startswith("eyeLook") and name in ours]
        self._looks = [(ours[name], theirs[name]) for name in looks] if len(looks) == 8 else []
        # Rigs with the same shapes are measured on the same expressions.
        common = len(ours.keys() & theirs.keys())
        alike = 2 * common > max(len(source.character.shape_names), len(target.character.shape_names))
        self._lean = 0.0 if alike else LEAN
        shared = shared_pairs(pairs, source.character, target.character)
        wanted = tuple(pair for pair in shared if not (self._looks and pair.of_gaze))
        moving = np.ones(len(wanted), dtype=bool)
        for model in (source, target):
            moving &= measure_ranges(model, wanted).widths > _STILL * model.character.height
        self.pairs = tuple(pair for pair, moves in zip(wanted, moving, strict=True) if moves)
        self.still = tuple(pair for pair, moves in zip(wanted, moving, strict=True) if not moves)
        self._our_ranges, self._their_ranges = (measure_ranges(model, self.pairs) for model in (source, target))
        self._ours = PairPoints(source, self.pairs, self._our_ranges.axes)
        self._theirs = PairPoints(target, self.pairs, self._their_ranges.axes)
        factors = np.array([pair.weight for pair in self.pairs])
        self._weights = factors / (sigma * self._their_ranges.widths) ** 2

    def distances(self, poses: ArrayLike) -> Array:
        """Return the distances of the source's faces ``poses``, (m, r), as the target should have them, (m, n)."""
        ours = self._ours.distances(poses)
        return scaled(ours, self._our_ranges, self._their_ranges, self._scaling, self._lean)

    def reached(self, poses: ArrayLike) -> Array:
        """Return the distances of the target's faces ``poses``, (m, r'), shape (m, n)."""
        return self._theirs.distances(poses)

    @property
    def widths(self) -> Array:
        """How far each distance of the target goes, shape (n,)."""
        return self._their_ranges.widths

    def pose(self, coefficients: Array, previous: Array | None = None) -> Array:
        """Return the target's coefficients, shape (r',), for the source's, shape (r,).

        Args:
            coefficients: Of the source's face.
            previous: The target's pose one frame before, from which it is searched; None to search everywhere.
        """
        from faceposer.solve.map_solver import solve
        from faceposer.solve.problem import RECORDED_SPREAD, PoseProblem

        term = SpaceDistanceTerm(self._theirs, self.distances(coefficients[None])[0], self._weights)
        held: list[RigWeightTerm] = []
        offset: Array | None = None
        if self._looks:
            weights = self.source.weights_of(coefficients)
            wanted = np.zeros(len(self.target.character.shape_names))
            lower, upper = self.target.character.shape_limits.T.astype(np.float64)
            rows = [theirs for _, theirs in self._looks]
            for our_row, their_row in self._looks:
                wanted[their_row] = np.clip(weights[our_row], lower[their_row], upper[their_row])
            held = [RigWeightTerm(self.target, rows, wanted[rows], 1.0 / _GAZE_SIGMA**2)]
            offset = self.target.coefficients_of(wanted)
        problem = PoseProblem(
            self.target,
            (),
            prior_weight=self._prior_weight,
            extra_terms=[term],
            passive_terms=held,
            offset=offset,
            spread=RECORDED_SPREAD,
        )
        return solve(problem, previous).coefficients
