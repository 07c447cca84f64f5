"""Strengths of the expression lines of a posed face, measured on its surface, however it was posed.

Skin folds where it is compressed across its lines. Strain gauges are placed across them: pairs a and b of small patches
of skin, with centres that are Gaussian averages of vertices. A gauge measures its relative shortening,

    e = 1 - |b - a| / |b₀ - a₀|,

zero on the neutral face and under rigid motion, negative where skin is stretched. With e the mean over the gauges of a
zone, the strength of its lines is 1.25 (1 - exp(-(x / 0.8)^1.6)) with x = max(0, e / e₁ - d) / (1 - d): zero up to the
dead band d, about one at e₁, the compression at full contraction of the zone's muscle. If the character has ARKit's
shape of that muscle, e₁ is measured on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from faceposer.model.character import Character
from faceposer.model.expression_line_map import EXTENT, LAYERS
from faceposer.model.face_chart import FaceChart, face_chart

Array = NDArray[np.float64]
Place = tuple[float, float]


@dataclass(frozen=True)
class _Zone:
    """Lines of one side that are driven together; places are in the left side of the chart.

    Attributes:
        name: Name such as "crows_feet", which begins with that of its group.
        gauges: Ends of each strain gauge.
        middles: Centres of its lines in the map; each place of the layer follows the zone with the nearest centre.
        full: The compression e₁ for characters on which it cannot be measured.
        shapes: ARKit's shapes of the muscle, without side.
        share: Share of the shapes' compression that is e₁.
        layer: Layer of the map.
        helpers: Other zones, and the share of their compression that is added.
    """

    name: str
    gauges: tuple[tuple[Place, Place], ...]
    middles: tuple[Place, ...]
    full: float
    shapes: tuple[str, ...]
    share: float = 1.0
    layer: int = 0
    helpers: tuple[tuple[str, float], ...] = ()


_LEFT_ZONES = (
    _Zone(
        "forehead_inner",
        (((0.9, 4.5), (0.9, 7.6)), ((1.8, 4.6), (1.8, 7.7))),
        ((1.0, 6.2),),
        0.065,
        ("browInnerUp",),
    ),
    _Zone(
        "forehead_outer",
        (((3.4, 4.7), (3.4, 7.6)), ((4.8, 4.5), (4.6, 7.3))),
        ((3.7, 6.2),),
        0.080,
        ("browOuterUp",),
    ),
    _Zone(
        "frown",
        (((-0.9, 3.5), (1.7, 3.7)), ((0.0, 1.3), (1.7, 3.8)), ((0.3, 1.8), (2.2, 3.9))),
        ((0.7, 4.0), (0.4, 2.6)),
        0.180,
        ("browDown",),
        layer=1,
    ),
    _Zone(
        "crows_feet",
        (((5.7, 2.0), (5.3, -0.6)), ((5.6, 1.5), (5.3, -0.8))),
        ((6.0, 1.2), (3.8, 0.1)),
        0.180,
        ("cheekSquint",),
        share=0.65,
    ),
    _Zone(
        "bunny",
        (((0.9, 1.6), (1.3, -1.3)), ((0.6, 1.3), (1.2, -1.0)), ((0.4, 1.4), (0.4, -0.8))),
        ((0.8, 0.8), (0.9, -0.4)),
        0.060,
        ("noseSneer",),
        layer=1,
    ),
    # A lifted cheek deepens the fold, although it pulls skin away from the corner of the mouth; so does a sneer.
    _Zone(
        "nasolabial_upper",
        (((2.2, -3.9), (4.0, -2.2)),),
        ((2.1, -2.0),),
        0.140,
        ("mouthSmile",),
        share=0.75,
        helpers=(("crows_feet", 0.7), ("bunny", 1.0)),
    ),
    _Zone(
        "nasolabial_lower",
        (((2.7, -4.8), (7.5, -2.5)), ((2.7, -4.8), (6.3, -2.0))),
        ((3.4, -4.4),),
        0.200,
        ("mouthSmile",),
        share=0.9,
        helpers=(("crows_feet", 0.4), ("bunny", 0.8)),
    ),
    _Zone("marionette", (((2.6, -5.3), (2.6, -7.2)),), ((3.0, -6.2),), 0.110, ("mouthFrown",), layer=1),
)
#: Names of all zones, those of the left side first: a group, its part, and the side.
ZONES: tuple[str, ...] = tuple(f"{zone.name}_{side}" for side in ("left", "right") for zone in _LEFT_ZONES)
#: Groups of lines; each zone's name begins with its group.
GROUPS: tuple[str, ...] = ("forehead", "frown", "crows_feet", "bunny", "nasolabial", "marionette")

_DEAD_BAND = 0.12
# Least and greatest measured e₁, as a multiple of the usual one.
_FULL_RANGE = (0.5, 4.0)
_PATCH_CM = 0.35
_FEWEST_IN_PATCH = 4
# Samples of the strength map per centimetre of the chart, and width of the blend between zones.
_STRENGTH_DENSITY = 2.0
_ZONE_CM = 1.0
# Depth of the lines of the built-in characters, by age and style, and of all others.
_DEPTHS = {"man": 1.0, "woman": 0.6, "low": 0.7, "creature": 1.3}
_USUAL_DEPTH = 0.8


@dataclass(frozen=True, eq=False)
class ExpressionLines:
    """The expression lines of one character.

    Attributes:
        chart: Chart of the face.
        depth: Depth of the lines as a multiple of the map's.
    """

    chart: FaceChart
    depth: float
    _gauges: sparse.csr_array
    _lengths: Array
    _full: Array = field(default_factory=lambda: np.ones(len(ZONES)))

    def compression(self, vertices: ArrayLike) -> Array:
        """Return the compression of each of ``ZONES``, shape (Z,), for the posed ``vertices``, shape (N, 3)."""
        spans = self._gauges @ np.asarray(vertices, dtype=np.float32)
        lengths = np.sqrt(np.einsum("gd,gd->g", spans, spans).astype(np.float64))
        mean, helpers = _gauge_zones()
        own = mean @ (1.0 - lengths / self._lengths)
        total: Array = own + helpers @ np.maximum(own, 0.0)
        return total

    def strengths(self, vertices: ArrayLike) -> Array:
        """Return the strength of each of ``ZONES``, shape (Z,), from 0 to 1.25, for the posed ``vertices``, (N, 3)."""
        x = np.maximum(self.compression(vertices) / self._full - _DEAD_BAND, 0.0) / (1.0 - _DEAD_BAND)
        strengths: Array = 1.25 * (1.0 - np.exp(-((x / 0.8) ** 1.6)))
        return strengths

    def by_zone(self, vertices: ArrayLike) -> Mapping[str, float]:
        """Return the strengths for the posed ``vertices``, shape (N, 3), by zone name."""
        return dict(zip(ZONES, self.strengths(vertices).tolist(), strict=True))


def expression_lines(character: Character) -> ExpressionLines | None:
    """Return the lines of ``character``, or None if its feature points do not locate them."""
    chart = face_chart(character)
    if chart is None:
        return None
    outer = np.flatnonzero(chart.visible > 0.3)
    if len(outer) < 16 * _FEWEST_IN_PATCH:
        return None
    places, visible = chart.places[outer].astype(np.float64), chart.visible[outer].astype(np.float64)
    rows, columns, values = [], [], []
    for row, ends in enumerate(_all_gauges()):
        for sign, end in zip((-1.0, 1.0), ends, strict=True):
            near, weights = _patch(places, visible, end)
            rows.append(np.full(len(near), row))
            columns.append(outer[near])
            values.append(sign * weights)
    gauges = sparse.csr_array(
        (np.concatenate(values).astype(np.float32), (np.concatenate(rows), np.concatenate(columns))),
        shape=(len(_all_gauges()), len(character.vertices)),
    )
    lengths = np.linalg.norm((gauges @ character.vertices).astype(np.float64), axis=1)
    if lengths.min() < 0.1 * chart.scale:
        return None
    depth = _DEPTHS.get(character.name, _USUAL_DEPTH)
    measured = ExpressionLines(chart, depth, gauges, lengths)
    return ExpressionLines(chart, depth, gauges, lengths, _full_compressions(character, measured))


def strength_map(strengths: ArrayLike) -> NDArray[np.float32]:
    """Return the map over ``EXTENT`` of ``strengths`` of ``ZONES``, (Z,); row 0 lowest, (rows, columns, LAYERS)."""
    shares = _zone_shares()
    spread = shares.reshape(-1, len(ZONES)) @ np.asarray(strengths, dtype=np.float32)
    return spread.reshape(shares.shape[:-1])


def _full_compressions(character: Character, lines: ExpressionLines) -> Array:
    full = np.array([zone.full for _ in range(2) for zone in _LEFT_ZONES])
    rows = {name: row for row, name in enumerate(character.shape_names)}
    for i, zone in enumerate((*_LEFT_ZONES, *_LEFT_ZONES)):
        # Both sides together, since skin in the middle of the face follows either.
        muscles = [rows[name + end] for name in zone.shapes for end in ("", "Left", "Right") if name + end in rows]
        moving = [row for row in muscles if np.any(character.shapes[row])]
        if moving:
            posed = character.vertices + character.shapes[moving].sum(axis=0)
            measured = zone.share * float(lines.compression(posed)[i])
            full[i] = np.clip(measured, _FULL_RANGE[0] * full[i], _FULL_RANGE[1] * full[i])
    return full


def _patch(places: Array, visible: Array, middle: Place) -> tuple[NDArray[np.intp], Array]:
    """Return the vertices of the patch of skin around ``middle`` and their weights, which sum to one."""
    squares = (places[:, 0] - middle[0]) ** 2 + (places[:, 1] - middle[1]) ** 2
    # On coarse meshes the patch grows until it has enough vertices.
    width = max(_PATCH_CM**2, float(np.partition(squares, _FEWEST_IN_PATCH - 1)[_FEWEST_IN_PATCH - 1]))
    near = np.flatnonzero(squares < 9.0 * width)
    weights = np.exp(-0.5 * squares[near] / width) * visible[near]
    return near, weights / weights.sum()


@lru_cache(maxsize=1)
def _all_gauges() -> tuple[tuple[Place, Place], ...]:
    left = [gauge for zone in _LEFT_ZONES for gauge in zone.gauges]
    return (*left, *(((-a[0], a[1]), (-b[0], b[1])) for a, b in left))


@lru_cache(maxsize=1)
def _gauge_zones() -> tuple[Array, Array]:
    """Return the matrices from gauges to zone means, (Z, G), and from zones to the zones that they help, (Z, Z)."""
    counts = [len(zone.gauges) for _ in range(2) for zone in _LEFT_ZONES]
    mean = np.zeros((len(ZONES), sum(counts)))
    for row, (begin, count) in enumerate(zip(np.cumsum([0, *counts[:-1]]), counts, strict=True)):
        mean[row, begin : begin + count] = 1.0 / count
    helpers = np.zeros((len(ZONES), len(ZONES)))
    for side in ("left", "right"):
        for zone in _LEFT_ZONES:
            for name, share in zone.helpers:
                helpers[ZONES.index(f"{zone.name}_{side}"), ZONES.index(f"{name}_{side}")] = share
    return mean, helpers


@lru_cache(maxsize=1)
def _zone_shares() -> NDArray[np.float32]:
    """Return the weight of each zone at each sample of the strength map, shape (rows, columns, LAYERS, Z)."""
    left, right, bottom, top = EXTENT
    columns, rows = round((right - left) * _STRENGTH_DENSITY), round((top - bottom) * _STRENGTH_DENSITY)
    u = left + (np.arange(columns) + 0.5) / _STRENGTH_DENSITY
    v = bottom + (np.arange(rows) + 0.5) / _STRENGTH_DENSITY
    nearness = np.full((rows, columns, LAYERS, len(ZONES)), -np.inf)
    for i, zone in enumerate((*_LEFT_ZONES, *_LEFT_ZONES)):
        sign = 1.0 if i < len(_LEFT_ZONES) else -1.0
        squares = [(u - sign * a) ** 2 + (v[:, None] - b) ** 2 for a, b in zone.middles]
        nearness[:, :, zone.layer, i] = -0.5 * np.min(squares, axis=0) / _ZONE_CM**2
    shares = np.exp(nearness - nearness.max(axis=-1, keepdims=True))
    normalised: NDArray[np.float32] = (shares / shares.sum(axis=-1, keepdims=True)).astype(np.float32)
    return normalised
