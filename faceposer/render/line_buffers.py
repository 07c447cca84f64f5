"""Expression lines of a character on the GPU: their place in the map, and their strength in the pose."""

from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.expression_line_map import EXTENT, LAYERS, line_heights
from faceposer.model.expression_lines import ZONES, ExpressionLines, expression_lines, strength_map

# Texture units; unit 0 is that of the material.
_HEIGHTS, _STRENGTHS = 1, 2
# Height in centimetres below which lines are invisible.
_FLAT = 4e-4
# Side of the blocks, in samples, in which the map is searched for lines.
_BLOCK = 5


class LineBuffers:
    """Expression lines of one character, prepared when a pose first needs them; the neutral face has none.

    Attributes:
        places: Three floats per vertex of the buffers: its place in the map of lines, and the lines' visibility there.
        triangles: Indices of all triangles, with those crossed by lines last in each part; None without lines.
        first_lined: First crossed triangle, counted over all triangles, by the name of the part.
    """

    def __init__(
        self, ctx: moderngl.Context, character: Character, source: NDArray[np.intp], indices: NDArray[np.int32]
    ) -> None:
        """Initialise without preparing the lines.

        Args:
            ctx: OpenGL context.
            character: The character.
            source: Vertex of the character for each vertex of the buffers.
            indices: Vertices of each triangle in the buffers, shape (T, 3).
        """
        self._ctx = ctx
        self._character = character
        self._source = source
        self._indices = indices
        self._lines: ExpressionLines | None = None
        self._prepared = False
        self._vertices: NDArray[np.float32] | None = None
        self._visible = False
        zeros = strength_map(np.zeros(len(ZONES)))
        self._strengths = ctx.texture((zeros.shape[1], zeros.shape[0]), LAYERS, zeros.tobytes(), dtype="f4")
        self._strengths.repeat_x = self._strengths.repeat_y = False
        self._heights: moderngl.Texture | None = None
        self.places: moderngl.Buffer | None = None
        self.triangles: moderngl.Buffer | None = None
        self.first_lined: dict[str, int] = {}

    def update(self, vertices: NDArray[np.float32]) -> None:
        """Store the pose ``vertices``, shape (N, 3); the strengths of the lines are computed when they are drawn."""
        self._vertices = vertices

    def prepare(self) -> None:
        """Locate the lines of the character unless done before; takes some tens of milliseconds."""
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
        # Eight bits would cause visible steps in the shading.
        texture = self._heights = self._ctx.texture(size, LAYERS, heights.astype(np.float16).tobytes(), dtype="f2")
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = False

    def _sort_triangles(self, places: NDArray[np.float32]) -> None:
        """Order the triangles such that those crossed by lines are last in each part."""
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
        """Bind the textures and return True if the pose has visible lines."""
        if self._vertices is not None:
            self._visible = self._update_strengths(self._vertices)
            self._vertices = None
        if self._visible and self._heights is not None:
            self._strengths.use(_STRENGTHS)
            self._heights.use(_HEIGHTS)
        return self._visible

    def _update_strengths(self, vertices: NDArray[np.float32]) -> bool:
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
        """Texture units by the names of the samplers in the shaders."""
        return {"line_heights": _HEIGHTS, "line_strengths": _STRENGTHS}

    def release(self) -> None:
        """Free the memory on the GPU."""
        for resource in (self._strengths, self._heights, self.places, self.triangles):
            if resource is not None:
                resource.release()


def _crossed(corners: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return the mask of triangles crossed by lines, shape (T,).

    Triangles on the border of the skin with lines are excluded, since their outer corners have no valid map places.

    Args:
        corners: Place in the map and visibility for each corner, shape (T, 3, 3).
    """
    counts = _cumulative_blocks()
    rows, columns = counts.shape
    low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
    left, bottom = (np.clip(np.floor(low * (columns - 1, rows - 1)), 0, (columns - 1, rows - 1))).astype(int).T
    right, top = (np.clip(np.ceil(high * (columns - 1, rows - 1)), 0, (columns - 1, rows - 1))).astype(int).T
    inside = counts[top, right] - counts[bottom, right] - counts[top, left] + counts[bottom, left]
    crossed: NDArray[np.bool_] = (inside > 0) & (corners[..., 2].min(axis=1) > 0.0)
    return crossed


@lru_cache(maxsize=1)
def _cumulative_blocks() -> NDArray[np.int64]:
    """Return the number of blocks with lines to the left of and below each block corner, (rows + 1, columns + 1)."""
    heights = line_heights()
    has_line = np.logical_or.reduce([np.abs(heights[..., layer]) > _FLAT for layer in range(LAYERS)])
    # One slice per offset is several times faster than a reduction over short axes.
    columns = np.logical_or.reduce([has_line[:, offset::_BLOCK] for offset in range(_BLOCK)])
    blocks = np.logical_or.reduce([columns[offset::_BLOCK] for offset in range(_BLOCK)])
    counts = np.zeros((blocks.shape[0] + 1, blocks.shape[1] + 1), dtype=np.int64)
    counts[1:, 1:] = blocks.cumsum(axis=0).cumsum(axis=1)
    return counts
