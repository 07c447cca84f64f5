"""Cloning by examples: pairs of key poses say what an expression looks like on the target.

Pyun et al., "An example-based approach for facial expression cloning", SCA 2003. The displacements of the source's
feature points give parameters (``key_parameters``), these give the weights of the keys (``key_weights``), and the
weights blend the keys of the target (eq. (11)). The blend is one of coefficients, which costs nothing beside the
vertices: x = neutral + B p is linear.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.transfer.key_damping import chosen_damping
from faceposer.transfer.key_parameters import (
    ROUNDING,
    Regions,
    feature_matrix,
    grouped,
    parameter_points,
    point_rows,
)
from faceposer.transfer.key_weights import KeyWeights
from faceposer.transfer.region_blending import region_projections, region_shares

Array = NDArray[np.float64]

#: Name of the pair that replaces the neutral faces as the base.
NEUTRAL = "neutral"
#: Largest number of keys.
MOST_KEYS = 500
# Root mean square distance of feature points, as a share of the source's height, below which two keys are the same.
_SAME = 1e-6
# The same within a region, as a share of its largest key: most visemes do not move the brows, but never by exactly 0.
_SAME_IN_REGION = 0.02
# Largest coefficients of a key, in displacements of vertices as a share of the height.
_FARTHEST = 10.0


@dataclass(frozen=True, eq=False)
class KeyPair:
    """A key: an expression of the source, and what it looks like on the target.

    Attributes:
        name: Its name; the pair called "neutral" is the base of both faces.
        source: Coefficients on the source, shape (r,).
        target: Coefficients on the target, shape (r',).
    """

    name: str
    source: Array
    target: Array


@dataclass(frozen=True, eq=False)
class RegionClone:
    """The keys of one region.

    Attributes:
        name: Name of the region.
        rows: Displacements of its feature points per coefficient of the source, shape (3 n, r).
        places: Displacements of its feature points in each key from the base, shape (K, 3 n), the base first.
        matrix: Parameters per displacement, F, shape (n', 3 n).
        covered: The part of it that counts more than half, shape (n'', 3 n); the rest is damped.
        weights: Weights of the keys.
        targets: Displacements of the keys on the target from its base, confined to the region, shape (K, r').
        members: Index of the key of each of the source's keys, shape (M,); keys that do not differ here share one.
    """

    name: str
    rows: Array
    places: Array
    matrix: Array
    covered: Array
    weights: KeyWeights
    targets: Array
    members: NDArray[np.intp]


class ExampleTransfer:
    """Transfer by key poses of source and target.

    The neutral faces, or the pair "neutral", are always a key.

    Attributes:
        base: The neutral faces, or the pair "neutral".
        pairs: The keys without the base.
        points: Feature points of the source in use.
        regions: What is known of each region.
    """

    def __init__(
        self,
        source: FaceModel,
        target: FaceModel,
        pairs: Sequence[KeyPair],
        points: Sequence[str] | None = None,
        regions: Regions = "whole",
        threshold: float | None = None,
    ) -> None:
        """Place the keys in the parameter space and solve for their weights.

        Args:
            source: The face that plays.
            target: The face that follows; any mesh, with any shapes.
            pairs: The keys.
            points: Names of the source's feature points that give the parameters; None for all that move.
            regions: "whole" as in the paper; "halves" or "parts" to clone regions of the face separately.
            threshold: Share of the largest variance of the keys below which directions are dropped, as in the paper;
                None to damp small ones as cross-validation over the keys finds best.

        Raises:
            FacePoserError: If there is no key, too many, two of one expression, or one that is no face.
        """
        self.source, self.target = source, target
        self.base = KeyPair(NEUTRAL, source.neutral(), target.neutral())
        for pair in pairs:
            _check_key(pair, source, target)
        self.base = next((pair for pair in pairs if pair.name.casefold() == NEUTRAL), self.base)
        self.pairs = tuple(pair for pair in pairs if pair.name.casefold() != NEUTRAL)
        if not self.pairs:
            raise FacePoserError("Cloning by examples needs a key besides the neutral face; add a pair of poses.")
        if len(self.pairs) >= MOST_KEYS:
            raise FacePoserError(f"There are {len(self.pairs)} keys, more than the maximum of {MOST_KEYS - 1}.")
        self.points = parameter_points(source.character, points)
        everything = (self.base, *self.pairs)
        sources = np.array([pair.source for pair in everything]) - self.base.source
        targets = np.array([pair.target for pair in everything]) - self.base.target
        self._check_distinct(sources, [pair.name for pair in everything])
        groups = grouped(self.points, regions)
        if len(groups) == 1:
            projections = np.eye(target.n_coefficients)[None]
        else:
            projections = region_projections(target, region_shares(target, groups))
        self.regions = tuple(
            _clone(region, point_rows(source, names), sources, targets @ projection.T, threshold, len(groups) > 1)
            for (region, names), projection in zip(groups.items(), projections, strict=True)
            if regions == "whole" or _moves(source, sources, names)
        )

    def _check_distinct(self, sources: Array, names: Sequence[str]) -> None:
        places = sources @ point_rows(self.source, self.points).T
        least = least_apart(self.source, self.points)
        for first, place in enumerate(places[:-1]):
            gaps = np.linalg.norm(places[first + 1 :] - place, axis=1)
            if not gaps.min() > least:
                second = first + 1 + int(np.argmin(gaps))
                raise FacePoserError(
                    f"The keys '{names[first]}' and '{names[second]}' are the same expression of the source at all "
                    "feature points; change or remove one of them."
                )

    def weights(self, poses: Array) -> tuple[Array, ...]:
        """Return the weights of the keys of each region, the base first, for the source's ``poses``, (m, r)."""
        moved = poses - self.base.source
        return tuple(region.weights(moved @ (region.matrix @ region.rows).T) for region in self.regions)

    def poses(self, poses: Array) -> Array:
        """Return the target's coefficients, shape (m, r'), for the source's, shape (m, r) (eqs. (9) to (11))."""
        blends = [weights @ region.targets for weights, region in zip(self.weights(poses), self.regions, strict=True)]
        result: Array = self.base.target + sum(blends)
        return result

    def pose(self, coefficients: Array, previous: Array | None = None) -> Array:
        """Return the target's coefficients, shape (r',), for the source's, shape (r,); ``previous`` is not used."""
        return self.poses(np.asarray(coefficients, dtype=np.float64)[None])[0]

    def displacements(self, poses: Array) -> tuple[Array, ...]:
        """Return the displacements of each region's points from the base, (m, 3 n), for the source's poses, (m, r)."""
        moved = poses - self.base.source
        return tuple(moved @ region.rows.T for region in self.regions)


def same_expression(model: FaceModel, one: Array, other: Array, points: Sequence[str] | None = None) -> bool:
    """Return True if two poses, (r,) each, cannot be told apart at the feature points, so that they cannot be two keys.

    Args:
        model: The face.
        one: Coefficients of a pose.
        other: Coefficients of another pose.
        points: Names of its feature points; None for all that move.
    """
    names = parameter_points(model.character, points)
    gap = np.linalg.norm(point_rows(model, names) @ (np.asarray(one) - other))
    return not gap > least_apart(model, names)


def least_apart(model: FaceModel, names: Sequence[str]) -> float:
    """Return the distance of the feature points ``names``, all together, below which two keys are the same."""
    return float(_SAME * model.character.height * np.sqrt(len(names)))


def earlier_same(model: FaceModel, poses: Array, points: Sequence[str] | None = None) -> list[int | None]:
    """Return for each of the ``poses``, (K, r), the first one before it that is the same expression, or None.

    Args:
        model: The face.
        poses: Coefficients of poses.
        points: Names of its feature points; None for all that move.
    """
    names = parameter_points(model.character, points)
    places, least = poses @ point_rows(model, names).T, least_apart(model, names)
    found: list[int | None] = []
    for i, place in enumerate(places):
        near = np.flatnonzero(~(np.linalg.norm(places[:i] - place, axis=1) > least))
        found.append(int(near[0]) if len(near) else None)
    return found


def check_motion(name: str, side: str, moved: float, character: Character) -> None:
    """Check that a key is a face, whose vertices move by up to ``moved``.

    Raises:
        FacePoserError: If they move too far.
    """
    # Comparisons with NaN are False.
    if not moved < _FARTHEST * character.height:
        raise FacePoserError(
            f"The {side} of the key '{name}' is no face: a vertex of {character.label} moves by more than "
            f"{_FARTHEST:g} times the height of the head; correct its weights."
        )


def _check_key(pair: KeyPair, source: FaceModel, target: FaceModel) -> None:
    for side, coefficients, model in (("source", pair.source, source), ("target", pair.target, target)):
        if coefficients.shape != (model.n_coefficients,):
            raise FacePoserError(
                f"The {side} of the key '{pair.name}' has {coefficients.size} coefficients, but the character "
                f"{model.character.label} has {model.n_coefficients}; take the key from this character."
            )
        moved = float(np.abs(model.instance(coefficients) - model.character.vertices).max())
        check_motion(pair.name, side, moved, model.character)


def _moves(source: FaceModel, sources: Array, names: Sequence[str]) -> bool:
    """Return True if a key moves one of the feature points ``names``."""
    return bool(np.abs(sources @ point_rows(source, names).T).max() > _SAME * source.character.height)


def _clone(
    name: str, rows: Array, sources: Array, targets: Array, threshold: float | None, merges: bool
) -> RegionClone:
    places = sources @ rows.T
    members = np.arange(len(places), dtype=np.intp)
    if merges:
        members = _merged(places)
        leaders = [np.flatnonzero(members == i) for i in range(members.max() + 1)]
        # The base keeps its place, and its target: what does not move stays exactly neutral.
        places = np.array([places[0] if group[0] == 0 else places[group].mean(axis=0) for group in leaders])
        targets = np.array([targets[0] if group[0] == 0 else targets[group].mean(axis=0) for group in leaders])
    matrix = feature_matrix(places, ROUNDING if threshold is None else threshold)
    parameters = places @ matrix.T
    damping = chosen_damping(parameters, targets) if threshold is None else 0.0
    covered = feature_matrix(places, damping) if threshold is None else matrix
    try:
        weights = KeyWeights(parameters, damping)
    except ValueError as error:
        raise FacePoserError(
            "Two keys are nearly the same expression of the source; remove one of them, or use more feature points."
        ) from error
    return RegionClone(name, rows, places, matrix, covered, weights, targets, members)


def _merged(places: Array) -> NDArray[np.intp]:
    """Return the group of each of the ``places``, (M, n), numbered in the order of their first members, shape (M,)."""
    least = _SAME_IN_REGION * np.sqrt((places**2).sum(axis=1).max())
    leaders: list[int] = []
    members = np.zeros(len(places), dtype=np.intp)
    for i, place in enumerate(places):
        near = [k for k, leader in enumerate(leaders) if np.linalg.norm(places[leader] - place) < least]
        members[i] = near[0] if near else len(leaders)
        if not near:
            leaders.append(i)
    return members
