"""Lines of SVG's shapes as polylines, and its transforms and lengths."""

import math
import re
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Shapes that are read.
SHAPES = frozenset({"path", "polyline", "polygon", "line", "circle", "ellipse"})
#: Largest number of characters of the data of a path, and of points of one shape.
MOST_CHARACTERS, MOST_POINTS = 2_000_000, 100_000
# Angle between two points of a flattened curve, in radians, and largest number of points of a curve.
_ANGLE, _MOST_OF_CURVE = math.radians(8.0), 48
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_TRANSFORM = re.compile(r"(\w+)\s*\(([^()]*)\)")
# Pixels of a unit of length (CSS).
_UNITS = {"": 1.0, "px": 1.0, "pt": 4.0 / 3.0, "pc": 16.0, "mm": 96.0 / 25.4, "cm": 960.0 / 25.4, "in": 96.0}


def numbers(text: str) -> list[float]:
    """Return the numbers in ``text``."""
    return [float(found) for found in _NUMBER.findall(text)]


def length(text: str | None, whole: float) -> float:
    """Return the length ``text`` in pixels, a percentage of ``whole``; 0 if there is none."""
    match = None if text is None else _NUMBER.match(text.strip())
    if match is None or text is None:
        return 0.0
    unit = text.strip()[match.end() :].strip()
    return float(match[0]) * (whole / 100.0 if unit == "%" else _UNITS.get(unit, 1.0))


def transform(text: str) -> Array:
    """Return the matrix, shape (3, 3), of a list of transforms.

    Raises:
        ValueError: If one is unknown or has the wrong number of values.
    """
    matrix = np.eye(3)
    for name, body in _TRANSFORM.findall(text):
        matrix = matrix @ _matrix(name, numbers(body))
    return matrix


def _matrix(name: str, values: list[float]) -> Array:
    match name, values:
        case "matrix", [a, b, c, d, e, f]:
            return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])
        case "translate", [x, *rest] if len(rest) < 2:
            return np.array([[1.0, 0.0, x], [0.0, 1.0, rest[0] if rest else 0.0], [0.0, 0.0, 1.0]])
        case "scale", [x, *rest] if len(rest) < 2:
            return np.diag([x, rest[0] if rest else x, 1.0])
        case "rotate", [angle, *centre] if len(centre) in {0, 2}:
            cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
            x, y = centre or (0.0, 0.0)
            return np.array([[cos, -sin, x - cos * x + sin * y], [sin, cos, y - sin * x - cos * y], [0.0, 0.0, 1.0]])
        case "skewX", [angle]:
            return np.array([[1.0, math.tan(math.radians(angle)), 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        case "skewY", [angle]:
            return np.array([[1.0, 0.0, 0.0], [math.tan(math.radians(angle)), 1.0, 0.0], [0.0, 0.0, 1.0]])
    raise ValueError(f"the transform '{name}' is unknown or has {len(values)} values")


def lines_of(tag: str, attributes: Mapping[str, str], size: tuple[float, float]) -> list[Array]:
    """Return the polylines, each of shape (n, 2), of a shape in its own coordinates.

    Args:
        tag: Name of the shape, one of ``SHAPES``.
        attributes: Its attributes.
        size: Width and height to which percentages refer.

    Raises:
        ValueError: If its data are invalid or too long.
    """
    get, (width, height) = attributes.get, size
    if tag == "path":
        return _path_lines(get("d", ""))
    if tag in {"polyline", "polygon"}:
        text = get("points", "")
        if len(text) > MOST_CHARACTERS:
            raise ValueError("its data are too long")
        values = numbers(text)
        points = np.array(values[: len(values) // 2 * 2]).reshape(-1, 2)
        return [np.concatenate([points, points[:1]]) if tag == "polygon" else points]
    if tag == "line":
        ends = [(get(f"x{i}"), get(f"y{i}")) for i in (1, 2)]
        return [np.array([[length(x, width), length(y, height)] for x, y in ends])]
    diagonal = math.hypot(width, height) / math.sqrt(2.0)
    if tag == "circle":
        radii = np.full(2, length(get("r"), diagonal))
    else:
        radii = np.array([length(get("rx"), width), length(get("ry"), height)])
        radii = np.where(radii > 0.0, radii, radii.max())
    if not (radii > 0.0).all():
        return []
    angle = np.linspace(0.0, 2.0 * np.pi, _MOST_OF_CURVE + 1)
    middle = np.array([length(get("cx"), width), length(get("cy"), height)])
    return [middle + radii * np.stack([np.cos(angle), np.sin(angle)], axis=1)]


def _path_lines(data: str) -> list[Array]:
    """Return the subpaths of the ``data`` of a path."""
    # Imported late: only drawings need it.
    from svg.path import Close, Move, parse_path

    if len(data) > MOST_CHARACTERS:
        raise ValueError("its data are too long")
    try:
        segments = parse_path(data)
    except (ValueError, IndexError, AssertionError, TypeError, ArithmeticError) as error:
        raise ValueError("its data are not those of a path") from error
    lines: list[list[complex]] = []
    count = 0
    for segment in segments:
        if isinstance(segment, Move):
            lines.append([segment.end])
            continue
        points = _points(segment)
        if not lines or lines[-1][-1] != segment.start:
            lines.append([segment.start])
        lines[-1] += points
        if isinstance(segment, Close):
            # What follows a closed subpath without a move starts a new one at the same point.
            lines.append([segment.end])
        count += len(points)
        if count > MOST_POINTS:
            raise ValueError("it has too many points")
    return [np.array([[point.real, point.imag] for point in line]) for line in lines if len(line) > 1]


def _points(segment: object) -> list[complex]:
    """Return points of a segment of a path after its first."""
    from svg.path import Arc, CubicBezier, QuadraticBezier

    if isinstance(segment, CubicBezier):
        return _bezier([segment.start, segment.control1, segment.control2, segment.end])
    if isinstance(segment, QuadraticBezier):
        return _bezier([segment.start, segment.control, segment.end])
    return _arc(segment) if isinstance(segment, Arc) else [segment.end]  # type: ignore[attr-defined]


def _bezier(controls: list[complex]) -> list[complex]:
    """Return points of a Bezier curve after its first, so close that they turn by a few degrees each."""
    legs = [b - a for a, b in pairwise(controls) if b != a]
    turn = sum(abs(math.atan2((b * a.conjugate()).imag, (b * a.conjugate()).real)) for a, b in pairwise(legs))
    if not math.isfinite(turn):
        raise ValueError("its numbers are too large")
    count = min(max(math.ceil(turn / _ANGLE), 1), _MOST_OF_CURVE)
    t = np.arange(1, count + 1) / count
    points = [np.full(count, control) for control in controls]
    while len(points) > 1:
        points = [a + t * (b - a) for a, b in pairwise(points)]
    found: list[complex] = points[0].tolist()
    return found


def _arc(arc: object) -> list[complex]:
    """Return points of an elliptical arc after its first."""
    count = _MOST_OF_CURVE // 2
    try:
        return [complex(arc.point(i / count)) for i in range(1, count + 1)]  # type: ignore[attr-defined]
    except (ArithmeticError, ValueError) as error:
        raise ValueError("an arc of it has no size") from error
