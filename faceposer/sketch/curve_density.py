"""Gaussian densities of the curves of features in a view, from training poses.

A pose is p = m + L z with z standard normal, where L spans the directions of the training poses that move the features
most. Curves are linear in p in space and, linearised at m, in the image.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.face_in_view import face_height
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES, FeatureCurve, feature_curves

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

#: Number of directions of the training poses.
DIRECTIONS = 20
# Number of directions in which one line moves.
_LINE_DIRECTIONS = 8
# Radius about a point of a curve over which normals are averaged, as a share of the character's height.
_NORMAL_RADIUS = 0.035
# Cosine of the angle to the camera at which half of a place counts as visible, and its softness.
_FACING, _SOFTNESS = -0.15, 0.08
#: Height of a face in units of the hand.
FACE_SIZE = 720.0


@dataclass(frozen=True, eq=False)
class Track:
    """A line to be drawn for a feature, as a run of the rows of ``FeatureRows``.

    Attributes:
        feature: Name of the feature.
        rows: The rows of the line's points.
        parameters: Parameter of each point; see ``FeatureCurve``.
        names: Names of the feature points of each chain that the line represents.
        closed: True if the line ends where it begins.
    """

    feature: str
    rows: slice
    parameters: Array
    names: tuple[tuple[str, ...], ...]
    closed: bool


@dataclass(frozen=True, eq=False)
class FeatureRows:
    """Points of all lines of a character, as linear functions of the pose.

    Attributes:
        tracks: The lines by feature.
        jacobian: Derivatives of the points, shape (n, 3, r).
        neutral: Positions on the neutral face, shape (n, 3).
        normals: Mean normal of the skin about each point, shape (n, 3).
        gaps: Derivatives, (g, 3, r), and values on the neutral face, (g, 3), of the offsets between opposite lips and
            lids; each name of ``GAPS`` has a slice of them.
        gap_slices: The slice of each gap, by its name.
        size: The face's size in the unit of the mesh, which is 720 units of the hand.
        middle: Middle of the features on the neutral face, shape (3,).
    """

    tracks: dict[str, Track]
    jacobian: Array
    neutral: Array
    normals: Array
    gaps: tuple[Array, Array]
    gap_slices: dict[str, slice]
    size: float
    middle: Array

    @cached_property
    def gram(self) -> Array:
        """Inner products of the points' derivatives, shape (r, r)."""
        flat = self.jacobian.reshape(-1, self.jacobian.shape[-1])
        return flat.T @ flat

    @classmethod
    def of(cls, model: FaceModel) -> "FeatureRows":
        """Gather the lines of the ``model``'s character; empty if it has no feature points."""
        curves = feature_curves(model.character)
        tracks: dict[str, Track] = {}
        jacobians, neutrals = [np.zeros((0, 3, model.n_coefficients))], [np.zeros((0, 3))]
        gathered: dict[str, list[tuple[Array, Array]]] = {}
        begin = 0
        for name, chains in curves.items():
            gathered[name] = [model.rows_of(chain.points) for chain in chains]
            (rows, neutral), *others = gathered[name]
            first = chains[0].parameters
            for chain, (other, place) in zip(chains[1:], others, strict=True):
                # One stroke along two chains lies between them.
                rows = 0.5 * (rows + _at(first, chain.parameters, other))
                neutral = 0.5 * (neutral + _at(first, chain.parameters, place))
            jacobians.append(rows)
            neutrals.append(neutral)
            end = begin + len(neutral)
            names = tuple(chain.names for chain in chains)
            tracks[name] = Track(name, slice(begin, end), first, names, FEATURES[name].closed)
            begin = end
        neutral = np.concatenate(neutrals)
        gaps, slices = _gaps(curves, gathered, model.n_coefficients)
        size = face_height(model.character, neutral)
        middle = 0.5 * (neutral.min(axis=0) + neutral.max(axis=0)) if len(neutral) else np.zeros(3)
        return cls(
            tracks, np.concatenate(jacobians), neutral, _mean_normals(model, neutral), gaps, slices, size, middle
        )


#: Pairs of features whose distance tells whether a mouth or an eye is open.
GAPS = {
    "mouth": ("inner upper lip", "inner lower lip"),
    "left eye": ("left upper lid", "left lower lid"),
    "right eye": ("right upper lid", "right lower lid"),
}


def _gaps(
    curves: Mapping[str, tuple[FeatureCurve, ...]], gathered: dict[str, list[tuple[Array, Array]]], r: int
) -> tuple[tuple[Array, Array], dict[str, slice]]:
    """Return the rows of the gaps of ``GAPS`` at five places each, and the slice of each gap."""
    rows, places, slices, begin = [np.zeros((0, 3, r))], [np.zeros((0, 3))], {}, 0
    for name, (upper, lower) in GAPS.items():
        if upper not in gathered or lower not in gathered:
            continue
        chains = [curves[upper][0], curves[lower][0]]
        at = np.linspace(0.25, 0.75, 5)
        sampled = [
            [_at(at * chain.parameters[-1], chain.parameters, values) for values in gathered[side][0]]
            for side, chain in zip((upper, lower), chains, strict=True)
        ]
        rows.append(sampled[0][0] - sampled[1][0])
        places.append(sampled[0][1] - sampled[1][1])
        slices[name] = slice(begin, begin + len(at))
        begin += len(at)
    return (np.concatenate(rows), np.concatenate(places)), slices


def _at(parameters: Array, known: Array, values: Array) -> Array:
    """Return ``values``, (n, ...), given at ``known`` parameters, (n,), at other ``parameters``, (m,)."""
    index = np.clip(np.searchsorted(known, parameters), 1, len(known) - 1)
    share = (parameters - known[index - 1]) / np.maximum(known[index] - known[index - 1], 1e-12)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1.0 - share) * values[index - 1] + share * values[index])


def _mean_normals(model: FaceModel, places: Array) -> Array:
    """Return the mean normal of the skin about each of ``places``, shape (n, 3)."""
    from scipy.spatial import cKDTree

    if not len(places):
        return np.zeros((0, 3))
    vertices = model.character.vertices.astype(np.float64)
    corners = vertices[model.triangles[model.character.solid_triangles]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centres = corners.mean(axis=1)
    near = cKDTree(centres).query_ball_point(places, _NORMAL_RADIUS * model.character.height)
    summed = np.stack([normals[ids].sum(axis=0) if ids else np.zeros(3) for ids in near])
    return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12))


@dataclass(frozen=True, eq=False)
class PoseMixture:
    """Poses p = base + L z with z from a mixture of Gaussians of unit covariance, one about each training pose.

    Attributes:
        base: Pose at which curves are linearised, shape (r,).
        factor: L, shape (r, q).
        means: Mean of z of each component, shape (n, q).
        log_weights: Logarithm of the share of each component, shape (n,).
    """

    base: Array
    factor: Array
    means: Array
    log_weights: Array

    @classmethod
    def of(cls, coefficients: Array, rows: FeatureRows, spread: float) -> "PoseMixture":
        """Return the density about the training poses ``coefficients``, shape (n, r).

        Args:
            coefficients: The poses.
            rows: The lines; directions are chosen by their motion.
            spread: Spread of the components, as a share of that of all poses.
        """
        base = coefficients.mean(axis=0)
        scaled = (coefficients - base).T / np.sqrt(max(len(coefficients) - 1, 1))
        _, vectors = np.linalg.eigh(scaled.T @ rows.gram @ scaled)
        chosen = vectors[:, ::-1][:, :DIRECTIONS]
        # The poses in these directions, in which they have unit covariance.
        latent = chosen * np.sqrt(max(len(coefficients) - 1, 1))
        count = len(coefficients)
        return cls(base, spread * (scaled @ chosen), latent / spread, np.full(count, -np.log(count)))

    def with_pose(self, pose: Array, rows: FeatureRows, share: float) -> "PoseMixture":
        """Return the mixture with a further component about ``pose``, shape (r,), of weight ``share``."""
        moved = self.factor.T @ rows.gram
        system = moved @ self.factor
        system[np.diag_indices_from(system)] += 1e-6 * max(float(np.trace(system)) / len(system), 1e-12)
        at = np.linalg.solve(system, moved @ (pose - self.base))
        weights = np.append(self.log_weights + np.log1p(-share), np.log(share))
        return replace(self, means=np.concatenate([self.means, at[None]]), log_weights=weights)

    def rebased(self, at: Array) -> "PoseMixture":
        """Return the same mixture with its base at z = ``at``, shape (q,)."""
        return replace(self, base=self.base + self.factor @ at, means=self.means - at)

    def updated(self, log_likelihood: Array, means: Array, covariance: Array) -> "PoseMixture":
        """Return the posterior mixture.

        Args:
            log_likelihood: Log likelihood of each component, shape (n,).
            means: Posterior mean of z of each component, shape (n, q).
            covariance: Their common posterior covariance, shape (q, q).
        """
        root = np.linalg.cholesky(0.5 * (covariance + covariance.T) + 1e-9 * np.eye(len(covariance)))
        weights = self.log_weights + log_likelihood
        weights = weights - np.logaddexp.reduce(weights)
        base = self.base + self.factor @ (np.exp(weights) @ means)
        centred = means - np.exp(weights) @ means
        return PoseMixture(base, self.factor @ root, np.linalg.solve(root, centred.T).T, weights)


class ViewedCurves:
    """The lines of some features, seen by a camera, under one density of poses.

    Each line depends on few directions of the pose: its derivatives are U V^T with the columns of V, shape (q, k),
    orthonormal, and V^T z takes the place of z.

    Attributes:
        pixels: The mean of each line in units of the hand about the principal point, shape (n, 2), by feature.
        moves: U of each line, shape (n, 2, k).
        directions: V of each line, shape (q, k).
    """

    def __init__(self, rows: FeatureRows, density: PoseMixture, camera: Camera, names: Sequence[str]) -> None:
        """Project the lines ``names``."""
        self.rows, self.density, self.camera = rows, density, camera
        self.unit = hand_unit(rows, camera)
        self.tracks = [rows.tracks[name] for name in names]
        chosen = np.concatenate([np.arange(track.rows.start, track.rows.stop) for track in self.tracks])
        jacobian = rows.jacobian[chosen]
        pixels, derivative = camera.project_with_jacobian(rows.neutral[chosen] + jacobian @ density.base)
        pixels = (pixels - camera.principal_point) / self.unit
        moves = derivative @ (jacobian @ density.factor) / self.unit
        ends = np.cumsum([track.rows.stop - track.rows.start for track in self.tracks])[:-1]
        self.pixels = dict(zip(names, np.split(pixels, ends), strict=True))
        whole = dict(zip(names, np.split(moves, ends), strict=True))
        flat = [part.reshape(-1, part.shape[-1]) for part in whole.values()]
        _, vectors = np.linalg.eigh(np.stack([part.T @ part for part in flat]))
        self.directions = dict(zip(names, vectors[:, :, ::-1][:, :, :_LINE_DIRECTIONS], strict=True))
        self.moves = {name: whole[name] @ self.directions[name] for name in names}


def hand_unit(rows: FeatureRows, camera: Camera) -> float:
    """Return the unit of the hand in pixels of ``camera``."""
    depth = float((camera.to_camera(rows.middle[None]))[0, 2])
    return max(camera.focal * rows.size / (FACE_SIZE * max(depth, 1e-3)), 1e-6)


def visibility(rows: FeatureRows, camera: Camera) -> dict[str, float]:
    """Return the share of each line that faces the ``camera``, by feature."""
    towards = camera.center - rows.neutral
    towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-12)
    facing = (rows.normals * towards).sum(axis=1)
    seen = 1.0 / (1.0 + np.exp(-(facing - _FACING) / _SOFTNESS))
    return {name: float(seen[track.rows].mean()) for name, track in rows.tracks.items()}
