"""Drawings in SVG, as Inkscape, Krita and other programs write them (docs/drawings.md)."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, printable
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.outlines import centreline
from faceposer.sketch.polyline import evenly
from faceposer.sketch.svg_shapes import SHAPES, length, lines_of, numbers, transform
from faceposer.sketch.svg_tree import Element, SvgTree, read_svg_tree

Array = NDArray[np.float64]

#: Largest number of strokes of a drawing, and of points of a stroke; longer ones are sampled anew.
MOST_STROKES, MOST_POINTS = 500, 1000
#: Name of the layer or group that holds the neutral face of the drawing.
NEUTRAL = "neutral"
_MOST_TOTAL_POINTS, _MOST_VISITED, _MOST_USES = 500_000, 50_000, 8
_LARGEST = 1e7
_LABEL = "http://www.inkscape.org/namespaces/inkscape label"
_HREF = ("href", "http://www.w3.org/1999/xlink href")
# Elements that are not shown where they are defined, and elements that are not lines.
_DEFINITIONS = {"defs", "clipPath", "mask", "marker", "pattern", "symbol", "linearGradient", "radialGradient", "filter"}
_SILENT = {"title", "desc", "metadata", "style", "script"}
_CONDITIONS = {"requiredExtensions", "systemLanguage"}
_NOUNS = {"text": "text", "image": "image", "rect": "rectangle", "foreignObject": "foreign object"}


@dataclass(frozen=True, eq=False)
class SvgStroke:
    """A line of a drawing.

    Attributes:
        points: Its points in pixels of the drawing, y downwards, shape (n, 2), n ≥ 2.
        name: Label or id of its element, or "".
        neutral: True if it is in the layer of the neutral face.
        feature: The feature that its label names, if any.
    """

    points: Array
    name: str = ""
    neutral: bool = False
    feature: str | None = None


@dataclass(frozen=True, eq=False)
class SvgDrawing:
    """The lines of a drawing.

    Attributes:
        strokes: The lines, in the order of the file.
        remarks: Phrases on what was left out or changed, such as "2 texts ignored".
    """

    strokes: tuple[SvgStroke, ...]
    remarks: tuple[str, ...] = ()


def read_svg(path: Path) -> SvgDrawing:
    """Return the lines of the SVG file ``path``.

    Read are paths, polylines, polygons, lines, circles and ellipses that are visible, with the transforms of their
    groups. A thin filled outline, as calligraphic pens write, becomes its centre line. Files that it refers to are not
    opened.

    Raises:
        FacePoserError: If it cannot be read, has no lines or too many.
    """
    tree = read_svg_tree(path)
    where = f"the drawing '{path}'"
    reader = _Reader(tree)
    try:
        reader.read()
    except _TooLargeError as error:
        raise FacePoserError(f"Cannot read {where}: {error}.") from error
    if not reader.strokes:
        said = f" ({'; '.join(reader.remarks())})" if reader.remarks() else ""
        raise FacePoserError(f"The drawing '{path}' has no visible lines{said}; convert objects to paths.")
    return SvgDrawing(tuple(reader.strokes), reader.remarks())


class _TooLargeError(Exception):
    pass


@dataclass(frozen=True)
class _Place:
    """What an element has from those around it."""

    matrix: Array
    style: Mapping[str, str]
    size: tuple[float, float]
    neutral: bool = False
    feature: str | None = None
    uses: int = 0


class _Reader:
    """Walk over the elements of a file."""

    def __init__(self, tree: SvgTree) -> None:
        self.strokes: list[SvgStroke] = []
        self._tree = tree
        self._ignored: Counter[str] = Counter()
        self._outlines = self._visited = self._points = 0

    def read(self) -> None:
        """Gather the strokes of the file."""
        self._walk(self._tree.root, _Place(np.eye(3), {}, (300.0, 150.0)))

    def remarks(self) -> tuple[str, ...]:
        """Return phrases on what was left out or changed."""
        said = [f"{n} {noun if n == 1 else _plural(noun)} ignored" for noun, n in sorted(self._ignored.items())]
        if self._outlines:
            lines = "1 filled outline was" if self._outlines == 1 else f"{self._outlines} filled outlines were"
            said.append(f"{lines} replaced by centre lines")
        return tuple(said)

    def _walk(self, element: Element, place: _Place) -> None:
        self._visited += 1
        if self._visited > _MOST_VISITED:
            raise _TooLargeError(f"with its clones, it has more than {_MOST_VISITED} elements; delete some")
        tag = element.tag
        if tag in _DEFINITIONS or tag in _SILENT or " " in tag:
            return
        style = self._tree.style(element, place.style)
        hidden = style.get("display") == "none" and _label(element) != NEUTRAL
        if hidden or _zero(style.get("opacity")):
            self._ignored["hidden layer or object"] += 1
            return
        try:
            inner = self._inner(element, place, style)
        except ValueError:
            self._ignored["object with an invalid transform"] += 1
            return
        if tag in {"svg", "g", "a"}:
            for child in element.children:
                self._walk(child, inner)
        elif tag == "switch":
            # The first alternative that needs no extension and no language, as Illustrator wraps drawings.
            shown = [child for child in element.children if not _CONDITIONS & set(child.attributes)]
            for child in shown[:1]:
                self._walk(child, inner)
        elif tag == "use":
            self._clone(element, inner)
        elif tag in SHAPES:
            self._shape(element, inner)
        else:
            self._ignored[_NOUNS.get(tag, "object of another kind")] += 1

    def _inner(self, element: Element, place: _Place, style: Mapping[str, str]) -> _Place:
        label = _label(element)
        matrix = place.matrix @ transform(element.attributes.get("transform", ""))
        size = place.size
        if element.tag == "svg":
            box, size = _viewport(element, size)
            matrix = matrix @ box
        feature = label if label in FEATURES else place.feature
        return _Place(matrix, style, size, place.neutral or label == NEUTRAL, feature, place.uses)

    def _clone(self, element: Element, place: _Place) -> None:
        """Read what a clone shows; files are not opened, and loops end."""
        reference = next((element.attributes[key] for key in _HREF if key in element.attributes), "").strip()
        target = self._tree.by_id.get(reference[1:]) if reference.startswith("#") else None
        if target is None or place.uses >= _MOST_USES:
            self._ignored["clone of what is not in the file" if target is None else "clone within clones"] += 1
            return
        x, y = (length(element.attributes.get(key), whole) for key, whole in zip("xy", place.size, strict=True))
        moved = place.matrix @ np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])
        inside = _Place(moved, place.style, place.size, place.neutral, place.feature, place.uses + 1)
        if target.tag == "symbol":
            for child in target.children:
                self._walk(child, inside)
        else:
            self._walk(target, inside)

    def _shape(self, element: Element, place: _Place) -> None:
        style = place.style
        # The initial values are a black fill and no stroke.
        filled, stroked = style.get("fill", "black") != "none", style.get("stroke", "none") != "none"
        if style.get("visibility") in {"hidden", "collapse"} or not (filled or stroked):
            self._ignored["invisible object"] += 1
            return
        try:
            lines = lines_of(element.tag, element.attributes, place.size)
        except ValueError:
            self._ignored["object with invalid data"] += 1
            return
        name = element.attributes.get(_LABEL, element.attributes.get("id", ""))[:100]
        for line in lines:
            with np.errstate(over="ignore", invalid="ignore"):
                points = line @ place.matrix[:2, :2].T + place.matrix[:2, 2]
            if not np.isfinite(points).all() or np.abs(points).max(initial=0.0) > _LARGEST:
                self._ignored["object outside of all pages"] += 1
                continue
            if len(points) < 2 or not np.ptp(points, axis=0).any():
                continue
            self._points += len(points)
            if self._points > _MOST_TOTAL_POINTS:
                raise _TooLargeError(f"its lines have more than {_MOST_TOTAL_POINTS} points; simplify its paths")
            points = evenly(points, MOST_POINTS) if len(points) > MOST_POINTS else points
            middle = centreline(points) if filled and not stroked else None
            self._outlines += middle is not None
            points = points if middle is None else middle
            self.strokes.append(SvgStroke(points, printable(name), place.neutral, place.feature))
            if len(self.strokes) > MOST_STROKES:
                raise _TooLargeError(
                    f"it has more than {MOST_STROKES} lines; hide those that do not belong to the features of the face"
                )


def _label(element: Element) -> str:
    return element.attributes.get(_LABEL, element.attributes.get("id", "")).strip().lower()


def _plural(noun: str) -> str:
    first, space, rest = noun.partition(" ")
    if noun == "hidden layer or object":
        return "hidden layers or objects"
    if noun == "invisible object":
        return "invisible objects"
    return f"{first}s{space}{rest}" if first in {"object", "clone"} else f"{noun}s"


def _zero(opacity: str | None) -> bool:
    values = [] if opacity is None else numbers(opacity)
    return bool(values) and values[0] == 0.0


def _viewport(element: Element, outer: tuple[float, float]) -> tuple[Array, tuple[float, float]]:
    """Return the matrix and the size of the coordinates inside an element ``svg``.

    Raises:
        ValueError: If its box has no size.
    """
    get = element.attributes.get
    x, y = length(get("x"), outer[0]), length(get("y"), outer[1])
    width, height = length(get("width", "100%"), outer[0]), length(get("height", "100%"), outer[1])
    box = numbers(get("viewBox", ""))
    if len(box) != 4:
        return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]), (width, height)
    left, top, across, down = box
    if not (across > 0.0 and down > 0.0 and math.isfinite(across) and math.isfinite(down)):
        raise ValueError("its viewBox has no size")
    sx, sy = (width or across) / across, (height or down) / down
    if "width" not in element.attributes or "height" not in element.attributes:
        # A drawing without a size is scaled in proportion; its size does not matter.
        sx = sy = sx if "width" in element.attributes else sy if "height" in element.attributes else 1.0
    dx = dy = 0.0
    if not get("preserveAspectRatio", "").strip().startswith("none"):
        scale = min(sx, sy)
        dx, dy = 0.5 * (sx - scale) * across, 0.5 * (sy - scale) * down
        sx = sy = scale
    matrix = np.array([[sx, 0.0, x + dx - sx * left], [0.0, sy, y + dy - sy * top], [0.0, 0.0, 1.0]])
    return matrix, (across, down)
