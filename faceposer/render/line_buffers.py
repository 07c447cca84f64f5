"""The GPU's copy of a character's expression lines: where they lie, and how strong the pose makes them."""

from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.expression_line_map import EXTENT, LAYERS, line_heights
from faceposer.model.expression_lines import ZONES, ExpressionLines, expression_lines, strength_map

# Units of the textures; unit 0 has that of the material.
_HEIGHTS, _STRENGTHS = 1, 2
# Heights of less than this many centimetres do not show; lines are looked for in blocks of so many samples each way.
_FLAT = 4e-4
_BLOCK = 5


class LineBuffers:
    """Expression lines of one character. They are prepared when a pose needs them first: the neutral face has none.

    Attributes:
        places: Three floats per vertex drawn: its place in the map of the lines, and how far it is skin that has any.
        triangles: Indices of all triangles, those that lines cross last in their part; None where there are no lines.
        first_lined: The first of these, counted over all triangles, by the name of the part.
    """

    def __init__(
        self, ctx: moderngl.Context, character: Character, source: NDArray[np.intp], indices: NDArray[np.int32]
    ) -> None:
        """Draw lines on ``character``.

        Args:
            ctx: Where.
            character: The character.
            source: Vertex of the character that each vertex drawn stands for.
            indices: Vertices drawn of each triangle, shape (T, 3).
        """
        self._ctx = ctx
        self._character = character
        self._source = source
        self._indices = indices
        self._lines: ExpressionLines | None = None
        self._prepared = False
        self._vertices: NDArray[np.float32] | None = None
        self._shown = False
        none = strength_map(np.zeros(len(ZONES)))
        self._strengths = ctx.texture((none.shape[1], none.shape[0]), LAYERS, none.tobytes(), dtype="f4")
        self._strengths.repeat_x = self._strengths.repeat_y = False
        self._heights: moderngl.Texture | None = None
        self.places: moderngl.Buffer | None = None
        self.triangles: moderngl.Buffer | None = None
        self.first_lined: dict[str, int] = {}

    def update(self, vertices: NDArray[np.float32]) -> None:
        """Take over a pose, shape (N, 3); what it means for the lines is found when they are drawn."""
        self._vertices = vertices

    def prepare(self) -> None:
        """Find where the lines of the character lie, unless that is known; takes some tens of milliseconds."""
        if self._prepared:
            return
        self._prepared = True
        self._lines = expression_lines(self._character)
        if self._lines is None:
            return
        left, right, bottom, top = EXTENT
        chart = self._lines.chart
        places = np.empty((len(self._character.vertices), 3), dtype=np.float32)
        places[:, 0] = (chart.places[:, 0] - left) / (right - left)
        places[:, 1] = (chart.places[:, 1] - bottom) / (top - bottom)
        places[:, 2] = chart.visible
        self.places = self._ctx.buffer(places[self._source])
        self._sort_triangles(places)
        heights = line_heights()
        size = (heights.shape[1], heights.shape[0])
        # Eight bits would show as steps in the light.
        texture = self._heights = self._ctx.texture(size, LAYERS, heights.astype(np.float16).tobytes(), dtype="f2")
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = False

    def _sort_triangles(self, places: NDArray[np.float32]) -> None:
        """Put the triangles that lines cross at the end of their part."""
        character = self._character
        crossed = _crossed(places[character.triangles])
        order = np.arange(len(crossed))
        for part in character.parts:
            first, last = character.part_triangles(part)
            if part.material == "skin" and np.any(crossed[first:last]):
                order[first:last] = first + np.argsort(crossed[first:last], kind="stable")
                self.first_lined[part.name] = last - int(np.count_nonzero(crossed[first:last]))
        self.triangles = self._ctx.buffer(np.ascontiguousarray(self._indices[order]))

    def use(self) -> bool:
        """Bind the textures and return whether the pose has any lines."""
        if self._vertices is not None:
            self._shown = self._find_strengths(self._vertices)
            self._vertices = None
        if self._shown and self._heights is not None:
            self._strengths.use(_STRENGTHS)
            self._heights.use(_HEIGHTS)
        return self._shown

    def _find_strengths(self, vertices: NDArray[np.float32]) -> bool:
        if np.array_equal(vertices, self._character.vertices):
            return False
        self.prepare()
        if self._lines is None:
            return False
        strengths = self._lines.strengths(vertices)
        if not np.any(strengths):
            return False
        height = self._lines.depth * self._lines.chart.scale
        self._strengths.write(strength_map(height * strengths))
        return True

    @property
    def units(self) -> dict[str, int]:
        """The unit of each texture by the name that shaders have for it."""
        return {"line_heights": _HEIGHTS, "line_strengths": _STRENGTHS}

    def release(self) -> None:
        """Free what the GPU holds."""
        for held in (self._strengths, self._heights, self.places, self.triangles):
            if held is not None:
                held.release()


def _crossed(corners: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which triangles have lines in them, shape (T,), by their ``corners`` as places in the map, (T, 3, 3).

    A triangle at the border of the skin that has lines has none: where its other corners lie in the map says nothing.
    """
    counts = _lines_below()
    rows, columns = counts.shape
    low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
    left, bottom = (np.clip(np.floor(low * (columns - 1, rows - 1)), 0, (columns - 1, rows - 1))).astype(int).T
    right, top = (np.clip(np.ceil(high * (columns - 1, rows - 1)), 0, (columns - 1, rows - 1))).astype(int).T
    inside = counts[top, right] - counts[bottom, right] - counts[top, left] + counts[bottom, left]
    crossed: NDArray[np.bool_] = (inside > 0) & (corners[..., 2].min(axis=1) > 0.0)
    return crossed


@lru_cache(maxsize=1)
def _lines_below() -> NDArray[np.int64]:
    """Return how many blocks with lines lie left of and below each corner of a block, (rows + 1, columns + 1)."""
    heights = line_heights()
    lined = np.logical_or.reduce([np.abs(heights[..., layer]) > _FLAT for layer in range(LAYERS)])
    # A slice for each offset is several times faster than a reduction over short axes.
    across = np.logical_or.reduce([lined[:, offset::_BLOCK] for offset in range(_BLOCK)])
    blocks = np.logical_or.reduce([across[offset::_BLOCK] for offset in range(_BLOCK)])
    counts = np.zeros((blocks.shape[0] + 1, blocks.shape[1] + 1), dtype=np.int64)
    counts[1:, 1:] = blocks.cumsum(axis=0).cumsum(axis=1)
    return counts
