"""Height map of the expression lines, shared by all faces, in the coordinates of their chart.

Forehead lines follow the brows, frown lines run between them, crow's feet radiate from the outer corners of the
eyes, bunny lines cross the sides of the nose, nasolabial folds run from its wings past the corners of the mouth, and
marionette lines run down from these. Compressed skin buckles like a sheet: broad rounded folds with a narrower valley
between them, not a furrow in a plane (Wu, Kalra and Magnenat Thalmann, "Simulation of static and dynamic
wrinkles of skin", 1996; Bando, Kuratate and Nishita, "A simple method for modeling wrinkles on human skin", 2002). Each
line is a valley along a smooth curve with a fold on both sides,

    h(d) = -a [exp(-d² / 2 v²) - ⅓ exp(-d² / 2 (c v)²)] + b exp(-(d - s)² / 2 (0.8 s)²),  v = w (1 ± l),

with d the signed distance to the curve, w the width, a the depth and l the lean: where skin hangs over the line, as the
cheek does over the nasolabial fold, that side is steep (-) and the other is gentle (+). c is 2, or 1.3 on the gentle
side of strongly leaning lines, which have hardly a fold there. h has a continuous slope. b is the swelling of the skin
at distance s on the steep side. Depth, width and course vary along the curves, which fade out at both ends, and the two
sides of the face differ slightly.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Extent of the map in the chart: least u, greatest u, least v, greatest v, in centimetres of the chart.
EXTENT = (-8.0, 8.0, -8.5, 9.0)
#: Number of layers. Lines of different groups are well separated within a layer: the first has forehead lines, crow's
#: feet and nasolabial folds, the second frown lines, bunny lines and marionette lines, which come close to the former.
LAYERS = 2
#: Samples per centimetre of the chart.
DENSITY = 40
_STEP = 0.05
_SMOOTHED_CM = 0.22
_SEED = 7
# Lines that lean more than this have hardly a fold on their gentle side.
_STRONG_LEAN = 0.3


@dataclass(frozen=True)
class _Line:
    """A valley along a curve of the left side: y as a function of x, where x is u or v.

    Attributes:
        along: The coordinate that x stands for.
        knots: Pairs (x, y) with rising x.
        depth: Depth in centimetres.
        width: Standard deviation across the line, in centimetres.
        ends: Lengths over which the line fades at the least and the greatest x.
        swelling: Height of the swelling in centimetres, and its signed distance from the line.
        lean: Excess steepness of the side with the swelling, or of greater y, as a share.
        wobble: Amplitude of the irregular course, in centimetres.
        unevenness: Variation of the depth along the line, as a share; the width varies by half of that.
        layer: Layer of the map.
        sides: Sides of the face that have the line: 1 left, -1 right; 0 for a single line across the middle.
    """

    along: Literal["u", "v"]
    knots: tuple[tuple[float, float], ...]
    depth: float
    width: float
    ends: tuple[float, float] = (0.5, 0.5)
    swelling: tuple[float, float] = (0.0, 1.0)
    lean: float = 0.0
    wobble: float = 0.05
    unevenness: float = 0.4
    layer: int = 0
    sides: tuple[int, ...] = (1, -1)


def _forehead() -> list[_Line]:
    main = [
        # Height in the middle, arch over the brows, fall at the temples, reach, depth, width.
        (5.24, 0.24, 0.070, 5.0, 0.046, 0.125),
        (5.98, 0.22, 0.060, 5.6, 0.068, 0.150),
        (6.74, 0.15, 0.050, 5.3, 0.062, 0.145),
        (7.48, 0.08, 0.040, 4.3, 0.040, 0.130),
    ]
    lines = []
    for middle, arch, fall, reach, depth, width in main:
        us = np.linspace(-reach, reach, 15)
        vs = middle + arch * np.exp(-(((np.abs(us) - 2.7) / 1.5) ** 2))
        vs -= fall * np.maximum(np.abs(us) - 2.8, 0.0) ** 2
        knots = tuple(zip(us.tolist(), vs.tolist(), strict=True))
        lines.append(_Line("u", knots, depth, width, (3.0, 3.0), lean=0.25, wobble=0.06, sides=(0,)))
    short = [
        ((-2.9, 5.70), (-0.4, 5.58)),
        ((1.0, 6.36), (3.9, 6.50)),
        ((-4.4, 6.34), (-2.0, 6.56)),
        ((-0.9, 7.08), (1.6, 7.06)),
        ((2.2, 5.76), (4.7, 5.50)),
        ((-3.6, 7.10), (-1.7, 7.16)),
        ((0.2, 5.66), (1.5, 5.60)),
    ]
    lines += [_Line("u", knots, 0.014, 0.080, (1.2, 1.2), lean=0.2, wobble=0.05, sides=(0,)) for knots in short]
    return lines


def _frown() -> list[_Line]:
    main = ((2.7, 0.48), (3.4, 0.64), (4.0, 0.78), (5.1, 0.74))
    secondary, between = ((3.3, 1.06), (4.0, 1.16), (4.7, 1.06)), ((3.1, 0.07), (4.0, -0.04), (4.6, -0.02))
    across = ((-1.0, 1.98), (0.0, 2.14), (1.0, 2.00))
    return [
        _Line("v", main, 0.145, 0.150, (1.2, 1.6), (0.080, 0.46), 0.35, 0.03, layer=1),
        _Line("v", secondary, 0.034, 0.110, (0.8, 0.9), lean=0.3, wobble=0.03, layer=1),
        _Line("v", between, 0.016, 0.090, (0.8, 0.9), wobble=0.02, layer=1, sides=(0,)),
        _Line("u", across, 0.048, 0.120, (0.9, 0.9), wobble=0.03, layer=1, sides=(0,)),
    ]


def _crows_feet() -> list[_Line]:
    fan = [
        (((5.20, 2.10), (5.9, 2.46), (6.6, 2.76), (7.2, 2.92)), 0.024),
        (((5.25, 1.66), (6.0, 1.82), (6.7, 1.84), (7.4, 1.76)), 0.036),
        (((5.25, 1.22), (5.9, 1.06), (6.6, 0.82), (7.3, 0.56)), 0.034),
        (((5.25, 0.72), (5.7, 0.34), (6.2, -0.08), (6.8, -0.56)), 0.024),
    ]
    lines = [_Line("u", knots, depth, 0.105, (0.8, 1.3), lean=0.25, wobble=0.03) for knots, depth in fan]
    lines += [
        _Line("u", ((5.75, 1.50), (6.4, 1.36), (6.9, 1.22)), 0.009, 0.070, (0.5, 0.6), wobble=0.03),
        _Line("u", ((5.70, 2.02), (6.3, 2.16), (6.8, 2.20)), 0.008, 0.070, (0.5, 0.6), wobble=0.03),
        # Beneath the lower lid.
        _Line(
            "u",
            ((2.6, 0.20), (3.4, -0.06), (4.3, 0.12), (5.0, 0.50)),
            0.018,
            0.150,
            (1.1, 1.2),
            lean=-0.15,
            wobble=0.03,
        ),
    ]
    return lines


def _bunny() -> list[_Line]:
    slanting = [
        (((-0.15, 1.66), (0.5, 1.44), (1.35, 0.78)), 0.080),
        (((-0.10, 1.16), (0.6, 0.84), (1.50, 0.12)), 0.120),
        (((-0.05, 0.62), (0.6, 0.30), (1.50, -0.48)), 0.105),
        (((0.30, 0.06), (0.8, -0.20), (1.45, -0.80)), 0.032),
    ]
    lines = [_Line("u", knots, depth, 0.115, (0.7, 1.0), lean=0.25, wobble=0.03, layer=1) for knots, depth in slanting]
    middle = ((-0.7, 1.00), (0.0, 1.12), (0.6, 1.04))
    return [*lines, _Line("u", middle, 0.030, 0.090, (0.6, 0.6), wobble=0.03, layer=1, sides=(0,))]


def _mouth() -> list[_Line]:
    fold = (
        (-6.4, 3.58),
        (-5.6, 3.60),
        (-4.9, 3.40),
        (-4.2, 3.06),
        (-3.4, 2.62),
        (-2.6, 2.18),
        (-1.8, 1.80),
        (-1.2, 1.65),
        (-0.8, 1.6),
    )
    corner = ((-7.0, 2.94), (-6.2, 3.12), (-5.6, 3.02), (-5.2, 2.86))
    return [
        # Broad: the border of the cheek; narrow: the fold proper, deepest next to the wing of the nose.
        _Line("v", fold, 0.145, 0.290, (2.8, 0.9), (0.110, 0.80), 0.35, 0.015, 0.12),
        _Line("v", fold, 0.030, 0.120, (3.4, 0.8), lean=0.40, wobble=0.015, unevenness=0.30),
        _Line("v", corner, 0.085, 0.190, (1.3, 0.6), (0.030, 0.5), 0.35, 0.02, layer=1),
    ]


def _lines() -> list[_Line]:
    return [*_forehead(), *_frown(), *_crows_feet(), *_bunny(), *_mouth()]


@lru_cache(maxsize=1)
def line_heights() -> NDArray[np.float32]:
    """Return the heights over ``EXTENT`` for full strength, in centimetres, row 0 lowest, (rows, columns, LAYERS)."""
    left, right, bottom, top = EXTENT
    columns, rows = round((right - left) * DENSITY), round((top - bottom) * DENSITY)
    us = left + (np.arange(columns) + 0.5) / DENSITY
    vs = bottom + (np.arange(rows) + 0.5) / DENSITY
    heights = np.zeros((rows, columns, LAYERS), dtype=np.float32)
    random = np.random.default_rng(_SEED)
    for line in _lines():
        for side in line.sides:
            _carve(heights[..., line.layer], us, vs, line, side, random)
    return heights


def _carve(
    heights: NDArray[np.float32], us: Array, vs: Array, line: _Line, side: int, random: np.random.Generator
) -> None:
    """Add ``line`` to ``heights`` on the left (1), the right (-1), or across the middle (0)."""
    knots = np.array(line.knots)
    low, high = knots[0, 0], knots[-1, 0]
    xs = np.arange(low - 1.0, high + 1.0, _STEP)
    kernel = np.exp(-0.5 * (np.arange(-0.6, 0.61, _STEP) / _SMOOTHED_CM) ** 2)
    # The curve continues straight beyond its ends, so that smoothing does not bend them.
    slopes = np.diff(knots[[0, 1, -2, -1]], axis=0)[[0, 2]]
    beyond = knots[[0, -1]] + np.array([-2.0, 2.0])[:, None] * np.stack([[1.0, s[1] / s[0]] for s in slopes])
    course = np.interp(xs, *np.vstack([beyond[0], knots, beyond[1]]).T)
    padded = np.pad(course, len(kernel) // 2, mode="reflect", reflect_type="odd")
    ys = np.convolve(padded, kernel / kernel.sum(), mode="valid")
    # All lines differ, and so do the two sides of the face.
    ys += line.wobble * (_irregular(xs, random, 1.1) + random.normal())
    tilt = 1.0 / np.sqrt(1.0 + np.gradient(ys, xs) ** 2)
    fade = _ramp((xs - low) / line.ends[0]) * _ramp((high - xs) / line.ends[1])
    strength = np.maximum(1.0 + line.unevenness * _irregular(xs, random, 1.6), 0.1)
    depth = line.depth * random.uniform(0.8, 1.2) * fade * strength
    width = line.width * (1.0 + 0.5 * line.unevenness * _irregular(xs, random, 1.3)) * (0.75 + 0.25 * fade)
    # The swelling fades over a greater length than the valley.
    swelling = line.swelling[0] * _ramp((xs - low) / (2.2 * line.ends[0])) * _ramp((high - xs) / (2.2 * line.ends[1]))

    reach = max(8.0 * line.width, 3.0 * abs(line.swelling[1]) if line.swelling[0] else 0.0)
    across, sign = ((us, vs) if line.along == "u" else (vs, us)), (-1.0 if side < 0 else 1.0)
    # On the right side u is mirrored, and with it the columns, since the grid is symmetric.
    first, second = (slice(None), slice(None)) if sign > 0 else (slice(None), slice(None, None, -1))
    grid = heights[first, second]
    x_ids = np.flatnonzero((across[0] >= low) & (across[0] <= high))
    y_ids = np.flatnonzero((across[1] >= ys.min() - reach) & (across[1] <= ys.max() + reach))
    if not len(x_ids) or not len(y_ids):
        return
    x = across[0][x_ids]
    y, scale, a, w, b = (np.interp(x, xs, values) for values in (ys, tilt, depth, width, swelling))
    d = ((across[1][y_ids][:, None] - y) * scale).astype(np.float32)
    is_steep = d > 0.0 if line.swelling[1] > 0.0 else d < 0.0
    v = w.astype(np.float32) * np.where(is_steep, np.float32(1.0 - line.lean), np.float32(1.0 + line.lean))
    squares = (d / v) ** 2
    broader = np.where(is_steep, np.float32(2.0), np.float32(1.3 if line.lean > _STRONG_LEAN else 2.0))
    h = -a.astype(np.float32) * (np.exp(-0.5 * squares) - np.exp(-0.5 * squares / broader**2) / 3.0)
    if line.swelling[0]:
        at = np.float32(line.swelling[1])
        h += b.astype(np.float32) * np.exp(-0.5 * ((d - at) / (0.8 * at)) ** 2)
    block = np.s_[y_ids[0] : y_ids[-1] + 1, x_ids[0] : x_ids[-1] + 1]
    (grid if line.along == "u" else grid.T)[block] += h


def _irregular(xs: Array, random: np.random.Generator, length: float) -> Array:
    """Return a smooth random function at ``xs``, of about unit amplitude and wavelengths of about ``length``."""
    waves = length * np.array([2.6, 1.5, 0.8])
    phases = random.uniform(0.0, 2.0 * np.pi, 3)
    total: Array = (np.array([0.65, 0.45, 0.12]) * np.sin(2.0 * np.pi * xs[:, None] / waves + phases)).sum(axis=1)
    return total


def _ramp(x: Array) -> Array:
    clipped = np.clip(x, 0.0, 1.0)
    ramp: Array = clipped * clipped * (3.0 - 2.0 * clipped)
    return ramp
