"""Camera pose from 3D points and their pixels, such as the pins of a photo.

Four points or more determine rotation and position by damped least squares on the reprojection errors (Lau et al. 2009,
eqs. (4) and (5) solved for the camera), with closed-form derivatives. With fewer points the rotation is kept.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera

Array = NDArray[np.float64]

#: Least number of points that determine the rotation.
LEAST_POINTS = 4
#: Least number of points that determine the focal length, unless they are coplanar.
LEAST_FOR_FOCAL = 6
# Least extent of the points across their plane, as a share of their largest: flatter ones leave the focal length open.
_FLAT = 0.08
_ITERATIONS = 60
_SLOWEST = 1e-9
# Initial rotations in degrees of yaw and pitch, of which at least one lies in the basin of the solution.
_TURNS = ((0.0, 0.0), (35.0, 0.0), (-35.0, 0.0), (0.0, 25.0), (0.0, -25.0))
# Radians. Faces are photographed from the front, which decides between rotations that explain few points equally well.
_USUAL_TURN = 1.0


@dataclass(frozen=True, eq=False)
class CameraFit:
    """A fitted camera and its reprojection errors.

    Attributes:
        camera: The fitted camera.
        residuals_px: Reprojection error of each point in pixels, shape (n,).
        turned: True if the rotation was fitted, False if there were too few points.
        focal_found: True if the focal length was fitted.
    """

    camera: Camera
    residuals_px: Array
    turned: bool
    focal_found: bool


def fit_camera(
    points: ArrayLike,
    pixels: ArrayLike,
    start: Camera,
    weights: ArrayLike | None = None,
    focal_spread: float = 0.0,
    sigma_px: float = 1.0,
    turn_spread: float = 0.0,
) -> CameraFit:
    """Return the camera that projects ``points`` closest to ``pixels``.

    Args:
        points: Positions in space, shape (n, 3).
        pixels: Pixel of each point, shape (n, 2).
        start: A camera of the same image. Its focal length is the expected one; with fewer than ``LEAST_POINTS``
            points its rotation is kept.
        weights: Weight of each point, shape (n,), at least 0; all 1 if None.
        focal_spread: Standard deviation of the logarithm of the focal length about that of ``start``; 0 to keep it. It
            is also kept if the points do not determine it.
        sigma_px: Standard deviation of the pixels, which balances them against the priors of focal length and rotation.
        turn_spread: Standard deviation of the sine of the angle between the face and the camera, for points that hardly
            determine the rotation, such as points on a line; 0 for no prior on the rotation.

    Raises:
        ValueError: If the shapes do not match, or no point has a positive weight.
    """
    places = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    observed = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    counts = np.ones(len(places)) if weights is None else np.asarray(weights, dtype=np.float64)
    if len(places) != len(observed) or counts.shape != (len(places),) or not counts.sum() > 0.0 or counts.min() < 0.0:
        raise ValueError("points, pixels and weights must have the same length, and some weight must be positive")
    counting = int((counts > 0.0).sum())
    placed = _fit_similarity(places, observed, counts, start)
    if counting < LEAST_POINTS:
        return CameraFit(placed, _distances(placed, places, observed), False, False)
    free = focal_spread > 0.0 and counting >= LEAST_FOR_FOCAL and not _is_planar(places[counts > 0.0])
    best: tuple[float, Camera] | None = None
    spread = focal_spread if free else 0.0
    for guess in _guesses(places, observed, counts, start, placed):
        camera, energy = _minimise(places, observed, counts / sigma_px**2, guess, start, spread, turn_spread)
        if not camera.to_camera(places)[:, 2].min() > 0.0:
            continue
        energy += (_angle(camera.rotation @ _FRONTAL.T) / _USUAL_TURN) ** 2
        if best is None or energy < best[0]:
            best = (energy, camera)
    camera = placed if best is None else best[1]
    return CameraFit(camera, _distances(camera, places, observed), best is not None, free and best is not None)


# World-to-camera rotation of a face that looks straight into the camera.
_FRONTAL = np.diag([1.0, -1.0, -1.0])


def _distances(camera: Camera, places: Array, observed: Array) -> Array:
    distances: Array = np.linalg.norm(camera.project(places) - observed, axis=1)
    return distances


def _is_planar(places: Array) -> bool:
    extents = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(extents[2] < _FLAT * extents[0])


def _fit_similarity(places: Array, observed: Array, counts: Array, start: Camera) -> Camera:
    """Return ``start`` moved, and with two points or more also rolled and scaled in depth, to fit the points.

    Weak perspective: a similarity of the image plane. A single point only translates the camera.
    """
    share = counts / counts.sum()
    centre = share @ places
    local = (places - centre) @ start.rotation.T
    flat = local[:, 0] + 1j * local[:, 1]
    target = (observed - start.principal_point) @ np.array([1.0, 1.0j])
    middle = share @ target
    extent = float(share @ np.abs(flat) ** 2)
    depth = max(float((start.rotation @ centre + start.translation)[2]), 1e-3)
    factor = complex(start.focal / depth)
    if (counts > 0.0).sum() > 1 and extent > 1e-9:
        found = complex(share @ ((target - middle) * flat.conj()) / extent)
        factor = found if abs(found) > 1e-6 else factor
    roll = factor / abs(factor)
    rotation = np.array([[roll.real, -roll.imag, 0.0], [roll.imag, roll.real, 0.0], [0.0, 0.0, 1.0]]) @ start.rotation
    depth = start.focal / abs(factor)
    position = depth * np.array([middle.real / start.focal, middle.imag / start.focal, 1.0])
    return replace(start, rotation=rotation, translation=position - rotation @ centre)


def _guesses(places: Array, observed: Array, counts: Array, start: Camera, placed: Camera) -> Sequence[Camera]:
    guesses = [start, placed]
    for yaw, pitch in _TURNS:
        turn = _rotation(np.radians([0.0, yaw, 0.0])) @ _FRONTAL
        turned = replace(start, rotation=_rotation(np.radians([pitch, 0.0, 0.0])) @ turn)
        guesses.append(_fit_similarity(places, observed, counts, turned))
    return guesses


def _minimise(
    places: Array, observed: Array, weights: Array, guess: Camera, likely: Camera, spread: float, turn_spread: float
) -> tuple[Camera, float]:
    """Return a local minimum of the energy near ``guess`` by Levenberg-Marquardt steps, and its energy.

    Unknowns: a rotation about the centroid of the points, the image position of the centroid, the logarithm of its
    depth, and the logarithm of the focal length. These are scaled alike, and a rotation leaves the centroid in place.
    """
    centre = places.mean(axis=0)
    local = places - centre
    roots = np.sqrt(weights)[:, None]
    rotation: Array = guess.rotation
    middle = rotation @ centre + guess.translation
    state: Array = np.array(
        [*(middle[:2] / max(middle[2], 1e-3)), math.log(max(middle[2], 1e-3)), math.log(guess.focal)]
    )
    axis, log_likely = guess.principal_point, math.log(likely.focal)
    unknowns = 7 if spread > 0.0 else 6
    by_focal = 1.0 / spread if spread > 0.0 else 0.0
    by_sine = 1.0 / turn_spread if turn_spread > 0.0 else 0.0

    def residual(rotation: Array, state: Array) -> Array:
        points = local @ rotation.T + math.exp(state[2]) * np.array([state[0], state[1], 1.0])
        depth = np.maximum(points[:, 2:], 1e-6)
        off: Array = (roots * (math.exp(state[3]) * points[:, :2] / depth + axis - observed)).ravel()
        expected = [rotation[0, 2] * by_sine, rotation[1, 2] * by_sine, (state[3] - log_likely) * by_focal]
        return np.append(off, expected)

    off = residual(rotation, state)
    energy, damping = float(off @ off), 1e-3
    for _ in range(_ITERATIONS):
        rows = (roots[:, :, None] * _derivatives(local @ rotation.T, state)).reshape(-1, 7)[:, :unknowns]
        # The face looks along z; a small rotation w moves the image of z by w x z.
        x, y, z = rotation[:, 2]
        expected = np.zeros((3, 7))
        expected[0, 1:3], expected[1, 0], expected[1, 2] = (z * by_sine, -y * by_sine), -z * by_sine, x * by_sine
        expected[2, 6] = by_focal
        rows = np.vstack([rows, expected[:, :unknowns]])
        curvature, slope = rows.T @ rows, rows.T @ off
        damped = curvature + damping * np.diag(np.diag(curvature) + 1e-12)
        step: Array = np.asarray(np.linalg.solve(damped, -slope), dtype=np.float64)
        tried = state + np.append(step[3:], np.zeros(7 - unknowns))
        turned = _rotation(step[:3]) @ rotation
        tried[2:] = np.clip(tried[2:], -7.0, 20.0)
        new = residual(turned, tried)
        value = float(new @ new)
        if value < energy:
            slow = energy - value < _SLOWEST * energy
            rotation, state, off, energy, damping = turned, tried, new, value, max(damping * 0.2, 1e-12)
            if slow:
                break
        else:
            damping *= 6.0
            if damping > 1e8:
                break
    # Accumulated rotations drift from orthogonality: project back.
    left, _, right = np.linalg.svd(rotation)
    rotation = np.asarray(left @ right, dtype=np.float64)
    position = math.exp(state[2]) * np.array([state[0], state[1], 1.0])
    focal = math.exp(state[3]) if spread > 0.0 else guess.focal
    return replace(guess, rotation=rotation, translation=position - rotation @ centre, focal=focal), energy


def _derivatives(turned: Array, state: Array) -> Array:
    """Return the derivatives of the pixels with respect to the unknowns of ``_minimise``, shape (n, 2, 7).

    Args:
        turned: The points about their centroid, rotated into camera space, shape (n, 3).
        state: The unknowns except the rotation, shape (4,).
    """
    depth, focal = math.exp(state[2]), math.exp(state[3])
    points = turned + depth * np.array([state[0], state[1], 1.0])
    inverse = 1.0 / np.maximum(points[:, 2], 1e-6)
    normal = points[:, :2] * inverse[:, None]
    by_point = np.zeros((len(turned), 2, 3))
    by_point[:, 0, 0] = by_point[:, 1, 1] = 1.0
    by_point[:, :, 2] = -normal
    by_point *= (focal * inverse)[:, None, None]
    # A small rotation w moves a point by w x point.
    by_turn = np.zeros((len(turned), 3, 3))
    by_turn[:, 0, 1], by_turn[:, 0, 2] = turned[:, 2], -turned[:, 1]
    by_turn[:, 1, 0], by_turn[:, 1, 2] = -turned[:, 2], turned[:, 0]
    by_turn[:, 2, 0], by_turn[:, 2, 1] = turned[:, 1], -turned[:, 0]
    by_place = depth * np.array([[1.0, 0.0, state[0]], [0.0, 1.0, state[1]], [0.0, 0.0, 1.0]])
    return np.concatenate([by_point @ by_turn, by_point @ by_place, (focal * normal)[:, :, None]], axis=2)


def _rotation(vector: Array) -> Array:
    """Return the rotation matrix, shape (3, 3), of a rotation ``vector``, (3,), in radians (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    one = math.sin(angle) / angle if angle > 1e-9 else 1.0
    two = (1.0 - math.cos(angle)) / angle**2 if angle > 1e-6 else 0.5
    rotation: Array = np.eye(3) + one * cross + two * cross @ cross
    return rotation


def _angle(rotation: Array) -> float:
    return math.acos(min(max((float(np.trace(rotation)) - 1.0) / 2.0, -1.0), 1.0))
