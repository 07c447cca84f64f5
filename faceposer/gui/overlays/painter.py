"""Drawing primitives of constraint marks: lines, dots, bands, handles and text over the view.

Sources on the face are blue, targets green, fixed vertices red.
"""

from typing import Any

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.viewport import Pixel, Viewport
from faceposer.gui.widgets.theme import EDGE, INK, Colour, u32

WHITE: Colour = (1.0, 1.0, 1.0, 1.0)
Array = NDArray[np.float64]


class Painter:
    """Draws into a view; lengths are pixels at normal density.

    Attributes:
        scale: Pixels of the view per pixel at normal density.
        highlighted: Indices of the highlighted constraints.
    """

    def __init__(self, draw: imgui.ImDrawList, viewport: Viewport, highlighted: frozenset[int]) -> None:
        """Draw into ``draw``."""
        self._draw = draw
        self._viewport = viewport
        self._origin = np.asarray(viewport.origin)
        self.scale = viewport.ui_scale
        self.highlighted = highlighted

    @staticmethod
    def ghost(own_view: bool) -> float:
        """Return the opacity of a target, which is faint in views other than that of its constraint."""
        return 1.0 if own_view else 0.45

    def project(self, points: SurfacePoints) -> Array:
        """Return the pixels of ``points`` of the posed face, shape (n, 2)."""
        session = self._viewport.session
        return self._viewport.camera.project(session.model.positions_at(points, session.coefficients))

    def ring(self, pixel: Pixel, radius: float, colour: Colour, alpha: float, thickness: float) -> None:
        """Draw a circle around ``pixel``."""
        self._draw.add_circle(self._at(pixel), radius * self.scale, u32(colour, alpha), 0, thickness * self.scale)

    def disc(self, pixel: Pixel, radius: float, colour: Colour, alpha: float) -> None:
        """Draw a filled circle at ``pixel``."""
        self._draw.add_circle_filled(self._at(pixel), radius * self.scale, u32(colour, alpha))

    def _at(self, pixel: Pixel) -> ImVec2:
        return ImVec2(pixel[0] + self._origin[0], pixel[1] + self._origin[1])

    def _path(self, pixels: Array) -> list[Any]:
        return [ImVec2(x, y) for x, y in (pixels + self._origin).tolist()]

    def dots(self, pixels: Array, radius: float, colour: Colour, alpha: float) -> None:
        """Draw a dot at each of ``pixels``, shape (n, 2)."""
        radius *= self.scale
        tint = u32(colour, alpha)
        for x, y in (pixels + self._origin).tolist():
            self._draw.add_circle_filled(ImVec2(x, y), radius, tint, 6)

    def line(self, pixels: Array, colour: Colour, thickness: float, alpha: float) -> None:
        """Draw a line with a dark outline through ``pixels``, shape (n, 2)."""
        if len(pixels) < 2:
            return
        path = self._path(pixels)
        self._draw.add_polyline(path, u32(EDGE, 0.55 * alpha), (thickness + 1.8) * self.scale, 0)
        self._draw.add_polyline(path, u32(colour, alpha), thickness * self.scale, 0)

    def band(self, path: Array, width: float, shape: str, colour: Colour, alpha: float) -> None:
        """Draw the area of a brush ``width`` pixels of the view wide along ``path``, shape (n, 2)."""
        if not len(path):
            return
        tint = u32(colour, alpha)
        if len(path) == 1:
            self._draw.add_circle_filled(self._at((path[0, 0], path[0, 1])), max(width / 2.0, 1.5), tint)
            return
        if shape == "filled" and len(path) > 2:
            self._draw.add_concave_poly_filled(self._path(path), u32(colour, 0.55 * alpha))
        closed = imgui.ImDrawFlags_.closed.value if shape != "line" else 0
        self._draw.add_polyline(self._path(path), tint, max(width, 2.0), closed)

    def knob(self, at: Pixel, radius: float, colour: Colour, alpha: float, highlighted: bool) -> None:
        """Draw a handle, with a ring around it if ``highlighted``."""
        center, radius = self._at(at), radius * self.scale
        if highlighted:
            self._draw.add_circle(center, radius + 2.6 * self.scale, u32(WHITE, alpha), 0, 1.6 * self.scale)
        self._draw.add_circle_filled(center, radius + 1.4 * self.scale, u32(EDGE, 0.85 * alpha))
        self._draw.add_circle_filled(center, radius, u32(colour, alpha))

    def text(self, at: Array, text: str, alpha: float) -> None:
        """Draw ``text`` with a background to the right of the pixel ``at``, shape (2,)."""
        size = imgui.calc_text_size(text)
        x, y = (at + self._origin).tolist()
        pad = 3.0 * self.scale
        top = y - size.y / 2.0
        self._draw.add_rect_filled(
            ImVec2(x - pad, top - 1.0),
            ImVec2(x + size.x + pad, top + size.y + 1.0),
            u32(EDGE, 0.7 * alpha),
            3.0 * self.scale,
        )
        self._draw.add_text(ImVec2(x, top), u32(INK, alpha), text)
