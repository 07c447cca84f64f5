"""The GPU's copy of a character's expression lines: where they lie, and how strong the pose makes them."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.model.expression_line_map import EXTENT, LAYERS, line_heights
from faceposer.model.expression_lines import ZONES, ExpressionLines, expression_lines, strength_map
from faceposer.model.subject import Subject

# Units of the textures; unit 0 has that of the material.
_HEIGHTS, _STRENGTHS = 1, 2


class LineBuffers:
    """Expression lines of one subject. They are prepared when a pose needs them first: the neutral face has none.

    Attributes:
        places: Three floats per vertex drawn: its place in the map of the lines, and how far it is skin that has any.
    """

    def __init__(self, ctx: moderngl.Context, subject: Subject, source: NDArray[np.intp]) -> None:
        """Draw lines on ``subject``, whose vertex ``source[i]`` is drawn as the i-th."""
        self._ctx = ctx
        self._subject = subject
        self._source = source
        self._lines: ExpressionLines | None = None
        self._prepared = False
        self._vertices: NDArray[np.float32] | None = None
        self._shown = False
        none = strength_map(np.zeros(len(ZONES)))
        self._strengths = ctx.texture((none.shape[1], none.shape[0]), LAYERS, none.tobytes(), dtype="f4")
        self._heights: moderngl.Texture | None = None
        self.places = ctx.buffer(np.zeros((len(source), 3), dtype=np.float32))

    def update(self, vertices: NDArray[np.float32]) -> None:
        """Take over a pose, shape (N, 3); what it means for the lines is found when they are drawn."""
        self._vertices = vertices

    def prepare(self) -> None:
        """Find where the lines of the subject lie, unless that is known; takes some tens of milliseconds."""
        if self._prepared:
            return
        self._prepared = True
        self._lines = expression_lines(self._subject)
        if self._lines is None:
            return
        left, right, bottom, top = EXTENT
        chart = self._lines.chart
        places = np.empty((len(self._subject.vertices), 3), dtype=np.float32)
        places[:, 0] = (chart.places[:, 0] - left) / (right - left)
        places[:, 1] = (chart.places[:, 1] - bottom) / (top - bottom)
        places[:, 2] = chart.visible
        self.places.write(places[self._source])
        heights = line_heights()
        size = (heights.shape[1], heights.shape[0])
        # Eight bits would show as steps in the light.
        texture = self._heights = self._ctx.texture(size, LAYERS, heights.astype(np.float16).tobytes(), dtype="f2")
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        for each in (texture, self._strengths):
            each.repeat_x = each.repeat_y = False

    def use(self) -> bool:
        """Bind the textures and return whether the pose has any lines."""
        if self._vertices is not None:
            self._shown = self._find_strengths(self._vertices)
            self._vertices = None
        self._strengths.use(_STRENGTHS)
        if self._heights is not None:
            self._heights.use(_HEIGHTS)
        return self._shown

    def _find_strengths(self, vertices: NDArray[np.float32]) -> bool:
        if np.array_equal(vertices, self._subject.vertices):
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
        self.places.release()
        self._strengths.release()
        if self._heights is not None:
            self._heights.release()
