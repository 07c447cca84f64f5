"""Errors of a hand that draws along a line of an image: shift, jitter, length, direction and speed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Share of a line over which it is continued beyond its end, and the spacing of the points of exact lines, in pixels.
_TANGENT, _STEP = 0.06, 1.0


@dataclass(frozen=True)
class HandErrors:
    """Sizes of the errors.

    Attributes:
        jitter: Standard deviation of the smooth deviation of each coordinate, in pixels.
        wavelength: Correlation length of the jitter, in pixels.
        shift: Length of the shift of the whole stroke, in any direction, in pixels.
        length: Greatest relative error of the length.
        unevenness: Greatest relative deviation of the speed.
    """

    jitter: float = 3.0
    wavelength: float = 25.0
    shift: float = 6.0
    length: float = 0.15
    unevenness: float = 0.6


@dataclass(frozen=True, eq=False)
class DrawnLine:
    """A line as a hand draws it.

    Attributes:
        pixels: The points of the stroke in the order of drawing, shape (n, 2).
        parameters: Parameter on the line of each point; of points beyond an end, that of the end. Shape (n,).
    """

    pixels: Array
    parameters: Array


def drawn(line: Array, parameters: Array, closed: bool, errors: HandErrors, rng: np.random.Generator) -> DrawnLine:
    """Return ``line`` drawn by a hand.

    Args:
        line: The exact line in pixels, shape (n, 2); the last point of a closed one is the first.
        parameters: Increasing parameter of each point, shape (n,).
        closed: True if the line ends where it begins; the hand begins anywhere then.
        errors: Sizes of errors.
        rng: Source of randomness.
    """
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    whole = float(along[-1])
    excess = rng.uniform(-errors.length, errors.length)
    begin = rng.uniform(0.0, 1.0) if closed else -excess * rng.uniform(0.0, 1.0)
    wanted = (begin + np.linspace(0.0, 1.0, max(int(whole * (1.0 + excess) / _STEP), 8)) * (1.0 + excess)) * whole
    places, at = (_wrapped if closed else _extended)(line, parameters, along, wanted)
    places = places + _smooth_noise(len(places), errors.jitter, errors.wavelength / _STEP, rng)
    direction = rng.uniform(0.0, 2.0 * np.pi)
    places += errors.shift * np.array([np.cos(direction), np.sin(direction)])
    # Uneven speed: samples at equal times are not at equal lengths.
    count = int(rng.integers(24, 120))
    time = np.linspace(0.0, 1.0, count)
    phase, waves = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.5, 2.0)
    speed = 1.0 + errors.unevenness * np.sin(2.0 * np.pi * waves * time + phase)
    passed = np.concatenate([[0.0], np.cumsum(speed[1:])])
    chosen = passed / passed[-1] * (len(places) - 1)
    grid = np.arange(len(places))
    pixels = np.stack([np.interp(chosen, grid, axis) for axis in places.T], axis=1)
    at = at[np.round(chosen).astype(np.intp)]
    if rng.uniform() < 0.5:
        pixels, at = pixels[::-1], at[::-1]
    return DrawnLine(np.ascontiguousarray(pixels), np.ascontiguousarray(at))


def _wrapped(line: Array, parameters: Array, along: Array, wanted: Array) -> tuple[Array, Array]:
    lengths = np.mod(wanted, along[-1])
    return np.stack([np.interp(lengths, along, axis) for axis in line.T], axis=1), np.interp(lengths, along, parameters)


def _extended(line: Array, parameters: Array, along: Array, wanted: Array) -> tuple[Array, Array]:
    places = np.stack([np.interp(wanted, along, axis) for axis in line.T], axis=1)
    inner = [
        np.array([np.interp(share * along[-1], along, axis) for axis in line.T]) for share in (_TANGENT, 1.0 - _TANGENT)
    ]
    for end, near, beyond in ((line[0], inner[0], -wanted), (line[-1], inner[1], wanted - along[-1])):
        direction = (end - near) / max(float(np.hypot(*(end - near))), 1e-9)
        places += np.maximum(beyond, 0.0)[:, None] * direction
    return places, np.interp(wanted, along, parameters)


def _smooth_noise(count: int, deviation: float, wavelength: float, rng: np.random.Generator) -> Array:
    """Return smooth Gaussian noise with the given standard ``deviation``, shape (count, 2)."""
    reach = int(4.0 * wavelength)
    kernel = np.exp(-((np.arange(-reach, reach + 1) / wavelength) ** 2))
    kernel /= np.sqrt((kernel**2).sum())
    white = rng.standard_normal((count + 2 * reach, 2))
    noise = np.stack([np.convolve(axis, kernel, mode="valid") for axis in white.T], axis=1)
    return np.asarray(deviation * noise)
